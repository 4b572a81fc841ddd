"""Former names of options: refused, with today's name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import click

from parcours.errors import BadRequest

_FORMER: dict[click.Command, Mapping[str, str]] = {}

# Names that some command once had for its limit or its number of cases. A user who knows one tries it elsewhere, too.
_LIMITS = ("--max-time", "--timeout", "--max-work", "--max-states", "--max-moves", "--max-runs")
_COUNTS = ("--cases", "--sample", "--max-requirements")
_ANYWHERE = {
    **dict.fromkeys(("--budget", "--max-seconds", "--patience", "--seconds"), _LIMITS),
    **dict.fromkeys(("--most", "--number", "--rows"), _COUNTS),
}


def formerly(names: Mapping[str, str]) -> Callable[[click.Command], click.Command]:
    """Return a decorator that gives a command the former names of its options, each with today's name."""

    def mark(command: click.Command) -> click.Command:
        _FORMER[command] = names
        return command

    return mark


def former_names(command: click.Command) -> Mapping[str, str]:
    """Return the former names of a command's options, each with today's name."""
    names = {name for option in command.params for name in option.opts}
    kin = {
        former: next(now for now in today if now in names)
        for former, today in _ANYWHERE.items()
        if former not in names and not names.isdisjoint(today)
    }
    return {**kin, **_FORMER.get(command, {})}


def renamed(error: click.NoSuchOption) -> BadRequest | None:
    """Return the refusal of an option's former name; nothing for an option that never was."""
    if error.ctx is None or (now := former_names(error.ctx.command).get(error.option_name)) is None:
        return None
    rule = f"this option of `{error.ctx.info_name}` has a new name, but its former one was given"
    return BadRequest(error.option_name, rule, f"write {now}", slug="option-renamed")

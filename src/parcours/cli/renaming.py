"""Former names of options: refused, with today's name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import click

from parcours.errors import BadRequest

_FORMER: dict[click.Command, Mapping[str, str]] = {}


def formerly(names: Mapping[str, str]) -> Callable[[click.Command], click.Command]:
    """Return a decorator that gives a command the former names of its options, each with today's name."""

    def mark(command: click.Command) -> click.Command:
        _FORMER[command] = names
        return command

    return mark


def former_names(command: click.Command) -> Mapping[str, str]:
    """Return the former names of a command's options, each with today's name."""
    return _FORMER.get(command, {})


def renamed(error: click.NoSuchOption) -> BadRequest | None:
    """Return the refusal of an option's former name; nothing for an option that never was."""
    if error.ctx is None or (now := former_names(error.ctx.command).get(error.option_name)) is None:
        return None
    rule = f"this option of `{error.ctx.info_name}` has a new name, but its former one was given"
    return BadRequest(error.option_name, rule, f"write {now}", slug="option-renamed")

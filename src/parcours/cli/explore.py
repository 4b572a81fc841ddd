"""`parcours explore`: the state space of a model, and what is wrong in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from parcours.cli.options import as_json, count, model_file, print_json, read_altered
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from parcours.model import Move
    from parcours.model.composition import Discovery, Space

_SHOWN = 3
"""Most doubts that are named."""


@formerly({"--max-seconds": "--max-states", "--witness": "--show"})
@click.command("explore")
@model_file
@count("--max-states", default=1_000_000, most=1 << 30, help="Most states to keep.")
@count("--show", "witnesses", default=3, least=0, help="How many findings to show with a shortest run to them.")
@as_json
def command(file: Path, max_states: int, witnesses: int, as_json: bool) -> None:
    """Explore the composition of a model's components: every state and move, deadlocks, lost messages, dead parts.

    Exit code 1 if there are findings that are errors, else 3 if a bound stopped the search, else 0. If the model
    comes from another tool's file and could not keep all of it, errors are doubtful: exit code 3.

    Example: parcours explore model.yaml --max-states 100000 --show 1
    """
    from parcours.cli.progress import progress
    from parcours.model.composition import explore

    cefsm, altered = read_altered(file)
    with progress() as report:
        space = explore(cefsm, max_states, report)
    if as_json:
        print_json(_as_data(space, altered, witnesses))
    else:
        _print(space, altered, witnesses)
    is_wrong = any(each.severity == "error" for each in space.findings)
    if is_wrong and not altered:
        raise click.exceptions.Exit(1)
    if is_wrong or not space.complete:
        raise click.exceptions.Exit(3)


def _severity(each: Discovery, altered: str) -> str:
    return "doubtful" if altered and each.severity != "note" else each.severity


def _print(space: Space, altered: str, witnesses: int) -> None:
    rate = space.n_expanded / max(space.seconds, 1e-9)
    click.echo(f"{space.cefsm.name}: {space.n_states} states, {space.n_transitions} transitions")
    click.echo(f"{space.stopped or _complete(space)}; {space.seconds:.2f} s, {rate:.0f} states/s")
    if altered:
        click.echo(altered)
    shown = 0
    for each in space.findings:
        click.echo(f"{_severity(each, altered)}: {each.message} [{each.kind}]{_extent(space, each)}")
        if each.state is not None and shown < witnesses:
            shown += 1
            for number, move in enumerate(space.path_to(each.state), 1):
                click.echo(f"  {number:>3} {_spelled(move)}")
            if each.move is not None:
                click.echo(f"    then {_spelled(each.move)}")
    if not space.findings:
        ending = " for the values tried" if space.complete and space.doubts else "" if space.complete else " so far"
        click.echo(f"nothing is wrong{ending}")


def _complete(space: Space) -> str:
    if not space.doubts:
        return "complete"
    more = f", and {len(space.doubts) - _SHOWN} more" if len(space.doubts) > _SHOWN else ""
    return f"complete for the values tried: {', '.join(space.doubts[:_SHOWN])}{more}"


def _extent(space: Space, found: Discovery) -> str:
    if found.state is None:
        return ""
    where = f"first after {len(space.path_to(found.state))} moves"
    return f" ({found.count} states, {where})" if found.count else f" ({where})"


def _spelled(move: Move) -> str:
    chosen = ", ".join(f"{name} = {value!r}" for name, value in move.inputs)
    return f"{move} with {chosen}" if chosen else str(move)


def _as_data(space: Space, altered: str, witnesses: int) -> dict[str, object]:
    shown = [each for each in space.findings if each.state is not None][:witnesses]
    return {
        "model": space.cefsm.name, "states": space.n_states, "transitions": space.n_transitions,
        "complete": space.complete, "exact": space.exact, "doubts": space.doubts, "stopped": space.stopped,
        "expanded": space.n_expanded, "seconds": round(space.seconds, 3),
        "altered": altered,
        "findings": [
            _finding(space, each, each in shown) | {"severity": _severity(each, altered)} for each in space.findings
        ],
    }  # fmt: skip


def _finding(space: Space, each: Discovery, is_shown: bool) -> dict[str, object]:
    path = None if each.state is None else space.path_to(each.state)
    return {
        "kind": each.kind, "severity": each.severity, "message": each.message, "states": each.count,
        "steps": None if path is None else len(path),
        "witness": None if path is None or not is_shown else list(map(_move, path)),
        "move": None if each.move is None else _move(each.move),
    }  # fmt: skip


def _move(move: Move) -> dict[str, object]:
    return {"transition": move.transition, "partner": move.partner, "inputs": dict(move.inputs)}

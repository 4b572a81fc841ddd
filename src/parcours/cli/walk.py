"""`parcours walk`: a model walked online until a stop condition holds, its steps streamed."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click

from parcours.cli.options import PATH, as_json, count, model_file, read_model, seed
from parcours.cli.renaming import formerly

if TYPE_CHECKING:
    from parcours.model import Cefsm
    from parcours.paths.walking import ModelSpace, Phase, Walk, WalkStep

_SHOWN = 20
"""Most requirements that the summary lists as missed."""


@formerly({"--budget": "--max-moves"})
@click.command("walk")
@model_file
@click.option("--walker", default=None, help="random, weighted, least-visited or guided.  [default: random]")
@click.option("--until", default=None, help="Stop condition, as below.  [default: edge>=100% or steps>=1e5]")
@click.option("--generator", default=None, help="GraphWalker's generator string instead of --walker and --until.")
@click.option("--path", "path_", default="", help="Transitions of predefined_path, separated by blanks.")
@click.option("--component", default="", help="Walk this component only; the environment does the others' part.")
@click.option("--machine", default="", help="Walk this machine only.")
@click.option("--ignore-guards", is_flag=True, help="Walk the bare graphs: no guards, no messages.")
@click.option("--at-dead-end", default="restart", show_default=True, help="restart or stop.")
@count(
    "--max-moves",
    "budget",
    default=1_000_000,
    help="Most moves and restarts where the condition bounds neither steps nor time.",
)
@click.option("--states", is_flag=True, help="Say after each step where the machines stand.")
@click.option("--out", type=PATH, help="File for the steps (JSON Lines) instead of the terminal.")
@seed
@as_json
def command(
    file: Path, walker: str | None, until: str | None, generator: str | None, path_: str, component: str, machine: str,
    ignore_guards: bool, at_dead_end: str, budget: int, states: bool, out: Path | None, seed: int, as_json: bool,
) -> None:  # fmt: skip
    """Walk a model, one step per line, and say at the end what was covered.

    A stop condition joins with 'and', 'or' and parentheses: edge>=100% (any criterion of `parcours paths`), steps>=1e6,
    restarts>=3, 30 s, reached(STATE), taken(TRANSITION), never.

    Example: parcours walk model.yaml --walker least-visited --until 'edge>=100% or steps>=1e5 or 30 s' --seed 1 --json
    """
    import numpy as np

    from parcours.paths.walking import GraphSpace, ModelSpace, Walk, part_of

    cefsm = read_model(file)
    if component or machine:
        cefsm = part_of(cefsm, component or _owner(cefsm, machine), machine)
    space = GraphSpace(cefsm) if ignore_guards else ModelSpace(cefsm)
    walk = Walk(
        space, _phases(space, walker, until, generator, path_), np.random.default_rng(seed),
        at_dead_end=at_dead_end, budget=budget,  # type: ignore[arg-type]
    )  # fmt: skip
    line = _json_line if as_json or out is not None else _text_line
    with _stream(out) as stream:
        stream.writelines(line(step, states) for step in walk)
    _summarise(walk, seed, as_json)


def _owner(cefsm: Cefsm, machine: str) -> str:
    """Return whose machine has a name that only one has."""
    from parcours.errors import BadRequest, one_of

    owners = [each.name for each in cefsm.components if machine in [its.name for its in each.machines]]
    if len(owners) == 1:
        return owners[0]
    if owners:
        rule = f"needs --component where several have a machine {machine!r}"
        raise BadRequest("--machine", rule, f"add --component with one of {', '.join(owners)}", slug="machine-alone")
    known = sorted({its.name for each in cefsm.components for its in each.machines})
    rule = f"must be a machine of '{cefsm.name}', but is {machine!r}"
    raise BadRequest("--machine", rule, one_of(machine, known), slug="unknown-part")


def _phases(
    space: ModelSpace, walker: str | None, until: str | None, generator: str | None, path: str
) -> tuple[Phase, ...]:
    from parcours.errors import BadRequest
    from parcours.paths.walking import parse_generators, phase

    if generator is None:
        return (phase(walker or "random", until or "edge>=100% or steps>=1e5"),)
    if walker is not None or until is not None:
        rule = "holds the walker and the stop condition, but --walker or --until is given too"
        raise BadRequest("--generator", rule, "leave one of them out", slug="walk-options")
    return parse_generators(generator, space.machines, path.replace(",", " ").split())


@contextmanager
def _stream(out: Path | None) -> Iterator[TextIO]:
    from parcours.errors import BadRequest

    if out is None:
        yield sys.stdout
        return
    try:
        file = out.open("w", encoding="utf-8")
    except OSError as error:
        rule = f"must be a file that can be written, but: {error.strerror or error}"
        raise BadRequest(str(out), rule, "name another place, or make the folder", slug="trace-unwritable") from None
    with file:
        yield file


def _json_line(step: WalkStep, states: bool) -> str:
    move = step.move
    record: dict[str, object] = {"step": step.number, "transition": move.transition}
    if move.partner:
        record["partner"] = move.partner
    if move.inputs:
        record["inputs"] = dict(move.inputs)
    if step.is_restart:
        record["restart"] = True
    if states:
        record["states"] = step.after.states
    return json.dumps(record, ensure_ascii=False, separators=(",", ":")) + "\n"


def _text_line(step: WalkStep, states: bool) -> str:
    inputs = ", ".join(f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in step.move.inputs)
    restart = "restart," if step.is_restart else ""
    parts = [f"{step.number:>7}", restart, str(step.move), f"[{inputs}]" if inputs else ""]
    stands = " -> " + ", ".join(step.after.states) if states else ""
    return " ".join(part for part in parts if part) + stands + "\n"


def _summarise(walk: Walk, seed: int, as_json: bool) -> None:
    """Say on standard error why the walk ended and what it covered; standard output holds steps only."""
    tallies = walk.tallies.of.values()
    missing = {each.name: [f"{need.machine}: {need}" for need in each.missed] for each in tallies}
    if as_json:
        ended = walk.ended.name.lower() if walk.ended else ""
        coverage = {one.name: {"met": one.met, "required": one.size, "missed": missing[one.name]} for one in tallies}
        counts = {"steps": walk.steps, "restarts": walk.restarts, "seed": seed}
        click.echo(json.dumps({"ended": ended, **counts, "coverage": coverage}, ensure_ascii=False), err=True)
        return
    click.echo(f"{walk.ended}: {walk.steps} steps, {walk.restarts} restarts, seed {seed}", err=True)
    for each in tallies:
        missed = missing[each.name]
        more = f" and {len(missed) - _SHOWN} more" if len(missed) > _SHOWN else ""
        tail = f"; missed {', '.join(missed[:_SHOWN])}{more}" if missed else ""
        click.echo(f"{each.name}: {each.met} of {each.size}{tail}", err=True)

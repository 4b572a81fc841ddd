"""Generator strings of GraphWalker, such as `random(edge_coverage(100) or time_duration(30))`, as phases of a walk.

Names and their meaning are those of GraphWalker's documentation (Generators and stop conditions); upper and
lower case, underscores and an ending `path` make no difference. What its models know and ours do not
(dependencies, shared states) is refused by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from parcours.errors import BadRequest, one_of
from parcours.model.structure import Machine
from parcours.paths.covering import cover
from parcours.paths.walking.conditions import StopCondition, joined, leaves
from parcours.paths.walking.tokens import TokenReader
from parcours.paths.walking.walk import Phase
from parcours.paths.walking.walkers import Guided, Planned, Random, Walker, Weighted

Machines = Sequence[tuple[str, Machine]]

GENERATORS = {
    "random": "random",
    "weightedrandom": "weighted_random",
    "quickrandom": "quick_random",
    "astar": "a_star",
    "predefined": "predefined_path",
    "shortestallpaths": "shortest_all_paths",
    "newshortestallpaths": "new_shortest_all_paths",
    "directedchinesepostman": "directed_chinese_postman",
    "newyorkstreetsweeper": "new_york_street_sweeper",
}
"""The generators, by their names in small letters without underscores and the ending `path`."""

TOURS = ("shortestallpaths", "newshortestallpaths", "directedchinesepostman", "newyorkstreetsweeper")
"""Those that take every edge on the shortest tour; a condition may be left out."""

TARGETS: dict[str, tuple[str, Literal["reached", "taken"]]] = {
    "reachedvertex": ("reached_vertex", "reached"),
    "reachededge": ("reached_edge", "taken"),
}
AMOUNTS: dict[str, tuple[str, Literal["covered", "elapsed", "steps"], str]] = {
    "edgecoverage": ("edge_coverage", "covered", "edge"),
    "vertexcoverage": ("vertex_coverage", "covered", "node"),
    "requirementcoverage": ("requirement_coverage", "covered", "tag"),
    "timeduration": ("time_duration", "elapsed", ""),
    "length": ("length", "steps", ""),
}
"""The conditions on a name and on a number: as GraphWalker writes them, and the kind and the criterion of ours."""

UNKNOWN_HERE = {
    "dependencyedgecoverage": "dependencies of edges",
    "reachedsharedstate": "shared states",
}
"""Conditions on what a model of ours does not hold."""


def parse_generators(text: str, machines: Machines, predefined: Sequence[str] = ()) -> tuple[Phase, ...]:
    """Return the phases that a generator string says, one for each generator in it.

    Args:
        text: one or more generators, separated by blanks.
        machines: the machines that walk (`ModelSpace.machines`).
        predefined: the ids of the transitions that `predefined_path` takes.

    Raises BadRequest: the text is not in that language, names an unknown generator or condition, or asks for a
    predefined path where none is given.
    """
    reader = TokenReader(text, "generator", "random(edge_coverage(100))")
    phases: list[Phase] = []
    while not phases or reader.here:
        phases.append(_phase(reader, machines, predefined))
    return tuple(phases)


def _phase(reader: TokenReader, machines: Machines, predefined: Sequence[str]) -> Phase:
    name = reader.kind("word")
    if not name:
        reader.fail("a generator must stand here")
    short = _short(name)
    if short not in GENERATORS:
        rule = f"must be one of GraphWalker's, but is {name!r}"
        raise BadRequest("generator", rule, one_of(name, list(GENERATORS.values())), slug="unknown-generator")
    until = StopCondition("never")
    if short not in TOURS or (reader.here is not None and reader.here.text == "("):
        reader.need("(", f"'{name}'")
        until = joined(reader, _leaf)
        reader.need(")", f"the condition of '{name}'")
    if short == "astar" and not all(leaf.kind in ("reached", "taken") for leaf in leaves(until)):
        reader.fail("'a_star' needs reached_vertex or reached_edge")
    return Phase(_walker(short, machines, predefined), until)


def _walker(short: str, machines: Machines, predefined: Sequence[str]) -> Walker:
    if short == "random":
        return Random()
    if short == "weightedrandom":
        return Weighted()
    if short in TOURS:
        return Planned([path.ids for _, machine in machines if machine.transitions for path in cover(machine)])
    if short != "predefined":
        return Guided()
    if not predefined:
        rule = "'predefined_path' needs the transitions of the path, but none are given"
        raise BadRequest("generator", rule, "name them, in order, with --path", slug="no-predefined-path")
    return Planned([predefined])


def _leaf(reader: TokenReader) -> StopCondition:
    word = reader.kind("word")
    short = _short(word)
    if not short:
        reader.fail("a stop condition must stand here")
    if short in ("never", "predefined"):
        if reader.take("("):
            reader.need(")", "a '('")
        return StopCondition("never")
    if short in TARGETS:
        return StopCondition(TARGETS[short][1], reader.argument(word))
    if short in AMOUNTS:
        _, kind, criterion = AMOUNTS[short]
        reader.need("(", f"'{word}'")
        amount = reader.number()
        reader.need(")", "the number")
        return StopCondition(kind, criterion, reader.percent(amount) if kind == "covered" else amount)
    if short in UNKNOWN_HERE:
        rule = f"models of Parcours have no {UNKNOWN_HERE[short]}, but {word!r} asks for them"
        remedy = "use edge_coverage, reached_vertex or reached_edge"
        raise BadRequest("generator", rule, remedy, slug="foreign-condition")
    names = [written for written, *_ in (*AMOUNTS.values(), *TARGETS.values())] + ["never", "predefined_path"]
    rule = f"a stop condition must be one of GraphWalker's, but {word!r} is not"
    raise BadRequest("generator", rule, one_of(word, names), slug="foreign-condition")


def _short(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "").removesuffix("path")

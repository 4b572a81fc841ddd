"""Which goals of a criterion are met by the walks that were done."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import TypeAlias

from parcours.paths.criteria.dataflow import Dataflow
from parcours.paths.criteria.requirement import Goal, Kind
from parcours.paths.criteria.requiring import Demand
from parcours.paths.graph import Walk
from parcours.paths.measuring.recorded import Walks
from parcours.paths.measuring.tours import Tours, distinct_since, in_order, occurrences, states_of, toured


def met_goals(demand: Demand, done: Walks, tours: Tours) -> list[bool]:
    """Return for each goal of a demand whether the walks meet it."""
    walks = done.walks
    if demand.flow is not None:  # there each edge has one number more, and edge 0 begins a run
        walks = [
            [0, *(edge + 1 for edge in walk)] if begins else [edge + 1 for edge in walk]
            for walk, begins in zip(walks, done.begins, strict=True)
        ]
    kinds: dict[Kind, list[int]] = {}
    for place, goal in enumerate(demand.goals):
        kinds.setdefault(goal.requirement.kind, []).append(place)
    answers = [False] * len(demand.goals)
    for kind, places in kinds.items():
        goals = [demand.goals[place] for place in places]
        for place, answer in zip(places, ANSWERS[kind](demand, goals, walks, tours), strict=True):
            answers[place] = answer
    return answers


Pair = tuple[str, int, int]
"""A variable, the edge that defines it and the edge that uses the value."""

Pieces: TypeAlias = Sequence[Sequence[int]]
"""Walks of a demand's graph, one straight piece each."""


def _states(demand: Demand, goals: Sequence[Goal], walks: Pieces, _tours: Tours) -> list[bool]:
    visited = {0} | {state for walk in walks for state in states_of(demand.graph, walk)}
    names = {demand.graph.states[state] for state in visited}
    return [goal.requirement.steps[0] in names for goal in goals]


def _transitions(demand: Demand, goals: Sequence[Goal], walks: Pieces, tours: Tours) -> list[bool]:
    return toured(demand.graph, [goal.walk for goal in goals], walks, tours)


def _round_trips(demand: Demand, goals: Sequence[Goal], walks: Pieces, tours: Tours) -> list[bool]:
    # With side trips or detours, any way back will do: what comes twice on it is left out.
    names = set()
    for walk in walks:
        states = states_of(demand.graph, walk)
        since, last = distinct_since(states), dict[int, int]()
        for place, state in enumerate(states):
            if state in last and (tours != "direct" or since[place - 1] <= last[state]):
                names.add(demand.graph.states[state])
            last[state] = place
    return [goal.requirement.steps[0] in names for goal in goals]


def _definitions(demand: Demand, goals: Sequence[Goal], walks: Pieces, tours: Tours) -> list[bool]:
    flow = demand.flow
    assert flow is not None
    used = {(variable, edge) for variable, edge, _ in _reached(flow, walks, simple=tours == "direct")}
    used |= {(variable, edge) for edge in {*chain(*walks)} for variable in flow.accesses[edge].confirms}
    return [(goal.requirement.variable, goal.walk[0]) in used for goal in goals]


def _uses(demand: Demand, goals: Sequence[Goal], walks: Pieces, tours: Tours) -> list[bool]:
    assert demand.flow is not None
    pairs = _reached(demand.flow, walks, simple=tours == "direct")
    return [(goal.requirement.variable, goal.walk[0], goal.walk[-1]) in pairs for goal in goals]


def _du_paths(demand: Demand, goals: Sequence[Goal], walks: Pieces, tours: Tours) -> list[bool]:
    assert demand.flow is not None
    required = [(goal.requirement.variable, goal.walk) for goal in goals]
    return _toured_du_paths(demand.flow, required, walks, tours)


ANSWERS = {
    "state": _states,
    "transitions": _transitions,
    "round trip": _round_trips,
    "definition": _definitions,
    "use": _uses,
    "du-path": _du_paths,
}
"""For each kind of requirement, which goals of that kind the walks meet."""


def _reached(flow: Dataflow, paths: Sequence[Sequence[int]], *, simple: bool) -> set[Pair]:
    """Return the definitions and uses between which a path does not define the variable again."""
    found: set[Pair] = set()
    for path in paths:
        since = distinct_since(states_of(flow.graph, path))
        found.update(pair for pair, begin, end in _passages(flow, path) if not simple or since[end] <= begin + 1)
    return found


def _toured_du_paths(
    flow: Dataflow, required: Sequence[tuple[str, Walk]], paths: Sequence[Sequence[int]], tours: Tours
) -> list[bool]:
    """Return for each du-path whether a path tours it without defining its variable on the way."""
    found = toured(flow.graph, [walk for _, walk in required], paths)
    if tours == "direct":
        return found
    # What has to lie between the definition and the use.
    between = [walk[1:-1] if tours == "sidetrips" else states_of(flow.graph, walk)[1:-1] for _, walk in required]
    waiting: dict[Pair, list[int]] = {}
    for number, (variable, walk) in enumerate(required):
        if not found[number]:
            waiting.setdefault((variable, walk[0], walk[-1]), []).append(number)
    for path in paths:
        places = occurrences(path if tours == "sidetrips" else states_of(flow.graph, path))
        for pair, begin, end in _passages(flow, path):
            # State k stands before edge k, so the last state between is at the place of the use.
            before = end if tours == "sidetrips" else end + 1
            for number in waiting.get(pair, ()):
                found[number] = found[number] or in_order(between[number], places, begin, before)
    return found


def _passages(flow: Dataflow, path: Sequence[int]) -> Iterator[tuple[Pair, int, int]]:
    """Yield what each use along a path reads, with the places of its definition and of the use."""
    defined: dict[str, int] = {}
    for place, edge in enumerate(path):
        done = flow.accesses[edge]
        for variable in done.reads:
            if variable in defined:
                begin = defined[variable]
                yield (variable, path[begin], edge), begin, place
        for variable in done.defines:
            defined[variable] = place

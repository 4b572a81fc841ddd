"""Runs of a machine and its data flow -> which definitions reached which uses, and which du-paths were toured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from parcours.paths.criteria.dataflow import Dataflow
from parcours.paths.graph import Walk
from parcours.paths.measuring.tours import Tours, distinct_since, in_order, occurrences, states_of, toured

Pair = tuple[str, int, int]
"""A variable, the edge that defines it and the edge that uses the value."""


def reached(flow: Dataflow, paths: Sequence[Sequence[int]], *, simple: bool) -> set[Pair]:
    """Return the definitions and uses between which a path does not define the variable anew.

    Args:
        flow: where variables are defined and used.
        paths: walks of `flow.graph`; edge 0 stands only before the first edge of a run.
        simple: whether no state may come twice between the two.
    """
    found: set[Pair] = set()
    for path in paths:
        since = distinct_since(states_of(flow.graph, path))
        found.update(pair for pair, begin, end in _passages(flow, path) if not simple or since[end] <= begin + 1)
    return found


def toured_du_paths(
    flow: Dataflow, required: Sequence[tuple[str, Walk]], paths: Sequence[Sequence[int]], tours: Tours
) -> list[bool]:
    """Return for each du-path whether a path tours it without defining its variable on the way.

    Args:
        flow: where variables are defined and used.
        required: variable and walk of each du-path.
        paths: walks of `flow.graph`; edge 0 stands only before the first edge of a run.
        tours: how.
    """
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

"""Which required walks a set of paths tours: directly, with side trips or with detours.

A path tours a walk directly if it contains it without a break; with side trips if it takes all edges of the walk in the
same order, so that it may leave a state only to come back to it; with detours if it visits all states of the walk in
the same order (Ammann & Offutt, 2008, section 2.2.1, Touring, sidetrips, and detours).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Literal, TypeAlias, get_args

from parcours.errors import require_known
from parcours.paths.automaton import Trie
from parcours.paths.graph import Graph, Walk

Tours: TypeAlias = Literal["direct", "sidetrips", "detours"]
"""How a path may tour what is required."""


def checked(tours: str) -> None:
    """Raise BadRequest unless it is one of `Tours`."""
    require_known(tours, list(get_args(Tours)), "tours", slug="unknown-tours")


def toured(graph: Graph, walks: Sequence[Walk], paths: Iterable[Sequence[int]], tours: Tours = "direct") -> list[bool]:
    """Return for each walk whether one of the paths tours it."""
    checked(tours)
    if tours == "direct":
        return _contained(len(graph.edges), walks, paths)
    found = [False] * len(walks)
    # Walks by their first step, so that a path only looks at those that it might tour.
    beginning: dict[int, list[tuple[int, tuple[int, ...]]]] = {}
    for number, walk in enumerate(walks):
        steps = walk if tours == "sidetrips" else states_of(graph, walk)
        beginning.setdefault(steps[0], []).append((number, steps))
    for path in paths:
        places = occurrences(path if tours == "sidetrips" else states_of(graph, path))
        for step in places.keys() & beginning.keys():
            for number, steps in beginning[step]:
                found[number] = found[number] or in_order(steps, places)
    return found


def states_of(graph: Graph, walk: Sequence[int]) -> tuple[int, ...]:
    """Return the states along a walk, one more than its edges; none for no edges."""
    if not walk:
        return ()
    return (int(graph.sources[walk[0]]), *graph.targets[list(walk)].tolist())


def occurrences(steps: Sequence[int]) -> dict[int, list[int]]:
    """Return for each step the places where it stands, ascending."""
    places: dict[int, list[int]] = {}
    for place, step in enumerate(steps):
        places.setdefault(step, []).append(place)
    return places


def in_order(steps: Iterable[int], places: dict[int, list[int]], after: int = -1, before: int | None = None) -> bool:
    """Return whether steps stand in this order, between two places if these are given."""
    place = after
    for step in steps:
        at = places.get(step, ())
        following = bisect_right(at, place)
        if following == len(at):
            return False
        place = at[following]
        if before is not None and place >= before:
            return False
    return True


def distinct_since(states: Sequence[int]) -> list[int]:
    """Return for each place the earliest one from which on all states up to it are different.

    >>> distinct_since([5, 6, 5, 5])
    [0, 0, 1, 3]
    """
    seen: dict[int, int] = {}
    found = []
    earliest = 0
    for place, state in enumerate(states):
        earliest = max(earliest, seen.get(state, -1) + 1)
        seen[state] = place
        found.append(earliest)
    return found


def _contained(n_edges: int, walks: Sequence[Walk], paths: Iterable[Sequence[int]]) -> list[bool]:
    trie = Trie(n_edges, walks)
    passed = [False] * len(trie.last)
    for path in paths:
        node = 0
        for edge in path:
            node = trie.after(node, edge)
            passed[node] = True
    depth = [0] * len(trie.last)
    for node in range(1, len(depth)):  # parents have lower numbers
        depth[node] = depth[trie.parent[node]] + 1
    # What ends at a node also ends wherever the node is the suffix; longer nodes hand on to shorter ones.
    for node in sorted(range(1, len(depth)), key=depth.__getitem__, reverse=True):
        if passed[node]:
            passed[trie.suffix[node]] = True
    return [passed[end] for end in trie.ends]

"""Prime paths and round trips of a graph, as edge sequences (Ammann & Offutt, 2008, section 2.2.1).

A path is simple if no state comes twice, except that the first may be the last. A simple path is prime if it lies in
no longer one; a round trip is a prime path that returns to its first state. Parallel edges make different paths.

The search goes depth first from each state `a`. What it has walked can still become a prime path exactly if

- all predecessors of `a` lie on it: then wherever it gets stuck, it is prime, since nothing extends it at either end;
- or a predecessor of `a` can be reached through states it has not used: then it closes to a round trip.

Looking that up costs a sweep over the graph at each step, so the search only does it while more branches have come
to nothing than were found. The work for each path found is thus bounded by a polynomial, and small where all is well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from parcours.paths.criteria.requirement import RequirementCounter, RequirementLimits
from parcours.paths.graph import Came, Graph, breadth_first, components, way_to

NEVER = -1
"""The `missing` states of a search that only completes by goal edges."""


def prime_paths(graph: Graph, limits: RequirementLimits | None = None) -> list[tuple[int, ...]]:
    """Return all prime paths of at least one edge, by their first state, in depth-first order.

    Example: a loop is a prime path of its own, and so is each way round.

    >>> from parcours.model.structure import Machine, Transition
    >>> from parcours.paths.graph import graph_of
    >>> lamp = graph_of(Machine("lamp", "off", ("off", "on"), (
    ...     Transition("t1", "off", "on"), Transition("t2", "on", "on"), Transition("t3", "on", "off"))))
    >>> [[lamp.edges[edge] for edge in path] for path in prime_paths(lamp)]
    [['t1', 't3'], ['t2'], ['t3', 't1']]
    """
    return _primes(graph, limits or RequirementLimits(), only_round=False)


def round_trips(graph: Graph, limits: RequirementLimits | None = None) -> list[tuple[int, ...]]:
    """Return all prime round trips, by their first state, in depth-first order; as `prime_paths`."""
    return _primes(graph, limits or RequirementLimits(), only_round=True)


def shortest_round_trips(graph: Graph, limits: RequirementLimits | None = None) -> list[tuple[int, ...]]:
    """Return for each state on a round trip a short one, by its first state: the shortest of the first that needs one.

    Where a round trip found for one state passes others, these get the same one, turned to begin with them.
    """
    tally = RequirementCounter(limits or RequirementLimits(), f"round trips of '{graph.name}'")
    targets, sources = graph.targets.tolist(), graph.sources.tolist()
    inner = _inner_edges(graph)
    chosen: dict[int, tuple[int, ...]] = {}
    for start in range(len(graph.states)):
        if start not in chosen and (trip := _shortest_trip(start, inner, targets, tally)):
            for place, edge in enumerate(trip):
                chosen.setdefault(sources[edge], (*trip[place:], *trip[:place]))
    for trip in chosen.values():
        tally.add(len(trip))
    return [chosen[state] for state in sorted(chosen)]


def simple_paths(
    start: int, targets: Sequence[int], onward: tuple[Sequence[Sequence[int]], Sequence[Sequence[int]]],
    goals: Mapping[int, Sequence[int]], wanted: set[int] | None, tally: RequirementCounter,
) -> Iterator[tuple[int, ...]]:  # fmt: skip
    """Yield paths from `start` on which no state comes twice, each completed in one of two ways.

    Args:
        targets: the state each edge enters.
        onward: for each state the edges to go on by: before all wanted states are on the path, and after.
        goals: for some states the edges that complete a path there, wherever they lead.
        wanted: a path that holds all of these is also complete where it can neither go on nor be completed by a goal;
            None if no path is.
        tally: counts the paths.
    """
    missing = NEVER if wanted is None else len(wanted)
    lacking = wanted or set()
    visited = {start}
    if start in lacking:
        missing -= 1
    path: list[int] = []
    found = wasted = 0
    for goal in goals.get(start, ()):
        tally.add(1)
        yield (goal,)
    stack = [iter(onward[not missing][start])]
    is_leaf = [start not in goals]
    while stack:
        for edge in stack[-1]:
            state = targets[edge]
            if state in visited:
                continue
            here = targets[path[-1]] if path else start
            # Where there is but one way on, it was looked at one step earlier.
            is_choice = here in goals or len(onward[0][here]) > 1
            if (
                missing
                and wasted > found
                and is_choice
                and not _reaches(state, targets, onward[0], goals, visited, tally)
            ):
                continue
            tally.tick()
            is_leaf[-1] = False
            visited.add(state)
            path.append(edge)
            if state in lacking:
                missing -= 1
            for goal in goals.get(state, ()):
                tally.add(len(path) + 1)
                found += 1
                yield (*path, goal)
            stack.append(iter(onward[not missing][state]))
            is_leaf.append(state not in goals)
            break
        else:
            stack.pop()
            if is_leaf.pop() and path:
                if missing:
                    wasted += 1
                else:
                    tally.add(len(path))
                    found += 1
                    yield tuple(path)
            if path:
                state = targets[path.pop()]
                visited.remove(state)
                if state in lacking:
                    missing += 1


def _primes(graph: Graph, limits: RequirementLimits, *, only_round: bool) -> list[tuple[int, ...]]:
    what = "round trips" if only_round else "prime paths"
    tally = RequirementCounter(limits, f"{what} of '{graph.name}'")
    targets, sources, entering = graph.targets.tolist(), graph.sources.tolist(), graph.entering()
    inner = _inner_edges(graph)
    within = {edge for edges in inner for edge in edges}
    onward = inner, graph.leaving()
    found: list[tuple[int, ...]] = []
    for start in range(len(graph.states)):
        inside = [edge for edge in entering[start] if edge in within]
        # A predecessor that cannot be reached from the start extends whatever begins here, unless it is a round trip.
        wanted = None if only_round or len(inside) < len(entering[start]) else {sources[edge] for edge in inside}
        if wanted is None and not inside:
            continue
        goals: dict[int, list[int]] = {}
        for edge in inside:
            goals.setdefault(sources[edge], []).append(edge)
        found += simple_paths(start, targets, onward, goals, wanted, tally)
    return found


def _inner_edges(graph: Graph) -> list[list[int]]:
    """Return for each state its leaving edges that stay in its strongly connected component."""
    component = components(len(graph.states), graph.sources, graph.targets)
    stays = component[graph.sources] == component[graph.targets]
    return [[edge for edge in edges if stays[edge]] for edges in graph.leaving()]


def _reaches(
    state: int, targets: Sequence[int], onward: Sequence[Sequence[int]], goals: Mapping[int, Sequence[int]],
    visited: set[int], tally: RequirementCounter,
) -> bool:  # fmt: skip
    """Return whether a state with a goal can be reached without those visited."""
    seen = {state}
    queue = [state]
    for here in queue:
        if here in goals:
            return True
        tally.tick()
        for edge in onward[here]:
            target = targets[edge]
            if target not in seen and target not in visited:
                seen.add(target)
                queue.append(target)
    return False


def _shortest_trip(
    start: int, inner: Sequence[Sequence[int]], targets: Sequence[int], tally: RequirementCounter
) -> tuple[int, ...] | None:
    """Return the fewest edges from a state back to itself, None if there is no way."""
    came: Came[int, int] = {}
    for state in breadth_first([start], lambda state: ((edge, targets[edge]) for edge in inner[state]), came):
        for edge in inner[state]:
            tally.tick()
            if targets[edge] == start:
                return (*way_to(state, came), edge)
    return None

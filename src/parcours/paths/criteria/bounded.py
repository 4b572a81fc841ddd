"""Walks of a graph by their length: n-switches, and complete paths up to a bound, as edge sequences.

An n-switch is a walk of n + 1 edges (Chow, Testing software design modeled by finite-state machines, IEEE TSE 4,
1978): edges are 0-switches, edge pairs 1-switches. A complete path leads from the start to a final state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from parcours.paths.criteria.requirement import RequirementCounter, RequirementLimits
from parcours.paths.graph import Came, Graph, breadth_first

UNBOUNDED = 1 << 62
"""More edges than any walk has."""


def switches(graph: Graph, n: int, limits: RequirementLimits | None = None) -> list[tuple[int, ...]]:
    """Return the walks of n + 1 edges, in order of edges, and then the shorter walks that none of them contains.

    Those lead from a start that nothing enters to a state that nothing leaves. They are required so that n-switch
    coverage subsumes (n - 1)-switch coverage.

    Args:
        n: how often to go from one edge to the next, at least 0.
        limits: how many are too many.

    Raises BadRequest: there are too many; the message says how many had been found.
    """
    tally = RequirementCounter(limits or RequirementLimits(), f"{n}-switches of '{graph.name}'")
    longest = _longest(graph)
    everywhere = range(len(graph.edges))
    found = list(
        _walks(graph, everywhere, n + 1, tally, lambda state, left: longest[state] >= left, lambda _, left: not left)
    )
    if n and 0 not in graph.targets:
        ends = [state for state, ahead in enumerate(longest) if not ahead]
        found += _up_to(graph, ends, n, tally)
    return found


def complete_paths(graph: Graph, most: int, limits: RequirementLimits | None = None) -> list[tuple[int, ...]]:
    """Return the paths from the start to a final state of at least one and at most `most` edges."""
    tally = RequirementCounter(limits or RequirementLimits(), f"complete paths of '{graph.name}' up to {most}")
    return list(_up_to(graph, graph.finals, most, tally))


def _up_to(graph: Graph, ends: Iterable[int], most: int, tally: RequirementCounter) -> Iterator[tuple[int, ...]]:
    nearest = _nearest(graph, ends)
    begin = graph.leaving()[0]
    return _walks(graph, begin, most, tally, lambda s, left: nearest[s] <= left, lambda s, _: not nearest[s])


def _walks(
    graph: Graph, firsts: Iterable[int], most: int, tally: RequirementCounter, may_become: Callable[[int, int], bool],
    is_complete: Callable[[int, int], bool],
) -> Iterator[tuple[int, ...]]:  # fmt: skip
    """Yield walks, depth first. The two questions are asked with a state and how many edges are left there."""
    leaving, targets = graph.leaving(), graph.targets.tolist()
    path: list[int] = []
    stack = [iter(firsts)]
    while stack:
        for edge in stack[-1]:
            state, left = targets[edge], most - len(path) - 1
            if not may_become(state, left):
                continue
            tally.tick()
            path.append(edge)
            if is_complete(state, left):
                tally.add(len(path))
                yield tuple(path)
            stack.append(iter(leaving[state] if left else ()))
            break
        else:
            stack.pop()
            if path:
                path.pop()


def _longest(graph: Graph) -> list[int]:
    """Return for each state the number of edges of the longest walk from there."""
    entering, sources = graph.entering(), graph.sources.tolist()
    waiting = [len(edges) for edges in graph.leaving()]
    longest = [UNBOUNDED if edges else 0 for edges in waiting]
    queue = [state for state, edges in enumerate(waiting) if not edges]
    for state in queue:
        for source in (sources[edge] for edge in entering[state]):
            waiting[source] -= 1
            if not waiting[source]:  # the last of its successors, which are taken by growing length
                longest[source] = longest[state] + 1
                queue.append(source)
    return longest


def _nearest(graph: Graph, ends: Iterable[int]) -> list[int]:
    """Return for each state the number of edges to the nearest of the ends."""
    entering, sources = graph.entering(), graph.sources.tolist()
    nearest, came = [UNBOUNDED] * len(graph.states), Came[int, int]()
    for state in breadth_first(ends, lambda state: ((edge, sources[edge]) for edge in entering[state]), came):
        step = came[state]
        nearest[state] = 0 if step is None else nearest[step[1]] + 1
    return nearest

"""Few short paths through a graph that visit all that is asked for (paper, section IV-B, Table III).

The number of paths is the least possible. Their total length is near the least; a lower bound tells how near. For
edges and edge pairs the two agree wherever cheapest passages hang together, which they do for edges.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from parcours.errors import BadRequest
from parcours.paths.automaton import SILENT, Network, Trie, network, outermost
from parcours.paths.flow import least_cost, passages
from parcours.paths.graph import Came, Graph, Walk, breadth_first, stranded, way_to
from parcours.paths.joining import Arcs

Shape = Literal["tests", "open", "closed"]
"""Paths from the start to final states; one walk that ends anywhere; one walk that ends where it began."""


@dataclass(frozen=True, slots=True)
class Cover:
    """Paths that visit all that was asked for.

    Attributes:
        paths: edges of each, from the start of the graph.
        fewest: no cover of the same shape has fewer paths.
        shortest: no cover with as few paths as `fewest` has fewer edges in all; where a limit on the length made
            more paths necessary, no cover at all has.
    """

    paths: tuple[Walk, ...]
    fewest: int
    shortest: int

    @property
    def length(self) -> int:
        """The edges of all paths together."""
        return sum(map(len, self.paths))


def cover_sequences(
    graph: Graph, sequences: Sequence[Walk], states: Iterable[int] = (), *, shape: Shape = "tests",
    max_length: int | None = None,
) -> Cover:  # fmt: skip
    """Return few short paths that contain each sequence of edges, without a break, and visit each state.

    Args:
        sequences: walks of the graph.
        shape: what a path is.
        max_length: most edges of a path; then there may be more paths than necessary.

    Raises BadRequest: a single walk cannot visit everything, or a path of at most `max_length` edges cannot visit
    something.
    """
    wanted = outermost(len(graph.edges), sequences)
    asked = set(states)
    begins = 0 in asked
    unseen = sorted(asked - _visited(graph, wanted))
    if wanted and unseen:
        entering = {target: edge for edge, target in reversed(list(enumerate(graph.targets.tolist())))}
        wanted, unseen = outermost(len(graph.edges), [*wanted, *((entering[state],) for state in unseen)]), []
    if not wanted and not unseen and not (begins and graph.edges):
        return Cover((), 0, 0)
    ends = _ends(graph, shape)
    if not wanted and not unseen:
        wanted = [_shortest_path(graph, ends)]
    built = _split(network(graph, wanted), unseen)
    arcs = _arcs(built, ends)
    paths, fewest, shortest = _fewest_paths(built, arcs)
    if shape == "open" and fewest > 1:
        rule = f"one walk must visit everything, but {fewest} are needed: there is no way back"
        raise BadRequest(f"graph of {graph.name!r}", rule, "ask for tests", slug="one-walk")
    if max_length is not None and max(map(len, paths)) > max_length:
        steps = wanted or [(path[place],) for path in paths for place in _arrivals(graph, path)]
        paths = _within(graph, paths, steps, set(ends), max_length)
        shortest = least_cost(arcs)
        fewest = max(fewest, -(-shortest // max_length))
    return Cover(paths, fewest, shortest)


def _visited(graph: Graph, walks: Sequence[Walk]) -> set[int]:
    touched = {edge for walk in walks for edge in walk}
    return {int(graph.sources[edge]) for edge in touched} | {int(graph.targets[edge]) for edge in touched} | {0}


def _arrivals(graph: Graph, path: Walk) -> list[int]:
    """Return where a path first enters each state."""
    first: dict[int, int] = {}
    for place, edge in enumerate(path):
        first.setdefault(int(graph.targets[edge]), place)
    return list(first.values())


def _ends(graph: Graph, shape: Shape) -> tuple[int, ...]:
    if shape == "tests":
        return graph.finals
    if shape == "open":
        return tuple(range(len(graph.states)))
    lost = stranded(len(graph.states), graph.sources.tolist(), graph.targets.tolist(), [0])
    if lost:
        rule = f"a closed walk must lead back to {graph.states[0]!r}, but "
        rule += f"there is no way from {graph.states[lost[0]]!r}"
        raise BadRequest(f"graph of {graph.name!r}", rule, "ask for tests or an open walk", slug="one-walk")
    return (0,)


def _split(built: Network, states: Sequence[int]) -> Network:
    """Return the network in which visiting one of the states is an arc of its own."""
    if not states:
        return built
    split, n_nodes = np.array(states), built.states.size
    where = np.empty(int(built.states.max()) + 1, dtype=np.int64)
    where[built.states] = np.arange(n_nodes)
    inner, onward = where[split], np.arange(n_nodes)
    onward[inner] = n_nodes + np.arange(split.size)  # what left the state now leaves the node behind it
    return Network(
        np.append(built.states, split), np.append(onward[built.sources], inner),
        np.append(built.targets, onward[inner]), np.append(built.edges, np.full(split.size, SILENT)),
        np.append(built.required, np.ones(split.size, dtype=bool)),
    )  # fmt: skip


def _arcs(built: Network, ends: Sequence[int]) -> Arcs:
    return Arcs(
        built.states.size, built.sources, built.targets, (built.edges != SILENT).astype(np.int64),
        built.required.astype(np.int64), np.flatnonzero(np.isin(built.states, np.array(ends))),
    )  # fmt: skip


def _fewest_paths(built: Network, arcs: Arcs) -> tuple[tuple[Walk, ...], int, int]:
    """Return paths through the network, how few are possible, and a lower bound of their length."""
    found = passages(arcs)
    pause, stops = arcs.n_nodes, arcs.ends
    sources = [*built.sources.tolist(), *stops.tolist(), pause]
    targets = [*built.targets.tolist(), *[pause] * stops.size, 0]
    taken = [*found.taken.tolist(), *found.ended.tolist(), found.beginnings]
    tour = _euler_tour(sources, targets, taken, 0)
    steps = [*built.edges.tolist(), *[SILENT] * (stops.size + 1)]
    walks = _cut(tour, steps, len(steps) - 1)
    return walks, found.beginnings, found.shortest


def _cut(tour: list[int], steps: list[int], pause: int) -> tuple[Walk, ...]:
    """Return the pieces of a closed tour between its passages of the arc `pause`."""
    last = len(tour) - 1 - tour[::-1].index(pause)
    walks: list[list[int]] = [[]]
    for arc in tour[last + 1 :] + tour[: last + 1]:
        if arc == pause:
            walks.append([])
        elif steps[arc] != SILENT:
            walks[-1].append(steps[arc])
    return tuple(tuple(walk) for walk in walks if walk)


def _euler_tour(sources: Sequence[int], targets: Sequence[int], taken: Sequence[int], root: int) -> list[int]:
    """Return the arcs of a closed tour from `root` that takes each arc as often as said (Hierholzer's walk, 1873).

    It is deterministic: at a node, an arc not taken yet goes before a repeated one, and earlier arcs go before
    later ones. Every node is left as often as it is entered, and what is taken hangs together with the root.
    """
    counts = np.array(taken)
    again = np.repeat(np.arange(counts.size), np.maximum(counts - 1, 0))
    waiting: list[list[int]] = [[] for _ in range(1 + max(sources))]
    for arc in np.append(np.flatnonzero(counts), again)[::-1].tolist():  # backwards, so that pop() takes the first
        waiting[sources[arc]].append(arc)
    tour: list[int] = []
    trail, node = [-1], root  # the arcs taken so far, and where the last one leads
    while trail:
        if left := waiting[node]:
            arc = left.pop()
            trail.append(arc)
            node = targets[arc]
        else:
            arc = trail.pop()
            tour.append(arc)
            node = sources[arc]  # of the first, which is no arc, it does not matter
    tour.reverse()
    return tour[1:]


def _within(
    graph: Graph, paths: Sequence[Walk], wanted: Sequence[Walk], ends: set[int], max_length: int
) -> tuple[Walk, ...]:
    """Return paths of at most `max_length` edges that visit what is wanted in the order in which `paths` do."""
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    outward = _reached([0], sources, targets)
    homeward = _reached(sorted(ends), targets, sources)
    trie = Trie(len(graph.edges), wanted)
    length = dict(zip(trie.ends, map(len, wanted), strict=True))
    due = set(length)
    shorter: list[list[int]] = []
    for path in paths:
        begun, done = 0, -1  # how far the trie and the last short path have come along this path
        for place, edge in enumerate(path):
            begun = trie.after(begun, edge)
            if begun not in due:
                continue
            due.discard(begun)
            home = len(_home(targets[edge], homeward))
            if done < 0 or len(shorter[-1]) + place - done + home > max_length:
                first = place + 1 - length[begun]
                shorter.append([*way_to(sources[path[first]], outward), *path[first : place + 1]])
                if len(shorter[-1]) + home > max_length:
                    what = " ".join(graph.edges[each] for each in path[first : place + 1])
                    needed = len(shorter[-1]) + home
                    rule = f"a path of at most {max_length} edges must visit {what}, but needs {needed}"
                    raise BadRequest(f"graph of {graph.name!r}", rule, "allow longer paths", slug="length-limit")
            else:
                shorter[-1] += path[done + 1 : place + 1]
            done = place
    return tuple((*path, *_home(targets[path[-1]], homeward)) for path in shorter)


def _shortest_path(graph: Graph, ends: Sequence[int]) -> Walk:
    """Return a path with the fewest edges, but one at least, from the start to one of the ends."""
    sources, targets = graph.sources.tolist(), graph.targets.tolist()
    homeward = _reached(ends, targets, sources)
    ways = [(edge, *_home(targets[edge], homeward)) for edge, source in enumerate(sources) if not source]
    return min(ways, key=len)


def _reached(begin: Iterable[int], sources: Sequence[int], targets: Sequence[int]) -> Came[int, int]:
    """Return how each state is reached from `begin` by the fewest edges, taken from their source to their target."""
    leaving: dict[int, list[tuple[int, int]]] = {}
    for edge, (source, target) in enumerate(zip(sources, targets, strict=True)):
        leaving.setdefault(source, []).append((edge, target))
    came: Came[int, int] = {}
    for _ in breadth_first(begin, lambda state: leaving.get(state, ()), came):
        pass
    return came


def _home(state: int, homeward: Came[int, int]) -> list[int]:
    # The search went backwards from the ends.
    return way_to(state, homeward)[::-1]

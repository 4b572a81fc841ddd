"""Passages of a network -> which of them hang together with a walk from the start, and ways to join the others."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.paths.circulation import strong_components

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Arcs:
    """A directed network with a start, and how often each arc must be taken.

    Attributes:
        n_nodes: nodes are numbered from 0; walks begin at node 0, and every node is reachable from there.
        sources, targets: shape (n_arcs,).
        costs: paid at every passage, not negative, shape (n_arcs,).
        least: least passages, shape (n_arcs,).
        ends: nodes where a walk may end; every node leads to one.
    """

    n_nodes: int
    sources: Integers
    targets: Integers
    costs: Integers
    least: Integers
    ends: Integers


def groups(arcs: Arcs, taken: Integers) -> Integers:
    """Return for each node -1 if nothing passes it, 0 if the last node's passages hang together with its own, else > 0.

    Args:
        arcs: the network.
        taken: passages of each arc, shape (n_arcs,); at least one at the last node.

    Returns:
        shape (n_nodes,); nodes of one detached group share their number.
    """
    used = np.flatnonzero(taken)
    ends = (arcs.sources[used], arcs.targets[used])
    both = np.concatenate(ends), np.concatenate(ends[::-1])
    labels = strong_components(arcs.n_nodes, *both)  # of arcs both ways: what hangs together
    found = np.full(arcs.n_nodes, -1, dtype=np.int64)
    passed = np.unique(np.concatenate(ends))
    found[passed] = (labels[passed] - labels[-1]) % (labels.max() + 1)
    return found


def ways_there(arcs: Arcs, component: Integers, where: Integers) -> Iterator[list[int]]:
    """Yield for each detached group the arcs of a shortest way to it from what is attached or reached before.

    Args:
        arcs: the network.
        component: the strongly connected component of each node; ways stay inside one.
        where: as `groups` returns it.
    """
    inner = _inner(arcs, component)
    attached = np.flatnonzero(where == 0).tolist()
    for _, _, way in _reached(inner, attached, where):
        yield way


def ways_there_and_back(arcs: Arcs, component: Integers, where: Integers) -> Iterator[tuple[list[int], list[int]]]:
    """Yield for each detached group a way there from an attached node, and the way back to that node."""
    inner = _inner(arcs, component)
    attached = np.flatnonzero(where == 0).tolist()
    for first, met, way in _reached(inner, attached, where):
        goal = np.full(where.size, -1, dtype=np.int64)
        goal[first] = 1
        for _, _, back in _reached(inner, [met], goal):
            yield way, back


def _inner(arcs: Arcs, component: Integers) -> list[list[tuple[int, int]]]:
    leaving: list[list[tuple[int, int]]] = [[] for _ in range(arcs.n_nodes)]
    inside = np.flatnonzero(component[arcs.sources] == component[arcs.targets])
    ends = (inside.tolist(), arcs.sources[inside].tolist(), arcs.targets[inside].tolist())
    for arc, source, target in zip(*ends, strict=True):
        leaving[source].append((arc, target))
    return leaving


def _reached(
    leaving: list[list[tuple[int, int]]], begin: Iterable[int], where: Integers
) -> Iterator[tuple[int, int, list[int]]]:
    """Yield (first node of the way, node met, arcs of the way) for each group, breadth first.

    A way begins at a node of `begin`.
    """
    came: dict[int, tuple[int, int] | None] = dict.fromkeys(begin)
    wanted = set(where[where > 0].tolist())
    goal = where.tolist()
    queue = deque(came)
    while queue and wanted:
        node = queue.popleft()
        for arc, target in leaving[node]:
            if target in came:
                continue
            came[target] = (arc, node)
            queue.append(target)
            if goal[target] in wanted:
                wanted.discard(goal[target])
                yield _way(came, target)


def _way(came: dict[int, tuple[int, int] | None], met: int) -> tuple[int, int, list[int]]:
    way = []
    node = met
    while (step := came[node]) is not None:
        arc, node = step
        way.append(arc)
    return node, met, way[::-1]

"""The graph of a machine in numbers: what every criterion and every cover walks on."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from parcours.model.structure import Machine, Transition
from parcours.paths.circulation import strong_components

Walk = tuple[int, ...]
"""Edges of a graph, one after the other."""

Edge = TypeVar("Edge")
Node = TypeVar("Node", bound=Hashable)
_SMALL = 2000
"""Graphs of at most this many edges need no scipy."""

Came: TypeAlias = dict[Node, tuple[Edge, Node] | None]


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """A directed multigraph with a start, all of it reachable from there.

    Attributes:
        name: of the machine, or of the composition.
        states: names of the states, numbered from 0; the start is state 0.
        edges: names of the edges (transition ids, or moves of a composition), numbered from 0 in file order.
        sources: the state each edge leaves, shape (n_edges,).
        targets: the state each edge enters, shape (n_edges,).
        finals: the states where a path may end, ascending; every state leads to one of them.
    """

    name: str
    states: tuple[str, ...]
    edges: tuple[str, ...]
    sources: NDArray[np.int64]
    targets: NDArray[np.int64]
    finals: tuple[int, ...]

    def leaving(self) -> list[list[int]]:
        """Return for each state the edges that leave it, in order."""
        found: list[list[int]] = [[] for _ in self.states]
        for edge, source in enumerate(self.sources.tolist()):
            found[source].append(edge)
        return found

    def entering(self) -> list[list[int]]:
        """Return for each state the edges that enter it, in order."""
        found: list[list[int]] = [[] for _ in self.states]
        for edge, target in enumerate(self.targets.tolist()):
            found[target].append(edge)
        return found


def graph_of(machine: Machine) -> Graph:
    """Return the graph of what a machine can reach from its initial state; guards are not looked at.

    States are numbered by distance from the initial one, ties in file order; edges keep the order of the file.
    A path may end in the `final` states of the machine, and wherever none of them can be reached any more. If the
    machine names none, it may end in the initial state if every state leads back there, and else in those that
    do not.

    >>> fuse = Machine("fuse", "whole", ("whole", "blown"), (Transition("t1", "whole", "blown"),))
    >>> graph_of(fuse).states, graph_of(fuse).finals
    (('whole', 'blown'), (1,))
    """
    leaving: dict[str, list[Transition]] = {}
    for transition in machine.transitions:
        leaving.setdefault(transition.source, []).append(transition)
    number, queue = {machine.initial: 0}, [machine.initial]
    for state in queue:  # grows while it is read
        for each in leaving.get(state, ()):
            if number.setdefault(each.target, len(queue)) == len(queue):
                queue.append(each.target)
    edges = [transition for transition in machine.transitions if transition.source in number]
    sources = [number[transition.source] for transition in edges]
    targets = [number[transition.target] for transition in edges]
    back = stranded(len(number), sources, targets, [0])
    if machine.final:
        ends = [number[state] for state in machine.final if state in number]
        finals = tuple(sorted({*ends, *stranded(len(number), sources, targets, ends)}))
    else:
        finals = back or (0,)
    return Graph(
        machine.name, tuple(number), tuple(transition.id for transition in edges), np.array(sources, dtype=np.int64),
        np.array(targets, dtype=np.int64), finals,
    )  # fmt: skip


def stranded(n_states: int, sources: Sequence[int], targets: Sequence[int], ends: Iterable[int]) -> tuple[int, ...]:
    """Return the states from which no path leads to one of the `ends`, ascending.

    >>> stranded(3, [0, 0], [1, 2], ends=[1])
    (2,)
    """
    entering: list[list[int]] = [[] for _ in range(n_states)]
    for source, target in zip(sources, targets, strict=True):
        entering[target].append(source)
    queue = list(ends)
    returning = [False] * n_states
    while queue:
        state = queue.pop()
        if not returning[state]:
            returning[state] = True
            queue += entering[state]
    return tuple(state for state, returns in enumerate(returning) if not returns)


def breadth_first(
    begin: Iterable[Node], onward: Callable[[Node], Iterable[tuple[Edge, Node]]], came: Came[Node, Edge] | None = None
) -> Iterator[Node]:
    """Yield the nodes that can be reached, nearest first.

    Args:
        begin: where the search starts.
        onward: the edges that leave a node, each with the node that it enters.
        came: gets for each node the edge by which it was reached first, and from where; None where the search starts.
    """
    came = {} if came is None else came
    came |= dict.fromkeys(begin)
    queue = list(came)
    for node in queue:  # grows while it is read
        yield node
        for edge, target in onward(node):
            if target not in came:
                came[target] = edge, node
                queue.append(target)


def way_to(node: Node, came: Came[Node, Edge]) -> list[Edge]:
    """Return the edges from where a search started to a node that it reached."""
    way = []
    while (step := came[node]) is not None:
        edge, node = step
        way.append(edge)
    return way[::-1]


def components(
    n_states: int, sources: NDArray[np.int64], targets: NDArray[np.int64], *, directed: bool = True
) -> NDArray[np.int64]:
    """Return for each state the number of its strongly connected component; of its connected one if not `directed`.

    Components are numbered in the order of their first states.
    """
    if len(sources) <= _SMALL:
        if not directed:
            sources, targets = np.concatenate([sources, targets]), np.concatenate([targets, sources])
        return strong_components(n_states, sources, targets)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(sources), dtype=np.int8), (sources, targets)), shape=(n_states, n_states))
    labels = connected_components(links, directed=directed, connection="strong")[1]
    _, first, places = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[places].astype(np.int64)

"""The network of a graph and of edge sequences to visit: its arcs say which sequence was just completed.

The network is the product of the graph with the Aho-Corasick automaton of the sequences (Aho & Corasick, Efficient
string matching, CACM 18, 1975): a walk in it is a walk in the graph that also knows the longest part of a sequence
it has just done. Where no sequence lies inside another one, each has exactly one place of the network where it is
complete, so a walk visits the sequence if it takes the one arc that leaves this place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.paths.graph import Graph

Integers = NDArray[np.int64]

SILENT = -1
"""The edge of an arc that is no step of the graph."""


@dataclass(frozen=True, slots=True)
class Network:
    """Numbered nodes and arcs; node 0 is where every walk begins.

    Attributes:
        states: the graph's state at each node, shape (n_nodes,).
        sources, targets: the nodes each arc joins, shape (n_arcs,).
        edges: the graph's edge each arc takes, or SILENT, shape (n_arcs,).
        required: for each arc whether it must be taken, shape (n_arcs,).
    """

    states: Integers
    sources: Integers
    targets: Integers
    edges: Integers
    required: NDArray[np.bool_]


class Trie:
    """The prefixes of some edge sequences; node 0 is the empty one.

    Attributes:
        children: (node * number of edges + edge) -> node.
        suffix: for each node the longest other node that its sequence ends with.
        last: the last edge of each node.
        ends: the node of each sequence.
    """

    def __init__(self, n_edges: int, sequences: Sequence[Sequence[int]]) -> None:
        self.n_edges = n_edges
        self.children: dict[int, int] = {}
        self.last, self.parent = [SILENT], [0]
        self.inner = [False]
        self.ends: list[int] = []
        for sequence in sequences:
            node = 0
            for edge in sequence:
                key = node * n_edges + edge
                self.inner[node] = True
                child = self.children.get(key)
                if child is None:
                    child = self.children[key] = len(self.last)
                    self.last.append(edge)
                    self.parent.append(node)
                    self.inner.append(False)
                node = child
            self.ends.append(node)
        self._link()

    def _link(self) -> None:
        by_depth = [0] * len(self.last)
        for node in range(1, len(self.last)):
            by_depth[node] = by_depth[self.parent[node]] + 1
        self.suffix = [0] * len(self.last)
        # A parent's suffix stands before the child's is looked for.
        for node in sorted(range(1, len(self.last)), key=by_depth.__getitem__):
            if by_depth[node] > 1:
                self.suffix[node] = self.after(self.suffix[self.parent[node]], self.last[node])

    def after(self, node: int, edge: int) -> int:
        """Return the longest node that ends what stands at `node` followed by `edge`."""
        while (child := self.children.get(node * self.n_edges + edge)) is None:
            if not node:
                return 0
            node = self.suffix[node]
        return child

    def endings(self, node: int) -> Iterator[int]:
        """Yield the nodes that end what stands at a node, the longest first: itself, and then each one's suffix."""
        while node:
            yield node
            node = self.suffix[node]


def outermost(n_edges: int, sequences: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return the sequences that lie in no other one, each once, in order: who visits these visits all.

    >>> outermost(3, [(0,), (0, 1), (2,), (0, 1)])
    [(0, 1), (2,)]
    """
    distinct = list(dict.fromkeys(sequence for sequence in sequences if sequence))
    trie = Trie(n_edges, distinct)
    suffixes = set(trie.suffix)
    return [
        sequence
        for sequence, end in zip(distinct, trie.ends, strict=True)
        if not trie.inner[end] and end not in suffixes
    ]


# Graph a -e-> b -f-> a, sequence (e, f). A node of the product is a state with the part of a sequence just done:
#
#     (a, -) ---e---> (b, e) ---f---> (a, e f)
#        ^                                |
#        +-------- SILENT, required ------+      the only way on from a completed sequence
#
# So "visit e f" becomes "take this arc", a lower bound of 1 in a flow problem.
def network(graph: Graph, sequences: Sequence[tuple[int, ...]]) -> Network:
    """Return the product of the graph with the automaton of the sequences, as far as walks from the start reach."""
    trie = Trie(len(graph.edges), sequences)
    children, suffix, n_edges = trie.children, trie.suffix, trie.n_edges
    leaving, into = graph.leaving(), graph.targets.tolist()
    complete = [False] * len(suffix)
    for end in trie.ends:
        complete[end] = True
    # A place is a state with nothing begun (0 .. n_states - 1), or a node of the trie.
    n_states = len(graph.states)
    numbered, places, states = {0: 0}, [0], [0]
    sources: list[int] = []
    targets: list[int] = []
    edges: list[int] = []
    for node, place in enumerate(places):  # grows while it is read
        begun, state = max(place - n_states, 0), states[node]
        for edge in (SILENT,) if complete[begun] else leaving[state]:
            if edge == SILENT:
                then, entered = suffix[begun], state
            else:
                found, entered = children.get(begun * n_edges + edge), into[edge]
                then = found if found is not None else trie.after(suffix[begun], edge) if begun else 0
            beyond = then + n_states if then else entered
            target = numbered.setdefault(beyond, len(places))
            if target == len(places):
                places.append(beyond)
                states.append(entered)
            sources.append(node)
            targets.append(target)
            edges.append(edge)
    return _short_cut(np.array(states), np.array(sources), np.array(targets), np.array(edges))


def _short_cut(states: Integers, sources: Integers, targets: Integers, edges: Integers) -> Network:
    """Return the network where a place of completion with one arc into it has become part of that arc."""
    required = edges == SILENT
    entered = np.bincount(targets[~required], minlength=states.size)
    short = required & (entered[sources] == 1)
    onward, gone = np.arange(states.size), np.zeros(states.size, dtype=bool)
    onward[sources[short]], gone[sources[short]] = targets[short], True
    place = np.cumsum(~gone) - 1
    kept = ~short
    return Network(
        states[~gone], place[sources[kept]], place[onward[targets[kept]]], edges[kept],
        required[kept] | gone[targets[kept]],
    )  # fmt: skip

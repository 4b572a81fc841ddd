"""The network of a graph and of edge sequences to visit: its arcs say which sequence was just completed.

The network is the product of the graph with the Aho-Corasick automaton of the sequences (Aho & Corasick, Efficient
string matching, CACM 18, 1975): a walk in it is a walk in the graph that also knows the longest part of a sequence
it has just done. Where no sequence lies inside another one, each has exactly one place of the network where it is
complete, so a walk visits the sequence if it takes the one arc that leaves this place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from parcours.paths.graph import Graph

SILENT = -1
"""The edge of an arc that is no step of the graph."""


@dataclass(frozen=True, slots=True)
class Network:
    """Numbered nodes and arcs; node 0 is where every walk begins.

    Attributes:
        states: the graph's state at each node.
        sources, targets: the nodes each arc joins.
        edges: the graph's edge each arc takes, or SILENT.
        required: for each arc whether it must be taken.
    """

    states: list[int]
    sources: list[int]
    targets: list[int]
    edges: list[int]
    required: list[bool]


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
    leaving, into = graph.leaving(), graph.targets.tolist()
    ended = set(trie.ends)
    # A node is a state with nothing begun (0 .. n_states - 1), or a node of the trie.
    n_states = len(graph.states)
    numbered = {0: 0}
    queue, built = [0], Network([0], [], [], [], [])
    children, suffix, n_edges = trie.children, trie.suffix, trie.n_edges

    def visit(place: int, state: int) -> int:
        number = numbered.setdefault(place, len(queue))
        if number == len(queue):
            queue.append(place)
            built.states.append(state)
        return number

    entered: dict[int, int] = {}
    for node, place in enumerate(queue):
        begun, state = max(place - n_states, 0), built.states[node]
        if begun in ended and begun:
            back = suffix[begun]
            _join(built, node, visit(back + n_states if back else state, state), SILENT, required=True)
            continue
        for edge in leaving[state]:
            then = children.get(begun * n_edges + edge)
            if then is None:
                then = trie.after(suffix[begun], edge) if begun else 0
            target = visit(then + n_states if then else into[edge], into[edge])
            entered[target] = entered.get(target, 0) + 1
            _join(built, node, target, edge, required=False)
    return _short_cut(built, entered)


def _join(built: Network, source: int, target: int, edge: int, *, required: bool) -> None:
    built.sources.append(source)
    built.targets.append(target)
    built.edges.append(edge)
    built.required.append(required)


def _short_cut(built: Network, entered: dict[int, int]) -> Network:
    """Return the network where a place of completion with one arc into it has become part of that arc."""
    onward = {
        source: target
        for source, target, required in zip(built.sources, built.targets, built.required, strict=True)
        if required and entered.get(source) == 1
    }
    shorter = Network([], [], [], [], [])
    kept = {node: place for place, node in enumerate(n for n in range(len(built.states)) if n not in onward)}
    shorter.states.extend(built.states[node] for node in kept)
    for source, target, edge, required in zip(built.sources, built.targets, built.edges, built.required, strict=True):
        if source not in onward:
            ends = target in onward
            _join(shorter, kept[source], kept[onward.get(target, target)], edge, required=required or ends)
    return shorter

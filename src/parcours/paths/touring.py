"""A directed graph with required arcs -> the cheapest closed tour that takes each of them.

This is the directed Chinese postman (Edmonds & Johnson, Matching, Euler tours and the Chinese postman,
Mathematical Programming 5, 1973): minimum-cost flow repeats arcs until as many enter each node as leave it,
and Hierholzer's walk then strings them together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Arc:
    """An arc between two numbered nodes; the cost is paid at every passage."""

    source: int
    target: int
    cost: int = 1
    required: bool = True


def covering_tour(n_nodes: int, arcs: Sequence[Arc], root: int) -> list[int]:
    """Return the positions in `arcs` of a closed tour from `root` that takes each required arc at least once.

    The tour has the least total cost. Among equals it is deterministic: at a node, an arc not taken yet goes
    before a repeated one, and earlier arcs go before later ones.

    Args:
        n_nodes: how many nodes there are, numbered from 0.
        arcs: the arcs; the required ones must form one connected piece with the root, and every node
            they touch must lead back to the root.
        root: the node where the tour begins and ends.

    Example: the inner circle is walked twice because two arcs lead into it and one leads out.

    >>> covering_tour(2, [Arc(0, 1), Arc(0, 1), Arc(1, 0)], root=0)
    [0, 2, 1, 2]
    """
    return _string_together(arcs, _passages(n_nodes, arcs), root)


def _passages(n_nodes: int, arcs: Sequence[Arc]) -> list[int]:
    """Return how often each arc must be taken so that every node is left as often as it is entered."""
    passages = [int(arc.required) for arc in arcs]
    surplus = [0] * n_nodes
    for arc in arcs:
        if arc.required:
            surplus[arc.target] += 1
            surplus[arc.source] -= 1
    if any(surplus):
        for place, extra in _repairs(surplus, arcs):
            passages[place] += extra
    return passages


def _repairs(surplus: list[int], arcs: Sequence[Arc]) -> list[tuple[int, int]]:
    """Return the arcs to repeat, and how often, so that nodes entered too often are left again."""
    import networkx as nx  # only needed where a machine does not balance by itself

    cheapest: dict[tuple[int, int], int] = {}
    for place, arc in enumerate(arcs):
        ends = (arc.source, arc.target)
        if arc.source != arc.target and (ends not in cheapest or arc.cost < arcs[cheapest[ends]].cost):
            cheapest[ends] = place
    network = nx.DiGraph()
    for node, extra in enumerate(surplus):
        network.add_node(node, demand=-extra)
    for (source, target), place in cheapest.items():
        network.add_edge(source, target, weight=arcs[place].cost)
    _, flow = nx.network_simplex(network)
    return [(place, flow[s][t]) for (s, t), place in cheapest.items() if flow[s].get(t, 0)]


def _string_together(arcs: Sequence[Arc], passages: list[int], root: int) -> list[int]:
    """Return the Euler tour of the repeated arcs (Hierholzer), without recursion."""
    waiting: dict[int, list[int]] = {}
    for place, arc in enumerate(arcs):
        if passages[place]:
            waiting.setdefault(arc.source, []).append(place)
    for place, arc in enumerate(arcs):
        waiting.setdefault(arc.source, []).extend([place] * (passages[place] - 1))
    for queue in waiting.values():
        queue.reverse()  # so that pop() takes the first
    tour: list[int] = []
    trail: list[tuple[int, int]] = [(root, -1)]
    while trail:
        node, taken = trail[-1]
        queue = waiting.get(node, [])
        if queue:
            place = queue.pop()
            trail.append((arcs[place].target, place))
        else:
            trail.pop()
            tour.append(taken)
    tour.reverse()
    return tour[1:]

"""Finds cheapest flows and strongly connected components of small networks without a solver.

Successive shortest paths (Ahuja, Magnanti & Orlin, Network Flows, 1993, ch. 9.7): as long as a node has surplus, one
unit more goes along the cheapest way of the residual network to a node that lacks some. Costs stay non-negative by
potentials, so that Dijkstra's algorithm finds the way. Ties go to lower numbers: the flow is the same everywhere.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


def cheapest_flow(
    sources: Integers, targets: Integers, costs: Integers, capacities: Integers, supplies: Integers
) -> Integers | None:
    """Return a flow on each arc that costs least in all, shape (n_arcs,); None if there is none.

    Args:
        sources, targets: nodes of each arc, shape (n_arcs,).
        costs: of one unit on each arc, not negative, shape (n_arcs,).
        capacities: the most that each arc takes, shape (n_arcs,).
        supplies: what each node has to give, negative if it lacks some, in all 0, shape (n_nodes,).

    Example: one unit goes by the cheaper of two ways, the other by what is left.

    >>> ends = np.array([0, 0]), np.array([1, 1])
    >>> cheapest_flow(*ends, np.array([1, 5]), np.array([1, 9]), np.array([2, -2])).tolist()
    [1, 1]
    """
    n_arcs, n_nodes = sources.size, supplies.size
    # Each round sends one path of flow from a surplus to a lack, along the cheapest way of the residual network:
    #
    #     +2 (u) ==cost 1, left 1==> (v) -2          +1 (u) <==cost -1, left 1== (v) -1   the used arc can be undone
    #        (u) --cost 5, left 9--> (v)      =>        (u) --cost  5, left 9--> (v)
    #
    # Potentials keep the reduced costs at 0 or more, which Dijkstra needs although undoing has a negative price.
    # Arc k forwards is 2 k, backwards 2 k + 1; `left` is what may still be added.
    heads = np.stack([targets, sources], 1).ravel().tolist()
    price = np.stack([costs, -costs], 1).ravel().tolist()
    left = np.stack([capacities, np.zeros(n_arcs, np.int64)], 1).ravel().tolist()
    leaving: list[list[int]] = [[] for _ in range(n_nodes)]
    for arc, (source, target) in enumerate(zip(sources.tolist(), targets.tolist(), strict=True)):
        leaving[source].append(2 * arc)
        leaving[target].append(2 * arc + 1)
    excess = supplies.tolist()
    potential = [0] * n_nodes
    while any(value > 0 for value in excess):
        came, cost = _cheapest_ways(excess, leaving, heads, price, left, potential)
        goal = min((node for node in cost if excess[node] < 0), key=lambda node: (cost[node], node), default=None)
        if goal is None:
            return None
        most = cost[goal]
        for node in range(n_nodes):
            potential[node] += min(cost.get(node, most), most)
        way, node = [], goal
        while (arc := came[node]) >= 0:
            way.append(arc)
            node = heads[arc ^ 1]
        amount = min(excess[node], -excess[goal], *(left[arc] for arc in way))
        for arc in way:
            left[arc] -= amount
            left[arc ^ 1] += amount
        excess[node] -= amount
        excess[goal] += amount
    return np.array(left[1::2], np.int64)


def _cheapest_ways(
    excess: list[int], leaving: list[list[int]], heads: list[int], price: list[int], left: list[int],
    potential: list[int],
) -> tuple[dict[int, int], dict[int, int]]:  # fmt: skip
    """Return by which arc the cheapest way from any surplus enters each node (-1 where it starts), and its cost."""
    came: dict[int, int] = {}
    cost: dict[int, int] = {}
    heap = [(0, node, -1) for node, value in enumerate(excess) if value > 0]
    while heap:
        so_far, node, arc = heapq.heappop(heap)
        if node in cost:
            continue
        cost[node], came[node] = so_far, arc
        for onward in leaving[node]:
            head = heads[onward]
            if left[onward] > 0 and head not in cost:
                heapq.heappush(heap, (so_far + price[onward] + potential[node] - potential[head], head, onward))
    return came, cost


def strong_components(n_nodes: int, sources: Integers, targets: Integers) -> Integers:
    """Return the strongly connected component of each node, numbered in the order of their first nodes.

    Tarjan's algorithm (Depth-first search and linear graph algorithms, 1972), without recursion.

    >>> strong_components(4, np.array([0, 1, 2, 2]), np.array([1, 2, 1, 3])).tolist()
    [0, 1, 1, 2]
    """
    onward: list[list[int]] = [[] for _ in range(n_nodes)]
    for source, target in zip(sources.tolist(), targets.tolist(), strict=True):
        onward[source].append(target)
    index: dict[int, int] = {}
    low = [0] * n_nodes
    found = np.full(n_nodes, -1, np.int64)
    open_nodes: list[int] = []
    for root in range(n_nodes):
        if root in index:
            continue
        work = [(root, 0)]
        while work:
            node, at = work.pop()
            if at == 0:
                low[node] = index[node] = len(index)
                open_nodes.append(node)
            elif found[child := onward[node][at - 1]] < 0:
                low[node] = min(low[node], low[child])
            for place in range(at, len(onward[node])):
                child = onward[node][place]
                if child not in index:
                    work += [(node, place + 1), (child, 0)]
                    break
                if found[child] < 0:
                    low[node] = min(low[node], index[child])
            else:
                if low[node] == index[node]:
                    while found[node] < 0:
                        found[open_nodes.pop()] = index[node]
    first: dict[int, int] = {}
    return np.array([first.setdefault(label, len(first)) for label in found.tolist()], np.int64)

"""The fewest walks, and the cheapest, that together take the arcs of a network as often as they must.

Fewest walks is a minimum flow with lower bounds on the condensation of the network: inside a strongly connected
component one walk can do everything, so only the components and the arcs between them count (Ntafos & Hakimi, On
path cover problems in digraphs, IEEE TSE 5, 1979). Least length is a minimum-cost circulation; where it falls into
cycles that hang together with no walk, they are joined by short ways; in a network that is not too large, `tightening`
then looks for the optimum and raises the lower bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from parcours.paths.circulation import cheapest_flow
from parcours.paths.contraction import Contraction, Flows
from parcours.paths.graph import components
from parcours.paths.joining import Arcs, Integers, groups, tightened, ways_there, ways_there_and_back

_UNLIMITED = 1 << 31
SMALL = 300
"""Networks of at most this many arcs are solved here, larger ones by OR-tools: whatever is installed, the same network
has the same cover."""
_ROUNDS = 8
"""How often cycles are joined by solving again before they are joined by going there and back."""


@dataclass(frozen=True, slots=True)
class Passages:
    """How often each arc is taken by the fewest walks, and what is known of the optimum.

    Attributes:
        taken: passages of each arc, shape (n_arcs,).
        beginnings: how many walks; no fewer can take every arc as often as it must.
        ended: how many walks end at each of the ends, shape (n_ends,).
        shortest: no set of that many walks costs less.
    """

    taken: Integers
    beginnings: int
    ended: Integers
    shortest: int

    def cost(self, arcs: Arcs) -> int:
        """Return what all passages cost together."""
        return int(self.taken @ arcs.costs)


def passages(arcs: Arcs) -> Passages:
    """Return the cheapest way found for the fewest walks to take each arc as often as it must be taken."""
    closed = _closed(arcs)
    component = components(arcs.n_nodes + 1, arcs.sources, arcs.targets)  # the last one is the pause
    between = _between(closed, component)
    n_beginnings = int(between[-1])
    closed.least[-1] = n_beginnings
    taken = _circulation(closed, n_beginnings)
    shortest = int(taken @ closed.costs)
    if groups(closed, taken).max() > 0:
        taken = _joined(closed, taken, component, between)
        if taken @ closed.costs > shortest:
            taken, shortest = tightened(closed, taken, shortest)
    n_arcs = arcs.sources.size
    return Passages(taken[:n_arcs], n_beginnings, taken[n_arcs:-1], shortest)


def least_cost(arcs: Arcs) -> int:
    """Return what walks that take each arc as often as it must be taken cost at least, however many they are."""
    closed = _closed(arcs)
    closed.least[-1] = 1
    return int(_circulation(closed, _UNLIMITED) @ closed.costs)


# Walks become one circulation through a pause node; its last arc counts the walks:
#
#      start 0 ~~> ... required arcs (flow >= least) ... ~~> ends
#         ^                                                   |
#         +--------- last arc: n walks <----- (pause) <-------+
def _closed(arcs: Arcs) -> Arcs:
    """Return the network with one more node, the pause between two walks: from every end, and back to the start."""
    pause, n_ends = arcs.n_nodes, arcs.ends.size
    free = np.zeros(n_ends + 1, dtype=np.int64)
    return Arcs(
        arcs.n_nodes + 1, np.concatenate([arcs.sources, arcs.ends, [pause]]).astype(np.int64),
        np.concatenate([arcs.targets, np.full(n_ends, pause), [0]]).astype(np.int64),
        np.concatenate([arcs.costs, free]).astype(np.int64), np.concatenate([arcs.least, free]).astype(np.int64),
        arcs.ends,
    )  # fmt: skip


def _between(closed: Arcs, component: Integers) -> Integers:
    """Return how often the fewest walks take each arc between two components; 0 on the arcs inside one."""
    sources, targets = component[closed.sources], component[closed.targets]
    outer = np.flatnonzero(sources != targets)
    # Each component is split: walks come in at 2 c and leave at 2 c + 1.
    n = int(component.max()) + 1
    through = np.zeros(n, dtype=np.int64)
    through[sources[(sources == targets) & (closed.least > 0)]] = 1
    costs = np.zeros(n + outer.size, dtype=np.int64)
    costs[-1] = 1  # the last arc is the one from the pause to the start: what is counted
    split = Arcs(
        2 * n, np.concatenate([2 * np.arange(n), 2 * sources[outer] + 1]),
        np.concatenate([2 * np.arange(n) + 1, 2 * targets[outer]]), costs,
        np.concatenate([through, closed.least[outer]]), closed.ends,
    )  # fmt: skip
    fewest = _circulation(split, _UNLIMITED)[-1]
    split.costs[n:] = closed.costs[outer]
    split.least[-1] = fewest
    flow = np.zeros(closed.sources.size, dtype=np.int64)
    flow[outer] = _circulation(split, int(fewest))[n:]
    return flow


def _circulation(closed: Arcs, most: int) -> Integers:
    """Return the cheapest passages that leave every node as often as they enter it, shape (n_arcs,)."""
    surplus = np.bincount(closed.targets, weights=closed.least, minlength=closed.n_nodes)
    surplus -= np.bincount(closed.sources, weights=closed.least, minlength=closed.n_nodes)
    if not surplus.any():
        return closed.least.copy()
    capacities = np.full(closed.sources.size, _UNLIMITED, dtype=np.int64)
    capacities[-1] = most - closed.least[-1]
    if closed.sources.size <= SMALL:
        added = cheapest_flow(closed.sources, closed.targets, closed.costs, capacities, surplus.astype(np.int64))
        if added is None:
            raise AssertionError("a network whose nodes all lead to an end has a circulation")
        return closed.least + added
    whole = Flows(
        closed.sources, closed.targets, closed.costs, surplus.astype(np.int64), np.arange(closed.sources.size)
    )
    contraction = Contraction(whole, fixed=closed.sources.size - 1)
    left = contraction.left
    return closed.least + contraction.flow(_solved(left, capacities[left.numbers]))


def _solved(problem: Flows, capacities: Integers) -> Integers:
    if not problem.supplies.any():
        return np.zeros(problem.numbers.size, dtype=np.int64)
    from ortools.graph.python.min_cost_flow import SimpleMinCostFlow

    network = SimpleMinCostFlow()
    numbers = network.add_arcs_with_capacity_and_unit_cost(problem.sources, problem.targets, capacities, problem.costs)
    network.set_nodes_supplies(np.arange(problem.supplies.size), problem.supplies)
    status = network.solve()
    if status != SimpleMinCostFlow.OPTIMAL:
        raise AssertionError(f"a network whose nodes all lead to an end has a circulation, but: {status}")
    return np.asarray(network.flows(numbers), dtype=np.int64)


def _joined(closed: Arcs, cheapest: Integers, component: Integers, between: Integers) -> Integers:
    """Return the cheapest passages without detached cycles that were found, given the cheapest with such cycles.

    Where the walks are led through every component that must be visited, each cycle lies in a component that some
    walk visits, and can be joined to it; without leading them it may fail, but is cheaper where it does not.
    """
    n_beginnings = int(closed.least[-1])
    tried = []
    for least in (closed.least.copy(), np.maximum(closed.least, between)):
        led = Arcs(closed.n_nodes, closed.sources, closed.targets, closed.costs, least, closed.ends)
        taken = cheapest if (least == closed.least).all() else _circulation(led, n_beginnings)
        for _ in range(_ROUNDS):
            where = groups(led, taken)
            if where.max() <= 0:
                tried.append(taken)
                break
            missing = [arc for way in ways_there(led, component, where) for arc in way if least[arc] < 1]
            if not missing:
                break  # solved again, it would be the same
            least[missing] = 1
            taken = _circulation(led, n_beginnings)
    if tried:
        return min(tried, key=lambda taken: int(taken @ closed.costs))
    while (where := groups(led, taken)).max() > 0:
        for there, back in ways_there_and_back(led, component, where):
            np.add.at(taken, there + back, 1)
    return taken

"""Which passages of a network hang together with a walk from the start, and ways to join the others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from parcours.paths.graph import Came, breadth_first, components, way_to

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Integers = NDArray[np.int64]

LARGEST = 4000
"""Most arcs of a network that is solved like this: time grows fast."""

_BRANCHED = 250
"""Most arcs of a network where also whole numbers are asked for; beyond, what comes out fractional is left."""

_ROUNDS = 40
_NODES = 60
"""Most rounds, and nodes of one search tree: counted, not timed, so that the result is the same everywhere."""


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
    """Return for each node -1 if nothing passes it, 0 if it hangs together with the last node, else its group."""
    used = np.flatnonzero(taken)
    ends = (arcs.sources[used], arcs.targets[used])
    labels = components(arcs.n_nodes, *ends, directed=False)
    found = np.full(arcs.n_nodes, -1, dtype=np.int64)
    passed = np.unique(np.concatenate(ends))
    found[passed] = (labels[passed] - labels[-1]) % (labels.max() + 1)
    return found


def ways_there(arcs: Arcs, component: Integers, where: Integers) -> Iterator[list[int]]:
    """Yield for each detached group the arcs of a shortest way to it from what is attached or reached before."""
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
    """Yield (first node of the way, node met, arcs of the way) for each group, breadth first from `begin`."""
    came: Came[int, int] = {}
    wanted, goal = set(where[where > 0].tolist()), where.tolist()
    first: dict[int, int] = {}
    for node in breadth_first(begin, leaving.__getitem__, came):
        step = came[node]
        first[node] = node if step is None else first[step[1]]
        if step is not None and goal[node] in wanted:
            wanted.discard(goal[node])
            yield first[node], node, way_to(node, came)
        if not wanted:
            return


def tightened(arcs: Arcs, known: Integers, shortest: int) -> tuple[Integers, int]:
    """Return the cheapest passages that hang together, or the known ones if none were found, and a lower bound.

    Each set of nodes that holds something required must be entered at least once. Where an optimal circulation breaks
    this, the rule for that set joins the integer program and it is solved again (subtour elimination, Dantzig,
    Fulkerson & Johnson, Solution of a large-scale traveling-salesman problem, Operations Research 2, 1954). What is
    optimal and hangs together is optimal altogether; and every step's optimum is a lower bound.
    """
    if arcs.sources.size > LARGEST:
        return known, shortest
    rules: list[Integers] = []
    whole = False
    for _ in range(_ROUNDS):
        found = _solved(arcs, rules, whole)
        bound = found.mip_dual_bound if whole else found.fun
        if bound is not None and np.isfinite(bound):
            shortest = max(shortest, int(np.ceil(bound - 1e-6)))
        if found.status != 0 or shortest >= known @ arcs.costs:
            return known, shortest
        where = groups(arcs, (found.x > 1e-6).astype(np.int64))
        taken = np.rint(found.x).astype(np.int64)
        if where.max() > 0:
            rules += _entering(arcs, where)
        elif np.abs(found.x - taken).max() < 1e-6:
            return taken, shortest
        elif whole or arcs.sources.size > _BRANCHED:
            return known, shortest
        else:
            whole = True
    return known, shortest


def _solved(arcs: Arcs, rules: Sequence[Integers], whole: bool) -> OptimizeResult:
    from scipy.optimize import Bounds, LinearConstraint, milp  # slow to load, and seldom needed
    from scipy.sparse import csr_array

    n_arcs = arcs.sources.size
    places = np.arange(n_arcs)
    balance = csr_array(
        (
            np.concatenate([np.ones(n_arcs), -np.ones(n_arcs)]),
            (np.concatenate([arcs.targets, arcs.sources]), np.concatenate([places, places])),
        ),
        shape=(arcs.n_nodes, n_arcs),
    )
    most = np.full(n_arcs, np.inf)
    most[-1] = arcs.least[-1]
    return milp(
        arcs.costs, integrality=np.full(n_arcs, int(whole)), bounds=Bounds(arcs.least, most),
        constraints=[LinearConstraint(balance, 0, 0), *(LinearConstraint(rule, 1, np.inf) for rule in rules)],
        options={"node_limit": _NODES},
    )  # fmt: skip


def _entering(arcs: Arcs, where: Integers) -> Iterator[Integers]:
    """Yield for each detached group that holds something required which arcs enter it, as ones."""
    begin, end = where[arcs.sources], where[arcs.targets]
    for group in np.unique(where[where > 0]):
        if (arcs.least[(begin == group) & (end == group)] > 0).any():
            yield ((begin != group) & (end == group)).astype(np.int64)

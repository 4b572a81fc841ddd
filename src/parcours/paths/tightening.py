"""The cheapest circulation with detached cycles -> the cheapest without, by cutting them off one after the other.

Each set of nodes that holds something required must be entered at least once. Where an optimal circulation breaks
this, the rule for that set joins the integer program and it is solved again (subtour elimination, Dantzig, Fulkerson
& Johnson, Solution of a large-scale traveling-salesman problem, Operations Research 2, 1954). What is optimal and
hangs together is optimal altogether; and every step's optimum is a lower bound.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array

from parcours.paths.joining import Arcs, Integers, groups

LARGEST = 4000
"""Most arcs of a network that is solved like this: time grows fast."""

_ROUNDS = 20
_NODES = 200
"""Most rounds, and nodes of one search tree: counted, not timed, so that the result is the same everywhere."""


def tightened(arcs: Arcs, known: Integers, shortest: int) -> tuple[Integers, int]:
    """Return the cheapest passages that hang together, or the known ones if none were found, and a lower bound.

    Args:
        arcs: a closed network; its last arc, from the pause to the start, is taken exactly as often as its least.
        known: passages that hang together, shape (n_arcs,).
        shortest: a lower bound known before.
    """
    n_arcs = arcs.sources.size
    if n_arcs > LARGEST:
        return known, shortest
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
    rules = [LinearConstraint(balance, 0, 0)]
    for _ in range(_ROUNDS):
        found = milp(
            arcs.costs,
            integrality=np.ones(n_arcs, dtype=np.int64),
            bounds=Bounds(arcs.least, most),
            constraints=rules,
            options={"node_limit": _NODES},
        )
        if found.mip_dual_bound is not None and np.isfinite(found.mip_dual_bound):
            shortest = max(shortest, int(np.ceil(found.mip_dual_bound - 1e-6)))
        if found.status != 0 or shortest >= known @ arcs.costs:
            return known, shortest
        taken = np.rint(found.x).astype(np.int64)
        where = groups(arcs, taken)
        if where.max() <= 0:
            return taken, shortest
        rules += [LinearConstraint(entering, 1, np.inf) for entering in _entering(arcs, where)]
    return known, shortest


def _entering(arcs: Arcs, where: Integers) -> Iterator[Integers]:
    """Yield for each detached group that holds something required which arcs enter it, as ones."""
    begin, end = where[arcs.sources], where[arcs.targets]
    for group in np.unique(where[where > 0]):
        if (arcs.least[(begin == group) & (end == group)] > 0).any():
            yield ((begin != group) & (end == group)).astype(np.int64)

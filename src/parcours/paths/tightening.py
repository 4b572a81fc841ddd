"""The cheapest circulation with detached cycles -> the cheapest without, by cutting them off one after the other.

Each set of nodes that holds something required must be entered at least once. Where an optimal circulation breaks
this, the rule for that set joins the integer program and it is solved again (subtour elimination, Dantzig, Fulkerson
& Johnson, Solution of a large-scale traveling-salesman problem, Operations Research 2, 1954). What is optimal and
hangs together is optimal altogether; and every step's optimum is a lower bound.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from parcours.paths.joining import Arcs, Integers, groups

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

LARGEST = 4000
"""Most arcs of a network that is solved like this: time grows fast."""

_BRANCHED = 250
"""Most arcs of a network where also whole numbers are asked for; beyond, what comes out fractional is left."""

_ROUNDS = 40
_NODES = 60
"""Most rounds, and nodes of one search tree: counted, not timed, so that the result is the same everywhere."""


def tightened(arcs: Arcs, known: Integers, shortest: int) -> tuple[Integers, int]:
    """Return the cheapest passages that hang together, or the known ones if none were found, and a lower bound.

    Args:
        arcs: a closed network; its last arc, from the pause to the start, is taken exactly as often as its least.
        known: passages that hang together, shape (n_arcs,).
        shortest: a lower bound known before.
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
    from scipy.optimize import Bounds, LinearConstraint, milp
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
        arcs.costs,
        integrality=np.full(n_arcs, int(whole)),
        bounds=Bounds(arcs.least, most),
        constraints=[LinearConstraint(balance, 0, 0), *(LinearConstraint(rule, 1, np.inf) for rule in rules)],
        options={"node_limit": _NODES},
    )


def _entering(arcs: Arcs, where: Integers) -> Iterator[Integers]:
    """Yield for each detached group that holds something required which arcs enter it, as ones."""
    begin, end = where[arcs.sources], where[arcs.targets]
    for group in np.unique(where[where > 0]):
        if (arcs.least[(begin == group) & (end == group)] > 0).any():
            yield ((begin != group) & (end == group)).astype(np.int64)

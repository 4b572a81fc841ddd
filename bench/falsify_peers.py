"""Falsifiers by others that call the same simulation as `parcours falsify`: psy-taliro (pip install psy-taliro)."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import numpy as np
import staliro
from numpy.typing import NDArray
from staliro.optimizers import DualAnnealing, Optimizer, UniformRandom

from parcours.study.falsifying import Cube, Search

PEERS: dict[str, Callable[[], Optimizer]] = {
    "psy-taliro: dual annealing": lambda: DualAnnealing(min_cost=0.0),
    "psy-taliro: uniform": lambda: UniformRandom(min_cost=0.0),
}


class _Over(Exception):
    """There is a failure, or the budget is spent."""


def simulations(peer: str, search: Search, seed: int, budget: int) -> tuple[int, bool]:
    """Return how many simulations a peer takes to the first failure, or in all; and whether there was one.

    It moves in the unit cube, as `falsify` does; constraints are unknown to it, so what they refuse is far from
    failing and costs no simulation.
    """
    cube = Cube(search.inputs)
    taken, found = 0, False

    @staliro.costfunc
    def cost(inputs: staliro.Inputs) -> float:
        nonlocal taken, found
        if found or taken >= budget:
            raise _Over
        values: NDArray[np.float64] = cube.values(np.array([[inputs.static[f"x{k}"] for k in range(cube.n)]]))
        if not cube.allows(values)[0]:
            return 10.0
        [far], [causes] = search.simulate(values, np.array([taken]))
        taken += 1
        found = any(one.startswith("collided") for one in causes)
        return -1.0 if found else max(float(far), 0.0)

    bounds = {f"x{k}": (0.0, math.nextafter(1.0, 0.0)) for k in range(cube.n)}
    options = staliro.TestOptions(runs=1, iterations=10 * budget, seed=seed, static_inputs=bounds)
    with contextlib.suppress(_Over):
        staliro.test(cost, PEERS[peer](), options)
    return taken, found

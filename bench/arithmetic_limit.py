"""What one core gives at best to the innermost test of collision evaluation: is a sample of a way within reach?

One test of a sample against an obstacle takes their relative position, its square and a comparison: six floating-point
operations. The kernels below do nothing else, on positions that lie ready in the nearest cache, compiled by the same
compiler under the same rules as all of Parcours. `count_hits` may use whatever vector instructions the machine has: the
most that the core gives. `first_hit` asks after every sample whether it was the one, and so takes them one at a time:
what a plain loop gives. An evaluation that looks at every sample of every trajectory has to do these tests, and
everything else besides: so the tests a case divided by a rate is a time that no such evaluation comes below.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import kernel

OPERATIONS = 6
"""Floating-point operations of one test: two subtractions, two squares, their sum, a comparison."""

SAMPLES, OBSTACLES = 100, 3

Floats = NDArray[np.float64]


@kernel
def count_hits(x: Floats, y: Floats, places_x: Floats, places_y: Floats, reach: float, times: int) -> int:
    """Return in how many tests sample and obstacle are within reach; the reach [m] differs a little every time.

    Args:
        x: of the samples [m], shape (n,).
        y: ...
        places_x: of the obstacles at these samples [m], shape (n_obstacles, n).
        places_y: ...
        reach: [m].
        times: how often all tests are done.
    """
    hits = 0
    for k in range(times):
        square = (reach + 1e-9 * k) * (reach + 1e-9 * k)
        for i in range(places_x.shape[0]):
            for j in range(x.shape[0]):
                dx, dy = places_x[i, j] - x[j], places_y[i, j] - y[j]
                hits += 1 if dx * dx + dy * dy < square else 0
    return hits


@kernel
def first_hit(x: Floats, y: Floats, places_x: Floats, places_y: Floats, reach: float, times: int) -> int:
    """Return the sum of the first samples within reach of each obstacle, n if none is; arguments as `count_hits`."""
    total = 0
    for k in range(times):
        square = (reach + 1e-9 * k) * (reach + 1e-9 * k)
        for i in range(places_x.shape[0]):
            first = x.shape[0]
            for j in range(x.shape[0]):
                dx, dy = places_x[i, j] - x[j], places_y[i, j] - y[j]
                if dx * dx + dy * dy < square:
                    first = j
                    break
            total += first
    return total


Tests = Callable[[Floats, Floats, Floats, Floats, float, int], int]


def tests_a_second(tests: Tests, times: int = 100_000, tries: int = 5) -> float:
    """Return how many tests one core does in a second of processor time by one of the kernels, best of `tries`."""
    draw = np.random.default_rng(0).random
    x, y = draw(SAMPLES), draw(SAMPLES)
    places_x, places_y = draw((OBSTACLES, SAMPLES)) + 2.0, draw((OBSTACLES, SAMPLES))  # out of reach: all are tested
    tests(x, y, places_x, places_y, 0.225, 1)
    best = np.inf
    for _ in range(tries):
        begun = time.process_time()
        tests(x, y, places_x, places_y, 0.225, times)
        best = min(best, time.process_time() - begun)
    return float(times * SAMPLES * OBSTACLES / best)

"""How a search over input domains chooses its next cases: by evolution, by CMA-ES, or at random.

A case is a point of the unit cube and a number, on which all else depends that is drawn. What comes near failing may
owe that to its number: so evolution keeps a parent's number more often than not, and CMA-ES the one it starts with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from parcours.study.cube import Cube, Floats, UniformDraws, anywhere, moved

Integers = NDArray[np.int64]
Method = Literal["evolution", "cma-es", "random"]

GENERATION, ELITE = 20, 5
_ANYWHERE, _KEPT = 0.15, 0.7  # shares of a generation that are drawn anywhere, and of children that keep the number
_SCALES = 10  # steps of 1/2 .. 1/1024 of a domain
_GAIN, _PATIENCE = 0.9, 12  # generations in which the best fell by no tenth: then a search starts again
_STEP = 0.1  # first standard deviation of CMA-ES, of a domain
_INSIDE = 0.01  # how far from the faces of the cube its first mean is at least


@dataclass(frozen=True, slots=True)
class Cases:
    """Cases, shape (n, ...) each."""

    points: Floats
    numbers: Integers
    far: Floats  # from failing


class CaseSampler(Protocol):
    """Chooses the next cases by how near those before came to failing."""

    def ask(self, most: int, first: int) -> tuple[Floats, Integers]:
        """Return the points, shape (n, n_inputs), and the numbers of the next cases, 1 .. `most` of them.

        No case has had a number from `first` on.
        """

    def tell(self, cases: Cases) -> None:
        """Take note of how near these cases came."""


def sampler_of(method: Method, cube: Cube, seed: int) -> CaseSampler:
    """Return a new sampler; the same seed chooses the same cases after the same answers."""
    draws = UniformDraws(seed)
    if method == "cma-es":
        return _CmaEs(cube, draws)
    return _Evolution(cube, draws) if method == "evolution" else _Random(cube, draws)


class _Random:
    """Draws every case as a campaign does."""

    def __init__(self, cube: Cube, draws: UniformDraws) -> None:
        self._cube, self._draws = cube, draws

    def ask(self, most: int, first: int) -> tuple[Floats, Integers]:
        n = min(GENERATION, most)
        return anywhere(n, self._cube, self._draws), np.arange(first, first + n)

    def tell(self, cases: Cases) -> None:
        pass


class _Patience:
    """Says when a search gets no nearer."""

    def __init__(self) -> None:
        self._best, self._since = math.inf, 0

    def is_over(self, best: float) -> bool:
        """Say whether it is, now that the best of a generation came so near."""
        self._best, self._since = (best, 0) if best < _GAIN * self._best else (self._best, self._since + 1)
        return self._since >= _PATIENCE


class _Evolution:
    """Breeds each generation from the best cases so far: one parent each, some inputs moved.

    An evolution strategy (Beyer, Schwefel, Natural Computing 1, 2002). Some are drawn anywhere all the same, and a
    search that gets no nearer starts again.
    """

    def __init__(self, cube: Cube, draws: UniformDraws) -> None:
        self._cube, self._draws = cube, draws
        self._start()

    def _start(self) -> None:
        self._elite = Cases(np.zeros((0, self._cube.n)), np.zeros(0, np.int64), np.zeros(0))
        self._patience = _Patience()

    def ask(self, most: int, first: int) -> tuple[Floats, Integers]:
        elite, draws = self._elite, self._draws
        n = min(GENERATION, most)
        points, numbers = anywhere(n, self._cube, draws), np.arange(first, first + n)
        if not len(elite.far):
            return points, numbers
        parents = (draws.uniform(n) * len(elite.far)).astype(np.int64)
        children = moved(elite.points[parents], draws, _SCALES)
        bred = self._cube.allows(self._cube.values(children)) & (draws.uniform(n) >= _ANYWHERE)
        kept = bred & (draws.uniform(n) < _KEPT)
        return np.where(bred[:, np.newaxis], children, points), np.where(kept, elite.numbers[parents], numbers)

    def tell(self, cases: Cases) -> None:
        both = (self._elite, cases)
        points, numbers, far = (np.concatenate([getattr(one, name) for one in both]) for name in Cases.__slots__)
        order = np.argsort(far, kind="stable")[:ELITE]
        self._elite = Cases(points[order], numbers[order], far[order])
        if self._patience.is_over(self._elite.far[0]):
            self._start()


class _CmaEs:
    """Covariance matrix adaptation from the best of some cases drawn anywhere, with its number.

    Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, as the package `cmaes` has it. What constraints
    refuse ranks last and is not simulated. A search that gets no nearer starts again.
    """

    def __init__(self, cube: Cube, draws: UniformDraws) -> None:
        self._cube, self._draws = cube, draws
        self._optimizer: Any = None  # of what is searched from one start

    def ask(self, most: int, first: int) -> tuple[Floats, Integers]:
        if self._optimizer:
            points = np.array([self._optimizer.ask() for _ in range(GENERATION)])
            allowed = self._cube.allows(self._cube.values(points))
            self._refused = points[~allowed]
            if allowed.any():
                points = points[allowed][:most]
                return points, np.full(len(points), self._number)
            self._optimizer = None
        n = min(GENERATION, most)
        return anywhere(n, self._cube, self._draws), np.arange(first, first + n)

    def tell(self, cases: Cases) -> None:
        best = int(np.argmin(cases.far))
        if not self._optimizer:
            self._start(cases.points[best], int(cases.numbers[best]))
        elif len(cases.far) + len(self._refused) == GENERATION:
            ranked = [*zip(cases.points, cases.far.tolist(), strict=True)]
            self._optimizer.tell(ranked + [(one, math.inf) for one in self._refused])
        if self._patience.is_over(float(cases.far[best])) or self._optimizer.should_stop():
            self._optimizer = None

    def _start(self, point: Floats, number: int) -> None:
        from cmaes import CMA

        bounds = np.tile([0.0, 1.0], (self._cube.n, 1))
        mean = np.clip(point, _INSIDE, 1.0 - _INSIDE)
        seed = int(self._draws.uniform(1)[0] * 2**32)
        self._optimizer = CMA(mean, _STEP, bounds=bounds, seed=seed, population_size=GENERATION)
        self._number, self._patience = number, _Patience()

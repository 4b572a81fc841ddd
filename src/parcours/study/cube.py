"""The unit cube over test inputs, whose uniform points are what a campaign draws: points drawn, and moved."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.data.constraints import allows
from parcours.data.drawing import ends_of
from parcours.errors import BadRequest
from parcours.streams import starts, uniforms

Floats = NDArray[np.float64]

_PURPOSE = 0x66616C73  # of the streams from which points are drawn (ASCII for `fals`)
_TRIES = 1000


class Cube:
    """The unit cube over test inputs: a uniform point of it has blocks and values as a campaign draws them.

    >>> from parcours.data import split
    >>> speeds = Cube(InputModel("speeds", (split("v", "m/s", [0.0, 1.0, 5.0]),)))
    >>> speeds.values(np.array([[0.0], [0.25], [0.5], [0.75]])).ravel().tolist()  # the upper half is the second block
    [0.0, 0.5, 1.0000000000000002, 3.0]
    """

    def __init__(self, inputs: InputModel) -> None:
        self._inputs = inputs
        self._ends = [np.array(ends_of(domain))[: len(domain.blocks)] for domain in inputs.domains]
        self.n = len(inputs.domains)
        self.sizes = np.array([len(ends) for ends in self._ends], np.int64)

    def blocks(self, points: Floats) -> NDArray[np.int64]:
        """Return the block in which each value of points lies, shape (n, n_inputs)."""
        return np.minimum((points * self.sizes).astype(np.int64), self.sizes - 1)

    def points(self, values: Floats, within: Floats) -> Floats:
        """Return points with these values, shape (n, n_inputs); `within` says where between two whole numbers.

        >>> from parcours.data import split
        >>> counts = Cube(InputModel("counts", (split("n", "1", [0.0, 1.0, 5.0]),)))
        >>> counts.values(counts.points(np.array([[0.5], [4.0]]), np.zeros((2, 1)))).ravel().tolist()
        [0.5, 4.0]
        """
        blocks, points = self._inputs.blocks_of(values), np.empty_like(values)
        for k, (domain, ends) in enumerate(zip(self._inputs.domains, self._ends, strict=True)):
            low, high = ends[blocks[:, k], :2].T
            above = values[:, k] - low
            if domain.kind == "angle":
                above = np.where(above < 0.0, above + 2.0 * math.pi, above)
            elif domain.kind in ("integer", "enumeration"):
                above = above + within[:, k]
            points[:, k] = (blocks[:, k] + np.clip(above / (high - low), 0.0, 1.0 - 1e-12)) / len(ends)
        return points

    def values(self, points: Floats) -> Floats:
        """Return the values of points, shape (n, n_inputs)."""
        values = np.empty_like(points)
        for k, (domain, ends) in enumerate(zip(self._inputs.domains, self._ends, strict=True)):
            place = np.clip(points[:, k], 0.0, np.nextafter(1.0, 0.0)) * len(ends)
            low, high, first, last = ends[np.floor(place).astype(np.int64)].T
            drawn = low + (high - low) * (place - np.floor(place))
            if domain.kind in ("integer", "enumeration"):
                drawn = np.floor(drawn)
            drawn = np.clip(drawn, first, last)
            values[:, k] = np.where(drawn > math.pi, drawn - 2.0 * math.pi, drawn) if domain.kind == "angle" else drawn
        return values

    def allows(self, values: Floats) -> NDArray[np.bool_]:
        """Return which rows meet all constraints, shape (n,)."""
        return allows(self._inputs, values)


class UniformDraws:
    """Uniform numbers of one stream, each once."""

    def __init__(self, seed: int, stream: int = 0, purpose: int = _PURPOSE) -> None:
        self._taken, self._start = 0, starts(seed, np.array([stream]), purpose)

    def uniform(self, *shape: int) -> Floats:
        """Return the next ones, in [0, 1)."""
        n = math.prod(shape)
        found: Floats = uniforms(self._start, self._taken, n)[0].reshape(shape)
        self._taken += n
        return found


def anywhere(n: int, cube: Cube, draws: UniformDraws) -> Floats:
    """Return uniform points that meet the constraints, shape (n, n_inputs).

    Raises BadRequest: 1000 times as many draws meet them less often than n times.
    """
    found = np.zeros((0, cube.n))
    for _ in range(_TRIES):
        points = draws.uniform(n, cube.n)
        found = np.concatenate([found, points[cube.allows(cube.values(points))]])
        if len(found) >= n:
            return found[:n]
    rule = f"constraints must be met now and then, but {_TRIES} x {n} draws met them {len(found)} times"
    raise BadRequest("falsify", rule, "loosen them", slug="falsify-inputs")


def moved(points: Floats, draws: UniformDraws, scales: int) -> Floats:
    """Return points near by, shape (n, n_inputs); the way back is as likely.

    Half of the inputs, a quarter, ... or one move by at most 1/2, 1/4, ... or 2^-scales of the cube's side: near a
    failure short steps stay there, or long ones along inputs that do not matter.
    """
    n, n_inputs = points.shape
    steps = np.ldexp(1.0, -1 - (draws.uniform(n) * scales).astype(np.int64))
    sizes = np.ldexp(float(n_inputs), -1 - (draws.uniform(n) * math.log2(2 * n_inputs)).astype(np.int64))
    ranks = np.argsort(draws.uniform(n, n_inputs), axis=1, kind="stable")
    by = np.where(ranks < np.maximum(sizes, 1.0)[:, np.newaxis], steps[:, np.newaxis], 0.0)
    new = points + by * (2.0 * draws.uniform(n, n_inputs) - 1.0)
    found: Floats = 1.0 - np.abs(1.0 - np.abs(new))  # thrown back at the faces of the cube
    return found

"""Looks for a failing case over the input domains of a study: an evolution that is guided by how near cases came.

Cases are points of the unit cube, uniform points being what a campaign draws. Each generation is bred from the best
cases so far: one parent each, some inputs moved (an evolution strategy: Beyer, Schwefel, Natural Computing 1, 2002).
Some are drawn anywhere all the same, and a search that gets no nearer starts again. The budget counts simulations.

A distribution fitted to the best, as by cross-entropy, was no better than random draws: cases fail in several ways (any
of three obstacles, from either side), and what lies between them does not.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.data.constraints import allows
from parcours.data.drawing import ends_of
from parcours.errors import BadRequest
from parcours.streams import starts, uniforms
from parcours.study.finding import find
from parcours.study.parameters import Settings, pairs_of, settings_of
from parcours.study.protocol import Progress

Floats = NDArray[np.float64]
Method = Literal["evolution", "random"]

_PURPOSE = 0x66616C73  # of the streams from which points are drawn (ASCII for `fals`)
GENERATION, FIRST, ELITE = 20, 80, 5
_ANYWHERE, _KEPT = 0.15, 0.7  # shares of a generation that are drawn anywhere, and of children that keep the number
_SCALES = 10  # steps of 1/2 .. 1/1024 of a domain
_GAIN, _PATIENCE = 0.9, 12  # generations in which the best fell by no tenth: then a search starts again
_TRIES = 1000


class Search(Protocol):
    """Cases of a study, by the values of their test inputs."""

    @property
    def inputs(self) -> InputModel:
        """The test inputs."""

    @property
    def event(self) -> str:
        """What it is to fail, in words."""

    def simulate(
        self, values: Floats, numbers: NDArray[np.int64]
    ) -> tuple[Floats, Sequence[Sequence[str]]]:  # fmt: skip
        """Run cases, shape (n, n_inputs), whose other randomness their numbers decide.

        Returns how far each is from failing, shape (n,), and why it fails, for no cause if it does not.
        """

    def keep(self, values: Floats, number: int, cause: str, out: Path) -> Sequence[Path]:
        """Write a case that fails for a cause; return what was written."""


@runtime_checkable
class Searchable(Protocol):
    """A study whose cases can be run with any values of their test inputs."""

    def search(self, settings: Settings, seed: int) -> Search:
        """Return its cases. Raises BadRequest: it has no test inputs, or settings are out of range."""


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


@dataclass(frozen=True, slots=True)
class Falsified:
    """What a search found."""

    seed: int
    simulations: int  # how many it took up to the first failure, or in all
    robustness: float  # least distance from failing; negative for a failure
    values: Mapping[str, float]  # test inputs of that case
    number: int  # of that case
    cause: str = ""  # why it fails; empty if nothing failed
    files: tuple[str, ...] = ()

    def __str__(self) -> str:
        shown = ", ".join(f"{name} = {value:.4g}" for name, value in self.values.items())
        if self.cause:
            return f"seed {self.seed}: failed in simulation {self.simulations}, {self.cause}: {shown}"
        return f"seed {self.seed}: no failure in {self.simulations} simulations; nearest {self.robustness:.4g}: {shown}"


def falsify(
    search: Search, *, seed: int, budget: int, progress: Progress, method: Method = "evolution", cause: str = ""
) -> Falsified:  # fmt: skip
    """Look for a failing case, until the first one or the end of the budget.

    Args:
        search: the cases.
        seed: of the search; the same seed takes the same way.
        budget: most simulations.
        progress: reports how many there were.
        method: `random` draws every case as a campaign does.
        cause: with what the cause must begin for a failure to count.

    Raises BadRequest: there are no test inputs, or constraints are not met in 1000 draws of a generation.
    """
    cube = Cube(search.inputs)
    if not cube.n:
        rule = "there must be test inputs to search over, but there are none"
        raise BadRequest("falsify", rule, "give the world `data`, or run a campaign", slug="falsify-inputs")
    draws = UniformDraws(seed)
    elite, best, since = _none(cube), math.inf, 0
    nearest, least, at, done = np.zeros(cube.n), math.inf, 0, 0
    why = ""
    while done < budget and not why:
        n = min(GENERATION if len(elite.far) else FIRST, budget - done)
        points, numbers = _anywhere(n, cube, draws), np.arange(done, done + n)
        if len(elite.far) and method != "random":
            points, numbers = _bred(points, numbers, elite, cube, draws)
        values = cube.values(points)
        far, causes = simulated(search, values, numbers)
        counted = [next((one for one in each if one.startswith(cause)), "") for each in causes]
        first = next((k for k, one in enumerate(counted) if one), int(np.argmin(far)))
        why = counted[first]
        if why or far[first] < least:
            least, nearest, at = float(far[first]), values[first], int(numbers[first])
        done += first + 1 if why else n
        progress(f"simulations\nnearest {least:.4g}", done, budget)
        elite = _best(elite, _Cases(points, numbers, far))
        best, since = (elite.far[0], 0) if elite.far[0] < _GAIN * best else (best, since + 1)
        if since == _PATIENCE:
            elite, best, since = _none(cube), math.inf, 0
    named = dict(zip(search.inputs.names, nearest.tolist(), strict=True))
    return Falsified(seed, done, least, named, at, why)


@dataclass(frozen=True, slots=True)
class _Cases:
    """Cases, shape (n, ...) each."""

    points: Floats
    numbers: NDArray[np.int64]
    far: Floats  # from failing


def _none(cube: Cube) -> _Cases:
    return _Cases(np.zeros((0, cube.n)), np.zeros(0, np.int64), np.zeros(0))


def _best(*cases: _Cases) -> _Cases:
    """Return the cases that came nearest to failing."""
    points, numbers, far = (np.concatenate([getattr(one, name) for one in cases]) for name in _Cases.__slots__)
    order = np.argsort(far, kind="stable")[:ELITE]
    return _Cases(points[order], numbers[order], far[order])


def _anywhere(n: int, cube: Cube, draws: UniformDraws) -> Floats:
    """Return uniform points that meet the constraints, shape (n, n_inputs)."""
    found = np.zeros((0, cube.n))
    for _ in range(_TRIES):
        points = draws.uniform(n, cube.n)
        found = np.concatenate([found, points[cube.allows(cube.values(points))]])
        if len(found) >= n:
            return found[:n]
    rule = f"constraints must be met now and then, but {_TRIES} x {n} draws met them {len(found)} times"
    raise BadRequest("falsify", rule, "loosen them", slug="falsify-inputs")


def _bred(
    points: Floats, numbers: NDArray[np.int64], elite: _Cases, cube: Cube, draws: UniformDraws
) -> tuple[Floats, NDArray[np.int64]]:  # fmt: skip
    """Return the points and numbers of a generation: most are the best cases, moved; some stay where they were drawn.

    A child keeps its parent's number more often than not, as what else is drawn may be what brought it so near.
    """
    n = len(points)
    parents = (draws.uniform(n) * len(elite.far)).astype(np.int64)
    children = moved(elite.points[parents], draws, _SCALES)
    bred = cube.allows(cube.values(children)) & (draws.uniform(n) >= _ANYWHERE)
    kept = bred & (draws.uniform(n) < _KEPT)
    return np.where(bred[:, np.newaxis], children, points), np.where(kept, elite.numbers[parents], numbers)


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


def simulated(
    search: Search, values: Floats, numbers: NDArray[np.int64]
) -> tuple[Floats, list[Sequence[str]]]:  # fmt: skip
    """Do as `Search.simulate` where several cases may have one number: those run one after the other."""
    far, left = np.empty(len(numbers)), np.arange(len(numbers))
    causes: list[Sequence[str]] = [()] * len(numbers)
    while len(left):
        _, first = np.unique(numbers[left], return_index=True)
        first.sort()
        now = left[first]
        far[now], found = search.simulate(values[now], numbers[now])
        for k, one in zip(now.tolist(), found, strict=True):
            causes[k] = one
        left = np.delete(left, first)
    return far, causes


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


def search_of(given: str, settings: Sequence[str], seed: int) -> Search:
    """Return the cases of the study that a user names, by their values.

    Raises BadRequest: the study is unknown, a setting is wrong, or its cases cannot be run with given values.
    """
    study = find(given)
    if not isinstance(study, Searchable):
        rule = "its cases must be ones that can be run with any values of their test inputs, but they are not"
        raise BadRequest(f"study {study.name!r}", rule, "run a campaign instead", slug="falsify-study")
    return study.search(settings_of(study.parameters, pairs_of(settings), study.name), seed)


def search_and_keep(
    given: str, settings: Sequence[str], out: Path, progress: Progress, *, seed: int, budget: int, method: str,
    cause: str,
) -> Falsified:  # fmt: skip
    """Look for a failing case of the study that a user names, and write it if there is one.

    Args:
        given: the study, as a user names it.
        settings: of its parameters, as `name=value`.
        out: folder for what is written.
        progress: reports how many simulations there were.
        seed: of the search, and of what the cases draw by their numbers.
        budget, method, cause: as in `falsify`.

    Raises BadRequest: the study is unknown, a setting is wrong, or its cases cannot be run with given values.
    """
    search = search_of(given, settings, seed)
    found = falsify(search, seed=seed, budget=budget, progress=progress, method=cast(Method, method), cause=cause)
    if not found.cause:
        return found
    files = search.keep(np.array([*found.values.values()]), found.number, found.cause, out)
    return dataclasses.replace(found, files=tuple(map(str, files)))

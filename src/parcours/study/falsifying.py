"""Looks for a failing case over the input domains of a study: cross-entropy, which is guided by how near cases came.

Cases are points of the unit cube, uniform points being what a campaign draws. Each generation is drawn round the best
cases so far: a normal distribution for each input, fitted to them (Rubinstein, Kroese, The Cross-Entropy Method, 2004).
Some are drawn anywhere all the same, and a search that has settled begins again. The budget counts simulations.
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
Method = Literal["cross-entropy", "random"]

_PURPOSE = 0x66616C73  # of the streams from which points are drawn (ASCII for `fals`)
GENERATION, FIRST, ELITE = 40, 80, 10
_ANYWHERE, _SPREAD, _SETTLED = 0.15, 0.3, 0.04
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
    search: Search, *, seed: int, budget: int, progress: Progress, method: Method = "cross-entropy", cause: str = ""
) -> Falsified:
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
    draws = _Points(seed, cube)
    proposal, elite, scores = _Proposal(cube.n), np.zeros((0, cube.n)), np.zeros(0)
    best, nearest, at, done = math.inf, np.zeros(cube.n), 0, 0
    why = ""
    while done < budget and not why:
        n = min(FIRST if not done else GENERATION, budget - done)
        points = draws.points(n, None if method == "random" else proposal)
        values = cube.values(points)
        far, causes = search.simulate(values, np.arange(done, done + n))
        counted = [next((one for one in each if one.startswith(cause)), "") for each in causes]
        first = next((k for k, one in enumerate(counted) if one), int(np.argmin(far)))
        why = counted[first]
        if why or far[first] < best:
            best, nearest, at = float(far[first]), values[first], done + first
        done += first + 1 if why else n
        progress(f"simulations\nnearest {best:.4g}", done, budget)
        elite, scores = np.concatenate([elite, points]), np.concatenate([scores, far])
        order = np.argsort(scores, kind="stable")[:ELITE]
        elite, scores = elite[order], scores[order]
        if proposal.settle(elite):
            proposal, elite, scores = _Proposal(cube.n), elite[:0], scores[:0]
    named = dict(zip(search.inputs.names, nearest.tolist(), strict=True))
    return Falsified(seed, done, best, named, at, why)


class _Proposal:
    """A normal distribution for each input; at first it is as good as uniform."""

    def __init__(self, n: int) -> None:
        self.mean, self.spread = np.full(n, 0.5), np.full(n, np.inf)

    def settle(self, elite: Floats) -> bool:
        """Move towards the best cases; return whether they are so much alike that nothing new will come."""
        spread = np.maximum(elite.std(axis=0), 0.5 * _SETTLED)
        known = np.isfinite(self.spread)
        self.spread = np.where(known, 0.3 * np.where(known, self.spread, 0.0) + 0.7 * spread, spread)
        self.mean = np.where(known, 0.3 * self.mean + 0.7 * elite.mean(axis=0), elite.mean(axis=0))
        return bool((self.spread < _SETTLED).all())


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


class _Points(UniformDraws):
    """Points of the cube that meet the constraints."""

    def __init__(self, seed: int, cube: Cube) -> None:
        super().__init__(seed)
        self._cube = cube

    def points(self, n: int, proposal: _Proposal | None) -> Floats:
        """Return points, shape (n, n_inputs): uniform without a proposal, else most of them from it."""
        found = np.zeros((0, self._cube.n))
        for _ in range(_TRIES):
            points = self.uniform(n, self._cube.n)
            if proposal is not None and np.isfinite(proposal.spread).all():
                normal = self.uniform(n, self._cube.n, 12).sum(axis=2) - 6.0
                near = proposal.mean + proposal.spread * normal
                near = 1.0 - np.abs(1.0 - np.abs(near) % 2.0)  # thrown back at the faces of the cube
                points = np.where(self.uniform(n, 1) < _ANYWHERE, points, near)
            found = np.concatenate([found, points[self._cube.allows(self._cube.values(points))]])
            if len(found) >= n:
                return found[:n]
        rule = f"constraints must be met now and then, but {_TRIES} x {n} draws met them {len(found)} times"
        raise BadRequest("falsify", rule, "loosen them", slug="falsify-inputs")


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

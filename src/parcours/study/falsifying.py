"""Looks for a failing case over the input domains of a study, guided by how near earlier cases came."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.errors import BadRequest
from parcours.study.cube import Cube, Floats
from parcours.study.finding import find
from parcours.study.parameters import Settings, pairs_of, settings_of
from parcours.study.protocol import Progress
from parcours.study.samplers import Cases, Method, sampler_of


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
        method: how cases are chosen; `random` draws each as a campaign does.
        cause: with what the cause must begin for a failure to count.

    Raises BadRequest: there are no test inputs, or constraints are not met in 1000 draws of a generation.
    """
    cube = Cube(search.inputs)
    if not cube.n:
        rule = "there must be test inputs to search over, but there are none"
        raise BadRequest("falsify", rule, "give the world `data`, or run a campaign", slug="falsify-inputs")
    sampler = sampler_of(method, cube, seed)
    nearest, least, at, done = np.zeros(cube.n), math.inf, 0, 0
    why = ""
    while done < budget and not why:
        points, numbers = sampler.ask(budget - done, done)
        values = cube.values(points)
        far, causes = simulated(search, values, numbers)
        counted = [next((one for one in each if one.startswith(cause)), "") for each in causes]
        first = next((k for k, one in enumerate(counted) if one), int(np.argmin(far)))
        why = counted[first]
        if why or far[first] < least:
            least, nearest, at = float(far[first]), values[first], int(numbers[first])
        done += first + 1 if why else len(numbers)
        progress(f"simulations\nnearest {least:.4g}", done, budget)
        sampler.tell(Cases(points, numbers, far))
    named = dict(zip(search.inputs.names, nearest.tolist(), strict=True))
    return Falsified(seed, done, least, named, at, why)


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

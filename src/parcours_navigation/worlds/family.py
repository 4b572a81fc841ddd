"""Numbered cases of a world: values drawn from its blocks by a criterion, everything else from (seed, number)."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.data.constraints import allows
from parcours.errors import ParcoursError
from parcours.suite import Case, Plan, combine
from parcours_navigation.cases.family import given_or_drawn
from parcours_navigation.protocol import SENSES
from parcours_navigation.stage.memory import Staged
from parcours_navigation.worlds import plan as plans
from parcours_navigation.worlds.file import BadWorld, World
from parcours_navigation.worlds.staging import Land, land_of, stage

MOST_CASES = 2**53
"""Numbers of cases lie below this."""

_NONE = InputModel("world", ())


@dataclass(frozen=True, slots=True)
class WorldCases:
    """The endless family of a world's cases."""

    seed: int  # the campaign's
    world: World
    study: str = "navigation"  # the name with which their ids begin
    criterion: str = "each_choice"  # by which blocks are combined

    @property
    def inputs(self) -> InputModel:
        """What is drawn for each case."""
        return self.world.inputs or _NONE

    @property
    def protocol(self) -> str:
        """What stands in tables for how obstacles move."""
        return self.world.name

    def plan(self, number: int) -> plans.WorldPlan:
        """Return what the world is made of in a case."""
        return self.world.plan(tuple(self.values(np.array([number]))[0].tolist()))

    def id(self, number: int) -> str:
        """Return the stable id of a case: study, world, number."""
        return f"{self.study}/{self.world.name}/{number}"

    def number(self, id: str) -> int | None:
        """Return the number of a case by its id, with or without the study, or by itself; None if unknown."""
        world, _, text = id.rpartition("/")
        if not (text.isdecimal() and len(text) < 16) or (world and world.rpartition("/")[2] != self.world.name):
            return None
        return int(text)

    def vector(self, number: int) -> tuple[int, ...]:
        """Return (): nothing orders these cases."""
        return ()

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the drawn values of the cases in the order of `inputs.names`, shape (n, n_inputs)."""
        return self._combined().values(numbers)

    @property
    def period(self) -> int:
        """1: whatever is not in the values is drawn by the number."""
        return 1

    def settled(
        self, values: NDArray[np.float64], numbers: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return what these cases make of drawn values, shape (n, n_inputs), and whether they take them, shape (n,)."""
        return values, allows(self.inputs, values)

    def suite(self, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases as files keep them; by default as many as the criterion needs."""
        total = n_cases if n_cases is not None else max(self._combined().n_rows, 1)
        for first in range(0, total, 1024):
            yield from self._combined().cases(first, min(1024, total - first))

    def manifest(self) -> dict[str, object]:
        """Return the parameters of a campaign that say which cases these are."""
        return {"world": self.world.reference, "world_digest": self.world.digest, "criterion": self.criterion}

    def _combined(self) -> Plan:
        return _combined(self.study, self.world, self.criterion, self.seed)

    def staged(self, numbers: Sequence[int], period: float) -> list[Staged]:
        """Return cases at their beginning, for a planner that is asked once a `period` [s].

        Raises BadWorld, naming the case, if its world cannot be.
        """
        return [self._staged(number, period) for number in numbers]

    def land(self, number: int) -> Land:
        """Return the ground of a case."""
        return land_of(self.plan(number), self.world.folder, self.seed, number)

    def _staged(self, number: int, period: float) -> Staged:
        try:
            return stage(self.plan(number), self.world.folder, self.seed, number, period)
        except BadWorld:
            raise
        except ParcoursError as error:
            where = f"{self.world.origin}:{self.world.line_of(error.where)}, case {number}: {error.where}"
            raise BadWorld(where, error.rule, error.remedy, slug=error.slug) from error

    def require(self, needs: Sequence[str], planner: str) -> None:
        """Raise BadWorld unless the world gives a planner what it needs."""
        plan = self.plan(0)
        given = plan.sensing.gives(bool(plan.task.path))
        lacking = [name for name in needs if name not in given]
        if lacking:
            rule = f"it needs {' and '.join(lacking)}, but the world {self.world.name!r} gives {_and(given)}"
            wanted = {"scan": "sensing: {scan: {}}", "map": "sensing: {map: 0.05}", "path": "task: {path: [...]}"}
            raise BadWorld(f"planner {planner!r}", rule, "; ".join(wanted[name] for name in lacking if name in SENSES),
                           slug="world-gives")  # fmt: skip

    def end(self, time_limit: float) -> float:
        """Return when a test of that length ends [s]."""
        return time_limit

    def __hash__(self) -> int:
        return hash((self.seed, self.world.digest, self.study, self.criterion))


@dataclass(frozen=True, slots=True)
class GivenWorldCases(WorldCases):
    """Cases whose values are given instead of drawn; all else, and what is not given, is drawn by their numbers."""

    given: Mapping[int, tuple[float, ...]] = field(default_factory=dict)  # by the number of the case

    __hash__ = WorldCases.__hash__

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the values of the cases, shape (n, n_inputs): case 0 is asked for to compile, given or not."""
        return given_or_drawn(numbers, self.given, partial(WorldCases.values, self))


def _and(names: Sequence[str]) -> str:
    return " and ".join(names) if names else "neither scan, map nor path"


@functools.lru_cache(maxsize=16)
def _combined(study: str, world: World, criterion: str, seed: int) -> Plan:
    found = combine(study, [world.name], world.inputs or _NONE, criterion=criterion, seed=seed, n_cases=1)
    return dataclasses.replace(found, n_cases=MOST_CASES)

"""The paper's arena as a world file: its cases are the paper's own, by their model and domains, bit for bit.

Other worlds that differ from the arena in their obstacles only are read by what is built for the arena alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.elementary import PI
from parcours.errors import BadRequest
from parcours.kernels import Record
from parcours.suite import Case
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.robots.kinds import Body
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld, World
from parcours_navigation.worlds.plan import PaperObstacles, SensingPlan, TaskPlan, WorldPlan


def paper_cases(world: World, seed: int, study: str) -> SystemCases | None:
    """Return the paper's cases if the world's obstacles are the paper's; None for any other world.

    Raises BadWorld if anything else in such a world is not as the paper has it.
    """
    if world.inputs is not None:
        return None
    plan = world.plan()
    entries = [entry for entry in plan.others if entry.get("motion") == "paper"]
    if not entries:
        return None
    where = f"{world.origin}:{world.line_of('others')}: others"
    if len(plan.others) > 1:
        raise BadWorld(where, "the paper's obstacles come alone, but there are others beside them", slug="world-range")
    try:
        found = PaperObstacles(**entries[0])
    except TypeError as error:
        raise BadWorld(where, f"its keys must be protocol and radius, but: {error}", slug="world-range") from None
    body, task = plan.robot, plan.task
    as_given = (
        task.start is not None and tuple(task.goal or ()) == (2.0, 2.0) and task.start[:2] == (0.0, 0.0)
        and body.kind == "unicycle" and not body.footprint and plan.sensing == SensingPlan()
        and plan.ground.bounds is None and not plan.ground.walls
    )  # fmt: skip
    if not as_given:
        rule = "the paper's obstacles head for a robot that starts in the origin, senses all, and goes to (2, 2)"
        raise BadWorld(where, rule, "use stop-move-stop obstacles in other worlds", slug="world-range")
    try:
        return SystemCases(seed, found.protocol, body.radius, found.radius, study)
    except BadRequest as error:
        raise BadWorld(where, error.rule, error.remedy, slug=error.slug) from error


@dataclass(frozen=True, slots=True)
class ArenaCases(SystemCases):
    """Cases of a world that is the paper's arena but for its obstacles, for what runs in the arena alone."""

    world: WorldCases | None = None

    @property
    def of(self) -> WorldCases:
        """The cases as those of the world."""
        assert self.world is not None
        return self.world

    @property
    def inputs(self) -> InputModel:
        """What is drawn for each case."""
        return self.of.inputs

    def id(self, number: int) -> str:
        """Return the id of a case."""
        return self.of.id(number)

    def number(self, id: str) -> int | None:
        """Return the number of a case by its id."""
        return self.of.number(id)

    def vector(self, number: int) -> tuple[int, ...]:
        """Return (): nothing orders these cases."""
        return ()

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the drawn values of the cases, shape (n, n_inputs)."""
        return self.of.values(numbers)

    @property
    def period(self) -> int:
        """By how much numbers of cases of the same kind differ."""
        return self.of.period

    def settled(
        self, values: NDArray[np.float64], numbers: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return what these cases make of drawn values, and whether they take them."""
        return self.of.settled(values, numbers)

    def suite(self, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases."""
        return self.of.suite(n_cases)

    def end(self, time_limit: float) -> float:
        """Return when a test ends [s]: the world has a limit of its own."""
        return min(time_limit, self.of.plan(0).task.time_limit)

    def obstacles(self, numbers: NDArray[np.int64]) -> Record:
        """Return the cases as an array of OBSTACLE, shape (n, n_obstacles). Raises BadWorld: they differ in number."""
        found = [one.scene.obstacles for one in self.of.staged([*numbers.tolist(), 0], 0.05)]
        if len({len(one) for one in found}) > 1:
            rule = "all its cases must have the same number of obstacles, but have not"
            raise BadWorld(f"world {self.of.world.name!r}", rule, "give a number", slug="world-range")
        return np.ascontiguousarray(np.stack(found)[:-1])


def arena_cases(cases: WorldCases) -> ArenaCases:
    """Return the cases of a world that is the paper's arena but for its obstacles. Raises BadWorld: it is not."""
    plan = cases.plan(0)
    task, radius = plan.task, plan.robot.radius
    own = task.start is not None and abs(task.start[2] - PI / 4.0) < 1e-12 and task.start[:2] == (0.0, 0.0)
    arena = TaskPlan(task.start, 0.249, (2.0, 2.0), time_limit=task.time_limit)
    is_arena = plan == WorldPlan(arena, robot=Body(radius=radius), others=plan.others, solid=plan.solid)
    if not (own and is_arena and all(one.get("motion") == "stop-move-stop" for one in plan.others)):
        rule = "it must be the paper's arena but for its obstacles, which stop, move and stop, but it is not"
        raise BadWorld(f"world {cases.world.name!r}", rule, "see the world `paper`", slug="world-range")
    return ArenaCases(cases.seed, robot_radius=radius, study=cases.study, world=cases)

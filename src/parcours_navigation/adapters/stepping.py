"""One case, a period at a time, under the caller's control: begin, look, hold speeds. The seam to the world's stage."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.planner_facts import FACTS
from parcours_navigation.guests.planner_tasks import planner_seed
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.guests.staging import Cases, staged
from parcours_navigation.protocol import Observation, Scan
from parcours_navigation.sensing.detecting import MOST_FALSE
from parcours_navigation.stage import moving
from parcours_navigation.stage.memory import AT_STAGE, AT_WORLD, STAGE, Staged, lay, observed, size_of
from parcours_navigation.stage.ticking import NO_POINTS, begin_any, move_any

_NO_TRACK, _PATIENCE = 0, 1e9


class Stepped:
    """Cases of a family, of which one runs at a time.

    The world is that of `NavigationStudy`: the same case under the same speeds has the same bits.

    >>> stepped = Stepped(SystemCases(seed=1))
    >>> seen = stepped.begin(0)
    >>> stepped.hold(0.25, 0.0), seen.time, float(seen.robot[0]) > 0.0
    (False, 0.05, True)
    """

    def __init__(self, cases: Cases, scenario: Scenario | None = None) -> None:
        self.cases, self.scenario = cases, scenario or Scenario()
        if isinstance(cases, SystemCases):
            self.scenario.require_room(cases.robot_radius)
        self._period = round(self.scenario.period * 1e9)
        self._end = self._now = 0
        self._memory = np.zeros(0)
        self._rows = np.zeros((0, 6))
        self._staged: Staged | None = None
        self._seen: Observation | None = None

    def begin(self, number: int) -> Observation:
        """Put a case at its beginning and return what is seen there; `hold` fills the same observation again."""
        [one] = staged(self.cases, self.scenario, np.array([number]))
        scene = one.scene
        self._memory = np.zeros(size_of(scene, _NO_TRACK))
        lay(self._memory, number, _PATIENCE, scene, _NO_TRACK)
        (moving.begin_case if scene.plain else begin_any)(self._memory)
        robot, self._rows, ranges = observed(self._memory)
        count, first, step, reach, _, _ = scene.scan
        task = dataclasses.replace(one.task, seed=planner_seed(self.cases.seed, number))
        self._now, self._staged = 0, one
        self._end = round(one.end * 1e9)
        scan = Scan(ranges, first, step, reach) if count else None
        self._seen = Observation(0.0, robot, self._rows, task, scan, one.map, one.path)
        self._look()
        return self._seen

    def _look(self) -> None:
        assert self._staged is not None and self._seen is not None
        stage = self._memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
        plain = self._staged.scene.plain
        self._seen.obstacles = self._rows[: len(self._rows) - MOST_FALSE if plain else int(stage["n_seen"])]
        goals = (self._staged.task, *self._staged.goals)
        at = goals[min(int(stage["next_goal"]), len(goals) - 1)]
        if at.goal != self._seen.task.goal:
            self._seen.task = dataclasses.replace(at, seed=self._seen.task.seed)

    def hold(self, v: float, w: float, aside: float = 0.0) -> bool:
        """Hold speeds [m/s, rad/s, m/s to the left] for a period; return whether the last goal was reached in it."""
        assert self._seen is not None and self._staged is not None, "begin a case first"
        until, status = min(self._now + self._period, self._end), moving.NEXT_GOAL
        while status == moving.NEXT_GOAL:
            if self._staged.scene.plain:
                status = moving.hold(self._memory, until, float(v), float(w))
            else:
                status = move_any(self._memory, until, float(v), float(w), float(aside), NO_POINTS, True)
        self._now = self._end if status == moving.ENDED else until
        self._seen.time = self._now * 1e-9
        self._look()
        return bool(status == moving.ARRIVED)

    @property
    def is_over(self) -> bool:
        """Whether the time limit has come, or the case has ended with a contact."""
        return self._now >= self._end

    def facts(self) -> NDArray[np.void]:
        """Return how the case stands, a record of FACTS, without the measures of its way."""
        facts = np.zeros(1, FACTS)
        moving.freeze(self._memory, facts[0])
        return facts[0]  # type: ignore[no-any-return]

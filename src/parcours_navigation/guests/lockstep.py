"""Moves many cases of the paper's world in lockstep, with a planner that is asked for all of them at once.

    time    0      50 ms    100 ms   ...                      a row of memory for each case
    case 0  ├──────┼────────┼──────── ... ─┤ goal
    case 1  ├──────┼────────┼──────── ... ─┼────────┤         a case that has reached its goal leaves the batch
    case 2  ├──────┼────────┼──────── ... ─┼────────┼─────┤
            ask    ask      ask

Each case is moved by the kernel that moves it alone, so where the answers have the same bits, so have the facts.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from parcours.run.heartbeat import TIME
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.batch import BatchPlugin
from parcours_navigation.guests.concluding import conclude, sum_up_later
from parcours_navigation.guests.planner_facts import FACTS
from parcours_navigation.protocol import Task
from parcours_navigation.requirements.requirement import Monitor
from parcours_navigation.requirements.user_measures import CaseRun
from parcours_navigation.stage.memory import AT_PARTS, AT_STAGE, Staged, lay, lay_again, recorded, size_of
from parcours_navigation.stage.moving import GO_ON, begin_all, hold_all

Floats = NDArray[np.float64]
Steps = Sequence[tuple[float, int]]


def are_alike(staged: Sequence[Staged]) -> bool:
    """Return whether cases can be moved in lockstep: all plain, and different in their obstacles only."""
    first = staged[0]
    return all(one.scene.is_like(first.scene) and one.end == first.end for one in staged)


@functools.lru_cache(maxsize=256)
def steps_between(period: int, first: int, last: int) -> tuple[tuple[float, int], ...]:
    """Return the observations from `first` to before `last` [ns] as (time [s], when the next one is due [ns])."""
    return tuple((now * 1e-9, min(now + period, last)) for now in range(first, last, period))


class Lockstep:
    """Batches of cases, one after the other, in the same memory.

    Args:
        clock: the words that are shared with the parent.
        asked: called after each call of the planner.
    """

    def __init__(self, batch: BatchPlugin, clock: Floats, asked: Callable[[], None]) -> None:
        self._batch, self._clock, self._asked = batch, clock, asked
        self._memory = np.zeros((0, 0))
        self._staged: Sequence[Staged] = ()
        self._tasks: tuple[Task, ...] = ()
        self._left = np.zeros(0, np.int64)
        self._robots, self._obstacles = np.zeros((0, 5)), np.zeros((0, 0, 6))

    def begin(self, staged: Sequence[Staged], most_track: int) -> None:
        """Put cases that are alike at their beginning; every kernel is compiled before the planner's time counts."""
        scene, n = staged[0].scene, len(staged)
        size = size_of(scene, most_track)
        if self._memory.shape[1] != size or len(self._memory) < n:
            self._memory = np.zeros((n, size))
        memory = self._memory[:n]
        lay(memory[0], staged[0].number, 0.0, scene, most_track)
        head = memory[0, AT_STAGE:AT_PARTS].copy()
        for row, one in zip(memory[1:], staged[1:], strict=True):
            lay_again(row, one.number, 0.0, one.scene, head)
        self._staged, self._left = staged, np.arange(n)
        self._robots, self._obstacles = np.empty((n, 5)), np.empty((n, len(scene.obstacles), 6))
        begin_all(memory, self._left, self._robots, self._obstacles)
        nobody = self._left[:0]
        hold_all(memory, nobody, 0, np.zeros((0, 2)), nobody.copy(), self._robots, self._obstacles)
        sum_up_later(memory, nobody, np.zeros(0, FACTS))

    def run(
        self, tasks: Sequence[Task], period: int, end: int, extension: int, monitor: Monitor | None
    ) -> tuple[NDArray[np.void], tuple[CaseRun, ...]]:
        """Run the cases up to their end, and watch the unfinished ones on [ns]; return what `conclude` does, and FACTS.

        Raises BadAnswer, and whatever the planner raises.
        """
        self._tasks = self._batch.begin(tasks)
        self._asked()
        memory, facts = self._memory[: len(tasks)], np.zeros(len(tasks), FACTS)
        facts["number"], facts["t_goal_after"] = [one.number for one in self._staged], NEVER
        facts["feasible"] = True
        self._drive(memory, steps_between(period, 0, end))
        runs = conclude(memory, self._staged, monitor, facts)
        if extension:
            unfinished = self._left
            self._drive(memory, steps_between(period, end, end + extension))
            sum_up_later(memory, unfinished, facts)
        facts["n_track"] = [len(recorded(row)[0]) for row in memory]
        facts["n_planning_cycles"] = -(-facts["t_end"] // period)
        return facts, runs

    def _drive(self, memory: Floats, steps: Steps) -> None:
        """Ask and move until all goals are reached or the steps end."""
        for time, until in steps:
            n = len(self._left)
            if not n:
                return
            # What the planner is given is its own: it may change or keep it.
            robots, obstacles = self._robots[:n].copy(), self._obstacles[:n].copy()
            commands = self._batch.ask(time, robots, obstacles, self._left.copy(), self._tasks)
            self._asked()
            status = np.empty(n, np.int64)
            hold_all(memory, self._left, until, commands, status, self._robots, self._obstacles)
            self._clock[TIME] = float(until)
            goes_on = status == GO_ON
            if not goes_on.all():
                self._left = self._left[goes_on]
                self._robots[: len(self._left)] = self._robots[:n][goes_on]
                self._obstacles[: len(self._left)] = self._obstacles[:n][goes_on]

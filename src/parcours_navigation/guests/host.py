"""Runs cases with a planner that is asked once a period: its answers become motion, and facts.

All that the planner does wrong costs the case it does it in: an exception, an answer that is not one, a call that never
ends. What it is shown are copies; what it does with them changes nothing but its own next observation.
"""

from __future__ import annotations

import contextlib
import os
import sys
import traceback
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from parcours.run import heartbeat as heartbeat
from parcours.streams import start
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.facts import NEVER, TRACK, TRACK_PERIOD
from parcours_navigation.guests import loop
from parcours_navigation.guests.answers import BadAnswer, read_answer
from parcours_navigation.guests.deadline import FIRST_CASE, Deadline, Hung
from parcours_navigation.guests.loop import ARRIVED, GO_ON, NOT_FINITE, follow, hold
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault, lost, reason_bytes, unmeasured
from parcours_navigation.guests.planners import Plugin, end_if_forked, is_ctrl_c
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.measures.kernel import measure
from parcours_navigation.measures.one_case import SAFE_DISTANCE
from parcours_navigation.protocol import Command, Observation, Task

Floats = NDArray[np.float64]
Orders = tuple[float, float, Floats | None]
"""What the robot is told to do: forward speed [m/s], yaw rate [rad/s], and the points to follow instead, if any."""

_PURPOSE = np.uint64(17)
"""Of the random stream from which planners get their seeds."""


def planner_seed(campaign_seed: int, number: int) -> int:
    """Return the seed that a planner is given in a case, in 0 .. 2**63 - 1.

    >>> planner_seed(1, 0) != planner_seed(1, 1) != planner_seed(2, 0)
    True
    """
    stream = np.zeros(1, np.uint64)
    start(stream, np.uint64(campaign_seed), np.uint64(number), _PURPOSE)
    return int(stream[0]) >> 1


def host_words(scenario: Scenario, n_obstacles: int) -> int:
    """Return how many float64 words a case needs."""
    return loop.memory_size(n_obstacles, _most_track(scenario))


def _most_track(scenario: Scenario) -> int:
    return int((1.0 + scenario.time_limit + scenario.watched_on) * 1e9 / TRACK_PERIOD + 1e-6) + 1


class Host:
    """Runs cases of one scenario, which end at `end` [s], with one planner, one after the other."""

    def __init__(self, plugin: Plugin, scenario: Scenario, robot_radius: float, n_obstacles: int, end: float) -> None:
        self._plugin, self._scenario, self._radius, self._n = plugin, scenario, robot_radius, n_obstacles
        self._memory = heartbeat.words(host_words(scenario, n_obstacles))
        self._robot, self._obstacles = loop.observed(self._memory, n_obstacles)
        limits = scenario.limits
        self._setting = np.array(
            [*scenario.start, scenario.start_speed, *scenario.goal, scenario.goal_tolerance, limits.speed,
             limits.yaw_rate, limits.acceleration, limits.yaw_acceleration, robot_radius], float
        )  # fmt: skip
        self._period, self._delay, limit, extension = (
            round(t * 1e9) for t in (scenario.period, scenario.command_delay, end, scenario.watched_on)
        )
        self._steps = _steps(self._period, 0, limit)
        self._steps_after = _steps(self._period, limit, limit + extension)
        self._allowed = FIRST_CASE * scenario.call_timeout
        self._orders: Orders = (scenario.start_speed, 0.0, None)
        self._pending: deque[tuple[int, Orders]] = deque()
        self._answered = False
        self._pid = os.getpid()
        self._radii = np.zeros(n_obstacles)
        self._compile()

    def _compile(self) -> None:
        """Call every kernel once, so that no compilation counts as a planner's time."""
        loop.begin_case(self._memory, 0, 1.0, np.zeros(0), self._setting, 0)
        self._memory[heartbeat.CASE] = heartbeat.NO_CASE
        hold(self._memory, 0, 0.0, 0.0)
        follow(self._memory, 0, np.zeros((1, 4)))
        loop.freeze(self._memory, np.zeros(1, FACTS)[0])
        loop.touched_later(self._memory, np.zeros(1, FACTS)[0])
        loop.moved_since(self._memory, 0)
        loop.goal_time(self._memory)
        self._measure(np.zeros(1, FACTS))

    def run(self, numbers: Sequence[int], cases: Floats, seed: int, facts: NDArray[np.void]) -> None:
        """Run cases and fill their facts, array of FACTS of zeros, shape (n_cases,).

        `cases` holds the OBSTACLE records of each case as float64 words, shape (n_cases, words), `seed` the campaign's.
        """
        most_track = _most_track(self._scenario)
        self._pid = os.getpid()
        with Deadline(self._memory, self._scenario.call_timeout), contextlib.redirect_stdout(sys.stderr):
            try:
                for k, number in enumerate(numbers):
                    loop.begin_case(self._memory, number, self._allowed, cases[k], self._setting, most_track)
                    self._radii = np.ascontiguousarray(cases[k].view(OBSTACLE)["radius"])
                    self._run_case(number, seed, facts[k : k + 1])
                    self._allowed = self._scenario.call_timeout
            finally:
                self._memory[heartbeat.CASE] = heartbeat.NO_CASE

    def track(self) -> tuple[NDArray[np.void], Floats]:
        """Return the track of the last case, array of TRACK of shape (n,), and the obstacles' places, (n, k, 2) [m]."""
        rows = loop.recorded(self._memory, self._n)
        track = np.zeros(len(rows), TRACK)
        for k, name in enumerate(TRACK.names or ()):
            track[name] = rows[:, k]
        return track, rows[:, len(TRACK.names or ()) :].reshape(len(rows), self._n, 2).copy()

    def _measure(self, facts: NDArray[np.void]) -> None:
        """Fill the measures of the way up to now, at the end of a case."""
        track, places = self.track()
        x, y = self._scenario.goal
        measure(
            track, places, self._radii, self._radius, x, y, self._scenario.goal_tolerance, int(facts["t_goal"][0]),
            SAFE_DISTANCE, facts[0]["measures"],
        )  # fmt: skip

    def _run_case(self, number: int, seed: int, facts: NDArray[np.void]) -> None:
        """Run the case that was begun, and fill its facts, shape (1,)."""
        scenario, plugin = self._scenario, self._plugin
        self._orders = (scenario.start_speed, 0.0, None)
        self._pending.clear()
        self._answered = False
        task = Task(
            scenario.goal, scenario.goal_tolerance, self._radius, scenario.limits, scenario.period, scenario.arena,
            planner_seed(seed, number),
        )  # fmt: skip
        view = Observation(0.0, self._robot, self._obstacles, task)
        drive = self._drive_late if self._delay else self._drive
        facts["number"], facts["t_goal_after"] = number, NEVER
        fault, reason, frozen, was_reset = PlannerFault.NONE, "", False, False
        try:
            if plugin.reset is not None:
                plugin.reset(task)
                end_if_forked(self._pid)
            was_reset = True
            arrived = drive(view, self._steps)
            loop.freeze(self._memory, facts[0])
            frozen = True
            self._measure(facts)
            if self._steps_after and not arrived:
                facts["t_goal_after"] = loop.goal_time(self._memory) if drive(view, self._steps_after) else NEVER
                loop.touched_later(self._memory, facts[0])
                later = int(facts["t_end"][0]) + 1_000_000_000
                facts["moved_after"] = facts["t_goal_after"] != NEVER or loop.moved_since(self._memory, later)
        except Hung:
            end_if_forked(self._pid)
            self._memory[heartbeat.CASE] = heartbeat.NO_CASE
            facts[:] = hung(number, int(self._memory[heartbeat.TIME]), scenario.call_timeout)
            return
        except BadAnswer as error:
            end_if_forked(self._pid)
            fault, reason = PlannerFault.BAD_ANSWER, f"bad answer: {error}"
        except BaseException as error:
            end_if_forked(self._pid)
            if is_ctrl_c(error):
                raise
            fault, reason = PlannerFault.RAISED, f"raised: {_words(error, plugin.file)}"
        if not frozen:
            loop.freeze(self._memory, facts[0])
        facts["error"], facts["reason"] = fault, reason_bytes(reason)
        if fault:
            unmeasured(facts)
        facts["n_track"] = len(loop.recorded(self._memory, self._n))
        facts["feasible"] = self._answered
        faulty = 1 if fault and was_reset else 0
        facts["n_planning_cycles"] = -(-facts["t_end"] // self._period) + faulty

    def _drive(self, view: Observation, steps: Sequence[tuple[float, int]]) -> bool:
        """Ask and move until the goal is reached or the steps end; return whether it was reached."""
        observe, memory, robot, obstacles, task = (
            self._plugin.observe, self._memory, self._robot, self._obstacles, view.task
        )  # fmt: skip
        # Every observation of a campaign passes here: locals instead of attributes, the usual answer read in place.
        v, w, points = self._orders
        pid, process_id = self._pid, os.getpid
        for time, until in steps:
            view.time = time
            view.robot = robot
            view.obstacles = obstacles
            view.task = task
            answer = observe(view)
            if process_id() != pid:
                os._exit(0)  # a child that the planner forked: the case is its parent's
            if answer is not None:
                kind = type(answer)
                if (kind is Command or kind is tuple) and len(answer) == 2:  # type: ignore[arg-type]
                    v, w = answer  # type: ignore[misc]
                    points = None
                    if type(v) is not float or type(w) is not float:
                        v, w, points = read_answer(answer)
                else:
                    v, w, points = read_answer(answer)
                self._answered = True
            status = hold(memory, until, v, w) if points is None else follow(memory, until, points)
            if status != GO_ON:
                if status == NOT_FINITE:
                    read_answer(answer)
                return True
        self._orders = (v, w, points)
        return False

    def _drive_late(self, view: Observation, steps: Sequence[tuple[float, int]]) -> bool:
        """Do as `_drive`, but let every answer take effect `command_delay` after its observation."""
        task = view.task
        for time, until in steps:
            view.time, view.robot, view.obstacles, view.task = time, self._robot, self._obstacles, task
            answer = self._plugin.observe(view)
            end_if_forked(self._pid)
            if answer is not None:
                self._pending.append((round(time * 1e9) + self._delay, read_answer(answer)))
                self._answered = True
            while self._pending and self._pending[0][0] < until:
                due, orders = self._pending.popleft()
                if self._move(due):
                    return True
                self._orders = orders
            if self._move(until):
                return True
        return False

    def _move(self, until: int) -> bool:
        v, w, points = self._orders
        memory = self._memory
        return (hold(memory, until, v, w) if points is None else follow(memory, until, points)) == ARRIVED


def hung(number: int, time: int, call_timeout: float) -> NDArray[np.void]:
    """Return the facts of a case in which the planner did not answer, shape (1,)."""
    reason = f"hung: no answer within {call_timeout:g} s to the observation at {time * 1e-9:.2f} s"
    return lost(number, PlannerFault.HUNG, reason, time)


def _steps(period: int, first: int, last: int) -> list[tuple[float, int]]:
    """Return the observations from `first` to before `last` [ns] as (time [s], when the next one is due [ns])."""
    return [(now * 1e-9, min(now + period, last)) for now in range(first, last, period)]


def _words(error: BaseException, file: str) -> str:
    """Return what was raised and where: in the planner's own file if it passed there."""
    try:
        said = str(error)
    except Exception:
        said = ""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if file and frame.filename == file] or frames
    place = f"{own[-1].filename.rpartition('/')[2]}:{own[-1].lineno}"
    head = f"{type(error).__name__}: {said}" if said else type(error).__name__
    room = 150 - len(place)
    return f"{head if len(head) <= room else head[: max(room - 3, 0)] + '...'} ({place})"

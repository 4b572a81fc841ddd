"""Runs cases with a planner that is asked once a period: its answers become motion, and facts.

All that the planner does wrong costs the case it does it in: an exception, an answer that is not one, a call that never
ends. What it is shown are copies; what it does with them changes nothing but its own next observation.
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from parcours.run import canaries as canaries
from parcours.run import heartbeat as heartbeat
from parcours.run.raised import Overdue, is_ctrl_c, place, said
from parcours.streams import start
from parcours_navigation.facts import NEVER, TRACK, TRACK_PERIOD
from parcours_navigation.guests.answers import BadAnswer, read_answer
from parcours_navigation.guests.deadline import FIRST_CASE, Deadline
from parcours_navigation.guests.measuring import take_own
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault, lost, reason_bytes, unmeasured
from parcours_navigation.guests.planners import Plugin, end_if_forked
from parcours_navigation.guests.windows import Window
from parcours_navigation.measures.kernel import measure
from parcours_navigation.measures.one_case import SAFE_DISTANCE
from parcours_navigation.protocol import Command, Limits, Map, Observation, Scan, Task
from parcours_navigation.requirements.own import CaseRun
from parcours_navigation.requirements.requirement import Monitor
from parcours_navigation.sensing.detecting import MOST_FALSE
from parcours_navigation.stage import moving
from parcours_navigation.stage.memory import (
    AT_PARTS,
    AT_STAGE,
    AT_WORLD,
    ROW,
    STAGE,
    Scene,
    Staged,
    lay,
    lay_again,
    observed,
    recorded,
    size_of,
)
from parcours_navigation.stage.moving import GO_ON, NEXT_GOAL, NOT_FINITE, follow, hold
from parcours_navigation.stage.ticking import begin_any, ground_gap, move_any

Floats = NDArray[np.float64]
Orders = tuple[float, float, Floats | None]
"""What the robot is told to do: forward speed [m/s], yaw rate [rad/s], and the points to follow instead, if any."""

_NO_POINTS = np.zeros((0, 4))
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


@dataclass(frozen=True, slots=True)
class Setting:
    """What all cases of a host have in common.

    `period`, `delay` (an answer takes effect so much later), `longest` (no case is longer) and `extension` (an
    unfinished one is watched for so long beyond its end) in ns; `call_timeout` [s of wall clock].
    """

    period: int
    delay: int
    longest: int
    extension: int
    call_timeout: float

    def most_track(self, end: int) -> int:
        """Return how many entries the track of a case may have that ends then [ns]."""
        return int((1_000_000_000 + end + self.extension) / TRACK_PERIOD + 1e-6) + 1

    def end_of(self, staged: Staged) -> int:
        """Return when a case ends [ns]."""
        return min(round(staged.end * 1e9), self.longest)


class Host:
    """Runs cases with one planner, one after the other.

    The clock words lie in memory that is shared with the parent; so does a whole case if there is room, else it has
    memory of its own.

    Args:
        words: that are shared with the parent.
    """

    def __init__(self, plugin: Plugin, setting: Setting, words: int) -> None:
        self._plugin, self._setting = plugin, setting
        self._clock = heartbeat.words(words)
        self._memory = self._clock
        self._windows: list[Window] = []
        self._robot, self._rows, self._ranges = np.zeros(5), np.zeros((0, 6)), np.zeros(0)
        self._allowed = FIRST_CASE * setting.call_timeout
        self._orders: Orders = (0.0, 0.0, None)
        self._aside = 0.0
        self._pending: deque[tuple[int, Orders, float]] = deque()
        self._answered = False
        self._pid = os.getpid()
        self._staged: Staged | None = None
        self._laid: Scene | None = None
        self._head = np.zeros(0)
        self._compiled: set[bool] = set()
        self._to_measure: CaseRun | None = None
        self.monitor: Monitor | None = None  # judges requirements over the cases that are run, if there are any

    @property
    def needs(self) -> tuple[str, ...]:
        """What its planner says that it needs, some of `protocol.SENSES`."""
        return self._plugin.needs

    def run(self, staged: Sequence[Staged], seed: int) -> NDArray[np.void]:
        """Run cases and return their facts, array of FACTS, shape (n_cases,); `seed` is the campaign's."""
        done: list[bytes] = []  # what is finished is nothing that a planner's hands could change in passing
        self._pid = os.getpid()
        deadline = Deadline(self._clock, self._setting.call_timeout)
        with deadline, contextlib.redirect_stdout(sys.stderr):
            try:
                for one in staged:
                    self._begin(one)
                    heartbeat.enter(one.number, self._allowed)
                    done.append(self._run_case_in_time(one, seed, deadline))
                    self._allowed = self._setting.call_timeout
            finally:
                end_if_forked(self._pid)
                heartbeat.leave()
                self._clock[heartbeat.CASE] = heartbeat.NO_CASE
        return np.frombuffer(bytearray(b"".join(done)), FACTS)

    def _begin(self, staged: Staged) -> None:
        """Put a case into memory, at its beginning; every kernel is compiled before the planner's time counts."""
        scene, most_track = staged.scene, self._setting.most_track(self._setting.end_of(staged))
        if scene.is_like(self._laid):
            lay_again(self._memory, staged.number, self._allowed, scene, self._head)
        else:
            size = size_of(scene, most_track)
            if size <= len(self._clock):
                self._memory = self._clock
            elif self._memory is self._clock or len(self._memory) < size:
                self._memory = np.zeros(size)
            lay(self._memory, staged.number, self._allowed, scene, most_track)
            self._head = self._memory[AT_STAGE:AT_PARTS].copy()
            self._windows = [Window(view) for view in observed(self._memory)]
            self._compile(scene)
        self._laid, self._staged = scene, staged
        self._robot, self._rows, self._ranges = (one.array() for one in self._windows)
        (moving.begin_case if scene.plain else begin_any)(self._memory)
        if self._memory is not self._clock:
            self._clock[:3] = self._memory[:3]

    def _compile(self, scene: Scene) -> None:
        """Call every kernel once, so that no compilation counts as a planner's time."""
        if scene.plain in self._compiled:
            return
        self._compiled.add(scene.plain)
        memory, facts = self._memory, np.zeros(1, FACTS)
        kept = memory[: int(memory[AT_STAGE:AT_WORLD].view(STAGE)["at_track"][0])].copy()
        memory[heartbeat.CASE] = heartbeat.NO_CASE
        if scene.plain:
            moving.begin_case(memory)
            hold(memory, 0, 0.0, 0.0)
            follow(memory, 0, np.zeros((1, 4)))
        else:
            begin_any(memory)
            move_any(memory, 0, 0.0, 0.0, 0.0, _NO_POINTS, True)
        moving.freeze(memory, facts[0])
        moving.touched_later(memory, facts[0])
        moving.moved_since(memory, 0)
        moving.goal_time(memory)
        moving.present(memory, np.zeros(ROW + 2 * len(scene.obstacles)))
        track, places = self.track()
        measure(track, places, np.zeros(places.shape[1]), 0.1, 0.0, 0.0, 0.1, NEVER, SAFE_DISTANCE, np.zeros(0),
                facts[0]["measures"])  # fmt: skip
        memory[: len(kept)] = kept

    def _run_case_in_time(self, staged: Staged, seed: int, deadline: Deadline) -> bytes:
        """Run the case that was begun, unless the planner does not answer in time; then see what it has changed.

        Returns its facts, the bytes of one of FACTS.
        """
        facts = np.zeros(1, FACTS)
        try:
            deadline.begin(self._allowed)
            with contextlib.suppress(Overdue):
                self._run_case(staged, seed, facts)
            deadline.end()
        except Overdue:  # again, while the first was on its way
            deadline.end()
        end_if_forked(self._pid)
        if deadline.rang:
            facts[:] = hung(staged.number, int(self._clock[heartbeat.TIME]), self._setting.call_timeout)
        canaries.after_case(failed=bool(facts["error"][0]))
        if self.monitor is not None and self._to_measure is not None and not facts["error"][0]:
            take_own(self.monitor, self._to_measure, deadline, self._allowed)
        return facts.tobytes()

    def track(self) -> tuple[NDArray[np.void], Floats]:
        """Return the track of the last case, array of TRACK of shape (n,), and the bodies' places, (n, k, 2) [m]."""
        rows, n = recorded(self._memory)
        track = np.zeros(len(rows), TRACK)
        for k, name in enumerate(TRACK.names or ()):
            track[name] = rows[:, k]
        return track, rows[:, ROW:].reshape(len(rows), n, 2).copy()

    def ground_gaps(self) -> Floats:
        """Return the gap between robot and ground at each entry of the last case's track [m], shape (n,)."""
        return recorded(self._memory)[0][:, ROW - 1].copy()

    def _measure(self, facts: NDArray[np.void]) -> None:
        """Fill the measures of the way up to now, at the end of a case."""
        assert self._staged is not None
        track, places = self.track()
        scene, task = self._staged.scene, (self._staged.task, *self._staged.goals)[-1]
        x, y = task.goal
        measure(
            track, places, np.ascontiguousarray(scene.obstacles["radius"]), task.robot_radius, x, y,
            task.goal_tolerance, int(facts["t_goal"][0]), SAFE_DISTANCE, self.ground_gaps(), facts[0]["measures"],
        )  # fmt: skip

    def _judge(self, monitor: Monitor, staged: Staged, facts: NDArray[np.void]) -> None:
        """Judge requirements over the way up to now, and keep what the user's own measures read, at a case's end."""
        rows = recorded(self._memory)[0]
        moving.present(self._memory, last := np.zeros(rows.shape[1]))
        if not staged.scene.plain:
            last[ROW - 1] = ground_gap(self._memory)
        radii = np.ascontiguousarray(staged.scene.obstacles["radius"])
        goals, size = tuple(one.goal for one in (staged.task, *staged.goals)), staged.task.robot_radius
        if monitor.program.roots.size:
            monitor.judge(staged.number, rows, last, radii, size, goals[-1])
        if monitor.measures:
            case = staged.number, *self.track(), radii, self.ground_gaps(), size, goals, facts[0].copy()
            self._to_measure = CaseRun(*case)

    def _run_case(self, staged: Staged, seed: int, facts: NDArray[np.void]) -> None:
        """Run the case that was begun, and fill its facts, shape (1,)."""
        number, plugin = staged.number, self._plugin
        self._orders, self._aside = (staged.first_command, 0.0, None), 0.0
        self._pending.clear()
        self._answered = False
        task = _handed_out(staged.task, planner_seed(seed, number))
        view = Observation(0.0, self._robot, self._rows, task)
        is_quick = staged.scene.plain and not self._setting.delay and self._memory is self._clock
        drive = self._drive if is_quick else self._drive_any
        facts["number"], facts["t_goal_after"] = number, NEVER
        fault, reason, frozen, was_reset = PlannerFault.NONE, "", False, False
        self._to_measure = None
        try:
            if plugin.reset is not None:
                plugin.reset(task)
                end_if_forked(self._pid)
            was_reset = True
            end = self._setting.end_of(staged)
            over = drive(view, _steps(self._setting.period, 0, end))
            moving.freeze(self._memory, facts[0])
            frozen = True
            self._measure(facts)
            if self.monitor is not None:
                self._judge(self.monitor, staged, facts)
            if self._setting.extension and not over:
                later = _steps(self._setting.period, end, end + self._setting.extension)
                facts["t_goal_after"] = moving.goal_time(self._memory) if drive(view, later) else NEVER
                moving.touched_later(self._memory, facts[0])
                soon = int(facts["t_end"][0]) + 1_000_000_000
                facts["moved_after"] = facts["t_goal_after"] != NEVER or moving.moved_since(self._memory, soon)
        except Overdue:
            raise
        except BadAnswer as error:
            end_if_forked(self._pid)
            fault, reason = PlannerFault.BAD_ANSWER, f"bad answer: {error}"
        except BaseException as error:
            end_if_forked(self._pid)
            if is_ctrl_c(error):
                raise
            fault, reason = PlannerFault.RAISED, f"raised: {_words(error, plugin.file)}"
        if not frozen:
            moving.freeze(self._memory, facts[0])
        facts["error"], facts["reason"] = fault, reason_bytes(reason)
        if fault:
            unmeasured(facts)
        facts["n_track"] = len(recorded(self._memory)[0])
        facts["feasible"] = self._answered
        faulty = 1 if fault and was_reset else 0
        facts["n_planning_cycles"] = -(-facts["t_end"] // self._setting.period) + faulty

    def _drive(self, view: Observation, steps: Sequence[tuple[float, int]]) -> bool:
        """Ask and move until the goal is reached or the steps end; return whether it was reached."""
        observe, memory, robot, task = self._plugin.observe, self._memory, self._robot, view.task
        obstacles = self._rows[: len(self._rows) - MOST_FALSE]
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
                        v, w, points, _ = read_answer(answer)
                else:
                    v, w, points, _ = read_answer(answer)
                self._answered = True
            status = hold(memory, until, v, w) if points is None else follow(memory, until, points)
            if status != GO_ON:
                if status == NOT_FINITE:
                    read_answer(answer)
                return True
        self._orders = (v, w, points)
        return False

    def _drive_any(self, view: Observation, steps: Sequence[tuple[float, int]]) -> bool:
        """Do as `_drive` in any world; an answer may take effect some time after its observation."""
        assert self._staged is not None
        staged, task = self._staged, view.task
        tasks = (task, *(replace(one, seed=task.seed) for one in staged.goals))
        is_holonomic = task.robot.kind == "holonomic"
        stage = self._memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
        count, first, step, reach, _, _ = staged.scene.scan
        scan = Scan(self._ranges, first, step, reach) if count else None
        shown, path = staged.map, staged.path
        if shown is not None:  # what the planner does with it shall not reach the next case
            shown = Map(shown.cells.copy(), shown.resolution, shown.origin)
        if path is not None:
            path = path.copy()
        for time, until in steps:
            view.time, view.robot, view.task = time, self._robot, tasks[min(int(stage["next_goal"]), len(tasks) - 1)]
            view.obstacles = self._rows[: int(stage["n_seen"])]
            view.scan, view.map, view.path = scan, shown, path
            answer = self._plugin.observe(view)
            end_if_forked(self._pid)
            if answer is not None:
                v, w, points, aside = read_answer(answer, is_holonomic=is_holonomic)
                self._pending.append((round(time * 1e9) + self._setting.delay, (v, w, points), aside))
                self._answered = True
            while self._pending and self._pending[0][0] < until:
                due, orders, aside = self._pending.popleft()
                if self._move(due, looks=False):
                    return True
                self._orders, self._aside = orders, aside
            if self._move(until):
                return True
        return False

    def _move(self, until: int, *, looks: bool = True) -> bool:
        """Move on to `until` [ns], and look around there; return whether the case is over before."""
        v, w, points = self._orders
        memory, status = self._memory, NEXT_GOAL
        while status == NEXT_GOAL:
            if self._laid is not None and self._laid.plain:
                status = hold(memory, until, v, w) if points is None else follow(memory, until, points)
            else:
                status = move_any(memory, until, v, w, self._aside, _NO_POINTS if points is None else points, looks)
            self._clock[heartbeat.TIME] = memory[heartbeat.TIME]
        return status != GO_ON


def _handed_out(task: Task, seed: int) -> Task:
    """Return a task that nobody else has, with a case's seed; `dataclasses.replace` takes three times as long."""
    one = task.limits
    limits = Limits(one.speed, one.yaw_rate, one.acceleration, one.yaw_acceleration)
    return Task(task.goal, task.goal_tolerance, task.robot_radius, limits, task.period, task.arena, seed, task.robot,
                task.goal_heading, task.heading_tolerance)  # fmt: skip


def hung(number: int, time: int, call_timeout: float) -> NDArray[np.void]:
    """Return the facts of a case in which the planner did not answer, shape (1,)."""
    reason = f"hung: no answer within {call_timeout:g} s to the observation at {time * 1e-9:.2f} s"
    return lost(number, PlannerFault.HUNG, reason, time)


@functools.lru_cache(maxsize=256)
def _steps(period: int, first: int, last: int) -> tuple[tuple[float, int], ...]:
    """Return the observations from `first` to before `last` [ns] as (time [s], when the next one is due [ns])."""
    return tuple((now * 1e-9, min(now + period, last)) for now in range(first, last, period))


def _words(error: BaseException, file: str) -> str:
    """Return what was raised and where: in the planner's own file if it passed there."""
    _, where = place(error, file)
    head, room = said(error), 150 - len(where)
    return f"{head if len(head) <= room else head[: max(room - 3, 0)] + '...'} ({where})"

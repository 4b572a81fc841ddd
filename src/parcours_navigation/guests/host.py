"""Runs cases with a planner that is asked once a period: its answers become motion, and facts.

All that the planner does wrong costs the case it does it in: an exception, an answer that is not one, a call that never
ends. What it is shown are copies; what it does with them changes nothing but its own next observation.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from parcours.run import canaries as canaries
from parcours.run import heartbeat as heartbeat
from parcours.run.exception_text import Overdue, is_ctrl_c, reason_bytes, words_of
from parcours_navigation.facts import NEVER, TRACK_PERIOD
from parcours_navigation.guests.answers import BadAnswer, read_answer
from parcours_navigation.guests.concluding import conclude, gaps_of, sum_up_later, track_of
from parcours_navigation.guests.deadline import FIRST_CASE, Deadline
from parcours_navigation.guests.lockstep import Lockstep, are_alike, steps_between
from parcours_navigation.guests.measuring import take_own
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault, lost, unmeasured
from parcours_navigation.guests.planner_tasks import handed_out, planner_seed
from parcours_navigation.guests.planners import Plugin, end_if_forked
from parcours_navigation.guests.windows import Window
from parcours_navigation.protocol import Command, Map, Observation, Scan
from parcours_navigation.requirements.requirement import Monitor
from parcours_navigation.requirements.user_measures import CaseRun
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
from parcours_navigation.stage.ticking import NO_POINTS, begin_any, ground_gap, move_any

Floats = NDArray[np.float64]
Orders = tuple[float, float, Floats | None]
"""What the robot is told to do: forward speed [m/s], yaw rate [rad/s], and the points to follow instead, if any."""

_FIRST = np.zeros(1, np.int64)


@dataclass(frozen=True, slots=True)
class HostSetting:
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


class GuestHost:
    """Runs cases with one planner, one after the other.

    The clock words lie in memory that is shared with the parent; so does a whole case if there is room, else it has
    memory of its own.

    Args:
        words: that are shared with the parent.
    """

    def __init__(self, plugin: Plugin, setting: HostSetting, words: int) -> None:
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
        self._to_measure: tuple[CaseRun, ...] = ()
        batch = None if setting.delay or plugin.needs else plugin.batch
        self._batch_size = 1 if batch is None else batch.size
        self._lockstep = None if batch is None else Lockstep(batch, self._clock, lambda: end_if_forked(self._pid))
        # What the planner has loaded gets one thread: workers are as many as cores already, and how BLAS shares work
        # out among threads may show in the last bits.
        self._libraries = ThreadpoolController()
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
        with deadline, contextlib.redirect_stdout(sys.stderr), self._libraries.limit(limits=1):
            try:
                size = self._batch_size
                for first in range(0, len(staged), size):
                    group = staged[first : first + size]
                    facts = self._run_batch_in_time(group, seed, deadline) if size > 1 < len(group) else None
                    if facts is not None:
                        done.append(facts)
                        continue
                    for one in group:
                        self._begin(one)
                        heartbeat.enter(one.number, self._allowed)
                        done.append(self._run_case_in_time(one, seed, deadline))
                        self._allowed = self._setting.call_timeout
            finally:
                end_if_forked(self._pid)
                heartbeat.leave()
                self._clock[heartbeat.CASE] = heartbeat.NO_CASE
        return np.frombuffer(bytearray(b"".join(done)), FACTS)

    def _run_batch_in_time(self, group: Sequence[Staged], seed: int, deadline: Deadline) -> bytes | None:
        """Return the facts of cases that are run in lockstep; None if anything goes wrong in one of them.

        Nobody knows in which: so they are run one after the other then.
        """
        lockstep, setting = self._lockstep, self._setting
        if lockstep is None or not are_alike(group):
            return None
        found, end = None, setting.end_of(group[0])
        self._begin(group[0])
        lockstep.begin(group, setting.most_track(end))
        tasks = [handed_out(one.task, planner_seed(seed, one.number)) for one in group]
        heartbeat.enter(heartbeat.MANY, self._allowed)
        try:
            deadline.begin(self._allowed)
            with contextlib.suppress(Overdue):
                found = lockstep.run(tasks, setting.period, end, setting.extension, self.monitor)
            deadline.end()
        except Overdue:  # again, while the first was on its way
            deadline.end()
        except BaseException as error:
            deadline.end()
            end_if_forked(self._pid)
            if is_ctrl_c(error):
                raise
        end_if_forked(self._pid)
        canaries.after_case(failed=found is None)
        self._allowed = setting.call_timeout
        if found is None or deadline.rang:
            return None
        facts, runs = found
        for run in runs:
            heartbeat.enter(run.number, self._allowed)
            self._take_own(run, deadline)
        return facts.tobytes()

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
            self._compile(staged)
        self._laid, self._staged = scene, staged
        self._robot, self._rows, self._ranges = (one.array() for one in self._windows)
        (moving.begin_case if scene.plain else begin_any)(self._memory)
        if self._memory is not self._clock:
            self._clock[:3] = self._memory[:3]

    def _compile(self, staged: Staged) -> None:
        """Call every kernel once, so that no compilation counts as a planner's time."""
        scene = staged.scene
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
            ground_gap(memory)
        moving.present(memory, np.zeros(ROW + 2 * len(scene.obstacles)), np.zeros(len(scene.obstacles)))
        moving.freeze(memory, facts[0])  # by itself where a planner fails: it may have left no file to load it from
        conclude(memory[np.newaxis], [staged], None, facts)
        sum_up_later(memory[np.newaxis], _FIRST, facts)
        memory[: len(kept)] = kept

    def _run_case_in_time(self, staged: Staged, seed: int, deadline: Deadline) -> bytes:
        """Run the case that was begun, unless the planner does not answer in time; then see what it has changed.

        Returns its facts, the bytes of one of FACTS.
        """
        facts = np.zeros(1, FACTS)
        try:
            deadline.begin(self._allowed)
            try:
                self._run_case(staged, seed, facts)
            except Overdue:  # the planner's own, unless the deadline rang
                time = int(self._clock[heartbeat.TIME])
                facts[:] = lost(staged.number, PlannerFault.RAISED, "raised: Overdue", time)
            deadline.end()
        except Overdue:  # again, while the first was on its way
            deadline.end()
        end_if_forked(self._pid)
        if deadline.rang:
            facts[:] = hung(staged.number, int(self._clock[heartbeat.TIME]), self._setting.call_timeout)
        canaries.after_case(failed=bool(facts["error"][0]))
        for run in self._to_measure if not facts["error"][0] else ():
            self._take_own(run, deadline)
        return facts.tobytes()

    def _take_own(self, run: CaseRun, deadline: Deadline) -> None:
        assert self.monitor is not None  # who else wants to measure?
        take_own(self.monitor, run, deadline, self._allowed)

    def track(self) -> tuple[NDArray[np.void], Floats]:
        """Return the track of the last case, array of TRACK of shape (n,), and the bodies' places, (n, k, 2) [m]."""
        return track_of(self._memory)

    def ground_gaps(self) -> Floats:
        """Return the gap between robot and ground at each entry of the last case's track [m], shape (n,)."""
        return gaps_of(self._memory)

    def _run_case(self, staged: Staged, seed: int, facts: NDArray[np.void]) -> None:
        """Run the case that was begun, and fill its facts, shape (1,)."""
        number, plugin = staged.number, self._plugin
        self._orders, self._aside = (staged.first_command, 0.0, None), 0.0
        self._pending.clear()
        self._answered = False
        task = handed_out(staged.task, planner_seed(seed, number))
        view = Observation(0.0, self._robot, self._rows, task)
        is_quick = staged.scene.plain and not self._setting.delay and self._memory is self._clock
        drive = self._drive if is_quick else self._drive_any
        facts["number"], facts["t_goal_after"] = number, NEVER
        fault, reason, frozen, was_reset = PlannerFault.NONE, "", False, False
        self._to_measure = ()
        try:
            if plugin.reset is not None:
                plugin.reset(task)
                end_if_forked(self._pid)
            was_reset = True
            end = self._setting.end_of(staged)
            over = drive(view, steps_between(self._setting.period, 0, end))
            frozen = True
            self._to_measure = conclude(self._memory[np.newaxis], [staged], self.monitor, facts)
            if self._setting.extension and not over:
                drive(view, steps_between(self._setting.period, end, end + self._setting.extension))
                sum_up_later(self._memory[np.newaxis], _FIRST, facts)
        except Overdue:
            raise
        except BadAnswer as error:
            end_if_forked(self._pid)
            fault, reason = PlannerFault.BAD_ANSWER, f"bad answer: {error}"
        except BaseException as error:
            end_if_forked(self._pid)
            if is_ctrl_c(error):
                raise
            fault, reason = PlannerFault.RAISED, f"raised: {words_of(error, plugin.file)}"
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
        if shown is not None:  # what the planner does with it must not reach the next case
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
                status = move_any(memory, until, v, w, self._aside, NO_POINTS if points is None else points, looks)
            self._clock[heartbeat.TIME] = memory[heartbeat.TIME]
        return status != GO_ON


def hung(number: int, time: int, call_timeout: float) -> NDArray[np.void]:
    """Return the facts of a case in which the planner did not answer, shape (1,)."""
    reason = f"hung: no answer within {call_timeout:g} s to the observation at {time * 1e-9:.2f} s"
    return lost(number, PlannerFault.HUNG, reason, time)

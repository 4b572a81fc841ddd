"""Control: a trajectory to follow and the robot's state -> commanded speeds, with pause and resume (component 4).

The published controller replays the trajectory's speeds from the moment it is received, corrects only the heading on
straights, and acts on imminent collision at the next trajectory point. The guarded one follows the planned poses at
their planned times with feedback (Kanayama et al., ICRA 1990) and halts at once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parcours.elementary import sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import POSE, SAMPLE, TRAJECTORY, PlannerStep, StateReport, fields, one, reporting
from parcours_ramp.planner.parameters import ORIGINAL, Parameters
from parcours_ramp.planner.trajectory import copy_trajectory, pose_at

COMMAND_PERIOD = 50_000_000  # Time between two commands [ns]
REPORT_PERIOD = 33_333_333  # Time between two reports of the robot's state [ns] (30 Hz)

CONTROL = np.dtype(
    [
        ("has", "i8"),  # 1 once there is a trajectory
        ("trajectory", TRAJECTORY),
        ("begins", "i8"),  # when its first sample is due [ns], pauses included
        ("halt", "i8"),  # 1 while imminent collision is signalled
        ("t_halt", "i8"),  # when the signal came [ns]
        ("paused", "i8"),  # 1 while the robot is held
        ("limit", "f8"),  # how fast it may drive now [m/s]
        ("lag", "i8"),  # by how much limits have delayed it so far [ns]
        ("reference", POSE),  # where it is to be by the plan; when replaying, one sample after `replayed`
        ("replayed", "i8"),  # the sample that was last replayed of this trajectory; -1 for none
        *fields("f8", "here there"),  # the headings planned at that sample, and at the one after it [rad]
        ("command_v", "f8"),  # [m/s]
        ("command_w", "f8"),  # [rad/s]
    ]
)  # State of the controller

_ALONG, _ACROSS, _TURN = 2.0, 64.0, 16.0  # Feedback gains: [1/s], [1/m2], [1/m]
_ASKEW = 0.3  # The plan waits for a robot whose heading is farther off than this [rad]

_STRAIGHT = 1e-4
_HEADING_GAIN = 0.5


@kernel
def follow(control: Record, trajectory: Record, now: int, parameters: Record) -> None:
    """Take over a new TRAJECTORY at `now` [ns]."""
    copy_trajectory(control.trajectory, trajectory, 0)
    control.has = 1
    control.replayed = -1
    control.begins = now if parameters.schedule == ORIGINAL else trajectory.begins + control.lag - trajectory.lag


@kernel
def signal(control: Record, imminent: bool, now: int, parameters: Record) -> None:
    """Take note of the imminent-collision flag."""
    if imminent and not control.halt:
        control.t_halt = now
    control.halt = 1 if imminent else 0
    if imminent and parameters.halts_at_once:
        control.paused = 1
        control.command_v = control.command_w = 0.0


@kernel
def _replay(control: Record, pose: Record, now: int) -> None:
    """Set the command to the trajectory's own speeds (published controller)."""
    trajectory = control.trajectory
    i = int((now - control.begins) * 1e-9 / SAMPLE + 1e-6)
    if i + 1 >= trajectory.n:
        control.command_v = control.command_w = 0.0
        return
    reference = control.reference
    if i != control.replayed:
        if i == control.replayed + 1 and i > 0:
            control.here = control.there
        else:
            pose_at(trajectory, i * SAMPLE, reference)
            control.here = reference.heading
        pose_at(trajectory, (i + 1) * SAMPLE, reference)
        control.there = reference.heading
        control.replayed = i
    control.command_v = reference.v
    control.command_w = wrap(control.there - control.here) / SAMPLE
    if abs(control.command_w) < _STRAIGHT:
        control.command_w = _HEADING_GAIN * wrap(control.here - pose.heading)


@kernel
def _track(control: Record, pose: Record, now: int) -> None:
    """Set the command so that the robot converges to the planned pose at the planned time.

    Where its speed is limited, time goes on more slowly by the same share; where it looks elsewhere, time waits. It
    never drives backward.
    """
    reference = control.reference
    elapsed = (now - control.begins) * 1e-9
    pose_at(control.trajectory, elapsed, reference)
    turn = wrap(reference.heading - pose.heading)
    share = control.limit / reference.v if reference.v > control.limit else 1.0
    if abs(turn) > _ASKEW:
        share = 0.0
    late = int((1.0 - share) * COMMAND_PERIOD)
    control.begins += late
    control.lag += late
    s, c = sin_cos(pose.heading)
    dx, dy = reference.x - pose.x, reference.y - pose.y
    ahead, aside = c * dx + s * dy, c * dy - s * dx
    turn_s, turn_c = sin_cos(turn)
    pose_at(control.trajectory, elapsed + share * 0.5e-9 * COMMAND_PERIOD, reference)
    reference.v, reference.w = share * reference.v, share * reference.w
    control.command_v = max(min(reference.v * turn_c + _ALONG * ahead, control.limit), 0.0)
    control.command_w = reference.w + reference.v * (_ACROSS * aside + _TURN * turn_s)
    if reference.v < 0.01:
        control.command_w = reference.w + 3.0 * turn
    if elapsed >= control.trajectory.duration and abs(ahead) < 0.005:
        control.command_v = 0.0


@kernel
def command(control: Record, pose: Record, now: int, parameters: Record) -> None:
    """Set command_v and command_w for the next command period, given the robot's POSE."""
    if not control.has:
        control.command_v = control.command_w = 0.0
        return
    if control.halt and not control.paused:
        due = int((control.t_halt - control.begins) * 1e-9 / SAMPLE) + 1
        if parameters.halts_at_once or (now - control.begins) * 1e-9 / SAMPLE >= due - 1e-9:
            control.paused = 1
    elif not control.halt:
        control.paused = 0
    if control.paused:
        control.begins += COMMAND_PERIOD
        control.command_v = control.command_w = 0.0
    elif parameters.schedule == ORIGINAL:
        _replay(control, pose, now)
    else:
        _track(control, pose, now)


class Control:
    """The component: follows the best trajectory, pauses for imminent collision, and reports the robot's state.

    It reads the robot's pose from `odometry` messages of the world and sends it `cmd_vel`. Of the trajectories that
    come before `opens` [ns] it takes the last one, then.
    """

    name = "Control"

    def __init__(self, parameters: Parameters, opens: int = 0) -> None:
        self._parameters, self._opens = parameters.record(), opens
        self.reset()

    def reset(self) -> None:
        """Forget trajectory, flag and clock."""
        self._state = one(CONTROL)
        self._state.limit = np.inf
        self._pose = one(POSE)
        self._next_command = 0
        self._next_report = REPORT_PERIOD
        self._executing = False
        self._early: object = None
        self.reported: StateReport | None = None
        """What it told the planner last."""

    def next_wake(self) -> int | None:
        """The next command or report is due, or a trajectory that came too early."""
        due = min(self._next_command, self._next_report)
        return due if self._early is None else min(due, self._opens)

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
        """Take a trajectory from `best_trajectory`, the flag from `imminent_collision`, the pose from `pose`."""
        if channel == "best_trajectory":
            if now < self._opens:
                self._early = message
                return
            if self._executing:
                yield reporting("p46", execute_all=True)  # superseded is done with, too
            follow(self._state, message, now, self._parameters)
            self._executing = True
            yield reporting("p42", operation="compute", tcp_socket=True)
        elif channel == "imminent_collision":
            signal(self._state, bool(message), now, self._parameters)
            if self._state.paused:
                yield PlannerStep("", (("cmd_vel", (0.0, 0.0)),))
        elif channel == "pose" and isinstance(message, StateReport):
            self._pose = message.pose
        elif channel == "speed_limit" and isinstance(message, float):
            self._state.limit = message
            yield PlannerStep("")
        else:
            yield reporting("p41", tcp_socket=False)

    def wake(self, now: int) -> Iterator[PlannerStep]:
        """Report the state and command the robot, whichever is due."""
        if self._early is not None and self._opens <= now:
            early, self._early = self._early, None
            yield from self.handle("best_trajectory", early, now)
            return
        yield from self.tick(now)
        if self._next_command <= now:
            yield from self.execute(now)

    def tick(self, now: int) -> Iterator[PlannerStep]:
        """Report the robot's state if the interval is over at `now` [ns]."""
        if self._next_report > now:
            yield reporting("p47", interval_done=False)
            return
        self._next_report += REPORT_PERIOD
        self.reported = update = StateReport(now, self._pose.copy(), int(self._state.lag))
        yield reporting("p48", ("update", update), interval_done=True)
        yield reporting("p49", operation="reset_timer")

    def execute(self, now: int) -> Iterator[PlannerStep]:
        """Command the robot for the next command period from `now` [ns]."""
        self._next_command += COMMAND_PERIOD
        state = self._state
        was_paused = state.paused
        command(state, self._pose, now, self._parameters)
        yield PlannerStep("", (("cmd_vel", (float(state.command_v), float(state.command_w))),))
        if state.paused and self._executing:
            self._executing = False
            yield reporting("p43", operation="pause", imminent_collision=bool(state.halt))
        elif was_paused and not state.paused and not self._executing:
            self._executing = True
            yield reporting("p44", operation="move", imminent_collision=bool(state.halt))
            yield reporting("p45", execute_all=False)
        elif self._executing and (now - state.begins) * 1e-9 >= state.trajectory.duration:
            self._executing = False
            yield reporting("p46", execute_all=True)
        elif not self._executing:
            yield reporting("p41", tcp_socket=False)

    @property
    def next_command(self) -> int:
        """When the next command is due [ns]."""
        return self._next_command

    @property
    def trajectory(self) -> Record:
        """The TRAJECTORY it follows."""
        return self._state.trajectory

"""What the compiled run of a system case is given and works in, messages to control on their way, and what is noted."""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.arena.observing import freeze_world
from parcours_navigation.arena.world import WORLD
from parcours_ramp.planner.control import COMMAND_PERIOD, CONTROL
from parcours_ramp.planner.messages import PATH, POSE, fields
from parcours_ramp.planner.planner_state import PLANNER

SENSING_PERIOD = 50_000_000  # Time between two obstacle messages [ns] (20 Hz)
ROOM = 128  # Messages that can be on their way at once: those of 6 s at 20 Hz
FAR = 1 << 62  # The time of what will not happen [ns]

MAILBOX = np.dtype(
    [
        ("n", "i8"),  # messages on their way
        ("first", "i8"),  # where the oldest is
        ("next", "i8"),  # when it is due [ns]; FAR if there is none
        ("due", "i8", (ROOM,)),
        ("value", "f8", (ROOM,)),
    ]
)  # A channel that keeps the order of its messages

SETTING = np.dtype(
    [
        ("seed", "u8"),
        *fields(
            "i8", "limit extension"
        ),  # end of the test; how long it is observed afterwards, for the true remaining time [ns]
        *fields("f8", "robot_x robot_y robot_heading robot_speed"),  # start [m], [rad], [m/s]
        ("told_speed", "f8"),  # the speed at the start that RAMP is told [m/s]
        ("starts_late", "i8"),  # 1 if control takes no trajectory before `late_start`
        *fields("f8", "goal_x goal_y goal_tolerance"),  # [m]
        ("solid", "i8"),  # 1 if an obstacle stops for good where it touches the robot
    ]
)  # What all cases of a campaign share

WORKSPACE = np.dtype(
    [
        ("world", WORLD),
        ("planner", PLANNER),
        ("control", CONTROL),
        *(
            (name, POSE) for name in ("start", "report", "measured")
        ),  # last report to the planner; what control measures
        ("report_lag", "i8"),  # the lag reported with it [ns]
        ("one", PATH),
        ("two", PATH),
        *fields("u8", "modifier clock", 1),
        *fields("i8", "obstacle_time obstacle_stamp"),  # when the pending message came (FAR: none) and was sensed [ns]
        *fields("i8", "report_time t_report"),  # when the pending report came (FAR: none), and the last was made [ns]
        ("guard_time", "i8"),
        *fields("i8", "spin wakes"),  # when the planner's thread woke for its callbacks, and is free again [ns]
        *fields("i8", "in_callbacks best_due"),  # when the best trajectory reaches control [ns]
        ("opens", "i8"),  # when the first trajectory may [ns]
        ("halts", MAILBOX),  # imminent-collision flags on their way to it
        ("limits", MAILBOX),  # speed limits [m/s]
        ("limit", "f8"),  # the one sent last [m/s]
        *fields("i8", "halted_before executing"),  # the flag at the last command; 1 while control follows a trajectory
        *fields("i8", "t_moving t_halted"),  # when the robot last moved, and when the guard last halted it [ns]
    ]
)  # Working memory of one run


@kernel
def clear(box: Record) -> None:
    """Forget all messages."""
    box.n = box.first = 0
    box.next = FAR


@kernel
def post(box: Record, due: int, value: float) -> None:
    """Send a value that arrives at `due` [ns], or with the one before if that comes later.

    A full box replaces its newest message.
    """
    if box.n == ROOM:
        box.n -= 1
    if box.n > 0:
        due = max(due, box.due[(box.first + box.n - 1) % ROOM])
    box.due[(box.first + box.n) % ROOM] = due
    box.value[(box.first + box.n) % ROOM] = value
    box.n += 1
    box.next = box.due[box.first]


@kernel
def take(box: Record) -> float:
    """Return the oldest message and take it out."""
    value = box.value[box.first]
    box.first = (box.first + 1) % ROOM
    box.n -= 1
    box.next = box.due[box.first] if box.n > 0 else FAR
    return float(value)


@kernel
def watch(work: Record, now: int, facts: Record) -> None:
    """Keep what the robot and its controller do between two commands."""
    control, robot = work.control, work.world.robot
    if control.halt and not work.halted_before:
        facts.n_halts += 1
    work.halted_before = control.halt
    if control.halt:
        facts.halted_time += COMMAND_PERIOD
    if robot.v * robot.v > 1e-4:
        work.t_moving = now


@kernel
def freeze(work: Record, obstacles: Record, facts: Record) -> None:
    """Write down how a case of RAMP stands at its end."""
    planner = work.planner
    freeze_world(work.world, obstacles, facts)
    facts.feasible = planner.moving_on.feasible
    facts.time_left = planner.moving_on.duration
    facts.halted = work.control.halt
    facts.n_switches = planner.n_switches
    facts.t_last_moving = work.t_moving

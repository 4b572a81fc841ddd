"""What the compiled run of a system case is given and works in: arrays with a documented layout."""

from __future__ import annotations

import numpy as np

from parcours_navigation.arena.world import WORLD
from parcours_ramp.planner.control import CONTROL
from parcours_ramp.planner.messages import PATH, POSE, fields
from parcours_ramp.planner.planner_state import PLANNER
from parcours_ramp.system.mailbox import MAILBOX

SETTING = np.dtype(
    [
        ("seed", "u8"),
        *fields(
            "i8", "limit extension"
        ),  # end of the test; how long it is watched on, for the true remaining time [ns]
        *fields("f8", "robot_x robot_y robot_heading robot_speed"),  # start [m], [rad], [m/s]
        *fields("f8", "goal_x goal_y goal_tolerance"),  # [m]
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
        ("halts", MAILBOX),  # imminent-collision flags on their way to it
        ("limits", MAILBOX),  # speed limits [m/s]
        ("limit", "f8"),  # the one sent last [m/s]
        *fields("i8", "halted_before executing"),  # the flag at the last command; 1 while control follows a trajectory
        *fields("i8", "t_moving t_halted"),  # when the robot last moved, and when the guard last halted it [ns]
    ]
)  # Working memory of one run

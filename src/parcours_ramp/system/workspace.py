"""What the compiled run of a system case is given and works in: arrays with a documented layout."""

from __future__ import annotations

import numpy as np

from parcours_navigation.arena.world import WORLD
from parcours_ramp.planner.control import CONTROL
from parcours_ramp.planner.messages import PATH, POSE
from parcours_ramp.planner.planner_state import PLANNER
from parcours_ramp.system.mailbox import MAILBOX

SETTING = np.dtype(
    [
        ("seed", "u8"),
        ("limit", "i8"),  # end of the test [ns]
        ("extension", "i8"),  # how long it is watched beyond that, for the true remaining time [ns]
        ("robot_x", "f8"),  # start of the robot [m]
        ("robot_y", "f8"),
        ("robot_heading", "f8"),  # [rad]
        ("robot_speed", "f8"),  # [m/s]
        ("goal_x", "f8"),  # [m]
        ("goal_y", "f8"),
        ("goal_tolerance", "f8"),  # [m]
    ]
)  # What all cases of a campaign share

WORKSPACE = np.dtype(
    [
        ("world", WORLD),
        ("planner", PLANNER),
        ("control", CONTROL),
        ("start", POSE),
        ("report", POSE),  # the last report to the planner
        ("report_lag", "i8"),  # the lag reported with it [ns]
        ("measured", POSE),  # what control measures
        ("one", PATH),
        ("two", PATH),
        ("modifier", "u8", (1,)),
        ("clock", "u8", (1,)),
        ("obstacle_time", "i8"),  # when the pending obstacle message came [ns]; FAR if none is pending
        ("obstacle_stamp", "i8"),  # when it was sensed [ns]
        ("report_time", "i8"),  # when the pending report came [ns]; FAR
        ("t_report", "i8"),  # when the last report was made [ns]
        ("guard_time", "i8"),
        ("spin", "i8"),  # when the planner's thread woke for its callbacks [ns]
        ("wakes", "i8"),  # when the thread is free again [ns]
        ("in_callbacks", "i8"),
        ("best_due", "i8"),  # when the best trajectory reaches control [ns]
        ("halts", MAILBOX),  # imminent-collision flags on their way to it
        ("limits", MAILBOX),  # speed limits [m/s]
        ("limit", "f8"),  # the one sent last [m/s]
        ("halted_before", "i8"),  # the flag at the last command
        ("executing", "i8"),  # 1 while control follows a trajectory
        ("t_moving", "i8"),  # last time the robot moved [ns]
        ("t_halted", "i8"),  # when the guard last halted the robot [ns]
    ]
)  # Working memory of one run

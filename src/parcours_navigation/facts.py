"""The facts of one navigation case that a judge needs, as the world or the host of the planner has measured them.

One record per case. Times are nanoseconds from the start of the case; NEVER stands for what did not happen.
"""

from __future__ import annotations

import numpy as np

NEVER = -1
"""The time of what did not happen."""

FACTS = np.dtype(
    [
        ("number", "i8"),  # case number
        ("t_end", "i8"),  # when the case ended: goal reached, or time limit [ns]
        ("x", "f8"),  # the robot then [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("to_goal", "f8"),  # distance to the goal then [m]
        ("t_goal", "i8"),  # goal first reached [ns]
        # clearance a robot on the goal would have when all obstacles rest [m]; -inf: no robot could get there in time
        ("goal_gap", "f8"),
        ("feasible", "i8"),  # 1 if the planner called its last published trajectory feasible
        ("time_left", "f8"),  # time stamp of that trajectory's last sample [s]
        ("halted", "i8"),  # 1 if the planner signalled imminent collision at the end
        ("n_halts", "i8"),  # times the signal came on
        ("halted_time", "i8"),  # how long it was on [ns]
        ("t_last_moving", "i8"),  # last time the robot moved before the end [ns]
        ("t_goal_after", "i8"),  # goal reached after the end of the test [ns]
        ("moved_after", "i8"),  # 1 if the robot moved again then
        ("t_contact", "i8"),  # first contact [ns]
        ("t_robot_contact", "i8"),  # first contact that the robot alone caused [ns], also after the end
        ("t_shared_contact", "i8"),  # ... that both caused [ns]
        ("n_robot_contacts", "i8"),
        ("n_shared_contacts", "i8"),
        ("n_contacts_after", "i8"),  # contacts after the end that the robot caused, alone or not
        ("n_obstacle_contacts", "i8"),  # contacts that the obstacle alone caused, or with the robot at rest
        ("min_clearance", "f8"),  # least gap to any obstacle before the end [m]; negative is overlap
        ("t_min_clearance", "i8"),  # [ns]
        ("travelled", "f8"),  # length of the robot's way [m]
        ("n_switches", "i8"),  # times the planner changed what it follows
        ("n_planning_cycles", "i8"),
        ("n_control_cycles", "i8"),
        ("n_late_cycles", "i8"),  # planning cycles that took longer than their period
        ("error", "i8"),  # 0, or why the planner's own fault ended the case: a code of the study
    ]
)
"""The layout of one case's facts; a study may append fields of its own."""

TRACK = np.dtype(
    [
        ("time", "i8"),  # [ns]
        ("x", "f8"),  # robot [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("v", "f8"),  # [m/s]
        ("w", "f8"),  # [rad/s]
        ("halted", "i8"),  # 1 while the planner signals imminent collision
    ]
)
"""One entry every TRACK_PERIOD of where the robot was. Where the obstacles were stands beside it as an array of
shape (n, n_obstacles, 2) [m]."""

TRACK_PERIOD = 50_000_000
"""Time between two entries of a track [ns]."""

UNITS = {
    **{name: "ns" for name in FACTS.names or () if name.startswith("t_") or name == "halted_time"},
    **dict.fromkeys(("x", "y", "to_goal", "goal_gap", "min_clearance", "travelled"), "m"),
    "heading": "rad", "time_left": "s",
}  # fmt: skip
"""The units of facts that have one, by name."""

"""What one run of a system case leaves behind: plain facts, on which the verdicts are rules."""

from __future__ import annotations

import numpy as np

TRANSITIONS = (
    *(f"p1{k}" for k in range(1, 10)),
    *(f"p2{k}" for k in range(1, 6)),
    *(f"p3{k}" for k in range(1, 6)),
    *(f"p4{k}" for k in range(1, 10)),
    *(f"p5{k}" for k in range(1, 6)),
    *(f"p6{k}" for k in range(1, 5)),
)
"""The transitions of the component model (Table II), in the order of FACTS.transitions."""

FACTS = np.dtype(
    [
        ("number", "i8"),  # case number
        ("t_end", "i8"),  # when the case ended: goal reached or limit [ns]
        ("x", "f8"),  # the robot then [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("to_goal", "f8"),  # distance to the goal then [m]
        ("t_goal", "i8"),  # goal first reached [ns]; -1 never
        ("feasible", "i8"),  # 1 if the last published trajectory was feasible when it was published
        ("time_left", "f8"),  # time stamp of that trajectory's last sample [s]
        ("halted", "i8"),  # 1 if imminent collision was on at the end
        ("n_halts", "i8"),  # times it came on
        ("halted_now", "i8"),
        ("halted_time", "i8"),  # how long it was on [ns]
        ("t_last_moving", "i8"),  # last time the robot moved, extension included [ns]
        ("t_still_since", "i8"),  # last time it moved before the end [ns]
        ("t_goal_after", "i8"),  # goal reached in the extension [ns]; -1 never
        ("moved_after", "i8"),  # 1 if the robot moved in the extension, more than 1 s after the end
        ("t_contact", "i8"),  # first contact [ns]; -1 never
        ("t_robot_contact", "i8"),  # first contact whose gap the robot closed alone [ns]
        ("t_shared_contact", "i8"),  # ... both closed [ns]
        ("n_robot_contacts", "i8"),
        ("n_shared_contacts", "i8"),
        ("n_obstacle_contacts", "i8"),
        ("min_clearance", "f8"),  # [m]
        ("t_min_clearance", "i8"),  # [ns]
        ("travelled", "f8"),  # [m]
        ("n_switches", "i8"),  # control cycles that changed the member followed
        ("n_planning_cycles", "i8"),
        ("n_control_cycles", "i8"),
        ("n_late_cycles", "i8"),  # planning cycles longer than their period
        ("n_track", "i8"),  # entries of the track
        ("transitions", "i8", (len(TRANSITIONS),)),  # how often each transition of the model was taken
    ]
)
"""Facts of one case."""

TRACK = np.dtype(
    [
        ("time", "i8"),  # [ns]
        ("x", "f8"),  # robot [m]
        ("y", "f8"),
        ("heading", "f8"),  # [rad]
        ("v", "f8"),  # [m/s]
        ("halted", "i8"),
        ("obstacle_x", "f8", (3,)),  # [m]
        ("obstacle_y", "f8", (3,)),
    ]
)
"""One entry a command period, for replays."""

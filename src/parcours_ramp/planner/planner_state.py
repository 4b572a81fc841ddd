"""What the planner remembers between its cycles, and how it begins a run."""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import Record, kernel
from parcours.streams import below
from parcours_ramp.planner.messages import (
    EPOCH,
    MAX_POPULATION,
    MEMBER,
    MODIFICATION,
    NO_COLLISION,
    PATH,
    POSE,
    TRAJECTORY,
    fields,
)
from parcours_ramp.planner.path_modification import far_point
from parcours_ramp.planner.route import HYBRID, ROUTE
from parcours_ramp.planner.trajectory_generator import generate

PLANNER = np.dtype(
    [
        *fields("f8", "goal_x goal_y"),  # [m]
        *fields("i8", "n next_id"),  # members of the population
        ("members", MEMBER, (MAX_POPULATION,)),
        ("moving_on", TRAJECTORY),  # what the robot is to do since the last control cycle
        ("moving_on_hit", "i8"),  # 1 if its guarded part met an obstacle when it was last evaluated
        ("moving_on_t", "f8"),  # when it would [s]
        ("moving_on_looked", "i8"),  # when the robot was taken to set out, in the last look at all obstacles [ns]
        *fields("i8", "t_control t_next"),  # last and next control cycle [ns]
        ("anchor", POSE),  # the state expected after the longest period, where paths begin
        ("switch", POSE),  # the state expected at the next control cycle, where trajectories begin
        ("switch_kind", "i8"),  # HYBRID if the switch is the anchor, else TRANSITION
        ("latest", POSE),  # the robot's state as last reported
        *fields(
            "i8", "t_latest lag"
        ),  # when that was, and how far it was behind its plan for limited speed, in all [ns]
        *fields("f8", "drift_x drift_y"),  # measured minus planned position since the last control cycle [m]
        ("dragged", "i8"),  # 1 if the last commitment was moved onto the robot noticeably
        *fields(
            "i8", "halted rested"
        ),  # 1 during imminent collision; 1 if the population then begins at rest at the robot
        ("knows_obstacles", "i8"),
        ("epoch", EPOCH),  # of the planner's predictions
        *fields("f8", "near_direction near_distance"),  # to the nearest obstacle [rad], [m] between centres
        *fields("i8", "n_switches followed"),  # control cycles that chose another member; the id of the member followed
        ("stream", "u8", (1,)),
        # Working memory:
        ("next_epoch", EPOCH),
        ("candidate", MEMBER),
        ("work_path", PATH),
        ("request", MODIFICATION),
        ("route", ROUTE),
    ]
)  # State of the planner


@kernel
def begin_population(planner: Record, pose: Record, parameters: Record) -> None:
    """Fill the population with random paths from `pose` to the goal, the first of them straight ahead.

    Interior knots number 1 to 4, drawn in the arena at least `knot_distance` from the others; the seeded member leads
    one metre along the robot's heading and then to the goal (published).
    """
    planner.n = parameters.population
    planner.next_id = 1
    planner.halted = planner.rested = planner.knows_obstacles = planner.n_switches = 0
    planner.drift_x = planner.drift_y = 0.0
    planner.dragged = 0
    planner.epoch.number = planner.epoch.stamp = 0
    planner.epoch.changed = planner.epoch.strayed = planner.epoch.ahead = planner.epoch.fastest = 0.0
    planner.near_direction, planner.near_distance = 0.0, NO_COLLISION
    planner.latest = pose
    planner.anchor = pose
    planner.switch = pose
    planner.switch_kind = HYBRID
    planner.t_control = planner.t_next = planner.t_latest = planner.lag = 0
    planner.moving_on.n = 0
    planner.moving_on_hit, planner.moving_on_t = 0, NO_COLLISION
    for i in range(planner.n):
        member = planner.members[i]
        path = member.path
        path.n = 2
        path.x[0], path.y[0] = pose.x, pose.y
        path.x[1], path.y[1] = planner.goal_x, planner.goal_y
        if i == 0:
            s, c = sin_cos(pose.heading)
            path.n = 3
            path.x[2], path.y[2] = path.x[1], path.y[1]
            path.x[1], path.y[1] = pose.x + c, pose.y + s
        else:
            for _ in range(1 + below(planner.stream, 4)):
                x, y = far_point(path, -1, parameters.knot_distance, parameters.arena, planner.stream)
                path.x[path.n], path.y[path.n] = path.x[path.n - 1], path.y[path.n - 1]
                path.x[path.n - 1], path.y[path.n - 1] = x, y
                path.n += 1
        member.id = planner.next_id
        planner.next_id += 1
        generate(path, pose, planner.switch_kind, parameters, planner.route, member.trajectory)
        member.trajectory.begins = 0
        member.trajectory.id = member.id

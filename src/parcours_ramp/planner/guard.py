"""Imminent collision: the motion under way and the predicted obstacles -> halt, go on, or stay halted.

`original` looks at the first control period of what the robot was to do, counted from its start although the obstacles
are counted from now, and at nothing beyond it: its look-ahead shrinks to zero before each control cycle. `guarded`
looks a constant time ahead on the motion that is really left, with robot and obstacles at the same instants. Besides,
it lets the robot approach a standing obstacle only so fast that it rests before a contact if the obstacle sets out
towards it (speed and separation monitoring, as in ISO/TS 15066).
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import Record, kernel
from parcours_ramp.planner.collision import collision_time, earliest_collision
from parcours_ramp.planner.messages import NO_COLLISION, SAMPLE
from parcours_ramp.planner.parameters import GUARDED
from parcours_ramp.planner.prediction import STANDS
from parcours_ramp.planner.trajectory_evaluation import known_up_to, remember

# What the imminent-collision check looks at (===), at the instant `now` between two control cycles:
#
#               t_control             now                  t_next            end of moving_on
#   plan        |---------------------+--------------------|-----------------|
#   original    |==========================================|                    robot as if it set out at `now` from the
#               times of the robot count from t_control, those of the            start of the plan: misaligned, and
#               obstacles from `now`                                             nothing beyond t_next is seen
#   guarded                           |====================|== _AHEAD ==|       guard_horizon from now on, robot and
#                                     obstacles at the same instants            obstacles at the same instants; beyond
#                                                                               it only slack is gathered
GUARD_PERIOD = 50_000_000  # Time between two imminent-collision checks of the published planner [ns] (20 Hz)
CREEP = 0.02  # Beside a standing obstacle the robot is never made slower than this [m/s], or it would never pass
_SAFE_CLEARANCE = 0.4  # Farther obstacles do not matter [m]
_TURNS_TOWARDS = 0.15  # Sine of the angle by which the robot may turn towards an obstacle between two looks
_VEERS = 0.04  # How far an obstacle that sets out may leave its heading until the robot rests [m]
_UNTIL_OBEYED = 0.1  # A limit counts for the robot's place so much later [s]: until the next look and the next command
_AHEAD = 20  # How many samples beyond its window the guarded schedule looks while it is at it


@kernel
def window(planner: Record, now: int, parameters: Record) -> tuple[int, int, int, float, bool]:
    """Return what is looked at of the motion under way: (when it begins [ns], first sample, one past the last, margin
    [m], whether the robot may leave an obstacle it is too near to)."""
    moving_on = planner.moving_on
    if not parameters.looks_ahead:
        last = min(int(parameters.control_period / SAMPLE + 0.5) + 1, moving_on.n)
        return now, 0, last, 0.0, bool(parameters.may_leave)
    first = max(int((now - moving_on.begins) * 1e-9 / SAMPLE), 0)
    last = first + int(parameters.guard_horizon / SAMPLE + 0.5) + 1
    return moving_on.begins, first, last, parameters.guard_margin, bool(parameters.may_leave)


@kernel
def is_known_to_pass(planner: Record, now: int, epoch: Record, parameters: Record) -> bool:
    """Return whether the last look tells that the motion under way meets nobody.

    The published schedule has the robot set out at each look, so that obstacles are farther along at every sample.
    """
    begins, first, last, _, _ = window(planner, now, parameters)
    late = epoch.fastest * (begins - planner.moving_on_looked) * 1e-9
    begins += first * 100_000_000
    up_to = known_up_to(planner.moving_on, begins, epoch, planner.drift_x, planner.drift_y, late)
    return bool(last <= min(up_to, planner.moving_on.met_at))


@kernel
def evaluate_moving_on(planner: Record, predictions: Record, now: int, epoch: Record, parameters: Record) -> None:
    """Set moving_on_hit and moving_on_t: whether and when the motion under way meets a predicted obstacle.

    The guarded schedule looks farther ahead than it needs to, and remembers the slack that it found.

    Args:
        now: [ns].
        epoch: EPOCH of these predictions.
    """
    if planner.moving_on.n == 0 or len(predictions) == 0 or is_known_to_pass(planner, now, epoch, parameters):
        note_moving_on(planner, NO_COLLISION)
        return
    moving_on, drift_x, drift_y = planner.moving_on, planner.drift_x, planner.drift_y
    begins, first, last, margin, may_leave = window(planner, now, parameters)
    if epoch.number > 0:
        ahead = _AHEAD if parameters.schedule == GUARDED else 0
        found = earliest_collision(
            moving_on, begins, first, last + ahead, predictions, drift_x, drift_y, margin, may_leave, parameters
        )
        planner.moving_on_looked = begins
        remember(moving_on, begins, last + ahead, found, predictions, epoch, drift_x, drift_y)
        note_moving_on(planner, found[0] * SAMPLE if found[0] < last else NO_COLLISION)
        return
    t = collision_time(moving_on, begins, first, last, predictions, drift_x, drift_y, margin, may_leave, parameters)
    note_moving_on(planner, t)


@kernel
def note_moving_on(planner: Record, t: float) -> None:
    """Keep when the motion under way meets a predicted obstacle [s]."""
    planner.moving_on_t = t
    planner.moving_on_hit = 1 if t < NO_COLLISION else 0


@kernel
def is_imminent(planner: Record, now: int, parameters: Record) -> bool:
    """Return whether a collision is imminent, by the last evaluation of the motion under way."""
    if not planner.knows_obstacles or planner.moving_on_hit == 0:
        return False
    if parameters.looks_ahead:
        return True
    period = (planner.t_next - planner.t_control) * 1e-9
    elapsed = (now - planner.t_control) * 1e-9
    return bool(planner.moving_on_t < period or planner.moving_on_t - elapsed < period)


@kernel
def take_report(planner: Record, pose: Record, stamp: int, lag: int) -> None:
    """Take note of the robot's POSE at `stamp` [ns]; what has yet to come is as late as the robot is."""
    planner.latest = pose
    planner.t_latest = stamp
    more = lag - planner.lag
    planner.lag = lag
    if more == 0 or planner.halted:
        return
    planner.moving_on.begins += more
    planner.moving_on.lag += more
    planner.t_next += more
    for i in range(planner.n):
        planner.members[i].trajectory.begins += more
    if planner.epoch.number > 0:
        planner.epoch.number += 1
        planner.epoch.changed = planner.epoch.strayed = 0.0


@kernel
def _safe_speed(clearance: float, obstacle_speed: float, reaction: float, a: float) -> float:
    """Return the speed [m/s] from which the robot stops in time before an obstacle that comes towards it from now on.

    After the reaction both have closed (v + v_obstacle) * reaction; while the robot brakes, v^2 / 2a by itself and
    v_obstacle * v / a by the obstacle: the sum must not exceed the clearance [m].
    """
    half = obstacle_speed / a + reaction
    left = clearance - obstacle_speed * reaction
    return float(a * (np.sqrt(half * half + 2.0 * left / a) - half)) if left > 0.0 else 0.0


@kernel
def speed_limit(planner: Record, obstacles: Record, parameters: Record) -> float:
    """Return how fast the robot may drive on [m/s]; inf where no obstacle matters.

    An obstacle that stands may set out: it matters if the robot heads towards it and is where it may drive, ahead of it
    and not aside. One that moves may stop: it matters if the robot would drive into the place where it is.
    """
    limit = np.inf
    robot = planner.latest
    a, reaction = parameters.a_max, parameters.reaction
    s = c = 0.0
    for k in range(len(obstacles)):
        pose = obstacles[k].pose
        x, y = pose.x - robot.x, pose.y - robot.y
        distance = np.sqrt(x * x + y * y)
        reach = parameters.robot_radius + obstacles[k].radius
        nearer = distance - reach - max(robot.v, 0.0) * _UNTIL_OBEYED
        if nearer > _SAFE_CLEARANCE:
            continue
        if s == 0.0 and c == 0.0:
            s, c = sin_cos(robot.heading)
        if x * c + y * s < -_TURNS_TOWARDS * distance:
            continue
        if abs(pose.v) >= STANDS:
            if abs(x * s - y * c) < reach:
                limit = min(limit, _safe_speed(nearer, 0.0, reaction, a))
            continue
        facing_s, facing_c = sin_cos(pose.heading)
        if x * facing_c + y * facing_s < 0.0 and abs(x * facing_s - y * facing_c) < reach + _VEERS:
            limit = min(limit, max(_safe_speed(nearer, parameters.obstacle_speed, reaction, a), CREEP))
    return limit

"""Imminent collision: the motion under way and the predicted obstacles -> halt, go on, or stay halted.

`original` looks at the first control period of what the robot was told, counted from its begin although the obstacles
are counted from now, and at nothing beyond it: its look-ahead shrinks to zero before each control cycle. `guarded`
looks a constant time ahead on the motion that is really left, with robot and obstacles at the same instants.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours.planners.ramp.messages import NO_COLLISION, SAMPLE
from parcours.planners.ramp.parameters import GUARDED, ORIGINAL
from parcours.planners.ramp.trajectory_evaluation import collision_time, earliest_collision, still_passes

GUARD_PERIOD = 50_000_000
"""Time between two imminent-collision checks of the published planner [ns] (20 Hz)."""

_AHEAD = 20
"""How many samples beyond its window the guarded schedule looks while it is at it."""


@kernel
def window(planner: Record, now: int, parameters: Record) -> tuple[int, int, int, float, bool]:
    """Return what is looked at of the motion under way: (when it begins [ns], first sample, one past the last, margin
    [m], whether the robot may leave an obstacle it is too near to)."""
    moving_on = planner.moving_on
    if parameters.schedule == ORIGINAL:
        return now, 0, min(int(parameters.control_period / SAMPLE + 0.5) + 1, moving_on.n), 0.0, False
    first = max(int((now - moving_on.begins) * 1e-9 / SAMPLE), 0)
    last = first + int(parameters.guard_horizon / SAMPLE + 0.5) + 1
    return moving_on.begins, first, last, parameters.guard_margin, True


@kernel
def evaluate_moving_on(planner: Record, predictions: Record, now: int, changed: float, parameters: Record) -> None:
    """Set moving_on_hit and moving_on_t: whether and when the motion under way meets a predicted obstacle.

    The guarded schedule looks farther ahead than it needs to, and remembers the room that it found.

    Args:
        planner: PLANNER.
        predictions: array of PREDICTION.
        now: [ns].
        changed: by how much these predictions have changed in this scene [m]; inf if that is unknown.
        parameters: PARAMETERS.
    """
    if planner.moving_on.n == 0 or len(predictions) == 0:
        note_moving_on(planner, NO_COLLISION)
        return
    moving_on, drift_x, drift_y = planner.moving_on, planner.drift_x, planner.drift_y
    begins, first, last, margin, may_leave = window(planner, now, parameters)
    if parameters.schedule == GUARDED and changed < np.inf:
        if last <= planner.moving_on_until and still_passes(moving_on, planner.scene, changed, drift_x, drift_y):
            note_moving_on(planner, NO_COLLISION)
            return
        until = last + _AHEAD
        hit, room = earliest_collision(
            moving_on, begins, first, until, predictions, drift_x, drift_y, margin, may_leave, parameters
        )
        moving_on.scene = planner.scene if hit == until else 0
        moving_on.room, moving_on.changed, moving_on.drift_x, moving_on.drift_y = room, changed, drift_x, drift_y
        planner.moving_on_until = until
        note_moving_on(planner, hit * SAMPLE if hit < last else NO_COLLISION)
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
    if parameters.schedule == GUARDED:
        return True
    period = (planner.t_next - planner.t_control) * 1e-9
    elapsed = (now - planner.t_control) * 1e-9
    return bool(planner.moving_on_t < period or planner.moving_on_t - elapsed < period)

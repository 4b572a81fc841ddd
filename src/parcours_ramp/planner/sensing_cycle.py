"""The sensing cycle, at every obstacle message: predict obstacles, evaluate population and motion under way."""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2
from parcours.kernels import Record, kernel
from parcours_ramp.planner.guard import evaluate_moving_on
from parcours_ramp.planner.late_evaluation import catch_up_with_all, evaluate_member
from parcours_ramp.planner.prediction import change_of, predict

NOT_BEFORE_CONTROL = 100_000_000
"""The population is not evaluated when the next control cycle is nearer than this [ns] (published)."""


@kernel
def note_nearest(planner: Record, obstacles: Record) -> None:
    """Keep direction and distance of the nearest obstacle, for the operator `move`."""
    nearest, near_x, near_y = np.inf, 0.0, 0.0
    for k in range(len(obstacles)):
        x, y = obstacles[k].pose.x - planner.latest.x, obstacles[k].pose.y - planner.latest.y
        distance = np.sqrt(x * x + y * y)
        if distance < nearest:
            nearest, near_x, near_y = distance, x, y
    if nearest < np.inf:
        planner.near_direction, planner.near_distance = atan2(near_y, near_x), nearest
    planner.knows_obstacles = 1 if len(obstacles) > 0 else 0


@kernel
def evaluates_population(planner: Record, now: int) -> bool:
    """Return whether this sensing cycle evaluates the population, or leaves it to the control cycle about to come."""
    return bool(planner.t_next - now > NOT_BEFORE_CONTROL or planner.halted == 1 or planner.moving_on.n == 0)


@kernel
def evaluate_population(planner: Record, predictions: Record, parameters: Record) -> None:
    """Evaluate every member of the population, or put that off."""
    for i in range(planner.n):
        evaluate_member(planner, planner.members[i], predictions, parameters)


@kernel
def look_on(planner: Record, predictions: Record, obstacles: Record, stamp: int) -> None:
    """Set planner.next_epoch to the EPOCH of predictions made of the obstacles as sensed at `stamp` [ns].

    Its number is 0 if an obstacle does what was not predicted.
    """
    epoch, following = planner.epoch, planner.next_epoch
    strayed = changed = fastest = 0.0
    for k in range(len(obstacles)):
        along, anywhere = change_of(predictions[k], obstacles[k], stamp)
        strayed, changed = max(strayed, along), max(changed, anywhere)
        fastest = max(fastest, abs(obstacles[k].pose.v))
    following.number = epoch.number if changed < np.inf else 0
    following.changed, following.strayed = epoch.changed + changed, epoch.strayed + strayed
    following.ahead, following.fastest, following.stamp = strayed, fastest, stamp


@kernel
def sensing_cycle(
    planner: Record, obstacles: Record, stamp: int, now: int, predictions: Record, parameters: Record
) -> bool:
    """Run one whole sensing cycle on an array of OBSTACLE_STATE that was sensed at `stamp` [ns].

    Returns:
        Whether the population was evaluated.
    """
    evaluates = evaluates_population(planner, now)
    if not evaluates:
        catch_up_with_all(planner, predictions, parameters)
    look_on(planner, predictions, obstacles, stamp)
    for k in range(len(obstacles)):
        predict(obstacles[k], stamp, predictions[k])
    if planner.next_epoch.number == 0:
        planner.next_epoch.number = planner.epoch.number + 1
        planner.next_epoch.changed = planner.next_epoch.strayed = 0.0
    planner.next_epoch.ahead = 0.0
    planner.epoch = planner.next_epoch
    note_nearest(planner, obstacles)
    if evaluates:
        evaluate_population(planner, predictions, parameters)
    evaluate_moving_on(planner, predictions, now, planner.epoch, parameters)
    return evaluates

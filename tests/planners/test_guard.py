"""Imminent collision: the published guard's look-ahead shrinks and is misaligned; the repaired one's is neither."""

from __future__ import annotations

import math

import numpy as np
import pytest

from parcours.kernels import Record
from parcours_ramp.planner.guard import evaluate_moving_on, is_imminent
from parcours_ramp.planner.messages import EPOCH, OBSTACLE_STATE, PATH, POSE, PREDICTION, many, one
from parcours_ramp.planner.parameters import Parameters, guarded, original
from parcours_ramp.planner.planner_state import PLANNER
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.route import HYBRID, ROUTE
from parcours_ramp.planner.trajectory_generator import generate

SECOND = 1_000_000_000
REACH = 0.225
SPEED = 0.25
BARE = guarded(guard_margin=0.0)
"""The repaired guard without its margin, so that both look at the same distance."""


def under_way(period: float = 2.0) -> Record:
    """Return a planner whose robot drives along x at top speed since its control cycle at time 0."""
    planner = one(PLANNER)
    planner.knows_obstacles = 1
    path, start = one(PATH), one(POSE)
    path.n, path.x[1], start.v = 2, 6.5 * SPEED, SPEED  # it brakes from 6.25 s on
    generate(path, start, HYBRID, guarded().record(), one(ROUTE), planner.moving_on)
    planner.t_next = round(period * SECOND)
    return planner


def seen(x: float, y: float, heading: float, v: float, now: float) -> Record:
    """Return the prediction made `now` [s] of an obstacle that is at (x, y)."""
    obstacle, predictions = one(OBSTACLE_STATE), many(PREDICTION, 1)
    obstacle.pose.x, obstacle.pose.y, obstacle.pose.heading, obstacle.pose.v = x, y, heading, v
    obstacle.radius = 0.1
    predict(obstacle, round(now * SECOND), predictions[0])
    return predictions


def alarm(parameters: Parameters, predictions: Record, now: float, period: float = 2.0) -> bool:
    planner, record = under_way(period), parameters.record()
    evaluate_moving_on(planner, predictions, round(now * SECOND), one(EPOCH), record)
    return bool(is_imminent(planner, round(now * SECOND), record))


def warning(parameters: Parameters, contact: float) -> float:
    """Return how long before a contact with a standing obstacle at time `contact` the first alarm comes [s]."""
    for now in np.arange(0.0, contact, 0.05):
        if alarm(parameters, seen(SPEED * contact + REACH, 0.0, 0.0, 0.0, now), float(now)):
            return contact - float(now)
    return 0.0


@pytest.mark.parametrize("contact", [2.15, 2.35, 2.55, 2.95])
def test_the_published_guard_sees_nothing_beyond_the_control_period_however_near_it_comes(contact: float) -> None:
    assert warning(original(), contact) <= contact - 2.0 + 1e-9


@pytest.mark.parametrize("contact", [1.45, 2.15, 2.35, 2.55, 2.95, 4.05])
def test_the_repaired_guard_warns_a_constant_time_ahead(contact: float) -> None:
    assert warning(BARE, contact) == pytest.approx(BARE.guard_horizon, abs=0.11)


def test_the_published_guard_s_look_ahead_shrinks_as_the_control_period_runs_out_and_the_repaired_one_s_does_not() -> (
    None
):
    def look_ahead(parameters: Parameters, now: float) -> float:
        """Return how far ahead of `now` a standing obstacle on the robot's way is noticed at most [s]."""
        ahead = [
            a
            for a in np.arange(0.05, 2.5, 0.1)
            if alarm(parameters, seen(SPEED * (now + a) + REACH, 0, 0, 0, now), now)
        ]
        return max(ahead, default=0.0)

    times = (0.0, 0.5, 1.0, 1.5, 1.9)
    published = [look_ahead(original(), now) for now in times]
    assert published == pytest.approx([2.0 - now for now in times], abs=0.16)
    repaired = [look_ahead(BARE, now) for now in times]
    assert repaired == pytest.approx([BARE.guard_horizon] * 5, abs=0.11)


def test_the_published_guard_pairs_where_the_robot_was_with_where_the_obstacle_is() -> None:
    # After 1.5 s the robot is at 0.375 m. An obstacle crosses far behind it, where it was when the period began.
    behind = seen(0.025, -0.3, math.pi / 2, 0.5, now=1.5)
    assert alarm(original(), behind, 1.5)
    assert not alarm(BARE, behind, 1.5)
    # And one that will hit it head-on in 0.4 s is taken to be met only when the robot has come there from the start.
    planner, record = under_way(), original().record()
    ahead = seen(0.375 + 0.4 * 0.75 + REACH, 0.0, math.pi, 0.5, now=1.5)
    evaluate_moving_on(planner, ahead, round(1.5 * SECOND), one(EPOCH), record)
    assert planner.moving_on_t == pytest.approx((0.375 + 0.3) / 0.75, abs=0.11)  # counted as if the robot were at 0
    planner, record = under_way(), BARE.record()
    evaluate_moving_on(planner, ahead, round(1.5 * SECOND), one(EPOCH), record)
    assert planner.moving_on_t - 1.5 == pytest.approx(0.4, abs=0.11)


def test_the_repaired_guard_lets_the_robot_leave_what_it_is_too_near_to_and_the_published_one_does_not() -> None:
    behind = seen(0.0, 0.0, 0.0, 0.0, now=0.4)  # the robot, at 0.1 m, drives away from it
    assert alarm(original(), behind, 0.4)
    assert not alarm(guarded(), behind, 0.4)
    ahead = seen(0.2, 0.0, 0.0, 0.0, now=0.4)
    assert alarm(guarded(), ahead, 0.4)


def test_the_repaired_guard_keeps_its_margin() -> None:
    beside = seen(0.3, REACH + 0.02, 0.0, 0.0, now=0.5)
    assert not alarm(original(), beside, 0.5)
    assert not alarm(BARE, beside, 0.5)
    assert alarm(guarded(), beside, 0.5)


def test_nothing_is_imminent_before_any_obstacle_is_known() -> None:
    for parameters in (original(), guarded()):
        planner, record = under_way(), parameters.record()
        evaluate_moving_on(planner, seen(0.1, 0.0, 0.0, 0.0, 0.0), 0, one(EPOCH), record)
        assert is_imminent(planner, 0, record)
        planner.knows_obstacles = 0
        assert not is_imminent(planner, 0, record)

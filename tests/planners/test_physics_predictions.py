"""Predicted motions of obstacles against the motion the arena really gives them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours_navigation.arena.obstacles import OBSTACLE, move, place_at
from parcours_ramp.planner.messages import HORIZON, OBSTACLE_STATE, PREDICTION, SAMPLE, one
from parcours_ramp.planner.prediction import STRAIGHT, predict

SECOND = 1_000_000_000


def moving(heading: float, speed: float, turn: float, stop: float) -> Record:
    """Return an obstacle that sets out after a second."""
    obstacle = np.zeros(1, OBSTACLE).view(np.recarray)[0]
    obstacle.x0, obstacle.y0, obstacle.heading0, obstacle.speed, obstacle.turn = 1.2, 0.7, heading, speed, turn
    obstacle.start, obstacle.stop, obstacle.radius = SECOND, round(stop * SECOND), 0.1
    return obstacle


def predicted(obstacle: Record, now: float) -> Record:
    """Return what is expected of the obstacle as it is at `now` [s]."""
    move(obstacle, round(now * SECOND))
    state, prediction = one(OBSTACLE_STATE), one(PREDICTION)
    for name in ("x", "y", "heading", "v", "w"):
        setattr(state.pose, name, getattr(obstacle, name))
    state.radius = obstacle.radius
    predict(state, round(now * SECOND), prediction)
    return prediction


turns = st.floats(-1.6, 1.6).filter(lambda turn: abs(turn) >= STRAIGHT or turn == 0.0)


@given(st.floats(-3.1, 3.1), st.floats(0.02, 0.5), turns, st.floats(1.0, 9.0))
def test_a_predicted_motion_is_the_arena_s_own_while_the_obstacle_keeps_its_speeds(
    heading: float, speed: float, turn: float, now: float
) -> None:
    obstacle = moving(heading, speed, turn, 99.0)
    prediction = predicted(obstacle, now)
    begin = round(now * SECOND)
    assert prediction.stamp == begin
    for i in range(int(prediction.n)):
        there = place_at(obstacle, begin + round(i * SAMPLE * SECOND))
        assert (prediction.x[i], prediction.y[i]) == pytest.approx(there, abs=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(0.02, 0.5), st.floats(-0.999, 0.999))
def test_a_bend_taken_for_a_straight_strays_by_no_more_than_its_bow(heading: float, speed: float, share: float) -> None:
    turn = share * STRAIGHT
    assume(turn != 0.0)
    obstacle = moving(heading, speed, turn, 99.0)
    prediction = predicted(obstacle, 2.0)
    for i in range(HORIZON):
        time = i * SAMPLE
        x, y = place_at(obstacle, round((2.0 + time) * SECOND))
        assert math.hypot(x - prediction.x[i], y - prediction.y[i]) <= 0.5 * speed * abs(turn) * time**2 + 1e-9


@given(st.floats(-3.1, 3.1), st.floats(0.02, 0.5), turns)
def test_before_it_sets_out_and_after_it_stops_an_obstacle_is_expected_to_stay(
    heading: float, speed: float, turn: float
) -> None:
    obstacle = moving(heading, speed, turn, 4.0)
    for now in (0.0, 0.999, 4.0, 7.0):
        prediction = predicted(obstacle, now)
        assert (prediction.n, prediction.speed) == (1, 0.0)
        assert (prediction.x[0], prediction.y[0]) == place_at(obstacle, round(now * SECOND))

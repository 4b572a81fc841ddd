"""Predicted obstacle motions against closed forms: standing, on a line, on an arc."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours.planners.ramp.messages import HORIZON, OBSTACLE_STATE, PREDICTION, SAMPLE, one
from parcours.planners.ramp.prediction import LONGEST_ARC, STANDS, STRAIGHT, predict

headings = st.floats(-math.pi, math.pi)
speeds = st.floats(0.02, 0.5)
turns = st.floats(0.02, 3.0) | st.floats(-3.0, -0.02)


def predicted(heading: float, v: float, w: float, stamp: int = 7) -> Record:
    obstacle, prediction = one(OBSTACLE_STATE), one(PREDICTION)
    pose = obstacle.pose
    pose.x, pose.y, pose.heading, pose.v, pose.w = 1.2, 0.4, heading, v, w
    obstacle.radius = 0.1
    predict(obstacle, stamp, prediction)
    return prediction


@given(headings, st.floats(-0.99, 0.99), turns)
def test_a_body_slower_than_a_centimetre_a_second_is_expected_to_stay(heading: float, v: float, w: float) -> None:
    prediction = predicted(heading, v * STANDS, w)
    assert (prediction.n, prediction.speed) == (1, 0.0)
    assert (prediction.x[0], prediction.y[0]) == (1.2, 0.4)


@given(headings, speeds, st.floats(-0.99, 0.99))
def test_a_body_that_hardly_turns_is_expected_on_a_line_for_twelve_seconds(heading: float, v: float, w: float) -> None:
    prediction = predicted(heading, v, w * STRAIGHT)
    assert prediction.n == HORIZON
    assert (prediction.n - 1) * SAMPLE == pytest.approx(12.0)
    time = np.arange(HORIZON) * SAMPLE
    assert np.allclose(prediction.x, 1.2 + v * time * math.cos(heading), atol=1e-12)
    assert np.allclose(prediction.y, 0.4 + v * time * math.sin(heading), atol=1e-12)


@given(headings, speeds, turns)
def test_a_turning_body_is_expected_on_its_arc_up_to_half_a_turn_or_five_seconds(
    heading: float, v: float, w: float
) -> None:
    prediction = predicted(heading, v, w)
    n = int(prediction.n)
    lasts = min(math.pi / abs(w), LONGEST_ARC)
    assert lasts - SAMPLE - 1e-9 <= (n - 1) * SAMPLE <= lasts + 1e-9
    towards = heading + w * np.arange(n) * SAMPLE
    assert np.allclose(prediction.x[:n], 1.2 + v / w * (np.sin(towards) - math.sin(heading)), atol=1e-10)
    assert np.allclose(prediction.y[:n], 0.4 - v / w * (np.cos(towards) - math.cos(heading)), atol=1e-10)


@given(headings, speeds, turns | st.just(0.0))
def test_no_predicted_step_is_longer_than_the_predicted_speed_allows(heading: float, v: float, w: float) -> None:
    prediction = predicted(heading, v, w)
    n = int(prediction.n)
    steps = np.hypot(np.diff(prediction.x[:n]), np.diff(prediction.y[:n]))
    assert steps.max(initial=0.0) <= prediction.speed * SAMPLE * (1 + 1e-9)


def test_a_prediction_keeps_when_it_was_sensed_and_how_large_the_body_is() -> None:
    prediction = predicted(0.0, 0.3, 0.0, stamp=123_456)
    assert (prediction.stamp, prediction.radius) == (123_456, 0.1)


def test_a_body_that_moves_backwards_is_expected_behind_it() -> None:
    prediction = predicted(0.0, -0.3, 0.0)
    assert prediction.x[10] == pytest.approx(1.2 - 0.3)
    assert prediction.speed == pytest.approx(0.3)

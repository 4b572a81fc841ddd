"""Predicted obstacle motions against closed forms: standing, on a line, on an arc."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours_ramp.planner.messages import HORIZON, OBSTACLE_STATE, PREDICTION, SAMPLE, one
from parcours_ramp.planner.prediction import (
    LONGEST_ARC,
    STANDS,
    STRAIGHT,
    change_of,
    coarseness,
    predict,
    predicted_place,
    predicted_until,
)

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
    assert prediction.speed == pytest.approx(-0.3)


def places(prediction: Record, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the obstacle is expected to be at the times from 0 on [s], shape (n, 2)."""
    at, n = (times - int(prediction.stamp) * 1e-9) / SAMPLE, int(prediction.n)
    for place in at[::50]:
        assert predicted_place(prediction, float(place)) == pytest.approx(
            (np.interp(place, np.arange(n), prediction.x[:n]), np.interp(place, np.arange(n), prediction.y[:n]))
        )
    return np.stack([np.interp(at, np.arange(n), prediction[name][:n]) for name in ("x", "y")], axis=1)


def sensed(x: float, y: float, heading: float, v: float, w: float) -> Record:
    obstacle = one(OBSTACLE_STATE)
    pose = obstacle.pose
    pose.x, pose.y, pose.heading, pose.v, pose.w = x, y, heading, v, w
    obstacle.radius = 0.1
    return obstacle


@settings(max_examples=1000)
@given(
    headings,
    st.floats(-0.5, 0.5),
    turns | st.floats(-0.02, 0.02) | st.just(0.0),
    st.floats(0.01, 1.0),
    st.just((0.0, 0.0, 0.0)) | st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
)
def test_a_prediction_made_anew_differs_nowhere_by_more_than_the_change_that_is_told_of_it(
    heading: float, v: float, w: float, later: float, off: tuple[float, float, float]
) -> None:
    before = predicted(heading, v, w, stamp=1_000_000_000)
    stamp = 1_000_000_000 + round(later * 1e9)
    if abs(v) < STANDS:
        x, y, towards = 1.2, 0.4, heading
    elif abs(w) < 1e-9:
        x, y, towards = 1.2 + v * later * math.cos(heading), 0.4 + v * later * math.sin(heading), heading
    else:
        towards = heading + w * later
        x = 1.2 + v / w * (math.sin(towards) - math.sin(heading))
        y = 0.4 - v / w * (math.cos(towards) - math.cos(heading))
    obstacle, after = sensed(x + off[0], y + off[1], towards + off[2], v, w), one(PREDICTION)
    along, anywhere = change_of(before, obstacle, stamp)
    predict(obstacle, stamp, after)
    coarse = coarseness(before) + 1e-12
    times = np.concatenate([np.arange(0.0, 16.0, 0.037), [1.0, 1.0 + later, 13.0, 13.0 + later]])
    differ = np.hypot(*(places(after, times) - places(before, times)).T)
    assert differ.max() <= anywhere + coarse
    known = (times >= stamp * 1e-9) & ((times - 1.0) / SAMPLE <= predicted_until(before, before.stamp) + 1e-9)
    assert differ[known].max(initial=0.0) <= along + coarse


def test_an_obstacle_that_does_as_predicted_changes_its_prediction_by_no_more_than_it_goes_on() -> None:
    assert change_of(predicted(0.3, 0.0, 0.0, 0), sensed(1.2, 0.4, 0.3, 0.0, 0.0), 50_000_000) == (0.0, 0.0)
    x, y = 1.2 + 0.3 * 0.05 * math.cos(0.3), 0.4 + 0.3 * 0.05 * math.sin(0.3)
    along, anywhere = change_of(predicted(0.3, 0.3, 0.0, 0), sensed(x, y, 0.3, 0.3, 0.0), 50_000_000)
    assert along < 1e-12
    assert anywhere == pytest.approx(0.3 * 0.05, abs=1e-9)


@given(headings, st.sampled_from([0.0, 0.2, 0.5]), st.sampled_from([0.0, 0.2, 0.5]), st.sampled_from([0.0, 0.5]))
def test_how_a_prediction_changes_is_unknown_exactly_if_the_obstacle_moves_otherwise(
    heading: float, v: float, other_v: float, other_w: float
) -> None:
    told = change_of(predicted(heading, v, 0.0, 0), sensed(1.2, 0.4, heading, other_v, other_w), 0)
    assert (told == (math.inf, math.inf)) == (v != other_v or (v != 0.0 and other_w != 0.0))

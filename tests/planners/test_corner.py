"""The rounded corner: closed forms against dense sampling of the Bezier curve itself, and the speed it allows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.planners.ramp.corner import corner_at, corner_length, corner_speed
from parcours.planners.ramp.parameters import guarded

Floats = NDArray[np.float64]

legs = st.floats(0.02, 2.0)
turns = st.floats(0.02, 2.8) | st.floats(-2.8, -0.02)

N = 20_000


def bezier(leg: float, turn: float) -> tuple[Floats, Floats, Floats]:
    """Return (u, way along the curve, signed curvature) at N + 1 parameters, from the control points."""
    points = np.array([[0.0, 0.0], [leg, 0.0], [leg + leg * math.cos(turn), leg * math.sin(turn)]])
    u = np.linspace(0.0, 1.0, N + 1)[:, np.newaxis]
    place = (1 - u) ** 2 * points[0] + 2 * u * (1 - u) * points[1] + u**2 * points[2]
    first = 2 * (1 - u) * (points[1] - points[0]) + 2 * u * (points[2] - points[1])
    second = 2 * (points[2] - 2 * points[1] + points[0])
    bend = (first[:, 0] * second[1] - first[:, 1] * second[0]) / np.hypot(first[:, 0], first[:, 1]) ** 3
    way = np.concatenate([[0.0], np.hypot(*np.diff(place, axis=0).T).cumsum()])
    return u[:, 0], way, bend


@settings(max_examples=50)
@given(legs, turns)
def test_the_length_is_that_of_a_fine_polygon(leg: float, turn: float) -> None:
    assert corner_length(leg, turn) == pytest.approx(bezier(leg, turn)[1][-1], rel=1e-6)


@settings(max_examples=50)
@given(legs, turns, st.floats(0.0, 1.0))
def test_parameter_and_curvature_along_the_way_are_the_curve_s_own(leg: float, turn: float, share: float) -> None:
    u, way, bend = bezier(leg, turn)
    at = share * corner_length(leg, turn)
    expected = float(np.interp(at, way, u))
    found, curvature = corner_at(at, expected, leg, turn)
    assert found == pytest.approx(expected, abs=1e-5)
    assert curvature == pytest.approx(float(np.interp(found, u, bend)), rel=1e-4, abs=1e-9)


@settings(max_examples=50)
@given(legs, st.floats(0.02, 2.5) | st.floats(-2.5, -0.02))
def test_walking_along_with_the_last_parameter_as_guess_never_loses_the_way(leg: float, turn: float) -> None:
    u, way, _ = bezier(leg, turn)
    guess = 0.0
    for at in np.arange(0.0, corner_length(leg, turn), 0.025):
        guess, _ = corner_at(float(at), guess, leg, turn)
        assert guess == pytest.approx(float(np.interp(at, way, u)), abs=1e-5)


@given(legs, turns)
def test_the_corner_speed_keeps_the_yaw_rate_within_its_limit_everywhere(leg: float, turn: float) -> None:
    parameters = guarded().record()
    speed = corner_speed(leg, turn, parameters)
    assert 0.0 < speed <= parameters.v_max
    assert speed * np.abs(bezier(leg, turn)[2]).max() <= parameters.w_max * (1 + 1e-9)


@given(legs, turns)
def test_at_corner_speed_the_yaw_rate_changes_no_faster_than_it_may_between_samples(leg: float, turn: float) -> None:
    parameters = guarded().record()
    speed = corner_speed(leg, turn, parameters)
    _, way, bend = bezier(leg, turn)
    rates = speed * np.interp(np.arange(0.0, way[-1], speed * 0.1), way, bend)
    # From straight to curve in one sample, then along it.
    changes = np.abs(np.diff(np.concatenate([[0.0], rates])))
    assert changes.max() <= parameters.alpha_max * 0.1


def test_no_turn_costs_no_speed_and_a_full_turn_back_allows_none() -> None:
    parameters = guarded().record()
    assert corner_speed(0.5, 0.0, parameters) == parameters.v_max
    assert corner_speed(0.5, math.pi, parameters) == 0.0
    assert corner_speed(0.0, 1.0, parameters) == 0.0


@given(legs, st.floats(0.1, 2.8))
def test_left_and_right_corners_are_mirror_images(leg: float, turn: float) -> None:
    parameters = guarded().record()
    assert corner_speed(leg, turn, parameters) == corner_speed(leg, -turn, parameters)
    assert corner_length(leg, turn) == corner_length(leg, -turn)
    left, right = corner_at(0.7 * leg, 0.3, leg, turn), corner_at(0.7 * leg, 0.3, leg, -turn)
    assert left == (right[0], -right[1])

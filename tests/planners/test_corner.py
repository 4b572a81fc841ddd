"""The rounded corner: closed forms against dense sampling of the Bezier curve itself, and the speed it allows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours_ramp.planner.corner import corner_length, corner_speed, place_on_corner, shape_corner, slope_at
from parcours_ramp.planner.messages import CURVE, PIECE, POSE, TRAJECTORY, one
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.trajectory import pose_at

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


def curve(leg: float, turn: float, heading: float = 0.0) -> Record:
    """Return the PIECE that rounds a corner, from the origin on."""
    piece = one(PIECE)
    piece.kind, piece.heading, piece.leg, piece.angle = CURVE, heading, leg, turn
    piece.length = corner_length(leg, turn)
    piece.s, piece.c = math.sin(heading), math.cos(heading)
    piece.to_s, piece.to_c = math.sin(heading + turn), math.cos(heading + turn)
    shape_corner(piece)
    return piece


def test_the_slope_after_some_way_along_a_parabola_is_that_of_the_parabola() -> None:
    # The way's closed form is the reference; entries of the table, its end and the gaps between are all looked at.
    slopes = np.concatenate([np.linspace(0.0, 8.0, 40_001), np.geomspace(1e-12, 1e4, 4_001)])
    ways = slopes * np.sqrt(1.0 + slopes**2) + np.arcsinh(slopes)
    found = np.array([slope_at(float(way)) for way in ways])
    assert (np.abs(found - slopes) / np.maximum(slopes, 1.0)).max() < 1e-8
    assert np.array_equal([slope_at(-float(way)) for way in ways[::50]], -found[::50])


@settings(max_examples=50)
@given(legs, turns, st.floats(0.0, 1.0))
def test_place_and_heading_along_the_way_are_the_curve_s_own(leg: float, turn: float, share: float) -> None:
    u, way, _ = bezier(leg, turn)
    at = share * corner_length(leg, turn)
    expected = float(np.interp(at, way, u))
    x, y, slope = place_on_corner(curve(leg, turn), at)
    placed = (2 * expected * (1 - expected) + expected**2 * (1 + math.cos(turn)), expected**2 * math.sin(turn))
    assert (x, y) == pytest.approx((leg * placed[0], leg * placed[1]), abs=2e-5 * leg)
    towards = math.atan2(expected * math.sin(turn), 1 - expected + expected * math.cos(turn))
    assert 0.5 * turn + math.copysign(1.0, turn) * math.atan(slope) == pytest.approx(towards, abs=1e-4)


@settings(max_examples=50)
@given(legs, turns, st.floats(0.0, 1.0))
def test_yaw_rate_on_the_way_is_speed_times_the_curve_s_own_curvature(leg: float, turn: float, share: float) -> None:
    _, way, bend = bezier(leg, turn)
    piece, trajectory, pose = curve(leg, turn), one(TRAJECTORY), one(POSE)
    piece.v0 = piece.peak = 0.1
    piece.hold = piece.end = piece.length / 0.1
    trajectory.n_pieces, trajectory.pieces[0], trajectory.duration = 1, piece, piece.end
    seconds = share * 0.999 * float(piece.end)
    pose_at(trajectory, seconds, pose)
    assert pose.w == pytest.approx(0.1 * float(np.interp(0.1 * seconds, way, bend)), rel=1e-4, abs=1e-9)
    assert pose.v == 0.1


def test_a_corner_begins_and_ends_on_its_legs() -> None:
    for turn in (-2.8, -1.0, 0.02, 1.0, 2.8):
        piece = curve(0.7, turn, heading=0.4)
        x, y, _ = place_on_corner(piece, 0.0)
        assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-8)
        x, y, _ = place_on_corner(piece, float(piece.length))
        end = 0.7 * (math.cos(0.4) + math.cos(0.4 + turn)), 0.7 * (math.sin(0.4) + math.sin(0.4 + turn))
        assert (x, y) == pytest.approx(end, abs=1e-8)


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
    left, right = place_on_corner(curve(leg, turn), 0.7 * leg), place_on_corner(curve(leg, -turn), 0.7 * leg)
    assert left == (right[0], -right[1], right[2])

"""Rounded corners and whole trajectories against an independent Bezier curve, quadrature, and differences in time."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad

from parcours_ramp.planner.corner import corner_length, corner_speed
from parcours_ramp.planner.messages import SAMPLE
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.route import NEAR

if TYPE_CHECKING:
    from tests.planners.conftest import Sampled, Sampler, Way

Floats = NDArray[np.float64]

LIMITS = guarded()
STEP = 0.01
EVERY = 4
ROUNDING = 1e-9

legs = st.floats(0.02, 2.0)
turns = st.floats(0.02, 2.8) | st.floats(-2.8, -0.02)


def bezier(control: Floats, u: Floats) -> tuple[Floats, Floats, Floats]:
    """Return (places (n, 2), headings (n,), signed curvatures (n,)) of the quadratic curve with controls (3, 2)."""
    u = u[:, np.newaxis]
    inner = control[:-1] + u[:, np.newaxis] * np.diff(control, axis=0)  # de Casteljau, (n, 2, 2)
    first = 2.0 * (inner[:, 1] - inner[:, 0])
    second = 2.0 * (control[2] - 2.0 * control[1] + control[0])
    places = inner[:, 0] + u * (inner[:, 1] - inner[:, 0])
    across = first[:, 0] * second[1] - first[:, 1] * second[0]
    return places, np.arctan2(first[:, 1], first[:, 0]), across / np.hypot(first[:, 0], first[:, 1]) ** 3


def corner(leg: float, turn: float) -> Floats:
    """Return the control points of a corner that begins in the origin, eastwards, shape (3, 2)."""
    return np.array([[0.0, 0.0], [leg, 0.0], [leg + leg * math.cos(turn), leg * math.sin(turn)]])


@given(legs, turns)
def test_a_corner_is_as_long_as_quadrature_and_a_fine_polygon_say(leg: float, turn: float) -> None:
    control = corner(leg, turn)

    def speed(u: float) -> float:
        first = 2.0 * ((1.0 - u) * (control[1] - control[0]) + u * (control[2] - control[1]))
        return math.hypot(first[0], first[1])

    length = sum(quad(speed, a, a + 0.25, epsabs=1e-12, epsrel=1e-12)[0] for a in (0.0, 0.25, 0.5, 0.75))
    assert corner_length(leg, turn) == pytest.approx(length, rel=1e-9)
    polygon = shapely.LineString(bezier(control, np.linspace(0.0, 1.0, 4001))[0])
    assert corner_length(leg, turn) == pytest.approx(polygon.length, rel=1e-5)
    assert corner_length(leg, turn) >= polygon.length * (1.0 - ROUNDING)


@given(legs, turns)
def test_at_corner_speed_no_yaw_limit_is_broken_along_the_whole_curve_at_any_phase_of_the_samples(
    leg: float, turn: float
) -> None:
    speed = corner_speed(leg, turn, LIMITS.record())
    places, _, bends = bezier(corner(leg, turn), np.linspace(0.0, 1.0, 20_001))
    times = np.concatenate([[0.0], np.hypot(*np.diff(places, axis=0).T).cumsum()]) / speed
    rates = speed * bends
    assert np.abs(rates).max() <= LIMITS.w_max * (1 + ROUNDING)
    # Yaw acceleration on the curve itself, in continuous time ...
    assert np.abs(np.diff(rates) / np.diff(times)).max() <= LIMITS.alpha_max * 1.001
    # ... and, with the jumps at its ends, over one sample that begins at any time.
    after = np.interp(times + SAMPLE, times, rates, right=0.0)
    entering = np.interp(np.linspace(0.0, SAMPLE, 200), times, rates, right=0.0)
    changes = np.concatenate([after - rates, entering])
    assert np.abs(changes).max() <= LIMITS.alpha_max * SAMPLE * (1 + ROUNDING)


def bends_of(samples: Sampled) -> list[slice]:
    """Return where the robot drives along one curve: every EVERY-th sample with speed and one sign of yaw rate."""
    sign = np.where(samples.v > 1e-6, np.sign(np.round(samples.w, 9)), 0.0)
    edges = [0, *(np.flatnonzero(np.diff(sign)) + 1), len(sign)]
    return [slice(int(a), int(b), EVERY) for a, b in itertools.pairwise(edges) if sign[a] != 0.0 and b - a > 2 * EVERY]


def test_every_curve_of_a_trajectory_is_a_bezier_curve_through_its_own_tangents(
    ways: list[Way], sampled: Sampler
) -> None:
    seen = 0
    for way in ways[:90]:
        samples = sampled(way.trajectory, STEP)
        for run in bends_of(samples):
            x, y, heading = samples.x[run], samples.y[run], samples.heading[run]
            turn = math.remainder(heading[-1] - heading[0], math.tau)
            if abs(turn) < 0.1:
                continue  # nearly parallel tangents do not say where they meet
            seen += 1
            dx, dy = x[-1] - x[0], y[-1] - y[0]
            leg = (dx * math.sin(heading[-1]) - dy * math.cos(heading[-1])) / math.sin(turn)
            meet = [x[0] + leg * math.cos(heading[0]), y[0] + leg * math.sin(heading[0])]
            control = np.array([[x[0], y[0]], meet, [x[-1], y[-1]]])
            u = np.linspace(0.0, 1.0, 4001)
            places, towards, curvature = bezier(control, u)
            line = shapely.LineString(places)
            points = shapely.points(x, y)
            assert shapely.distance(line, points).max() < 1e-6
            at = shapely.line_locate_point(line, points) / line.length
            way_made = np.concatenate([[0.0], np.hypot(*np.diff(places, axis=0).T).cumsum()])
            at_u = np.interp(at * way_made[-1], way_made, u)
            off = np.interp(at_u, u, np.unwrap(towards)) - heading
            assert np.abs(np.remainder(off + math.pi, math.tau) - math.pi).max() < 1e-5
            assert np.allclose(samples.w[run], samples.v[run] * np.interp(at_u, u, curvature), atol=1e-4)
            # Curves are driven at constant speed, so equal times are equal ways.
            assert np.ptp(samples.v[run]) < ROUNDING
            assert np.abs(np.diff(at) * line.length - samples.v[run][0] * EVERY * STEP).max() < 1e-6
    assert seen > 30


def test_place_and_heading_are_the_integrals_of_speed_and_yaw_rate(ways: list[Way], sampled: Sampler) -> None:
    errors_place, errors_heading = [], []
    for way in ways[:50]:
        half = sampled(way.trajectory, 0.5 * STEP)
        n = (len(half.x) - 2) // 2 * 2 + 1  # the last sample comes early
        heading = np.unwrap(half.heading[:n])
        for place, velocity in ((half.x[:n], half.v[:n] * np.cos(heading)), (half.y[:n], half.v[:n] * np.sin(heading))):
            simpson = (velocity[:-2:2] + 4.0 * velocity[1::2] + velocity[2::2]) * STEP / 6.0
            errors_place.append(np.abs(np.diff(place[::2]) - simpson))
        w = half.w[:n]
        errors_heading.append(np.abs(np.diff(heading[::2]) - (w[:-2:2] + 4.0 * w[1::2] + w[2::2]) * STEP / 6.0))
    place_off, heading_off = np.concatenate(errors_place), np.concatenate(errors_heading)
    # Where a piece ends or speed reaches its cap within the step, Simpson's rule is off by what can change there ...
    assert place_off.max() <= LIMITS.a_max * STEP**2
    assert heading_off.max() <= NEAR + LIMITS.alpha_max * SAMPLE * STEP
    # ... and there are few such steps.
    assert np.quantile(place_off, 0.95) < 1e-8
    assert np.quantile(heading_off, 0.95) < 1e-6


def test_place_is_continuous_at_every_joint(ways: list[Way], sampled: Sampler) -> None:
    for way in ways[:40]:
        fine = sampled(way.trajectory, 0.004)
        steps = np.hypot(np.diff(fine.x), np.diff(fine.y))
        assert (steps <= 0.5 * (fine.v[1:] + fine.v[:-1]) * 0.004 + LIMITS.a_max * 0.004**2 + ROUNDING).all()


def test_speed_and_yaw_keep_their_limits_in_between_the_samples_and_at_any_phase_of_them(
    ways: list[Way], sampled: Sampler
) -> None:
    window = round(SAMPLE / STEP)
    for way in ways:
        fine = sampled(way.trajectory, STEP)
        assert fine.v.min() >= 0.0
        assert fine.v.max() <= LIMITS.v_max + ROUNDING
        assert np.abs(fine.w).max() <= LIMITS.w_max + ROUNDING
        assert np.abs(np.diff(fine.v)).max(initial=0.0) <= LIMITS.a_max * STEP + ROUNDING
        assert np.abs(np.diff(fine.w)).max(initial=0.0) <= LIMITS.alpha_max * (0.875 * SAMPLE + STEP) + ROUNDING
        over = np.abs(fine.w[window:] - fine.w[:-window]).max(initial=0.0)
        assert over <= LIMITS.alpha_max * SAMPLE + ROUNDING


def test_the_samples_are_the_motion_every_tenth_of_a_second(ways: list[Way], sampled: Sampler) -> None:
    for way in ways[:50]:
        coarse, fine = sampled(way.trajectory), sampled(way.trajectory, STEP)
        assert len(coarse.x) == int(way.trajectory.n)
        for name in ("x", "y", "heading", "v", "w"):
            every = getattr(fine, name)[: 10 * (len(coarse.x) - 1) : 10]
            assert np.allclose(getattr(coarse, name)[: len(every)], every, atol=ROUNDING), name
            assert getattr(coarse, name)[-1] == getattr(fine, name)[-1], name

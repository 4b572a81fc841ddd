"""Time profiles against ruckig, an independent generator of time-optimal motion: the same times, the same places."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ruckig import InputParameter, Result, Ruckig, Trajectory

from parcours_ramp.planner.messages import PATH, POSE, TRAJECTORY, one
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.profile import along, reachable, trapezoid
from parcours_ramp.planner.route import HOLONOMIC, NEAR, ROUTE
from parcours_ramp.planner.trajectory_generator import generate

Stretch = tuple[float, float, float, float, float]

SAME_TIME = 1e-6
"""Ruckig and the closed form agree on durations to this [s]."""

SAME_PLACE = 1e-6
"""... and on way [m] and speed [m/s] at any time."""


@st.composite
def stretches(draw: st.DrawFn, edge: float = 0.0) -> Stretch:
    """Return (length, v0, v1, cap, acceleration), v1 at least a share `edge` inside of what v0 can reach."""
    length, acceleration = draw(st.floats(0.005, 4.0)), draw(st.floats(0.2, 3.0))
    cap = draw(st.floats(0.05, 1.5))
    v0 = cap * draw(st.sampled_from([0.0, 1.0]) | st.floats(0.0, 1.0))
    least = math.sqrt(max(v0 * v0 - 2.0 * acceleration * length, 0.0))
    most = min(cap, math.sqrt(v0 * v0 + 2.0 * acceleration * length))
    return length, v0, least + (most - least) * draw(st.floats(edge, 1.0 - edge)), cap, acceleration


def fastest(stretch: Stretch, jerk: float = math.inf) -> Trajectory:
    """Return ruckig's time-optimal motion over the stretch."""
    length, v0, v1, cap, acceleration = stretch
    wanted, found = InputParameter(1), Trajectory(1)
    wanted.current_position, wanted.target_position = [0.0], [length]
    wanted.current_velocity, wanted.target_velocity = [v0], [v1]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [cap], [acceleration], [jerk]
    assert Ruckig(1).calculate(wanted, found) in (Result.Working, Result.Finished)
    return found


@given(stretches(1e-6))
def test_a_profile_lasts_as_long_as_ruckig_s_time_optimal_motion(stretch: Stretch) -> None:
    _, up, hold, down = trapezoid(*stretch)
    assert up + hold + down == pytest.approx(fastest(stretch).duration, abs=SAME_TIME)


@given(stretches(1e-6))
def test_way_and_speed_are_ruckig_s_at_every_time_of_the_profile(stretch: Stretch) -> None:
    _, v0, _, _, acceleration = stretch
    peak, up, hold, down = trapezoid(*stretch)
    motion = fastest(stretch)
    for time in np.linspace(0.0, up + hold + down, 41):
        place, speed, _ = motion.at_time(float(time))
        assert along(float(time), v0, peak, up, hold, down, acceleration) == pytest.approx(
            (place[0], speed[0]), abs=SAME_PLACE
        )


@given(stretches(0.05), st.sampled_from([1e3, 1e4]))
def test_a_limit_on_jerk_costs_at_most_a_few_times_the_time_it_needs_to_build_up_the_acceleration(
    stretch: Stretch, jerk: float
) -> None:
    length, v0, v1, _, acceleration = stretch
    _, up, hold, down = trapezoid(*stretch)
    build_up = acceleration / jerk
    assume(length > 20.0 * build_up * max(v0, v1, 0.1))
    assert 0.0 <= fastest(stretch, jerk).duration - (up + hold + down) + SAME_TIME <= 8.0 * build_up


@given(st.floats(0.0, 1.0), st.floats(0.005, 3.0), st.floats(0.2, 3.0))
def test_ruckig_needs_the_whole_length_to_reach_what_is_just_reachable(
    speed: float, length: float, acceleration: float
) -> None:
    top = reachable(speed, length, acceleration)
    motion = fastest((length, speed, top * (1.0 - 1e-9), top + 1.0, acceleration))
    assert motion.duration == pytest.approx((top - speed) / acceleration, abs=1e-4)


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)), min_size=2, max_size=6), st.floats(-3.0, 3.0))
def test_a_way_that_stops_at_each_knot_lasts_as_long_as_ruckig_s_straights_and_turns(
    knots: list[tuple[float, float]], heading: float
) -> None:
    limits = guarded()
    legs = np.diff(np.array(knots), axis=0)
    lengths, towards = np.hypot(*legs.T), np.arctan2(*legs.T[::-1])
    turns = [math.remainder(b - a, math.tau) for a, b in zip([heading, *towards], towards, strict=False)]
    assume(lengths.min() > NEAR and all(NEAR < abs(turn) < math.pi - 1e-6 for turn in turns))
    expected = sum(
        fastest((float(length), 0.0, 0.0, limits.v_max, limits.a_max)).duration
        + fastest((abs(turn), 0.0, 0.0, limits.w_max, limits.alpha_max)).duration
        for length, turn in zip(lengths, turns, strict=True)
    )
    assume(expected < 50.0)
    path, start, trajectory = one(PATH), one(POSE), one(TRAJECTORY)
    path.n = len(knots)
    path.x[: path.n], path.y[: path.n] = np.array(knots).T
    start.x, start.y, start.heading = *knots[0], heading
    generate(path, start, HOLONOMIC, limits.record(), one(ROUTE), trajectory)
    assert trajectory.duration == pytest.approx(expected, abs=1e-5)

"""Generated trajectories: they begin in the start state, end at the goal, and keep every limit in between."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours_ramp.planner.messages import (
    LINE,
    MAX_SAMPLES,
    NO_COLLISION,
    PATH,
    POSE,
    SAMPLE,
    TRAJECTORY,
    TURN,
    one,
)
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.route import HOLONOMIC, HYBRID, NEAR, ROUTE
from parcours_ramp.planner.trajectory import copy_trajectory, place_at, pose_at, samples, shift
from parcours_ramp.planner.trajectory_generator import generate

if TYPE_CHECKING:
    from tests.planners.conftest import Way

LIMITS = guarded()
ROUNDING = 1e-9
Floats = NDArray[np.float64]


def turned(angles: Floats) -> Floats:
    return np.abs(np.remainder(np.diff(angles) + math.pi, math.tau) - math.pi)


def path_of(*knots: tuple[float, float]) -> Record:
    path = one(PATH)
    path.n = len(knots)
    for k, (x, y) in enumerate(knots):
        path.x[k], path.y[k] = x, y
    return path


def trajectory_of(path: Record, heading: float = 0.0, v: float = 0.0, kind: int = HYBRID) -> Record:
    start, trajectory = one(POSE), one(TRAJECTORY)
    start.x, start.y, start.heading, start.v = path.x[0], path.y[0], heading, v
    generate(path, start, kind, LIMITS.record(), one(ROUTE), trajectory)
    return trajectory


def test_every_kind_of_way_is_among_the_random_ones(ways: list[Way]) -> None:
    smooth = [way.kind for way in ways if way.trajectory.smooth and way.start.v > NEAR]
    assert set(smooth) == {0, 1, 2}
    assert any(not way.trajectory.smooth for way in ways)
    assert any(way.trajectory.rest_length > 0.0 for way in ways)
    assert any(way.trajectory.curve_end > 0.0 for way in ways)


def test_a_trajectory_has_between_one_and_501_samples(ways: list[Way]) -> None:
    sizes = [int(way.trajectory.n) for way in ways]
    assert min(sizes) >= 1
    assert max(sizes) <= MAX_SAMPLES


def test_a_trajectory_begins_in_the_start_state(ways: list[Way]) -> None:
    for way in ways:
        first = [way.samples(name)[0] for name in ("x", "y", "v")]
        assert first == pytest.approx([way.start.x, way.start.y, way.start.v], abs=ROUNDING)
        # A heading nearer than NEAR to the one needed is taken to be it.
        assert abs(math.remainder(way.samples("heading")[0] - way.start.heading, math.tau)) <= NEAR


def test_a_trajectory_ends_at_rest_exactly_on_the_goal_when_no_rest_remains(ways: list[Way]) -> None:
    complete = [way for way in ways if way.trajectory.rest_length == 0.0 and way.trajectory.n < MAX_SAMPLES]
    assert len(complete) > 200
    for way in complete:
        last = int(way.path.n) - 1
        end = math.hypot(way.samples("x")[-1] - way.path.x[last], way.samples("y")[-1] - way.path.y[last])
        assert end < ROUNDING
        assert (way.samples("v")[-1], way.samples("w")[-1]) == (0.0, 0.0)


def test_where_a_rest_remains_the_trajectory_ends_on_a_knot_and_the_rest_is_the_polygon_from_there(
    ways: list[Way],
) -> None:
    cut = [way for way in ways if way.trajectory.rest_length > 0.0 and way.trajectory.n < MAX_SAMPLES]
    assert len(cut) > 50
    for way in cut:
        n = int(way.path.n)
        knots = np.stack([way.path.x[:n], way.path.y[:n]], axis=1)
        end = np.array([way.samples("x")[-1], way.samples("y")[-1]])
        k = int(np.argmin(np.hypot(*(knots - end).T)))
        assert np.hypot(*(knots[k] - end)) < ROUNDING
        assert way.trajectory.rest_length == pytest.approx(np.hypot(*np.diff(knots[k:], axis=0).T).sum(), abs=0.05)


def test_speed_and_yaw_rate_keep_their_limits_at_every_sample(ways: list[Way]) -> None:
    for way in ways:
        assert way.samples("v").min() >= 0.0
        assert way.samples("v").max() <= LIMITS.v_max + ROUNDING
        assert np.abs(way.samples("w")).max() <= LIMITS.w_max + ROUNDING


def test_speed_changes_within_the_acceleration_limit(ways: list[Way]) -> None:
    for way in ways:
        assert np.abs(np.diff(way.samples("v"))).max(initial=0.0) <= LIMITS.a_max * SAMPLE + ROUNDING


def test_yaw_rate_changes_within_its_limit_at_every_sample(ways: list[Way]) -> None:
    worst = max(float(np.abs(np.diff(way.samples("w"))).max(initial=0.0)) / SAMPLE for way in ways)
    assert worst <= LIMITS.alpha_max + ROUNDING


def test_a_trajectory_has_no_jump_in_place_or_heading(ways: list[Way]) -> None:
    for way in ways:
        steps = np.hypot(np.diff(way.samples("x")), np.diff(way.samples("y")))
        assert steps.max(initial=0.0) <= LIMITS.v_max * SAMPLE + ROUNDING
        assert turned(way.samples("heading")).max(initial=0.0) <= LIMITS.w_max * SAMPLE + ROUNDING


def test_the_robot_moves_along_its_heading_at_its_speed(ways: list[Way]) -> None:
    for way in ways:
        # Per-sample means differ from the middle by the acceleration within the sample, and by pieces that end in it.
        x, y, v, heading = (way.samples(name)[:-1] for name in ("x", "y", "v", "heading"))
        steps = np.hypot(np.diff(x), np.diff(y))
        assert (
            np.abs(steps - 0.5 * (v[1:] + v[:-1]) * SAMPLE).max(initial=0.0) <= LIMITS.a_max * SAMPLE**2 / 4 + ROUNDING
        )
        moves = steps > 0.01
        course = np.arctan2(np.diff(y), np.diff(x))
        middle = heading[:-1] + 0.5 * (np.remainder(np.diff(heading) + math.pi, math.tau) - math.pi)
        aside = np.abs(np.remainder(course - middle + math.pi, math.tau) - math.pi)[moves]
        assert aside.max(initial=0.0) < 0.08


def test_duration_is_within_one_sample_of_the_samples(ways: list[Way]) -> None:
    for way in ways:
        last = (int(way.trajectory.n) - 1) * SAMPLE
        assert last - SAMPLE - ROUNDING <= way.trajectory.duration <= last + ROUNDING


def test_knots_are_passed_in_order_and_the_last_one_at_the_end(ways: list[Way]) -> None:
    for way in ways:
        if way.trajectory.n == MAX_SAMPLES:
            continue
        times = way.trajectory.knot_time[: int(way.path.n)]
        assert (np.diff(times) >= 0.0).all()
        passed = times[times < NO_COLLISION]
        assert passed[-1] == pytest.approx(way.trajectory.duration, abs=ROUNDING)
        assert (len(passed) == way.path.n) == (way.trajectory.rest_length == 0.0)


@pytest.mark.parametrize("v", [0.001, 0.004, 0.0099])
@pytest.mark.parametrize("heading", [-2.0, 0.15, 0.5, 3.0])
@pytest.mark.parametrize("kind", [HYBRID, HOLONOMIC])
def test_a_robot_that_barely_creeps_is_planned_for_as_one_at_rest(v: float, heading: float, kind: int) -> None:
    creeping = trajectory_of(path_of((0.2, 0.2), (1.2, 0.2), (1.8, 1.5)), heading, v, kind)
    resting = trajectory_of(path_of((0.2, 0.2), (1.2, 0.2), (1.8, 1.5)), heading, 0.0, kind)
    assert creeping.duration + creeping.rest_length / 0.25 == pytest.approx(
        resting.duration + resting.rest_length / 0.25, abs=0.1
    )


def test_a_straight_way_takes_the_time_of_its_trapezoid() -> None:
    trajectory = trajectory_of(path_of((0.0, 0.0), (1.0, 0.0)))
    assert trajectory.duration == pytest.approx(1.0 / 0.25 + 0.25 / 1.0)
    assert trajectory.curve_end == 0.0
    assert not samples(trajectory).y.any()


def test_a_hybrid_way_rounds_its_first_corner_without_a_stop_and_inside_the_corner() -> None:
    trajectory = trajectory_of(path_of((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    states = samples(trajectory)
    assert trajectory.rest_length == 0.0
    assert states.v[1:-4].min() >= 0.1  # but for speeding up and braking at the ends
    assert states.x.max() <= 1.0
    assert np.hypot(states.x - 1.0, states.y).min() > 0.01
    assert states.heading[-1] == pytest.approx(math.pi / 2)


def test_a_holonomic_way_stops_and_rotates_on_every_knot() -> None:
    trajectory = trajectory_of(path_of((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), kind=HOLONOMIC)
    x, y, v, w = (samples(trajectory)[name] for name in ("x", "y", "v", "w"))
    turns = np.abs(w) > 1e-9
    assert turns.any()
    assert not v[turns].any()
    assert x[turns] == pytest.approx(1.0)
    assert y[turns] == pytest.approx(0.0, abs=1e-9)
    assert trajectory.curve_end == 0.0


@pytest.mark.parametrize("heading", [0.31, 1.0, -2.0, 3.0])
def test_a_holonomic_way_rounds_no_corner_though_it_must_begin_with_a_stop(heading: float) -> None:
    trajectory = trajectory_of(path_of((0.2, 0.2), (1.2, 0.2), (1.8, 1.5)), heading, 0.25, HOLONOMIC)
    assert trajectory.smooth == 0
    assert [int(piece.kind) for piece in trajectory.pieces[: trajectory.n_pieces]] == [LINE, TURN, LINE, TURN, LINE]
    assert trajectory.rest_length == 0.0


def test_a_moving_robot_must_stop_for_a_way_that_leads_behind_it() -> None:
    trajectory = trajectory_of(path_of((1.0, 1.0), (0.2, 1.0)), heading=0.0, v=0.25)
    states = samples(trajectory)
    assert trajectory.smooth == 0
    assert states.x.max() == pytest.approx(1.0 + 0.25**2 / 2.0, abs=1e-3)  # it brakes first
    assert (states.x[-1], states.y[-1]) == pytest.approx((0.2, 1.0))


def test_a_moving_robot_overshoots_a_goal_it_cannot_brake_for_and_turns_back_to_it() -> None:
    trajectory = trajectory_of(path_of((1.0, 1.0), (1.02, 1.0)), v=0.25)
    states = samples(trajectory)
    assert trajectory.smooth == 0
    assert states.x.max() == pytest.approx(1.0 + 0.25**2 / 2.0, abs=1e-3)
    assert (states.x[-1], states.y[-1]) == pytest.approx((1.02, 1.0))
    assert np.abs(np.diff(states.v)).max() <= LIMITS.a_max * SAMPLE + ROUNDING


def test_a_way_longer_than_fifty_seconds_is_cut_off_there() -> None:
    corners = [(0.0, 0.0), (2.0, 2.0), (0.0, 0.1), (2.0, 1.9), (0.0, 0.2), (2.0, 1.8), (0.0, 0.3)]
    trajectory = trajectory_of(path_of(*corners), kind=HOLONOMIC)
    assert trajectory.n == MAX_SAMPLES
    assert trajectory.duration == pytest.approx(50.0)


def test_a_pose_between_samples_lies_between_them_and_turns_the_short_way() -> None:
    trajectory = trajectory_of(path_of((0.0, 0.0), (-1.0, -0.1)), heading=3.0, kind=HOLONOMIC)
    states, pose = samples(trajectory), one(POSE)
    assert states.heading[-1] < -3.0  # it turns left, over pi
    for k in range(len(states) - 2):  # the last sample is the end, whenever that is
        before, after = states[k], states[k + 1]
        pose_at(trajectory, (k + 0.5) * SAMPLE, pose)
        for name in ("x", "y"):
            assert min(before[name], after[name]) - ROUNDING <= pose[name] <= max(before[name], after[name]) + ROUNDING
        assert 0.0 <= math.remainder(pose.heading - before.heading, math.tau) <= LIMITS.w_max * SAMPLE
        assert 0.0 <= math.remainder(after.heading - pose.heading, math.tau) <= LIMITS.w_max * SAMPLE
        assert abs(pose.heading) <= math.pi


def test_before_its_begin_a_trajectory_is_where_it_begins_and_after_its_end_it_rests_there(ways: list[Way]) -> None:
    pose = one(POSE)
    for way in ways[:100]:
        first, last = way.states[0], way.states[-1]
        pose_at(way.trajectory, -1.0, pose)
        assert (pose.x, pose.y, pose.heading) == (first.x, first.y, first.heading)
        pose_at(way.trajectory, float(way.trajectory.duration) + 9.0, pose)
        assert (pose.x, pose.y, pose.heading) == (last.x, last.y, last.heading)
        assert way.trajectory.n == MAX_SAMPLES or (pose.v, pose.w) == (0.0, 0.0)


def test_a_place_is_that_of_the_pose(ways: list[Way]) -> None:
    pose = one(POSE)
    for way in ways[:100]:
        for seconds in np.linspace(-0.2, float(way.trajectory.duration) + 0.2, 17):
            pose_at(way.trajectory, seconds, pose)
            assert place_at(way.trajectory, seconds) == (pose.x, pose.y)


def test_what_is_left_of_a_trajectory_is_the_same_motion_at_the_same_times(ways: list[Way]) -> None:
    rng = np.random.default_rng(8)
    for way in ways[:200]:
        first, rest = int(rng.integers(0, way.trajectory.n)), one(TRAJECTORY)
        copy_trajectory(rest, way.trajectory, first)
        left = way.states[first:]
        assert rest.n == len(left)
        for name in ("x", "y", "v", "w"):
            assert np.allclose(samples(rest)[name], left[name], rtol=0.0, atol=ROUNDING), name
        turns = samples(rest).heading - left.heading
        assert np.abs(np.remainder(turns + math.pi, math.tau) - math.pi).max() < ROUNDING
        assert rest.begins == way.trajectory.begins + first * 100_000_000
        assert rest.duration == pytest.approx(way.trajectory.duration - first * SAMPLE, abs=ROUNDING) or len(left) == 1
        again = one(TRAJECTORY)
        copy_trajectory(again, rest, 1)  # a rest of a rest
        assert samples(again).x[-1] == pytest.approx(left.x[-1], abs=ROUNDING)


def test_a_shifted_trajectory_is_elsewhere_and_otherwise_the_same(ways: list[Way]) -> None:
    for way in ways[:50]:
        moved = one(TRAJECTORY)
        copy_trajectory(moved, way.trajectory, 0)
        shift(moved, 0.03, -0.02)
        states = samples(moved)
        assert np.allclose(states.x - 0.03, way.states.x, rtol=0.0, atol=ROUNDING)
        assert np.allclose(states.y + 0.02, way.states.y, rtol=0.0, atol=ROUNDING)
        assert np.array_equal(states.heading, way.states.heading)
        assert np.array_equal(states.v, way.states.v)


def test_the_legs_of_a_trajectory_follow_one_another_and_stray_from_it_no_farther_than_they_say(
    ways: list[Way],
) -> None:
    for way in ways:
        legs = way.trajectory.legs[: way.trajectory.n_legs]
        assert legs["begin"][0] == 0.0
        assert legs["begin"][1:] == pytest.approx(legs["end"][:-1], abs=ROUNDING)
        for leg in legs:
            for share in (0.0, 0.25, 0.5, 0.8, 1.0):
                seconds = leg["begin"] + share * (leg["end"] - leg["begin"])
                if seconds > way.trajectory.duration:
                    continue
                x, y = place_at(way.trajectory, seconds)
                off = math.hypot(leg["x"] + share * leg["dx"] - x, leg["y"] + share * leg["dy"] - y)
                assert off <= leg["stray"] + ROUNDING


def test_a_way_longer_than_50_s_is_cut_and_still_costs_its_time() -> None:
    path, start, trajectory = one(PATH), one(POSE), one(TRAJECTORY)
    path.n = 7
    path.x[:7], path.y[:7] = [0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0], [0.0, 2.0, 0.1, 1.9, 0.2, 1.8, 0.3]
    generate(path, start, HOLONOMIC, LIMITS.record(), one(ROUTE), trajectory)
    length = float(np.hypot(np.diff(path.x[:7]), np.diff(path.y[:7])).sum())
    assert trajectory.n == MAX_SAMPLES and trajectory.duration == 50.0
    assert trajectory.duration + trajectory.rest_length / LIMITS.estimate_v > length / LIMITS.v_max

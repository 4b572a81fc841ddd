"""Measures of one run against closed forms: lines, circles, accelerations, gaps and halts whose answers are known."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from parcours.kernels import Record, kernel
from parcours_navigation.facts import NEVER, TRACK
from parcours_navigation.measures import MEASURES, measures_of
from parcours_navigation.measures.kernel import measure

Floats = NDArray[np.float64]
NOWHERE = (100.0, 0.0)


def drive(
    seconds: float,
    period: float = 0.05,
    x: Callable[[Floats], ArrayLike] = np.zeros_like,
    y: Callable[[Floats], ArrayLike] = np.zeros_like,
    heading: Callable[[Floats], ArrayLike] = np.zeros_like,
    v: Callable[[Floats], ArrayLike] = np.zeros_like,
    w: Callable[[Floats], ArrayLike] = np.zeros_like,
    halted: Callable[[Floats], ArrayLike] = np.zeros_like,
) -> NDArray[np.void]:
    """The track of a robot whose pose and speeds are functions of time."""
    n = round(seconds / period) + 1
    track = np.zeros(n, TRACK)
    track["time"] = np.round(np.arange(n) * period * 1e9).astype(np.int64)
    t = track["time"] * 1e-9
    for name, function in (("x", x), ("y", y), ("heading", heading), ("v", v), ("w", w), ("halted", halted)):
        track[name] = function(t)
    return track


def alone(track: NDArray[np.void], goal: tuple[float, float] = NOWHERE, **options: Any) -> np.void:
    """Its measures without obstacles."""
    return measures_of(track, np.zeros((len(track), 0, 2)), [], robot_radius=0.125, goal=goal, **options)


def beside(track: NDArray[np.void], *obstacles: tuple[ArrayLike, ArrayLike], **options: Any) -> np.void:
    """Its measures with obstacles of radius 0.1 m, each given by its x and y over the track; the robot's is 0.125 m."""
    places = np.zeros((len(track), len(obstacles), 2))
    for k, (x, y) in enumerate(obstacles):
        places[:, k, 0], places[:, k, 1] = x, y
    return measures_of(track, places, np.full(len(obstacles), 0.1), robot_radius=0.125, goal=NOWHERE, **options)


def test_a_straight_line_at_constant_speed() -> None:
    run = alone(drive(4.0, x=lambda t: 0.5 * t, v=lambda t: 0.5 + 0 * t), goal=(2.0, 0.0))
    assert run["duration"] == pytest.approx(4.0)
    assert run["path_length"] == pytest.approx(2.0)
    assert run["displacement"] == pytest.approx(2.0)
    assert run["time_to_goal"] == pytest.approx(3.6)
    assert run["time_to_set_out"] == pytest.approx(0.2)
    assert run["mean_speed"] == pytest.approx(0.5)
    assert run["goal_distance"] == pytest.approx(0.0, abs=1e-12)
    for still in ("time_at_rest", "heading_change", "needed_turn", "smoothness", "squared_acceleration", "mean_jerk"):
        assert run[still] == 0.0, still
    assert run["mean_curvature"] == pytest.approx(0.0, abs=1e-9) and run["roughness"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("period", [0.05, 0.03, 0.2])
def test_a_circle_has_its_curvature_and_its_turn_at_any_sampling(period: float) -> None:
    radius, w = 0.8, 0.6
    run = alone(
        drive(
            15.0,
            period,
            x=lambda t: radius * np.sin(w * t),
            y=lambda t: -radius * np.cos(w * t),
            heading=lambda t: (w * t + np.pi) % (2 * np.pi) - np.pi,
            v=lambda t: radius * w + 0 * t,
            w=lambda t: w + 0 * t,
        )
    )
    assert run["mean_curvature"] == pytest.approx(1 / radius) and run["max_curvature"] == pytest.approx(1 / radius)
    assert run["heading_change"] == pytest.approx(15.0 * w)
    chords = 15.0 / period * 2 * radius * math.sin(w * period / 2)
    assert run["path_length"] == pytest.approx(chords)


def test_roughness_of_a_circle_is_height_over_base_of_its_triangles() -> None:
    step = 0.1
    run = alone(drive(6.0, 0.1, x=lambda t: np.cos(step * t * 10), y=lambda t: np.sin(step * t * 10)))
    height, base = 1 - math.cos(step), 2 * math.sin(step)
    assert run["roughness"] == pytest.approx(height / base)


def test_curvature_does_not_exist_for_a_robot_that_hardly_moves_and_ignores_rests() -> None:
    assert np.isnan(alone(drive(5.0, x=lambda t: 1e-3 * np.sin(99 * t)))["max_curvature"])

    def angle(t: Floats) -> Floats:
        return np.minimum(t, 1.0) + np.maximum(t - 4.0, 0.0)

    jitter = 1e-4
    resting = drive(5.0, x=lambda t: np.cos(angle(t)) + jitter * np.sin(77 * t), y=lambda t: np.sin(angle(t)))
    assert alone(resting)["mean_curvature"] == pytest.approx(1.0, rel=0.02)
    assert alone(resting)["max_curvature"] == pytest.approx(1.0, rel=0.15)


def test_turning_on_the_spot_across_the_cut_of_the_angle_counts_the_turn_only() -> None:
    turning = drive(10.0, heading=lambda t: (-1.0 * t + np.pi) % (2 * np.pi) - np.pi, w=lambda t: -1.0 + 0 * t)
    run = alone(turning, goal=(0.0, 3.0))
    assert run["heading_change"] == pytest.approx(10.0)
    assert run["needed_turn"] == pytest.approx(math.pi / 2)
    assert run["time_at_rest"] == 0.0 and run["path_length"] == 0.0 and np.isnan(run["time_to_set_out"])


def test_accelerating_then_braking() -> None:
    a = 0.4
    run = alone(drive(4.0, v=lambda t: np.where(t < 2, a * t, a * (4 - t))))
    assert run["smoothness"] == pytest.approx(a)
    assert run["squared_acceleration"] == pytest.approx(a * a * 4)
    assert run["mean_speed"] == pytest.approx(a)
    # one jump of the acceleration by 2 a: its jerk is as high as the sampling is dense
    assert run["squared_jerk"] == pytest.approx((2 * a) ** 2 / 0.05)
    assert run["mean_jerk"] == pytest.approx(2 * a / (4 - 0.05))
    twice = alone(drive(4.0, 0.025, v=lambda t: np.where(t < 2, a * t, a * (4 - t))))
    assert twice["squared_jerk"] == pytest.approx(2 * run["squared_jerk"])
    assert twice["squared_acceleration"] == pytest.approx(run["squared_acceleration"])


@pytest.mark.parametrize("period", [0.05, 0.1])
def test_constant_jerk_has_its_value_in_true_units_at_any_sampling(period: float) -> None:
    j = 0.3
    run = alone(drive(6.0, period, v=lambda t: j * t**2 / 2, w=lambda t: j * t**2))
    assert run["mean_jerk"] == pytest.approx(j)
    assert run["squared_jerk"] == pytest.approx(j * j * (6.0 - period))
    assert run["squared_yaw_jerk"] == pytest.approx(4 * j * j * (6.0 - period))
    assert run["squared_acceleration"] == pytest.approx(j * j * 6.0**3 / 3, rel=1e-3)
    assert run["squared_yaw_acceleration"] == pytest.approx(4 * j * j * 6.0**3 / 3, rel=1e-3)


def test_constant_acceleration_has_no_jerk() -> None:
    run = alone(drive(10.0, 0.1, v=lambda t: 0.5 * t))
    assert run["mean_jerk"] == pytest.approx(0.0, abs=1e-9) and run["smoothness"] == pytest.approx(0.5)


def test_speed_through_zero_counts_both_directions() -> None:
    run = alone(drive(2.0, 0.4, v=lambda t: 0.5 * (t - 1.0)))
    assert run["mean_speed"] == pytest.approx(0.25)


def test_time_at_rest_holds_each_entry_until_the_next() -> None:
    run = alone(drive(4.0, v=lambda t: np.where(t < 1.49, 0.3, 0.0)))
    assert run["time_at_rest"] == pytest.approx(2.5)


def test_passing_an_obstacle() -> None:
    track = drive(4.0, 0.01, x=lambda t: 0.5 * t - 1.0, v=lambda t: 0.5 + 0 * t)
    run = beside(track, (0.0, 0.3), (0.0, -5.0))
    assert run["least_clearance"] == pytest.approx(0.075)
    # unsafe while the centres are less than 0.325 m apart
    assert run["time_unsafe"] == pytest.approx(2 * math.sqrt(0.325**2 - 0.3**2) / 0.5, rel=1e-4)
    assert run["time_intimate"] == pytest.approx(2 * math.sqrt(0.675**2 - 0.3**2) / 0.5, rel=1e-4)
    assert run["time_personal"] == pytest.approx(4.0 - run["time_intimate"])
    assert run["time_social"] == pytest.approx(0.0, abs=1e-12)
    mean = (math.hypot(1.0, 0.3) + 0.09 * math.asinh(1.0 / 0.3)) / 2 - 0.225
    assert run["mean_clearance"] == pytest.approx(mean, rel=1e-4)
    assert run["least_time_to_collision"] == math.inf


def test_an_unsafe_stretch_open_at_the_end_counts() -> None:
    track = drive(20.0, 0.1)
    run = beside(track, (np.where(track["time"] < 10e9, 1.0, 0.3), 0.0))
    assert run["time_unsafe"] == pytest.approx(10.0, abs=0.1)


def test_crossings_of_the_safety_distance_are_interpolated() -> None:
    track = drive(2.0, 1.0)
    run = beside(track, ([0.425, 0.225, 0.625], 0.0))
    assert run["time_unsafe"] == pytest.approx(0.5 + 0.25)
    assert beside(track, ([0.425, 0.225, 0.625], 0.0), safe_distance=0.2)["time_unsafe"] == pytest.approx(1.0 + 0.5)


def test_time_to_collision_head_on_past_and_in_overlap() -> None:
    track = drive(2.0, x=lambda t: 0.2 * t)
    meeting = 3.225 - 0.3 * track["time"] * 1e-9
    # closing at 0.5 m/s over 3 m; the last entry with a velocity is 0.05 s before the end
    assert beside(track, (meeting, 0.0))["least_time_to_collision"] == pytest.approx(6.0 - 1.95)
    assert beside(track, (meeting, 0.23))["least_time_to_collision"] == math.inf
    assert beside(track, (5.0 + 0.2 * track["time"] * 1e-9, 0.0))["least_time_to_collision"] == math.inf
    assert beside(track, (0.1, 0.1))["least_time_to_collision"] == 0.0
    off_centre = 3.225 - 0.3 * track["time"] * 1e-9
    reach = math.sqrt(0.225**2 - 0.1**2)
    expected = (3.225 - reach) / 0.5 - 1.95
    assert beside(track, (off_centre, 0.1))["least_time_to_collision"] == pytest.approx(expected)


def test_halts_and_the_way_covered_in_them() -> None:
    def flag(t: Floats) -> ArrayLike:
        return ((t >= 0.99) & (t < 1.49)) | (t >= 1.99)

    run = alone(drive(4.0, x=lambda t: np.minimum(0.2 * t, 0.44), halted=flag))
    assert run["time_halted"] == pytest.approx(2.5)
    assert run["longest_halt"] == pytest.approx(2.0)
    assert run["stop_distance"] == pytest.approx(0.1)


def test_the_goal_is_met_between_entries_and_by_a_chord_that_only_grazes_it() -> None:
    run = alone(drive(3.0, 1.0, x=lambda t: t), goal=(1.5, 0.1), goal_tolerance=0.2)
    assert run["time_to_goal"] == pytest.approx(1.5 - math.sqrt(0.2**2 - 0.1**2))
    assert run["least_goal_distance"] == pytest.approx(0.1)
    assert run["goal_distance"] == pytest.approx(math.hypot(1.5, 0.1))
    assert np.isnan(alone(drive(3.0, 1.0, x=lambda t: t), goal=(1.5, 0.21))["time_to_goal"])
    assert alone(drive(1.0), goal=(0.0, 0.2))["time_to_goal"] == 0.0


def test_the_world_s_time_at_the_goal_holds_where_the_track_ends_before() -> None:
    track = drive(3.0, x=lambda t: t)
    assert np.isnan(alone(track, goal=(3.21, 0.0))["time_to_goal"])
    assert alone(track, goal=(3.21, 0.0), t_goal=3_010_000_000)["time_to_goal"] == pytest.approx(3.01)
    track["time"] += 1_000_000_000
    assert alone(track, goal=(3.21, 0.0), t_goal=4_010_000_000)["time_to_goal"] == pytest.approx(3.01)


def test_a_corner_has_the_curvature_that_the_spacing_gives_it() -> None:
    step = 0.0625
    corner = drive(2.0, 0.125, x=lambda t: np.minimum(t, 1.0) * step / 0.125, y=lambda t: np.maximum(t - 1.0, 0.0) / 2)
    assert alone(corner)["max_curvature"] == pytest.approx(2 * math.sin(math.pi / 4) / step)


@kernel
def _measure_each(runs: Record, buffer: Record, places: Record, radii: Record, gaps: Record, n: int) -> None:
    """Measure the first n entries of a working buffer into the nested record of every run."""
    for k in range(len(runs)):
        measure(buffer[:n], places[:n], radii, 0.125, 2.0, 0.0, 0.2, NEVER, 0.1, gaps, runs[k].measures)


def test_a_kernel_fills_the_same_bits_from_a_working_buffer_into_a_nested_record() -> None:
    track = drive(4.0, x=lambda t: 0.5 * t, v=lambda t: 0.5 + 0 * t, heading=np.sin)
    places = np.tile([1.0, 0.4], (len(track), 1, 1))
    runs = np.zeros(2, np.dtype([("number", "i8"), ("measures", MEASURES)]))
    _measure_each(runs, track, places, np.array([0.1]), np.zeros(0), 41)
    alike = measures_of(track[:41], places[:41], [0.1], robot_radius=0.125, goal=(2.0, 0.0))
    assert runs["measures"][0].tobytes() == runs["measures"][1].tobytes() == alike.tobytes()


def test_what_was_watched_on_can_be_left_out() -> None:
    track = drive(4.0, x=lambda t: 0.5 * t)
    assert alone(track, until=2_000_000_000)["path_length"] == pytest.approx(1.0)


@pytest.mark.parametrize("n", [0, 1])
def test_a_track_without_duration_has_integrals_of_0_and_means_of_nan(n: int) -> None:
    run = beside(drive(1.0)[:n], (np.ones(n), 0.0))
    for name in ("path_length", "time_unsafe", "time_halted", "squared_jerk", "heading_change", "duration"):
        assert run[name] == 0.0, name
    for name in ("mean_clearance", "mean_speed", "mean_jerk", "smoothness", "mean_curvature", "time_to_goal"):
        assert np.isnan(run[name]), name


def test_without_obstacles_the_gap_is_infinite() -> None:
    run = alone(drive(1.0))
    assert run["mean_clearance"] == run["least_clearance"] == run["least_time_to_collision"] == math.inf
    assert run["time_social"] == run["time_unsafe"] == 0.0


def test_an_interval_without_duration_changes_positions_only() -> None:
    track = drive(2.0, 0.5, x=lambda t: t, v=lambda t: t)
    doubled = np.repeat(track, 2)
    for name in ("path_length", "smoothness", "squared_acceleration", "squared_jerk", "mean_jerk", "duration"):
        assert alone(doubled)[name] == pytest.approx(alone(track)[name]), name

"""DWA: what it chooses keeps the dynamic window and can still brake; its arcs against small steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours.elementary import PI, atan2, wrap
from parcours.errors import BadRequest
from parcours_navigation.planners.dwa import Dwa, best_speeds, drive_arc, is_admissible
from parcours_navigation.planners.motion import extrapolate, travel

if TYPE_CHECKING:
    from tests.navigation.planners.conftest import Course

    from parcours_navigation.protocol import Floats


def crowd(rng: np.random.Generator, n: int) -> Floats:
    columns = (rng.uniform(-0.8, 0.8, (n, 2)), rng.uniform(-math.pi, math.pi, (n, 1)), rng.uniform(0.0, 0.5, (n, 1)))
    return np.hstack([*columns, rng.uniform(-1.5, 1.5, (n, 1)), np.full((n, 1), 0.1)])


def random_robot(rng: np.random.Generator) -> Floats:
    return np.array([0.0, 0.0, rng.uniform(-3.0, 3.0), rng.uniform(0.0, 0.25), rng.uniform(-1.5, 1.5)])


def place(obstacle: Floats, t: float) -> tuple[float, float]:
    return travel(obstacle[0], obstacle[1], obstacle[2], obstacle[3], obstacle[4], t)


def gaps_on_arcs(robot: Floats, v: float, w: float, obstacles: Floats, times: Floats) -> Floats:
    """Return the gap to each obstacle at each time [m], shape (n_times, n)."""
    rows = []
    for t in times.tolist():
        x, y = travel(robot[0], robot[1], robot[2], v, w, t)
        places = [place(o, t) for o in obstacles]
        rows.append([math.hypot(ox - x, oy - y) - 0.1 - 0.125 for ox, oy in places])
    return np.array(rows)


def test_a_chosen_speed_can_be_braked_away_before_the_robot_would_run_into_anything(course: Course) -> None:
    rng, task, planner = np.random.default_rng(5), course.task_to(2.0, 0.0), Dwa()
    planner.reset(task)
    times = np.linspace(0.0, 0.1, 6)
    driven = 0
    for _ in range(400):
        robot, obstacles = random_robot(rng), crowd(rng, 4)
        if np.hypot(obstacles[:, 0], obstacles[:, 1]).min() < 0.25:
            continue
        command = course.observe(planner, robot, obstacles, task)
        if command.v <= 0.0:
            continue
        driven += 1
        stop = 0.1 + command.v / 1.0
        gaps = gaps_on_arcs(robot, command.v, command.w, obstacles, times / 0.1 * stop)
        for i in np.flatnonzero(gaps.min(axis=0) < -0.005):
            k = int(np.argmax(gaps[:, i] < 0.0))
            t = times[k] / 0.1 * stop
            x, y = travel(0.0, 0.0, robot[2], command.v, command.w, t)
            ox, oy = place(obstacles[i], t)
            heading = robot[2] + command.w * t
            assert (ox - x) * math.cos(heading) + (oy - y) * math.sin(heading) < 0.03
    assert driven > 100


def test_speeds_out_of_the_dynamic_window_are_not_chosen_but_for_braking(course: Course) -> None:
    rng, task, planner = np.random.default_rng(6), course.task_to(-1.0, 1.5), Dwa(interval=0.1)
    planner.reset(task)
    for _ in range(200):
        robot = random_robot(rng)
        command = course.observe(planner, robot, crowd(rng, 3), task)
        assert command.v == 0.0 or abs(command.v - robot[3]) <= 0.1 + 1e-12
        assert abs(command.w - robot[4]) <= 0.2094 + 1e-12
        assert 0.0 <= command.v <= 0.25 and abs(command.w) <= math.pi / 2


def test_the_contact_of_an_arc_is_that_of_small_steps() -> None:
    rng, touched = np.random.default_rng(7), 0
    fine = np.linspace(0.0, 2.0, 401)
    for _ in range(150):
        robot, obstacles = random_robot(rng), crowd(rng, 2)
        v, w = rng.uniform(0.0, 0.25), rng.uniform(-1.5, 1.5)
        places, reaches = np.empty((41, 2, 2)), np.empty(2)
        n = extrapolate(robot, obstacles, 0.25, 0.125, 0.1, 0.05, places, reaches)
        contact, closing, gap = drive_arc(robot, v, w, places, reaches, n, 0.05, 0.1)
        gaps = gaps_on_arcs(robot, v, w, obstacles, fine).min(axis=1)
        if closing == math.inf:
            assert gap == pytest.approx(min(gaps.min(), 0.1), abs=2e-3)
        if gaps.min() < -0.002:
            touched += 1
            first = fine[np.argmax(gaps < 0.0)]
            assert contact == pytest.approx(first, abs=0.06)
        elif gaps.min() > 0.002:
            assert contact == closing == math.inf
        assert contact <= closing
    assert touched > 30


def best_of_all(
    robot: Floats, limits: Floats, world: tuple[Floats, Floats, int, float], weights: Floats, shape: tuple[int, int]
) -> tuple[float, float]:
    """Return what `best_speeds` returns for a goal at (1, 0.5), by driving every candidate in turn."""
    (places, reaches, n, step), (n_v, n_w) = world, shape
    v_high = max(min(robot[3] + 0.25, 0.25), 0.0)
    v_low = min(max(robot[3] - 0.25, 0.0), v_high)
    w_low, w_high = max(robot[4] - limits[3] * 0.25, -limits[1]), min(robot[4] + limits[3] * 0.25, limits[1])
    best, found = -math.inf, (0.0, 0.0)
    for v in [*(v_high - (v_high - v_low) * i / (n_v - 1) for i in range(n_v)), 0.0]:
        for w in [w_low + (w_high - w_low) * j / (n_w - 1) for j in range(n_w)]:
            contact, closing, gap = drive_arc(robot, v, w, places, reaches, n, step, 0.15)
            if is_admissible(v, closing, limits[2], 0.1):
                x, y = travel(robot[0], robot[1], robot[2], v, w, 0.25)
                heading = robot[2] + w * 0.25 + 0.5 * w * abs(w) / limits[3]
                off = abs(wrap(atan2(0.5 - y, 1.0 - x) - heading))
                value = weights[0] * (1.0 - off / PI) + weights[1] * min(contact / ((len(places) - 1) * step), 1.0)
                value += weights[2] * v / limits[0] + weights[3] * max(gap, 0.0) / 0.15
                if value > best:
                    best, found = value, (v, w)
    return found


@pytest.mark.parametrize(
    "weights", [(1.0, 1.0, 0.8, 0.4), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.3), (0.3, 0.0, 1.0, 2.0)]
)
def test_candidates_that_are_not_driven_are_not_better_nor_earlier_among_equals(weights: tuple[float, ...]) -> None:
    rng, limits = np.random.default_rng(9), np.array([0.25, math.pi / 2, 1.0, 2.0])
    for n in (0, 1, 3, 6, 12) * 6:
        robot, obstacles = random_robot(rng), crowd(rng, n)
        places, reaches = np.empty((11, n, 2)), np.empty(n)
        near = extrapolate(robot, obstacles, 0.25, 0.125, 0.15, 0.2, places, reaches)
        world, memory = (places, reaches, near, 0.2), np.empty((2, 5, 7))
        given = (robot, limits, world, np.array(weights))
        found = best_speeds(robot, (1.0, 0.5), 0.25, limits, world, (0.25, 0.1), given[3], 0.15, memory)
        assert found == best_of_all(*given, (4, 7))


def test_obstacles_left_out_as_too_far_change_nothing() -> None:
    rng = np.random.default_rng(8)
    left_out = 0
    for _ in range(100):
        robot, obstacles = random_robot(rng), crowd(rng, 20)
        obstacles[:, :2] *= 4.0
        places, reaches = np.empty((11, 20, 2)), np.empty(20)
        n = extrapolate(robot, obstacles, 0.25, 0.125, 0.15, 0.2, places, reaches)
        every = np.array([[place(o, 0.2 * k) for o in obstacles] for k in range(11)])
        v, w = rng.uniform(0.0, 0.25), rng.uniform(-1.5, 1.5)
        near = drive_arc(robot, v, w, places, reaches, n, 0.2, 0.15)
        assert near == drive_arc(robot, v, w, every, np.full(20, 0.225), 20, 0.2, 0.15)
        left_out += 20 - n
    assert left_out > 100


def test_a_robot_that_stands_is_admissible_whatever_comes() -> None:
    assert is_admissible(0.0, 0.0, 1.0, 0.1)
    assert is_admissible(0.2, 0.31, 1.0, 0.1)
    assert not is_admissible(0.2, 0.29, 1.0, 0.1)


@pytest.mark.parametrize(("name", "value"), [("n_v", 1), ("n_w", 2.5), ("step", 0.0), ("horizon", 0.1), ("gap", True)])
def test_a_parameter_out_of_its_range_is_refused_by_name(name: str, value: object) -> None:
    parameters = {name: value}
    with pytest.raises(BadRequest, match=rf"planner dwa, {name}: .*\[planner-parameter\]"):
        Dwa(**parameters)  # type: ignore[arg-type]

"""The robot's body: its motion against closed forms, and its limits under any commands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours_navigation.arena.robot import ROBOT, drive

V_MAX, W_MAX, A_MAX, ALPHA_MAX = 0.25, math.pi / 2, 1.0, 2 * math.pi / 3
TICK = 0.01
ROUNDING = 1e-12


def body(v: float = 0.0, w: float = 0.0, heading: float = 0.0) -> Record:
    robot = np.zeros(1, ROBOT).view(np.recarray)[0]
    robot.v, robot.w, robot.heading = v, w, heading
    robot.v_max, robot.w_max, robot.a_max, robot.alpha_max = V_MAX, W_MAX, A_MAX, ALPHA_MAX
    return robot


def driven(robot: Record, v: float, w: float, seconds: float) -> Record:
    robot.command_v, robot.command_w = v, w
    for _ in range(round(seconds / TICK)):
        drive(robot, TICK)
    return robot


def test_a_robot_that_keeps_its_speed_goes_a_straight_line() -> None:
    robot = driven(body(v=0.2, heading=math.pi / 6), 0.2, 0.0, 3.0)
    assert robot.x == pytest.approx(0.6 * math.cos(math.pi / 6), abs=ROUNDING)
    assert robot.y == pytest.approx(0.6 * math.sin(math.pi / 6), abs=ROUNDING)
    assert (robot.v, robot.w) == (0.2, 0.0)


def test_a_robot_that_keeps_speed_and_yaw_rate_goes_an_arc() -> None:
    robot = driven(body(v=0.2, w=0.8), 0.2, 0.8, 2.0)
    assert robot.heading == pytest.approx(1.6, abs=ROUNDING)
    assert robot.x == pytest.approx(0.25 * math.sin(1.6), abs=1e-6)
    assert robot.y == pytest.approx(0.25 * (1.0 - math.cos(1.6)), abs=1e-6)


def test_speeding_up_from_rest_covers_half_the_square_of_time() -> None:
    robot = driven(body(), V_MAX, 0.0, 0.2)
    assert robot.v == pytest.approx(0.2)
    assert robot.x == pytest.approx(0.5 * A_MAX * 0.2**2)


def test_braking_from_top_speed_takes_v_squared_over_twice_the_deceleration() -> None:
    robot = driven(body(v=V_MAX), 0.0, 0.0, 1.0)
    assert robot.v == 0.0
    assert robot.x == pytest.approx(V_MAX**2 / (2 * A_MAX))


def test_a_robot_at_rest_without_command_stays_where_it_is_to_the_bit() -> None:
    robot = body(heading=2.5)
    before = robot.copy()
    driven(robot, 0.0, 0.0, 5.0)
    assert robot.tobytes() == before.tobytes()


speeds = st.floats(-1.0, 1.0)
rates = st.floats(-8.0, 8.0)


@given(st.lists(st.tuples(speeds, rates, st.integers(1, 30)), min_size=1, max_size=12))
def test_no_command_drives_the_robot_beyond_any_of_its_limits(commands: list[tuple[float, float, int]]) -> None:
    robot = body()
    for command_v, command_w, ticks in commands:
        robot.command_v, robot.command_w = command_v, command_w
        for _ in range(ticks):
            x, y, heading, v, w = robot.x, robot.y, robot.heading, robot.v, robot.w
            drive(robot, TICK)
            assert abs(robot.v) <= V_MAX
            assert abs(robot.w) <= W_MAX
            assert abs(robot.v - v) <= A_MAX * TICK + ROUNDING
            assert abs(robot.w - w) <= ALPHA_MAX * TICK + ROUNDING
            assert math.hypot(robot.x - x, robot.y - y) <= V_MAX * TICK + ROUNDING
            assert abs(math.remainder(robot.heading - heading, math.tau)) <= W_MAX * TICK + ROUNDING


@given(speeds, rates)
def test_every_command_within_the_limits_is_reached_in_the_time_the_limits_need(v: float, w: float) -> None:
    robot = driven(body(), v, w, 1.0)
    assert robot.v == pytest.approx(min(max(v, -V_MAX), V_MAX), abs=ROUNDING)
    assert robot.w == pytest.approx(min(max(w, -W_MAX), W_MAX), abs=ROUNDING)

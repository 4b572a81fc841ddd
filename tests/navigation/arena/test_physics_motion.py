"""Motion of robot and obstacles against an integrator of ordinary differential equations and against closed forms."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from parcours.kernels import Record
from parcours_navigation.arena.obstacles import OBSTACLE, place_at
from parcours_navigation.arena.robot import ROBOT, drive

Floats = NDArray[np.float64]

SECOND = 1_000_000_000
TICK = 0.01
V_MAX, W_MAX, A_MAX, ALPHA_MAX = 0.25, math.pi / 2, 1.0, 2 * math.pi / 3

PER_TICK = 3e-8
"""How far one tick at constant speeds may stray [m]: what the body promises."""

PER_TICK_SPEEDING = 2.1e-7
"""... while speeds change: (a w / 12 + v alpha / 12) dt^3 and the above, rounded up."""


def obstacle(heading: float, speed: float, turn: float, start: int = 0, stop: int = 20 * SECOND) -> Record:
    one = np.zeros(1, OBSTACLE).view(np.recarray)[0]
    one.x0, one.y0, one.heading0, one.speed, one.turn = 0.7, 1.9, heading, speed, turn
    one.start, one.stop = start, stop
    return one


def integrated(
    state: list[float], v: Callable[[float], float], w: Callable[[float], float], until: float, since: float = 0.0
) -> Floats:
    """Return the unicycle's (x, y, heading) at `until` [s] from its `state` at `since`, by an integrator of order 8."""

    def rates(time: float, at: Floats) -> list[float]:
        return [v(time) * math.cos(at[2]), v(time) * math.sin(at[2]), w(time)]

    solved = solve_ivp(rates, (since, until), state, method="DOP853", rtol=1e-11, atol=1e-12)
    return np.asarray(solved.y[:, -1])


@settings(max_examples=60)
@given(
    st.floats(-3.1, 3.1), st.floats(0.0, 0.5), st.floats(-1.6, 1.6) | st.sampled_from([0.0, 1e-5, -1e-7, 1e-8]),
    st.floats(0.1, 20.0),
)  # fmt: skip
def test_an_obstacle_is_where_integration_of_its_speed_and_yaw_rate_leads(
    heading: float, speed: float, turn: float, time: float
) -> None:
    x, y, _ = integrated([0.7, 1.9, heading], lambda _: speed, lambda _: turn, time)
    # Nearly straight arcs have centres far away: 0.5 m/s over 1e-8 rad/s loses eight digits.
    assert place_at(obstacle(heading, speed, turn), round(time * SECOND)) == pytest.approx((x, y), abs=3e-8)


@given(st.floats(-3.1, 3.1), st.floats(0.05, 0.5), st.floats(0.3, 1.6), st.booleans())
def test_obstacles_on_circles_pass_the_opposite_point_after_half_a_turn_and_come_back_after_a_whole_one(
    heading: float, speed: float, turn: float, left: bool
) -> None:
    one = obstacle(heading, speed, turn if left else -turn, stop=100 * SECOND)
    side = heading + (math.pi / 2 if left else -math.pi / 2)
    across = 2.0 * speed / turn
    opposite = (0.7 + across * math.cos(side), 1.9 + across * math.sin(side))
    assert place_at(one, round(math.pi / turn * SECOND)) == pytest.approx(opposite, abs=2e-9)
    assert place_at(one, round(math.tau / turn * SECOND)) == pytest.approx((0.7, 1.9), abs=2e-9)


@given(st.floats(0.05, 0.5), st.floats(-1.6, 1.6), st.integers(0, 5 * SECOND), st.integers(1, 5 * SECOND))
def test_an_obstacle_that_has_stopped_is_where_it_was_when_it_stopped(
    speed: float, turn: float, start: int, lasts: int
) -> None:
    one = obstacle(0.4, speed, turn, start, start + lasts)
    x, y, _ = integrated([0.7, 1.9, 0.4], lambda _: speed, lambda _: turn, lasts / SECOND)
    assert place_at(one, start + lasts + 7 * SECOND) == pytest.approx((x, y), abs=1e-7)
    assert place_at(one, start) == (0.7, 1.9)


def body(v: float, w: float, heading: float) -> Record:
    robot = np.zeros(1, ROBOT).view(np.recarray)[0]
    robot.v, robot.w, robot.heading, robot.command_v, robot.command_w = v, w, heading, v, w
    robot.v_max, robot.w_max, robot.a_max, robot.alpha_max = V_MAX, W_MAX, A_MAX, ALPHA_MAX
    return robot


speeds = st.floats(-V_MAX, V_MAX)
rates = st.floats(-W_MAX, W_MAX)


@given(speeds, rates, st.floats(-3.1, 3.1))
def test_one_tick_at_constant_speeds_strays_from_its_arc_by_less_than_promised(
    v: float, w: float, heading: float
) -> None:
    robot = body(v, w, heading)
    drive(robot, TICK)
    half = 0.5 * w * TICK
    chord = v * TICK * np.sinc(half / math.pi)
    assert math.hypot(robot.x - chord * math.cos(heading + half), robot.y - chord * math.sin(heading + half)) < PER_TICK


@settings(max_examples=80)
@given(speeds, rates, speeds, rates, st.floats(-3.1, 3.1))
def test_one_tick_of_changing_speeds_is_the_integral_of_their_ramps(
    v: float, w: float, command_v: float, command_w: float, heading: float
) -> None:
    robot = body(v, w, heading)
    robot.command_v, robot.command_w = command_v, command_w
    drive(robot, TICK)
    v1 = v + min(max(command_v - v, -A_MAX * TICK), A_MAX * TICK)
    w1 = w + min(max(command_w - w, -ALPHA_MAX * TICK), ALPHA_MAX * TICK)
    x, y, turned = integrated(
        [0.0, 0.0, heading], lambda t: v + (v1 - v) * t / TICK, lambda t: w + (w1 - w) * t / TICK, TICK
    )
    assert math.hypot(robot.x - x, robot.y - y) < PER_TICK_SPEEDING
    assert math.remainder(robot.heading - turned, math.tau) == pytest.approx(0.0, abs=1e-12)
    assert (robot.v, robot.w) == pytest.approx((v1, w1), abs=1e-15)


def ramp(start: float, target: float, limit: float) -> Callable[[float], float]:
    """Return the speed over time that goes from start to target at the limit and stays."""
    return lambda t: start + math.copysign(min(abs(target - start), limit * t), target - start)


def area(start: float, target: float, limit: float, time: float) -> float:
    """Return the way made under the ramp."""
    lasts = min(abs(target - start) / limit, time)
    end = start + math.copysign(limit * lasts, target - start)
    return 0.5 * (start + end) * lasts + end * (time - lasts)


@settings(max_examples=40)
@given(speeds, rates, speeds, rates, st.floats(-3.1, 3.1), st.integers(1, 150))
def test_a_new_command_is_obeyed_as_the_limits_allow_in_continuous_time(
    v: float, w: float, command_v: float, command_w: float, heading: float, ticks: int
) -> None:
    robot = body(v, w, heading)
    robot.command_v, robot.command_w = command_v, command_w
    for _ in range(ticks):
        drive(robot, TICK)
    time = ticks * TICK
    to_v, to_w = ramp(v, command_v, A_MAX), ramp(w, command_w, ALPHA_MAX)
    state = [0.0, 0.0, heading]
    kinks = sorted({0.0, time, *(t for t in (abs(command_v - v) / A_MAX, abs(command_w - w) / ALPHA_MAX) if t < time)})
    for begins, ends in itertools.pairwise(kinks):
        state = integrated(state, to_v, to_w, ends, begins).tolist()
    # Where a speed reaches its target within a tick, the body smooths the kink over the tick.
    smoothed = ALPHA_MAX * TICK**2 / 8
    assert math.remainder(robot.heading - state[2], math.tau) == pytest.approx(0.0, abs=smoothed + 1e-12)
    assert state[2] == pytest.approx(heading + area(w, command_w, ALPHA_MAX, time), abs=1e-9)
    off = A_MAX * TICK**2 / 8 + smoothed * V_MAX * time + PER_TICK_SPEEDING * ticks
    assert math.hypot(robot.x - state[0], robot.y - state[1]) < off


def test_a_whole_turn_at_full_speed_closes_to_a_hundredth_of_a_millimetre() -> None:
    robot = body(V_MAX, math.tau / 4.0, 0.0)
    for _ in range(400):
        drive(robot, TICK)
    assert math.hypot(robot.x, robot.y) < 1e-5
    robot = body(V_MAX, math.tau / 4.0, 0.0)
    for _ in range(200):
        drive(robot, TICK)
    assert (robot.x, robot.y) == pytest.approx((0.0, 2.0 * V_MAX / (math.tau / 4.0)), abs=2e-5)

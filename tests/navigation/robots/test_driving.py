"""Every drive against a plain program and its own limits; the unicycle against the arena's, to the bit."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours_navigation.arena.robot import ROBOT, drive
from parcours_navigation.robots.body import command_body
from parcours_navigation.robots.driving import drive_body, world_velocity
from parcours_navigation.robots.kinds import PRESETS, Body

TICK = 0.01
WHEELED = Body(
    "differential", speed=1.0, yaw_rate=2.0, track_width=0.3, wheel_speed=0.9, wheel_acceleration=2.0
)  # fmt: skip
CAR = Body("car", speed=2.0, yaw_rate=3.0, acceleration=3.0, wheelbase=0.5, steering=0.5, steering_rate=1.5)
OMNI = Body("holonomic", speed=0.8, yaw_rate=1.5, acceleration=1.5)
UNICYCLE = Body()
BODIES = [UNICYCLE, WHEELED, CAR, OMNI]

commands = st.lists(
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-5.0, 5.0), st.integers(1, 40)),
    min_size=1,
    max_size=8,
)


def towards(value: float, target: float, reach: float) -> float:
    return max(value - reach, min(value + reach, target))


def clip(value: float, most: float) -> float:
    return max(-most, min(most, value))


class Twin:
    """The same body with complex numbers and the machine's sin, cos, tan; a tick's ends are averaged."""

    def __init__(self, body: Body) -> None:
        self.body, self.at, self.heading = body, 0j, 0.3
        self.v, self.w = 0j, 0.0
        self.wheels, self.steering = [0.0, 0.0], 0.0

    def tick(self, vx: float, vy: float, w: float) -> None:
        b, before = self.body, (self.v, self.w)
        if b.kind != "holonomic":
            w, vy = w + vy / b.radius, 0.0
        mean_w = None
        if b.kind == "unicycle":
            self.v = towards(self.v.real, clip(vx, b.speed), b.acceleration * TICK) + 0j
            self.w = towards(self.w, clip(w, b.yaw_rate), b.yaw_acceleration * TICK)
        elif b.kind == "differential":
            v, w = clip(vx, b.speed), clip(w, b.yaw_rate)
            aims = [v - w * b.track_width / 2, v + w * b.track_width / 2]
            scale = max(1.0, max(map(abs, aims)) / b.wheel_speed)
            self.wheels = [
                towards(now, aim / scale, b.wheel_acceleration * TICK)
                for now, aim in zip(self.wheels, aims, strict=True)
            ]
            self.v, self.w = sum(self.wheels) / 2 + 0j, (self.wheels[1] - self.wheels[0]) / b.track_width
        elif b.kind == "car":
            v, w = clip(vx, b.speed), clip(w, b.yaw_rate)
            aim = math.atan2(w * b.wheelbase * (1 if v >= 0 else -1), abs(v)) if v or w else self.steering
            steering = towards(self.steering, clip(aim, b.steering), b.steering_rate * TICK)
            self.v = towards(self.v.real, v, b.acceleration * TICK) + 0j
            mean_w = (self.v + before[0]).real / 2 * math.tan((self.steering + steering) / 2) / b.wheelbase
            self.steering, self.w = steering, self.v.real * math.tan(steering) / b.wheelbase
        else:
            aim_v = complex(vx, vy)
            aim_v /= max(1.0, abs(aim_v) / b.speed)
            change = aim_v - self.v
            self.v += change / max(1.0, abs(change) / (b.acceleration * TICK))
            self.w = towards(self.w, clip(w, b.yaw_rate), b.yaw_acceleration * TICK)
        if mean_w is None:
            mean_w = (self.w + before[1]) / 2
        self.at += (self.v + before[0]) / 2 * TICK * cmath.rect(1.0, self.heading + mean_w * TICK / 2)
        self.heading += mean_w * TICK


@pytest.mark.parametrize("body", BODIES, ids=lambda body: str(body.kind))
@settings(max_examples=60)
@given(given_=commands)
def test_a_body_goes_as_the_plain_program_says(body: Body, given_: list[tuple[float, float, float, int]]) -> None:
    record, twin = body.record(0.0, 0.0, 0.3), Twin(body)
    for vx, vy, w, ticks in given_:
        command_body(record, vx, vy, w)
        for _ in range(ticks):
            drive_body(record, TICK)
            twin.tick(vx, vy, w)
    assert (record.x, record.y) == pytest.approx((twin.at.real, twin.at.imag), abs=1e-10)
    assert math.remainder(record.heading - twin.heading, math.tau) == pytest.approx(0.0, abs=1e-10)
    assert (record.v, record.vy, record.w) == pytest.approx((twin.v.real, twin.v.imag, twin.w), abs=1e-11)
    assert (record.believed_x, record.believed_y, record.believed_heading) == (record.x, record.y, record.heading)


@given(commands)
def test_the_unicycle_has_the_bits_of_the_arena(given_: list[tuple[float, float, float, int]]) -> None:
    body = UNICYCLE.record(0.1, -0.2, 2.9, 0.05)
    robot = np.zeros(1, ROBOT).view(np.recarray)[0]
    for name in ROBOT.names or ():
        robot[name] = body[name]
    for v, _, w, ticks in given_:
        command_body(body, v, 0.0, w)
        robot.command_v, robot.command_w = v, w
        for _ in range(ticks):
            drive_body(body, TICK)
            drive(robot, TICK)
            assert all(body[name].tobytes() == robot[name].tobytes() for name in ROBOT.names or ())


@pytest.mark.parametrize("body", BODIES, ids=lambda body: str(body.kind))
@given(given_=commands)
def test_no_command_drives_a_body_beyond_its_limits(body: Body, given_: list[tuple[float, float, float, int]]) -> None:
    record, slack = body.record(0.0, 0.0, 0.3), 1e-12
    for vx, vy, w, ticks in given_:
        command_body(record, vx, vy, w)
        for _ in range(ticks):
            before = record.copy()
            drive_body(record, TICK)
            assert math.hypot(record.v, record.vy) <= body.speed + slack
            way = math.hypot(record.x - before.x, record.y - before.y)
            assert way <= body.speed * TICK + slack
            turn = abs(math.remainder(record.heading - before.heading, math.tau))
            if body.kind != "car":
                assert abs(record.w) <= body.yaw_rate + slack
                assert turn <= body.yaw_rate * TICK + slack
            if body.kind == "differential":
                for name in ("left", "right"):
                    assert abs(record[name]) <= body.wheel_speed + slack
                    assert abs(record[name] - before[name]) <= body.wheel_acceleration * TICK + slack
            else:
                change = math.hypot(record.v - before.v, record.vy - before.vy)
                assert change <= body.acceleration * TICK + slack
            if body.kind in ("unicycle", "holonomic"):
                assert abs(record.w - before.w) <= body.yaw_acceleration * TICK + slack
            if body.kind == "car":
                assert abs(record.steering) <= body.steering + slack
                assert abs(record.steering - before.steering) <= body.steering_rate * TICK + slack
                assert turn * body.turning_radius <= way * (1.0 + 1e-6) + slack


def driven(body: Body, v: float, w: float, seconds: float, vy: float = 0.0, **start: Any) -> Record:
    record = body.record(0.0, 0.0, 0.0, **start)
    command_body(record, v, vy, w)
    for _ in range(round(seconds / TICK)):
        drive_body(record, TICK)
    return record


@pytest.mark.parametrize("w", [1.0, 3.0])
def test_a_car_goes_round_a_circle_no_tighter_than_its_turning_radius(w: float) -> None:
    record = driven(CAR, 1.0, w, 3.0)
    radius = max(1.0 / w, CAR.turning_radius)
    assert CAR.turning_radius == pytest.approx(0.5 / math.tan(0.5))
    command_body(record, 1.0, 0.0, w)
    places = []
    for _ in range(round(2.0 * math.pi * radius / TICK)):
        drive_body(record, TICK)
        places.append((record.x, record.y))
    across = max(math.dist(a, b) for a in places[::5] for b in places[::5])
    assert across == pytest.approx(2.0 * radius, rel=2e-3)
    assert record.w == pytest.approx(1.0 / radius)


def test_a_car_cannot_turn_on_the_spot() -> None:
    record = driven(CAR, 0.0, 2.0, 3.0)
    assert (record.x, record.y, record.heading, record.w) == (0.0, 0.0, 0.0, 0.0)
    assert record.steering == CAR.steering


def test_a_car_in_reverse_turns_as_it_was_told() -> None:
    record = driven(CAR, -1.0, 0.8, 2.0)
    assert record.v == -1.0
    assert record.w == pytest.approx(0.8)
    assert record.steering < 0.0


def test_a_wheel_that_is_asked_too_much_keeps_the_curve() -> None:
    record = driven(WHEELED, 1.0, 1.0, 3.0)
    assert record.right == pytest.approx(0.9)
    assert record.w / record.v == pytest.approx(1.0)


def test_two_wheels_reach_their_speeds_one_by_one() -> None:
    record = driven(WHEELED, 0.4, 2.0, 0.06)
    assert (record.left, record.right) == pytest.approx((0.1, 0.12))


def test_a_holonomic_body_goes_sideways_and_turns_at_once() -> None:
    record = driven(OMNI, 0.0, 0.5, 4.0, vy=0.6)
    assert (record.v, record.vy, record.w) == pytest.approx((0.0, 0.6, 0.5))
    vx, vy = world_velocity(record)
    assert (vx, vy) == pytest.approx((-0.6 * math.sin(record.heading), 0.6 * math.cos(record.heading)))


def test_another_body_follows_a_velocity_with_the_point_ahead_of_it() -> None:
    record, ahead = UNICYCLE.record(0.0, 0.0, 0.0), []
    for k in range(3000):
        s, c = math.sin(record.heading), math.cos(record.heading)
        command_body(record, 0.1 * s, 0.1 * c, 0.0)  # the world's y, as seen from the body
        drive_body(record, TICK)
        if k > 300:
            ahead.append((record.x + 0.125 * math.cos(record.heading), record.y + 0.125 * math.sin(record.heading)))
    assert max(abs(x - ahead[-1][0]) for x, _ in ahead[1000:]) < 1e-3
    assert ahead[-1][1] - ahead[0][1] == pytest.approx(0.1 * TICK * (len(ahead) - 1), rel=0.01)


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.15, 1.0])
def test_a_command_takes_effect_after_the_delay(delay: float) -> None:
    record, seen = Body(delay=delay).record(0.0, 0.0, 0.0), []
    for k in range(150):
        command_body(record, 0.001 * k, 0.0, 0.0)
        drive_body(record, TICK)
        seen.append(float(record.command_v))
    late = round(delay / TICK)
    assert seen == [0.0] * late + [0.001 * k for k in range(150 - late)]


@pytest.mark.parametrize("name", PRESETS)
def test_robots_that_exist_drive_forward_and_say_what_they_can_do(name: str) -> None:
    body = PRESETS[name]
    record = driven(body, body.limits.speed, 0.0, 4.0)
    assert record.v == pytest.approx(body.limits.speed)
    assert record.y == 0.0
    assert body.robot.kind == body.kind
    if body.footprint:
        assert body.robot.footprint is not None
        assert np.linalg.norm(body.robot.footprint, axis=1).max() <= body.radius

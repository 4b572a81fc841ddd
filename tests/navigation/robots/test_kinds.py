"""Robots that cannot be: each is refused by what is wrong with it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from parcours.errors import BadRequest
from parcours_navigation.robots.kinds import PRESETS, Body, Odometry

SQUARE = ((0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1))
STAR = tuple((math.cos(0.8 * math.pi * k), math.sin(0.8 * math.pi * k)) for k in range(5))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "tank"}, r"robot, kind: must be a known name, but 'tank' was given.*\[robot-kind\]"),
        ({"radius": 0.0}, r"robot, radius: it must lie in 0.001 to 100 m, but is 0; .*\[robot-range\]"),
        ({"speed": "fast"}, r"robot, speed: it must be a number from 0.001 to 100 m/s, but is 'fast'"),
        ({"speed": math.nan}, r"robot, speed: it must lie in"),
        ({"delay": 1.5}, r"robot, delay: it must lie in 0 to 1 s, but is 1.5"),
        ({"kind": "differential"}, r"robot, track_width: it must lie in 0.001 to 100 m, but is 0"),
        ({"kind": "car"}, r"robot, wheelbase: it must lie in"),
        ({"kind": "car", "wheelbase": 1.0, "steering": 1.6}, r"robot, steering: it must lie in 0.001 to 1.5 rad"),
        ({"footprint": ((0.0, 0.0), (0.1, 0.0))}, r"robot, footprint: it must be three corners .*\[robot-footprint\]"),
        ({"footprint": SQUARE[::-1], "radius": 0.2}, r"its corners must go round a convex polygon counter-clockwise"),
        ({"footprint": STAR, "radius": 1.0}, r"robot, footprint: its corners must go round once"),
        ({"footprint": SQUARE, "radius": 0.1}, r"the circle round it must hold all corners, but .* is outside 0.1 m"),
    ],
)
def test_a_body_that_cannot_be_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(BadRequest, match=message):
        Body(**values)


@pytest.mark.parametrize(("name", "value"), [("way_noise", -0.1), ("way_scale", 0.7), ("turn_noise", math.inf)])
def test_odometry_out_of_range_is_refused(name: str, value: float) -> None:
    with pytest.raises(BadRequest, match=rf"robot, odometry, {name}: it must lie in .*\[robot-range\]"):
        Odometry(**{name: value})


def test_what_planners_are_told_of_a_differential_drive_follows_from_its_wheels() -> None:
    limits = PRESETS["turtlebot3-burger"].limits
    assert limits.speed == 0.22
    assert limits.yaw_rate == 2.84
    assert limits.yaw_acceleration == pytest.approx(2.5 / 0.08)

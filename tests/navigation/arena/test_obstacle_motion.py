"""Obstacles: their closed-form motion against a slow integration, and when they move at all."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours_navigation.arena.obstacles import OBSTACLE, move, place_at

SECOND = 1_000_000_000


def obstacle(
    x: float = 0.0, y: float = 0.0, heading: float = 0.0, speed: float = 0.0, turn: float = 0.0,
    start: float = 0.0, stop: float = 10.0,
) -> Record:  # fmt: skip
    one = np.zeros(1, OBSTACLE).view(np.recarray)[0]
    one.x0, one.y0, one.heading0, one.speed, one.turn = x, y, heading, speed, turn
    one.start, one.stop, one.radius = round(start * SECOND), round(stop * SECOND), 0.1
    return one


def integrated(one: Record, seconds: float, steps: int = 4000) -> tuple[float, float]:
    """Sum the velocity over the time the obstacle moves, by the midpoint rule."""
    elapsed = max(min(seconds, one.stop / SECOND) - one.start / SECOND, 0.0)
    middle = (np.arange(steps) + 0.5) * elapsed / steps
    heading = one.heading0 + one.turn * middle
    way = one.speed * elapsed / steps
    return float(one.x0 + (way * np.cos(heading)).sum()), float(one.y0 + (way * np.sin(heading)).sum())


turns = st.floats(-math.pi / 2, math.pi / 2) | st.sampled_from([0.0, 1e-8, -1e-8, 1e-6, 2e-9])


@settings(max_examples=60)
@given(
    st.floats(-math.pi, math.pi), st.floats(0.0, 0.5), turns, st.floats(0.0, 10.0), st.floats(0.0, 10.0),
    st.floats(0.0, 21.0),
)  # fmt: skip
def test_the_closed_form_is_the_integral_of_the_velocity(
    heading: float, speed: float, turn: float, start: float, lasts: float, now: float
) -> None:
    one = obstacle(0.7, 1.9, heading, speed, turn, start, start + lasts)
    assert place_at(one, round(now * SECOND)) == pytest.approx(integrated(one, now), abs=3e-7)


@given(st.floats(0.0, 0.5), turns, st.integers(0, 21 * SECOND))
def test_where_an_obstacle_is_does_not_depend_on_how_often_anybody_looked(speed: float, turn: float, now: int) -> None:
    looked_at = obstacle(1.0, 1.0, 0.3, speed, turn, 2.0, 9.0)
    for k in range(7):
        move(looked_at, now * k // 7)
    move(looked_at, now)
    assert (looked_at.x, looked_at.y) == place_at(obstacle(1.0, 1.0, 0.3, speed, turn, 2.0, 9.0), now)


def test_an_obstacle_stands_then_moves_then_stands_again() -> None:
    one = obstacle(speed=0.4, turn=0.0, start=2.0, stop=5.0)
    seen = []
    for now in (0.0, 1.999999999, 2.0, 3.0, 4.999999999, 5.0, 20.0):
        move(one, round(now * SECOND))
        seen.append((one.v, round(one.x, 6)))
    assert seen == [(0.0, 0.0), (0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.4, 1.2), (0.0, 1.2), (0.0, 1.2)]


def test_a_turning_obstacle_heads_along_its_own_way() -> None:
    one = obstacle(speed=0.3, turn=-0.9, stop=4.0)
    for now in np.linspace(0.2, 3.8, 10):
        move(one, round((now - 1e-4) * SECOND))
        x, y, heading = one.x, one.y, one.heading
        move(one, round((now + 1e-4) * SECOND))
        towards = math.atan2(one.y - y, one.x - x)
        assert math.remainder(towards - 0.5 * (heading + one.heading), math.tau) == pytest.approx(0.0, abs=1e-6)
        assert (one.v, one.w) == (0.3, -0.9)

"""Contact and clearance between two ticks, against fine sampling, and who is to blame."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours_navigation.arena.contact import (
    AT_REST,
    BOTH_CLOSED,
    OBSTACLE_CLOSED,
    ROBOT_CLOSED,
    contact_share,
    least_distance,
    who_closed,
)

places = st.floats(-2.0, 2.0)


def sampled(x0: float, y0: float, x1: float, y1: float, n: int = 4001) -> np.ndarray:
    """Return the distances from the origin along the segment, ends included."""
    share = np.linspace(0.0, 1.0, n)
    return np.hypot(x0 + share * (x1 - x0), y0 + share * (y1 - y0))


@given(places, places, places, places)
def test_least_distance_is_what_fine_sampling_finds(x0: float, y0: float, x1: float, y1: float) -> None:
    distances = sampled(x0, y0, x1, y1)
    spacing = math.hypot(x1 - x0, y1 - y0) / 4000
    found = least_distance(x0, y0, x1, y1)
    assert found <= distances.min() + 1e-12
    assert found >= distances.min() - spacing - 1e-12


@given(places, places, places, places, st.floats(0.05, 1.0))
def test_contact_comes_at_the_first_moment_within_reach(
    x0: float, y0: float, x1: float, y1: float, reach: float
) -> None:
    share = contact_share(x0, y0, x1, y1, reach)
    distances = sampled(x0, y0, x1, y1)
    if share == 2.0:
        assert distances.min() >= reach - 1e-9
        return
    assert 0.0 <= share <= 1.0
    at = math.hypot(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
    assert at <= reach + 1e-9
    if share > 0.0:
        assert at == pytest.approx(reach, abs=1e-9)
    before = distances[: math.ceil(share * 4000)]
    assert before.size == 0 or before.min() >= reach - 1e-9


def test_bodies_that_pass_each_other_within_one_tick_are_caught_in_the_act() -> None:
    # Clear at both instants, in the middle one through the other.
    assert least_distance(-1.0, 0.01, 1.0, -0.01) == pytest.approx(0.0, abs=1e-12)
    assert contact_share(-1.0, 0.0, 1.0, 0.0, 0.225) == pytest.approx((1.0 - 0.225) / 2.0)


def test_bodies_that_touch_and_part_again_are_in_contact_at_once_and_those_that_only_part_never() -> None:
    assert contact_share(0.1, 0.0, 1.0, 0.0, 0.225) == 0.0
    assert contact_share(0.3, 0.0, 1.0, 0.0, 0.225) == 2.0
    assert contact_share(0.3, 0.0, 0.3, 0.0, 0.225) == 2.0


EAST, WEST, NORTH, STILL = (0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, 0.0)
CREEPS = (0.9 * AT_REST, 0.0)


@pytest.mark.parametrize(
    ("robot", "obstacle", "closer"),
    [
        (EAST, WEST, BOTH_CLOSED),
        (EAST, STILL, ROBOT_CLOSED),
        (EAST, (0.1, 0.0), ROBOT_CLOSED),  # the robot runs into the back of a slower obstacle
        (EAST, NORTH, ROBOT_CLOSED),
        (STILL, WEST, OBSTACLE_CLOSED),
        (CREEPS, WEST, OBSTACLE_CLOSED),
        (CREEPS, STILL, OBSTACLE_CLOSED),
        (WEST, (-0.3, 0.0), OBSTACLE_CLOSED),  # the obstacle runs into the back of a robot that flees
        (NORTH, WEST, OBSTACLE_CLOSED),
        ((0.1, 0.2), (-0.1, 0.2), BOTH_CLOSED),
    ],
)
def test_who_closed_the_gap_is_whose_velocity_points_at_the_other(
    robot: tuple[float, float], obstacle: tuple[float, float], closer: int
) -> None:
    for angle in (0.0, 0.7, 2.0, -2.9):
        c, s = math.cos(angle), math.sin(angle)
        turned = [(c * x - s * y, s * x + c * y) for x, y in ((0.2, 0.0), robot, obstacle)]
        if robot == NORTH or obstacle == NORTH:  # exactly across: only as given, since rounding decides otherwise
            turned = [(0.2, 0.0), robot, obstacle]
        assert who_closed(*turned[0], *turned[1], *turned[2]) == closer

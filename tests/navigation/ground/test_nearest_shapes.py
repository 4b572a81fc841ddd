"""What is near a place, against a list of all shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import plain_ground as plain
from parcours_navigation.ground.ground import Ground, lay_ground
from parcours_navigation.ground.nearest_shapes import FOUND, nearest_point, walls_within

near = st.floats(-2.0, 10.0) | st.integers(-2, 18).map(lambda k: 0.5 * k)


def listed(ground: Ground, x: float, y: float) -> list[tuple[float, list[float]]]:
    """Return the distance and numbers of every shape."""
    edges = np.concatenate([ground.solid_edges(), ground.segments]).tolist()
    found = [(plain.to_segment((x, y), (a, b), (c, d)), [a, b, c, d, 0.0]) for a, b, c, d in edges]
    return found + [(math.hypot(x - a, y - b) - r, [a, b, a, b, r]) for a, b, r in ground.discs.tolist()]


@settings(max_examples=200)
@given(plain.grounds(), near, near)
def test_the_nearest_point_is_as_near_as_the_nearest_shape_and_lies_on_one(ground: Ground, x: float, y: float) -> None:
    shapes = listed(ground, x, y)
    distance, px, py = nearest_point(ground.pack(), x, y)
    assert distance == pytest.approx(min((far for far, _ in shapes), default=math.inf), abs=1e-12)
    if shapes:
        assert math.hypot(x - px, y - py) == pytest.approx(abs(distance), abs=1e-12)
        assert min(abs(far) for far, _ in listed(ground, px, py)) < 1e-12


@settings(max_examples=200)
@given(plain.grounds(), near, near, st.floats(0.0, 4.0), st.integers(0, 20))
def test_walls_within_reach_are_all_there_once_nearest_first(
    ground: Ground, x: float, y: float, reach: float, room: int
) -> None:
    into = np.full((room, FOUND), np.nan)
    n = walls_within(ground.pack(), x, y, reach, into)
    shapes = {tuple(shape): far for far, shape in listed(ground, x, y)}  # the same wall twice counts once
    inside = sorted(far for far in shapes.values() if far < reach)
    if any(abs(far - reach) < 1e-9 for far in shapes.values()):
        return
    assert n == min(len(inside), room)
    np.testing.assert_allclose(into[:n, 5], inside[:n], atol=1e-12)
    rows = [tuple(row) for row in into[:n, :5].tolist()]
    assert len(set(rows)) == n
    assert [shapes[row] for row in rows] == pytest.approx(into[:n, 5].tolist(), abs=1e-12)


def test_where_there_is_nothing_nothing_is_near() -> None:
    packed = lay_ground().pack()
    assert nearest_point(packed, 1.0, 2.0) == (math.inf, 1.0, 2.0)
    assert walls_within(packed, 1.0, 2.0, 9.0, np.empty((3, FOUND))) == 0


def test_the_rim_of_a_disc_is_what_is_near_also_from_within() -> None:
    packed = lay_ground(discs=[[0.0, 0.0, 1.0]]).pack()
    assert nearest_point(packed, 0.0, 3.0) == (2.0, 0.0, 1.0)
    assert nearest_point(packed, 0.0, 0.5) == (-0.5, 0.0, 1.0)
    assert nearest_point(packed, 0.0, 0.0) == (-1.0, 1.0, 0.0)

"""Walls: the nearest one and those in reach, against a plain search."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from parcours_navigation.others.walls import FOUND, nearest, walls_within

coordinates = st.floats(-10.0, 10.0)
segments = st.lists(st.tuples(coordinates, coordinates, coordinates, coordinates), max_size=12)


def distance(segment: tuple[float, ...], x: float, y: float) -> float:
    ax, ay, bx, by = segment
    length = (bx - ax) ** 2 + (by - ay) ** 2
    t = 0.0 if length == 0.0 else max(0.0, min(1.0, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length))
    return math.hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay))


@given(segments, coordinates, coordinates)
def test_the_nearest_wall_is_the_one_that_a_plain_search_finds(
    walls: list[tuple[float, float, float, float]], x: float, y: float
) -> None:
    found, wx, wy = nearest(np.array(walls).reshape(-1, 4), x, y)
    assert math.isclose(found, min((distance(w, x, y) for w in walls), default=math.inf), abs_tol=1e-12)
    if walls:
        assert math.isclose(math.hypot(x - wx, y - wy), found, abs_tol=1e-12)


@given(segments, coordinates, coordinates, st.floats(0.0, 12.0), st.integers(1, 5))
def test_walls_in_reach_come_nearest_first_and_the_farthest_are_left_out(
    walls: list[tuple[float, float, float, float]], x: float, y: float, reach: float, room: int
) -> None:
    into = np.empty((room, FOUND))
    n = walls_within(np.array(walls).reshape(-1, 4), x, y, reach, into)
    expected = sorted(d for d in (distance(w, x, y) for w in walls) if d < reach)[:room]
    assert np.allclose(into[:n, 5], expected, atol=1e-12)
    for row in into[:n]:
        assert math.isclose(distance(tuple(row[:4]), x, y), row[5], abs_tol=1e-12)


def test_without_walls_the_nearest_one_is_infinitely_far() -> None:
    assert nearest(np.empty(0), 1.0, 2.0)[0] == math.inf
    assert walls_within(np.empty((0, 4)), 0.0, 0.0, 1.0, np.empty((1, FOUND))) == 0

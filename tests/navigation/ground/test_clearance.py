"""Clearance, ways, touches and sight against naive twins that look at every shape."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import plain_ground as plain
from parcours_navigation.ground.clearance import at_least, clearance, depth_at, first_touch, least_on_way, sees
from parcours_navigation.ground.footprint import footprint_least
from parcours_navigation.ground.ground import Ground, lay_ground
from parcours_navigation.ground.packing import CELL
from parcours_navigation.ground.shapes import enters_capsule, enters_disc

near = st.floats(-1.0, 9.0) | st.integers(-2, 18).map(lambda k: 0.5 * k)
anywhere = near | st.floats(-50.0, 50.0)
short = st.floats(-0.3, 0.3) | st.floats(-9.0, 9.0)


@settings(max_examples=300)
@given(plain.grounds(), anywhere, anywhere)
def test_clearance_is_what_looking_at_every_shape_finds(ground: Ground, x: float, y: float) -> None:
    found = clearance(ground.pack(), x, y)
    wanted = plain.clearance(ground, (x, y))
    if abs(abs(found) - abs(wanted)) < 1e-12 and abs(found) < 1e-12:
        return  # on an edge: either side
    assert found == pytest.approx(wanted, abs=1e-12)


@settings(max_examples=200)
@given(plain.grounds(), st.integers(0, 2**32))
def test_the_bound_of_the_field_is_never_above_clearance_and_near_it_on_the_grid(ground: Ground, seed: int) -> None:
    packed = ground.pack()
    for x, y in np.random.default_rng(seed).uniform(-3.0, 11.0, (40, 2)):
        bound, true = at_least(packed, x, y), clearance(packed, x, y)
        assert bound <= true
        if len(packed) and -0.5 < x < 8.5 and -0.5 < y < 8.5 and ground.bounds is not None:
            assert bound >= true - 1.5 * packed[CELL]


@settings(max_examples=300)
@given(plain.grounds(), near, near, short, short, st.floats(0.0, 0.6), st.floats(-0.2, 2.0) | st.just(math.inf))
def test_the_least_clearance_on_a_way_is_what_looking_at_every_shape_finds(
    ground: Ground, x: float, y: float, dx: float, dy: float, radius: float, enough: float
) -> None:
    found = least_on_way(ground.pack(), x, y, x + dx, y + dy, radius, enough)
    wanted = plain.least_on_way(ground, (x, y), (x + dx, y + dy), radius)
    if wanted > enough + 1e-12:
        assert found > enough
    elif found <= enough or wanted < enough - 1e-12:
        assert found == pytest.approx(wanted, abs=1e-12)


def test_the_deeper_of_two_discs_on_a_long_way_counts() -> None:
    two = lay_ground(discs=[[0.0, 0.0, 0.6], [4.0, 0.0, 1.0]]).pack()
    assert least_on_way(two, 0.0, 0.0, 4.0, 0.0, 0.1, math.inf) == pytest.approx(-1.1, abs=1e-12)
    square = np.array([[0.1, -0.1], [0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]])
    assert footprint_least(two, square, 0.0, 0.0, 0.0, 4.0, 0.0, 1.0, math.inf) == pytest.approx(-1.1, abs=1e-12)


@settings(max_examples=300)
@given(plain.grounds(), near, near, short, short, st.floats(0.01, 0.6))
def test_a_disc_touches_first_where_its_clearance_comes_down_to_nothing(
    ground: Ground, x: float, y: float, dx: float, dy: float, radius: float
) -> None:
    share = first_touch(ground.pack(), x, y, x + dx, y + dy, radius)
    if share == 2.0:
        assert plain.least_on_way(ground, (x, y), (x + dx, y + dy), radius) >= -1e-12
        return
    assert 0.0 <= share <= 1.0
    at = (x + share * dx, y + share * dy)
    assert plain.clearance(ground, at) <= radius + 1e-9
    before = (x + (share - 1e-6) * dx, y + (share - 1e-6) * dy)
    if share > 1e-6:
        # it comes nearer until then, however flatly, so the way before is free
        assert plain.least_on_way(ground, (x, y), before, radius) >= -1e-9


@settings(max_examples=300)
@given(plain.grounds(), near, near, near, near)
def test_one_sees_another_where_no_shape_meets_the_line(
    ground: Ground, x0: float, y0: float, x1: float, y1: float
) -> None:
    apart = plain.least_on_way(ground, (x0, y0), (x1, y1), 0.0)
    if abs(apart) > 1e-9:
        assert sees(ground.pack(), x0, y0, x1, y1) == (apart > 0.0)
    assert sees(ground.pack(), x0, y0, x1, y1) == sees(ground.pack(), x1, y1, x0, y0) or abs(apart) <= 1e-9


@given(plain.grounds(), near, near)
def test_depth_counts_the_bodies_that_cover_a_point(ground: Ground, x: float, y: float) -> None:
    packed = ground.pack()
    if len(packed) and abs(clearance(packed, x, y)) > 1e-9:
        alone = [lay_ground(solids=[each]) for each in ground.solids]
        out = ground.bounds is not None and not (0.0 <= x <= 8.0 and 0.0 <= y <= 8.0)
        assert depth_at(packed, x, y) == sum(plain.is_solid(each, (x, y)) for each in alone) + out


def test_nothing_is_in_the_way_where_there_is_nothing() -> None:
    packed = lay_ground().pack()
    assert len(packed) == 0
    assert clearance(packed, 0.0, 0.0) == at_least(packed, 0.0, 0.0) == math.inf
    assert least_on_way(packed, 0.0, 0.0, 1.0, 0.0, 0.5, 0.1) == math.inf
    assert first_touch(packed, 0.0, 0.0, 1.0, 0.0, 0.5) == 2.0
    assert sees(packed, 0.0, 0.0, 1.0, 0.0)


def test_a_fast_disc_does_not_jump_through_a_thin_wall() -> None:
    packed = lay_ground([[0.0, -5.0, 0.0, 5.0]]).pack()
    assert least_on_way(packed, -4.0, 0.0, 4.0, 0.0, 0.25, math.inf) == pytest.approx(-0.25)
    assert first_touch(packed, -4.0, 0.0, 4.0, 0.0, 0.25) == pytest.approx(3.75 / 8.0)
    assert first_touch(packed, 0.25 + 1e-9, 0.0, 4.0, 0.0, 0.25) == 2.0, "it only moves away"


def test_what_is_beyond_the_bounds_is_solid_and_what_is_deep_in_a_body_too() -> None:
    packed = lay_ground(solids=[[[1.0, 1.0], [5.0, 1.0], [5.0, 5.0], [1.0, 5.0]]], bounds=[0.0, 0.0, 9.0, 9.0]).pack()
    assert clearance(packed, 3.0, 3.0) == -2.0
    assert clearance(packed, 8.0, 4.0) == 1.0
    assert clearance(packed, -2.0, 4.0) == -2.0
    assert clearance(packed, 99.0, 4.0) == -90.0
    assert least_on_way(packed, 3.0, 3.0, 3.1, 3.0, 0.2, 0.05) == pytest.approx(-2.2)
    assert first_touch(packed, 3.0, 3.0, 3.1, 3.0, 0.2) == 0.0
    assert not sees(packed, 2.0, 2.0, 3.0, 3.0)


def test_a_large_ground_far_from_the_origin_is_as_exact() -> None:
    rng = np.random.default_rng(1)
    ends = rng.uniform(0.0, 100.0, (400, 2)) + 5000.0
    ground = lay_ground(np.hstack([ends, ends + rng.uniform(-3.0, 3.0, (400, 2))]))
    packed = ground.pack()
    for x, y in rng.uniform(4990.0, 5110.0, (50, 2)):
        assert clearance(packed, x, y) == pytest.approx(plain.clearance(ground, (x, y)), abs=1e-10)


def test_small_posts_far_apart_are_found_across_many_empty_cells() -> None:
    rng = np.random.default_rng(2)
    for n in (2, 5, 12):
        posts = lay_ground(discs=np.column_stack([rng.uniform(0.0, 100.0, (n, 2)), np.full(n, 0.05)]))
        packed = posts.pack()
        for x, y in rng.uniform(-10.0, 110.0, (300, 2)):
            assert clearance(packed, x, y) == pytest.approx(plain.clearance(posts, (x, y)), abs=1e-12)
            assert least_on_way(packed, x, y, x + 1.0, y, 0.2, math.inf) == pytest.approx(
                plain.least_on_way(posts, (x, y), (x + 1.0, y), 0.2), abs=1e-12
            )


def test_of_all_shapes_on_a_long_way_the_first_is_touched_first() -> None:
    rng = np.random.default_rng(4)
    ends = rng.uniform(0.0, 40.0, (40, 4))
    posts = np.column_stack([rng.uniform(0.0, 40.0, (60, 2)), np.full(60, 0.05)])
    packed = lay_ground(ends, posts).pack()
    for x0, y0, x1, y1 in rng.uniform(0.0, 40.0, (400, 4)).tolist():
        alone = [enters_capsule(x0, y0, x1, y1, ax, ay, bx, by, 0.02) for ax, ay, bx, by in ends.tolist()]
        alone += [enters_disc(x0 - x, y0 - y, x1 - x, y1 - y, 0.02 + r) for x, y, r in posts.tolist()]
        assert first_touch(packed, x0, y0, x1, y1, 0.02) == min(alone)

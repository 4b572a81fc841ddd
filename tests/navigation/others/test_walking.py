"""Those who look at nobody: constant velocity, waypoints, random walks, tracks, against plain programs."""

from __future__ import annotations

import cmath
import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.elementary import sin_cos
from parcours.streams import uniform
from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import ConstantVelocity, RandomWalk, Recorded, Waypoints
from parcours_navigation.others.tracks import Tracks
from parcours_navigation.others.walls import nearest

if TYPE_CHECKING:
    from tests.navigation.others.conftest import Stroller

    from parcours_navigation.protocol import Floats

ROOM = np.array([[0.0, 0.0, 5.0, 0.0], [5.0, 0.0, 5.0, 4.0], [5.0, 4.0, 0.0, 4.0], [0.0, 4.0, 0.0, 0.0]])


@settings(max_examples=30)
@given(st.floats(-3.1, 3.1), st.floats(0.1, 3.0), st.floats(0.0, 2.0))
def test_constant_velocity_is_a_straight_line_from_the_start_on(
    stroll: Stroller, heading: float, speed: float, start: float
) -> None:
    one = Others(ConstantVelocity(heading), places=((1.0, 2.0),), speed=speed, start=(start, start))
    walked = stroll(one, 4.0)
    times = 0.01 * np.arange(401)
    first = math.ceil(round(start * 1e9) / 1e7) * 0.01
    way = speed * np.maximum(times - first, 0.0)
    expected = np.column_stack([1.0 + way * math.cos(heading), 2.0 + way * math.sin(heading)])
    assert walked.places[:, 0] == pytest.approx(expected, abs=1e-9)


def test_at_a_wall_or_a_bound_constant_velocity_is_thrown_back_or_ends(stroll: Stroller) -> None:
    for given_ in ({"walls": ROOM}, {}):
        bounds = None if given_ else (0.0, 0.0, 5.0, 4.0)
        back = Others(ConstantVelocity(0.3, bounds=bounds), places=((1.0, 2.0),), speed=1.0, radius=0.2)
        walked = stroll(back, 30.0, **given_)
        x, y = walked.places[:, 0].T
        assert x.min() >= 0.2 - 1e-9
        assert x.max() <= 4.8 + 1e-9
        assert 0.2 - 1e-9 <= y.min() < y.max() <= 3.8 + 1e-9
        assert walked.speeds[1:] == pytest.approx(1.0)
        # folded back, the way is that of a straight line, but for the tick at the wall
        unfolded = np.abs(1.0 - 0.2 + 30.0 * math.cos(0.3)) % (2 * 4.6)
        assert x[-1] == pytest.approx(0.2 + min(unfolded, 2 * 4.6 - unfolded), abs=0.15)
        ends = Others(ConstantVelocity(0.0, "stand", bounds), places=((1.0, 2.0),), speed=1.0, radius=0.2)
        walked = stroll(ends, 8.0, **given_)
        assert walked.places[-1, 0] == pytest.approx([4.8, 2.0], abs=0.011)
        assert walked.speeds[-1, 0] == 0.0


def polyline(points: list[tuple[float, float]], way: float) -> tuple[float, float]:
    for a, b in itertools.pairwise(points):
        length = math.dist(a, b)
        if way <= length and length > 0.0:
            return a[0] + (b[0] - a[0]) * way / length, a[1] + (b[1] - a[1]) * way / length
        way -= length
    return points[-1]


coordinates = st.integers(-40, 40).map(lambda n: n / 10)


@settings(max_examples=40)
@given(
    st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=5, unique=True),
    st.floats(0.2, 3.0),
    st.booleans(),
)
def test_waypoints_are_joined_by_straight_lines_at_one_speed(
    stroll: Stroller, points: list[tuple[float, float]], speed: float, loop: bool
) -> None:
    walked = stroll(Others(Waypoints(tuple(points), loop), speed=speed, radius=0.1), 6.0)
    way = points * (2 + int(6.0 * speed / 0.1)) if loop and len(points) > 1 else points
    for k in range(0, 601, 20):
        assert walked.places[k, 0] == pytest.approx(polyline(way, speed * 0.01 * k), abs=1e-9)


def test_at_a_waypoint_one_may_pause(stroll: Stroller) -> None:
    one = Others(Waypoints(((0.0, 0.0), (1.0, 0.0)), pause=0.5), speed=1.0, radius=0.2)
    x = stroll(one, 4.0).places[:, 0, 0]
    assert (x[101:150] == 1.0).all()
    assert x[200] == pytest.approx(0.5, abs=0.02)
    assert (x[252:300] == 0.0).all()


def test_several_on_one_way_are_spread_evenly(stroll: Stroller) -> None:
    ring = tuple((2.0 * sin_cos(0.1 * math.pi * k)[1], 2.0 * sin_cos(0.1 * math.pi * k)[0]) for k in range(20))
    walked = stroll(Others(Waypoints(ring), number=5, speed=0.5), 10.0)
    assert walked.gaps.min() > 2.0 * 2.0 * math.sin(math.pi / 5) - 0.6 - 0.1
    assert walked.gaps.max() < 2.0 * 2.0 * math.sin(math.pi / 5) - 0.6 + 0.1


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.floats(0.1, 2.0), st.floats(0.3, 6.0))
def test_a_random_walk_keeps_within_bounds_and_walls_speeds_and_turn_rate(
    stroll: Stroller, seed: int, speed: float, turn_rate: float
) -> None:
    walk = RandomWalk(slowest=0.5, between=(0.3, 1.5), turn_rate=turn_rate, bounds=(1.0, 0.0, 5.0, 4.0))
    others = Others(walk, number=3, area=(1.0, 0.5, 4.0, 3.5), radius=0.2, speed=speed)
    walls = np.array([[0.0, 0.0, 5.0, 0.0], [3.0, 2.0, 3.0, 4.0]])
    walked = stroll(others, 20.0, seed=seed, walls=walls)
    inside = walked.places.reshape(-1, 2)
    clear = np.array([nearest(walls, x, y)[0] for x, y in walked.places[0]]) >= 0.2
    assert inside[:, 0].min() >= 1.2 - 1e-9 or walked.places[0, :, 0].min() < 1.2
    assert inside[:, 0].max() <= 4.8 + 1e-9
    for i in np.flatnonzero(clear):
        assert min(nearest(walls, x, y)[0] for x, y in walked.places[::7, i]) >= 0.2 - 1e-9
    assert (walked.speeds[1:] <= speed * (1.0 + 1e-12)).all()
    ways = np.linalg.norm(np.diff(walked.places, axis=0), axis=-1)
    assert (ways[walked.speeds[1:] == 0.0] == 0.0).all()
    moving = walked.speeds[1:][walked.speeds[1:] > 0.0]
    assert moving.min() >= 0.5 * speed - 1e-12
    turned = np.abs((np.diff(walked.headings, axis=0) + math.pi) % (2.0 * math.pi) - math.pi)
    assert turned.max() <= turn_rate * 0.01 * (1.0 + 1e-6)


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.floats(0.2, 6.0))
def test_a_random_walk_in_the_open_is_that_of_a_plain_program(stroll: Stroller, seed: int, turn_rate: float) -> None:
    walk = RandomWalk(slowest=0.3, between=(0.3, 1.5), turn=2.0, turn_rate=turn_rate, bounds=(-100, -100, 100, 100))
    walked = stroll(Others(walk, places=((0.0, 0.0),), speed=1.2), 8.0, seed=seed)
    agent = walked.crowd.agents[0]
    stream, at, heading = np.array([agent.seed], np.uint64), 0j, float(agent.heading)
    want, pace, until = heading, 0.0, 0
    for k in range(1, 801):
        if k * 10_000_000 > until:
            pace = 1.2 * (0.3 + 0.7 * uniform(stream))
            want = heading + 2.0 * (2.0 * uniform(stream) - 1.0)
            until = k * 10_000_000 + int((0.3 + 1.2 * uniform(stream)) * 1e9)
        turned = max(-turn_rate * 0.01, min(turn_rate * 0.01, math.remainder(want - heading, math.tau)))
        at += cmath.rect(pace * 0.01, heading + turned / 2)
        heading += turned
        assert walked.places[k, 0] == pytest.approx((at.real, at.imag), abs=1e-9)


def test_random_walks_spread_over_their_area(stroll: Stroller) -> None:
    walkers = Others(RandomWalk(), number=20, area=(0.0, 0.0, 6.0, 6.0), radius=0.1, speed=1.0)
    places = stroll(walkers, 60.0).places[::50].reshape(-1, 2)
    counts, _, _ = np.histogram2d(places[:, 0], places[:, 1], bins=3, range=[[0, 6], [0, 6]])
    assert counts.min() > 0.3 * counts.mean()


@st.composite
def tracks(draw: st.DrawFn) -> Floats:
    n = draw(st.integers(1, 8))
    steps = draw(st.lists(st.floats(0.05, 2.0), min_size=n, max_size=n))
    places = draw(st.lists(st.tuples(coordinates, coordinates), min_size=n, max_size=n))
    return np.column_stack([np.cumsum(steps) - draw(st.floats(0.0, 2.0)), places])


@settings(max_examples=60)
@given(tracks(), st.sampled_from(["stand", "go-on"]), st.floats(0.0, 1.0))
def test_a_track_is_interpolated_linearly(stroll: Stroller, rows: Floats, ends: str, later: float) -> None:
    recorded = Recorded(Tracks(("a",), (rows,)), ends, later)  # type: ignore[arg-type]
    walked = stroll(Others(recorded), 6.0)
    times = 0.01 * np.arange(601) - round(later * 1e9) * 1e-9
    t = rows[:, 0]
    for k in (0, 1):
        expected = np.interp(times, t, rows[:, 1 + k])
        if ends == "go-on" and len(rows) > 1:
            v = np.diff(rows[:, 1 + k]) / np.diff(t)
            expected = np.where(times < t[0], rows[0, 1 + k] + v[0] * (times - t[0]), expected)
            expected = np.where(times > t[-1], rows[-1, 1 + k] + v[-1] * (times - t[-1]), expected)
        assert walked.places[:, 0, k] == pytest.approx(expected, abs=1e-7)


def test_who_looks_at_nobody_walks_through_the_robot(stroll: Stroller) -> None:
    one = Others(ConstantVelocity(0.0), places=((0.0, 0.0),), speed=1.0)
    walked = stroll(one, 4.0, robot=lambda time: (2.0, 0.0, 0.0, 0.0, 0.5))
    assert walked.places[-1, 0] == pytest.approx([4.0, 0.0])

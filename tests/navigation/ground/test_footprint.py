"""Polygons that move and turn, against fine sampling of a naive twin, and where the answer is plain."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import plain_ground as plain
from parcours_navigation.ground.footprint import (
    TOLERANCE,
    footprint_disc_least,
    footprint_disc_touch,
    footprint_least,
    footprint_to_disc,
    footprint_touch,
)
from parcours_navigation.ground.ground import Ground, lay_ground
from parcours_navigation.ground.outlines import convex

CAR = convex([[-0.4, -0.25], [0.9, -0.25], [1.0, 0.0], [0.9, 0.25], [-0.4, 0.25]])
SAMPLES = 100

Pose = tuple[float, float, float]
near = st.floats(0.0, 8.0) | st.integers(0, 16).map(lambda k: 0.5 * k)
headings = st.floats(-math.pi, math.pi) | st.integers(-4, 4).map(lambda k: k * math.pi / 4)
poses = st.tuples(near, near, headings)
moves = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.8, 0.8) | st.just(0.0))


def placed(corners: np.ndarray, pose: Pose) -> list[tuple[float, float]]:
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    return [(x + c * u - s * v, y + s * u + c * v) for u, v in corners.tolist()]


def to_disc(corners: np.ndarray, pose: Pose, disc: tuple[float, float, float]) -> float:
    at = placed(corners, pose)
    nearest = min(plain.to_segment(disc[:2], at[i - 1], at[i]) for i in range(len(at)))
    return (-nearest if plain.inside(disc[:2], np.array(at)) else nearest) - disc[2]


def standing(ground: Ground, corners: np.ndarray, pose: Pose) -> float:
    """Return the clearance of the polygon, 0 or less where it overlaps something."""
    at = placed(corners, pose)
    edges = plain.pairs(ground.solid_edges()) + plain.pairs(ground.segments)
    found = [to_disc(corners, pose, disc) for disc in ground.discs.tolist()]
    if any(plain.is_solid(ground, corner) for corner in at):
        found.append(0.0)
    for a, b in edges:
        if plain.inside(a, np.array(at)):
            found.append(0.0)
        found += [plain.between_segments(at[i - 1], at[i], a, b) for i in range(len(at))]
    return min(found, default=math.inf)


def on_way(before: Pose, move: Pose, share: float) -> Pose:
    return tuple(b + share * m for b, m in zip(before, move, strict=True))  # type: ignore[return-value]


def apart(pose: Pose, move: Pose) -> float:
    """Return how far any corner goes between two samples at most."""
    return (math.hypot(move[0], move[1]) + abs(move[2]) * 1.01) / SAMPLES


@settings(max_examples=60)
@given(plain.grounds(), poses, moves)
def test_the_least_clearance_is_what_fine_sampling_finds(ground: Ground, before: Pose, move: Pose) -> None:
    found = footprint_least(ground.pack(), CAR, *before, *on_way(before, move, 1.0), math.inf)
    seen = min(standing(ground, CAR, on_way(before, move, k / SAMPLES)) for k in range(SAMPLES + 1))
    if not ground.discs.size:
        seen, found = max(seen, 0.0), max(found, 0.0)
    if seen == math.inf:
        assert found == math.inf
    elif seen <= 0.0:
        assert found <= TOLERANCE
    else:
        assert seen - apart(before, move) - TOLERANCE <= found <= seen + TOLERANCE


@settings(max_examples=60)
@given(plain.grounds(), poses)
def test_a_polygon_that_stands_has_its_exact_clearance(ground: Ground, pose: Pose) -> None:
    wanted = standing(ground, CAR, pose)
    found = footprint_least(ground.pack(), CAR, *pose, *pose, math.inf)
    if wanted > 1e-9:
        assert found == pytest.approx(wanted, abs=1e-12)
    else:
        assert found <= 1e-9


@settings(max_examples=60)
@given(plain.grounds(), poses, moves, st.floats(0.0, 2.0))
def test_enough_changes_no_clearance_below_it(ground: Ground, before: Pose, move: Pose, enough: float) -> None:
    packed, after = ground.pack(), on_way(before, move, 1.0)
    exact = footprint_least(packed, CAR, *before, *after, math.inf)
    found = footprint_least(packed, CAR, *before, *after, enough)
    if exact > enough + TOLERANCE:
        assert found > enough - TOLERANCE
    elif exact < enough - TOLERANCE:
        assert found == pytest.approx(exact, abs=2.0 * TOLERANCE)


@settings(max_examples=40)
@given(plain.grounds(), poses, moves)
def test_the_first_touch_is_where_a_free_way_ends(ground: Ground, before: Pose, move: Pose) -> None:
    packed = ground.pack()
    share = footprint_touch(packed, CAR, *before, *on_way(before, move, 1.0))
    for k in range(SAMPLES + 1):
        if k / SAMPLES < share - 1e-6:
            assert standing(ground, CAR, on_way(before, move, k / SAMPLES)) > -TOLERANCE
    if share <= 1.0:
        assert standing(ground, CAR, on_way(before, move, share)) <= TOLERANCE


@settings(max_examples=100)
@given(poses, moves, st.tuples(near, near), st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)))
def test_a_disc_that_moves_meanwhile(
    before: Pose, move: Pose, disc: tuple[float, float], step: tuple[float, float]
) -> None:
    after, end = on_way(before, move, 1.0), (disc[0] + step[0], disc[1] + step[1])

    def seen(share: float) -> float:
        place = (disc[0] + share * step[0], disc[1] + share * step[1], 0.3)
        return to_disc(CAR, on_way(before, move, share), place)

    least = min(seen(k / SAMPLES) for k in range(SAMPLES + 1))
    found = footprint_disc_least(CAR, *before, *after, *disc, *end, 0.3, math.inf)
    gone = apart(before, move) + math.hypot(*step) / SAMPLES
    assert found <= max(least, -0.3) + TOLERANCE, "how deep the middle comes in between is not measured"
    assert found >= min(least, -0.3 if least < gone - 0.3 else math.inf) - gone - TOLERANCE
    assert footprint_to_disc(CAR, *before, *disc, 0.3) == pytest.approx(seen(0.0), abs=1e-12)
    share = footprint_disc_touch(CAR, *before, *after, *disc, *end, 0.3)
    if share == 2.0:
        assert least > -TOLERANCE
    else:
        assert seen(share) <= TOLERANCE
        assert all(seen(k / SAMPLES) > -TOLERANCE for k in range(SAMPLES + 1) if k / SAMPLES < share - 1e-6)


def test_a_corner_that_swings_past_a_wall_is_seen_between_the_ends() -> None:
    # a bar along x, a wall above that it reaches only half-way through its turn
    bar = convex([[-1.0, -0.01], [1.0, -0.01], [1.0, 0.01], [-1.0, 0.01]])
    packed = lay_ground([[-0.2, 0.9, 0.2, 0.9]]).pack()
    before, after = (0.0, 0.0, math.pi / 2 - 0.4), (0.0, 0.0, math.pi / 2 + 0.4)
    assert footprint_least(packed, bar, *before, *before, math.inf) > 0.1
    assert footprint_least(packed, bar, *before, *after, math.inf) == 0.0
    share = footprint_touch(packed, bar, *before, *after)
    corner = math.atan2(0.01, 1.0)  # the leading corner comes to the wall's end, or its tip into the wall
    assert 0.0 < share < 0.5 and math.sin(math.pi / 2 - 0.4 + 0.8 * share + corner) <= 1.0


def test_a_thin_wall_is_not_jumped_and_a_polygon_within_a_body_touches() -> None:
    packed = lay_ground([[5.0, -5.0, 5.0, 5.0]]).pack()
    assert footprint_least(packed, CAR, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, math.inf) == 0.0
    assert footprint_touch(packed, CAR, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0) == pytest.approx(0.5)
    block = lay_ground(solids=[[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]]]).pack()
    assert footprint_least(block, CAR, 4.0, 4.0, 0.0, 4.1, 4.0, 0.0, math.inf) <= 0.0
    assert footprint_touch(block, CAR, 4.0, 4.0, 0.0, 4.1, 4.0, 0.0) == 0.0


def test_a_post_within_the_footprint_is_overlap() -> None:
    packed = lay_ground(discs=[[0.2, 0.0, 0.05]]).pack()
    assert footprint_least(packed, CAR, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.inf) == pytest.approx(-0.3)

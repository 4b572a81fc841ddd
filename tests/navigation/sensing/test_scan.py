"""The laser scan against a naive twin that cuts every beam with every shape."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import plain_ground as plain
from parcours_navigation.ground.ground import Ground, lay_ground
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.sensing.scan import Beams, scan

near = st.floats(-1.0, 9.0)
NOBODY = np.empty((0, 3))


def scanned(ground: Ground, discs: np.ndarray, x: float, y: float, heading: float, beams: Beams) -> np.ndarray:
    ranges = np.full(beams.n, np.nan)
    scan(ground.pack(), discs, x, y, heading, beams.first, beams.step, beams.reach, ranges)
    return ranges


@settings(max_examples=200)
@given(
    plain.grounds(), st.integers(0, 2**32), near, near, st.floats(-20.0, 20.0), st.integers(1, 90),
    st.sampled_from([(-math.pi, 0.0), (-0.7, 0.013), (0.0, 0.05), (3.0, 1e-3)]), st.floats(0.5, 15.0),
)  # fmt: skip
def test_every_beam_goes_as_far_as_cutting_it_with_every_shape_says(
    ground: Ground, seed: int, x: float, y: float, heading: float, n: int, angles: tuple[float, float], reach: float
) -> None:
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(0.0, 8.0, (5, 2)), rng.uniform(0.1, 0.5, 5)])
    beams = Beams(n, *angles, reach)
    found = scanned(ground, discs, x, y, heading, beams)
    edges = plain.pairs(ground.solid_edges()) + plain.pairs(ground.segments)
    shapes = ground.discs.tolist() + discs.tolist()
    if any(plain.to_segment((x, y), a, b) < 1e-9 for a, b in edges):
        return  # on a wall: on which side of it is rounding
    for k in range(n):
        angle = heading + beams.first + k * beams.step
        wanted = [plain.ray(x, y, angle + off, edges, shapes) for off in (0.0, -1e-7, 1e-7)]
        if max(wanted) > min(wanted) * 1.001 + 1e-6 or abs(min(wanted) - reach) < 1e-6:
            continue  # at the edge of a shape, or nearly along a wall
        assert found[k] == pytest.approx(wanted[0] if wanted[0] < reach else math.inf, abs=1e-9)


def test_beams_at_the_corner_of_a_closed_room_do_not_leak() -> None:
    room = lay_ground(bounds=[0.0, 0.0, 4.0, 4.0])
    for n in (4, 8, 360, 4096):
        ranges = scanned(room, NOBODY, 2.0, 2.0, 0.25 * math.pi, Beams(n, reach=100.0))
        assert ranges.max() <= 2.0 * math.sqrt(2.0) + 1e-9
        assert ranges.min() >= 2.0 - 1e-9


def test_the_first_beam_points_where_it_should() -> None:
    wall = lay_ground([[3.0, -1.0, 3.0, 1.0]])
    ranges = scanned(wall, NOBODY, 0.0, 0.0, 0.5 * math.pi, Beams(3, first=-0.5 * math.pi, step=0.5 * math.pi))
    assert ranges.tolist() == [pytest.approx(3.0), math.inf, math.inf]


def test_bodies_hide_the_ground_and_a_sensor_in_one_sees_nothing_else() -> None:
    wall, beams = lay_ground([[3.0, -9.0, 3.0, 9.0]]), Beams(1, first=0.0, step=1.0)
    assert scanned(wall, np.array([[1.0, 0.0, 0.25]]), 0.0, 0.0, 0.0, beams).tolist() == [0.75]
    assert scanned(wall, np.array([[4.0, 0.0, 0.25]]), 0.0, 0.0, 0.0, beams).tolist() == [3.0]
    assert scanned(wall, np.array([[0.1, 0.0, 0.25]]), 0.0, 0.0, 0.0, beams).tolist() == [0.0]
    assert scanned(lay_ground(), NOBODY, 0.0, 0.0, 0.0, beams).tolist() == [math.inf]


def test_a_wall_seen_end_on_is_met_at_its_end() -> None:
    wall, beams = lay_ground([[1.0, 0.0, 3.0, 0.0]]), Beams(2, first=0.0, step=0.1)
    assert scanned(wall, NOBODY, 0.0, 0.0, 0.0, beams).tolist() == [1.0, math.inf]
    assert scanned(wall, NOBODY, 2.0, 0.0, 0.0, beams).tolist() == [0.0, 0.0], "on it"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"n": 1_000_000}, r"scan: .*1000000 were asked for; take fewer \[scan-beams\]"),
        ({"n": 0}, r"\[scan-beams\]"),
        ({"n": 10, "step": -0.1}, r"scan: steps must be above 0 .*10 beams from -3.14159 by -0.1 rad \[scan-angles\]"),
        ({"n": 10, "step": 1.0}, r"\[scan-angles\]"),
        ({"n": 10, "first": math.nan}, r"\[scan-angles\]"),
        ({"n": 10, "reach": -1.0}, r"scan: the reach must be above 0 m .* is -1.0 m \[scan-reach\]"),
        ({"n": 10, "reach": math.inf}, r"\[scan-reach\]"),
    ],
)
def test_beams_that_make_no_sense_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(BadGround, match=message):
        Beams(**given)  # type: ignore[arg-type]

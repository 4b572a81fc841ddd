"""Sets of lattice points as bits: against truth values in numpy, and the covering that the outer set rests on."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours_navigation.arena.lattice import (
    EDGE,
    EVERYWHERE,
    REACH,
    ROWS,
    SHADOW,
    WORDS,
    as_bits,
    as_points,
    grow_inner,
    grow_outer,
    has,
    lay_lattice,
    lay_points,
    put,
    reached_box,
    take_disc,
)  # fmt: skip


def scattered(seed: int, share: float) -> NDArray[np.bool_]:
    return np.random.default_rng(seed).random((ROWS, ROWS)) < share


def dilated(points: NDArray[np.bool_], square: int) -> NDArray[np.bool_]:
    """Return the points at most sqrt(square) from one of the set, one offset at a time."""
    wide = np.pad(points, 6)
    out = np.zeros_like(points)
    for j in range(-6, 7):
        for i in range(-6, 7):
            if i * i + j * j <= square:
                out |= wide[6 + j : 6 + j + ROWS, 6 + i : 6 + i + ROWS]
    return out


def empty() -> NDArray[np.uint64]:
    return np.zeros((WORDS + 2, ROWS + 2 * EDGE), np.uint64)


def test_bits_and_truth_values_are_inverse() -> None:
    points = scattered(1, 0.3)
    assert (as_points(as_bits(points)) == points).all()


def test_a_point_put_is_had_and_stands_where_numpy_has_it() -> None:
    bits = empty()
    put(bits, 200, 17)
    assert has(bits, 200, 17)
    assert not has(bits, 201, 17)
    assert np.argwhere(as_points(bits)).tolist() == [[17, 200]]


@pytest.mark.parametrize(("seed", "share"), [(2, 0.0005), (3, 0.01), (4, 0.5)])
def test_growing_is_dilation_by_a_disc(seed: int, share: float) -> None:
    points = scattered(seed, share)
    points[0, 0] = points[-1, -1] = points[0, 63] = points[100, 64] = True
    wide = np.zeros((4, *empty().shape), np.uint64)
    for grow, square in ((grow_inner, 18), (grow_outer, 26)):
        bits = as_bits(points)
        grow(bits, wide, EVERYWHERE)
        assert (as_points(bits) == dilated(points, square)).all()
        assert not bits[0].any() and not bits[-1].any(), "the frame stays empty"
        assert not bits[:, :EDGE].any() and not bits[:, -EDGE:].any()


@pytest.mark.parametrize(
    ("x", "y", "radius"), [(1.0, 1.0, 0.24), (-0.5, 2.5, 0.3), (0.252, 0.3, 0.004), (3.5, 1.0, 0.2), (1.0, 1.0, 9.0)]
)
def test_taking_a_disc_takes_exactly_its_points(x: float, y: float, radius: float) -> None:
    lattice = lay_points((0.0, 0.0), (2.0, 2.0), 0.2, 21.0, 0.25, 0.125)
    axis = np.arange(ROWS) * lattice.spacing
    far = np.hypot(lattice.x0 + axis[None, :] - x, lattice.y0 + axis[:, None] - y)
    assert np.abs(far - radius).min() > 1e-9, "no point lies on the rim"
    points = scattered(5, 0.7)
    bits = as_bits(points)
    take_disc(bits, lattice, x, y, radius)
    assert (as_points(bits) == points & (far > radius)).all()


def test_a_shadow_can_always_follow() -> None:
    """Each point within REACH + SHADOW of the origin is within SHADOW of an offset that the outer set grows by.

    The distance to the nearest offset changes by no more than one walks, so samples this dense prove it for all.
    """
    dense = 0.005
    axis = np.arange(0.0, REACH + SHADOW + dense, dense)
    x, y = np.meshgrid(axis, axis)
    least = np.full_like(x, np.inf)
    for i in range(-5, 6):
        for j in range(-5, 6):
            if i * i + j * j <= 26:
                least = np.minimum(least, np.hypot(x - i, y - j))
    within = np.hypot(x, y) <= REACH + SHADOW + dense
    assert least[within].max() + dense * 0.7072 <= SHADOW


def test_start_is_a_point_and_the_goal_lies_inside() -> None:
    for start, goal in (((0.0, 0.0), (2.0, 2.0)), ((1.0, -3.0), (-0.5, 0.25))):
        lattice = lay_points(start, goal, 0.2, 21.0, 0.25, 0.125)
        assert lattice.x0 + lattice.column * lattice.spacing == pytest.approx(start[0], abs=1e-12)
        assert lattice.y0 + lattice.row * lattice.spacing == pytest.approx(start[1], abs=1e-12)
        side = (ROWS - 1) * lattice.spacing
        assert 0.4 < goal[0] - lattice.x0 < side - 0.4
        assert 0.4 < goal[1] - lattice.y0 < side - 0.4


def test_caps_hold_what_could_be_on_a_way_and_little_more() -> None:
    record = lay_points((0.0, 0.0), (2.0, 2.0), 0.2, 21.0, 0.25, 0.125)
    caps = lay_lattice(record).caps
    assert has(caps[0], record.column, record.row)
    assert as_points(caps[0]).sum() == 1
    last = as_points(caps[record.n_steps])
    j, i = np.nonzero(last)
    far = np.hypot(record.x0 + i * record.spacing - 2.0, record.y0 + j * record.spacing - 2.0)
    assert 0.2 < far.max() < 0.2 + 2.0 * record.spacing + record.v_max * record.step


@pytest.mark.parametrize(("start", "goal", "margin"), [((0.0, 0.0), (2.0, 2.0), 0.5), ((1.0, -3.0), (0.9, 4.0), 0.05)])
def test_no_set_leaves_the_box_that_is_reached(
    start: tuple[float, float], goal: tuple[float, float], margin: float
) -> None:
    record = lay_points(start, goal, 0.2, 40.0, 0.25, 0.125, margin)
    caps, wide = lay_lattice(record).caps, np.zeros((4, *empty().shape), np.uint64)
    everywhere, within = empty(), empty()
    for bits in (everywhere, within):
        put(bits, record.column, record.row)
    for k in range(1, 70):
        box = reached_box(record, k)
        beyond = caps[k].copy()
        beyond[box[0] : box[1], box[2] : box[3]] = 0
        assert not beyond.any(), "nothing comes back outside the box"
        grow_outer(everywhere, wide, EVERYWHERE)
        wide[:, :, EDGE:-EDGE] = ~np.uint64(0)  # what another case left there
        grow_outer(within, wide, box)
        assert (everywhere == within).all()

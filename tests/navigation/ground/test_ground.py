"""Grounds as data: what is refused, determinism, packing, and geometry by an independent library."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
import shapely
from hypothesis import given
from numpy.typing import NDArray

import plain_ground as plain
from parcours_navigation.ground.ground import Ground, lay_ground
from parcours_navigation.ground.outlines import BadGround, bounds_of, convex, outline
from parcours_navigation.ground.packing import CELL, COLUMNS, HEAD, ITEMS, ROWS, SHAPES, STRIDE
from parcours_navigation.ground.shapes import enters_capsule, point_to_polygon, segment_to_segment


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"segments": [[0, 0, 1]]},
            r"walls: it must be rows of 4 numbers, but has the shape \(1, 3\) \[ground-shape\]",
        ),
        ({"segments": "wall"}, r"walls: it must be rows of 4 numbers.*\[ground-shape\]"),
        ({"segments": [[0, 0, math.nan, 1]]}, r"walls: numbers must be finite .* row 1 has nan; .*\[ground-number\]"),
        ({"discs": [[0, math.inf, 1]]}, r"discs: .* row 1 has inf.*\[ground-number\]"),
        ({"discs": [[0, 1e9, 1]]}, r"\[ground-number\]"),
        ({"segments": [[0, 0, 1, 1], [2, 2, 2, 2]]}, r"wall 2: .*both are at \(2, 2\); delete it.*\[wall-length\]"),
        ({"discs": [[0, 0, 0]]}, r"disc 1: a radius must be above 0 m, but is 0 m; give metres above 0"),
        ({"solids": [[[0, 0], [1, 0]]]}, r"polygon 1: a polygon has from 3 .*but 2 were given.*\[polygon-corners\]"),
        ({"solids": [[[0, 0], [1, 0], [0, 0]]]}, r"\[polygon-corners\]"),
        ({"solids": [[[0, 0], [1, 0], [1, 0], [0, 1]]]}, r"corners 2 and 3 are both at \(1, 0\).*\[polygon-corners\]"),
        (
            {"solids": [[[0, 0], [1, 0], [1, 1]], [[0, 0], [2, 2], [2, 0], [0, 2]]]},
            r"polygon 2: .*after corner 1 and corner 3 do; put the corners in order.*\[polygon-crosses\]",
        ),
        ({"solids": [[[0, 0], [2, 0], [1, 0], [1, 1]]]}, r"\[polygon-crosses\]"),
        ({"solids": [[[0, 0], [2, 0], [2, 2], [1, 0]]]}, r"\[polygon-crosses\]"),
        ({"solids": [[[0, 0], [1, 0], [2, 0]]]}, r"\[polygon-crosses\]"),
        ({"bounds": [0, 0, 0, 1]}, r"bounds: they are x0, y0, x1, y1 .*but are 0, 0, 0, 1; give the lower left"),
        ({"bounds": [0, 0, 1]}, r"\[ground-shape\]"),
        ({"bounds": "none"}, r"\[ground-shape\]"),
    ],
)
def test_what_makes_no_ground_is_refused_by_name(parts: dict[str, object], message: str) -> None:
    with pytest.raises(BadGround, match=message):
        lay_ground(**parts)  # type: ignore[arg-type]


def test_outlines_come_out_counter_clockwise_and_open() -> None:
    assert outline([[0, 0], [0, 1], [1, 0], [0, 0]]).tolist() == [[1, 0], [0, 1], [0, 0]]
    assert convex([[0, 0], [1, 0], [2, 0], [1, 2]]).shape == (4, 2), "corners on a side are no harm"
    with pytest.raises(BadGround, match=r"footprint-convex"):
        convex([[0, 0], [4, 0], [1, 1], [0, 4]])
    assert bounds_of((0, 0, 2, 1)).tolist() == [0, 0, 2, 1]


def test_arrays_of_a_ground_cannot_be_written() -> None:
    ground = lay_ground([[0, 0, 1, 1]], [[0, 0, 1]], [[[0, 0], [1, 0], [0, 1]]], [0, 0, 1, 1])
    assert ground.bounds is not None
    for part in (ground.segments, ground.discs, ground.solids[0], ground.bounds):
        with pytest.raises(ValueError, match="read-only"):
            part[0] = 7.0


@given(plain.grounds())
def test_each_shape_is_in_the_bucket_of_every_cell_that_it_passes(ground: Ground) -> None:
    packed = ground.pack()
    if not len(packed):
        return
    columns, cell = int(packed[COLUMNS]), packed[CELL]
    starts = packed[int(packed[ITEMS]) - columns * int(packed[ROWS]) - 1 : int(packed[ITEMS])].astype(int)
    items = packed[int(packed[ITEMS]) :].astype(int)
    assert starts[-1] == len(items)
    edges = np.concatenate([ground.solid_edges(), ground.segments])
    for i, (x0, y0, x1, y1) in enumerate(edges):
        assert packed[HEAD + STRIDE * i : HEAD + STRIDE * i + 4].tolist() == [x0, y0, x1, y1]
        for share in np.linspace(0.0, 1.0, 50):
            x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
            c = int((y - packed[4]) / cell) * columns + int((x - packed[3]) / cell)
            assert i in items[starts[c] : starts[c + 1]]
    assert packed[SHAPES] == len(edges) + len(ground.discs)


@given(plain.grounds())
def test_packing_twice_gives_the_same_bits(ground: Ground) -> None:
    assert ground.pack().tobytes() == ground.pack().tobytes()


def test_long_walls_and_large_discs_do_not_blow_up_the_buckets() -> None:
    rng = np.random.default_rng(0)
    across = np.column_stack([np.zeros(1000), rng.uniform(0, 50, 1000), np.full(1000, 50.0), rng.uniform(0, 50, 1000)])
    discs = np.column_stack([rng.uniform(0, 50, (500, 2)), np.full(500, 20.0)])
    assert len(lay_ground(across, discs).pack()) < 1_000_000


def random_pairs(n: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(2)
    pairs = rng.uniform(-1.0, 1.0, (n, 8))
    pairs[::3] = np.round(pairs[::3] * 4.0) / 4.0  # round numbers: parallel, touching and crossing exactly
    return pairs


def test_segments_are_as_far_apart_as_shapely_says() -> None:
    pairs = random_pairs(20_000)
    wanted = shapely.distance(
        shapely.linestrings(pairs[:, :4].reshape(-1, 2, 2)), shapely.linestrings(pairs[:, 4:].reshape(-1, 2, 2))
    )
    found = np.sqrt([segment_to_segment(*row) for row in pairs])
    np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_a_point_enters_a_capsule_where_shapely_says_that_it_is_as_near() -> None:
    for row in random_pairs(3_000):
        x0, y0, x1, y1, ax, ay, bx, by = row.tolist()
        share = enters_capsule(x0, y0, x1, y1, ax, ay, bx, by, 0.3)
        wall = shapely.LineString(row[4:].reshape(2, 2))
        way = shapely.LineString(row[:4].reshape(2, 2))
        if share == 2.0:
            assert wall.distance(way) >= 0.3 - 1e-12
        else:
            at = row[:2] + share * (row[2:4] - row[:2])
            assert wall.distance(shapely.Point(at)) <= 0.3 + 1e-9
            before = row[:2] + max(share - 1e-6, 0.0) * (row[2:4] - row[:2])
            assert share == 0.0 or wall.distance(shapely.LineString([row[:2], before])) >= 0.3 - 1e-9


def test_a_point_is_as_far_from_a_convex_polygon_as_shapely_says() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        hull = shapely.convex_hull(shapely.multipoints(rng.uniform(-1.0, 1.0, (8, 2))))
        corners = convex(shapely.get_coordinates(hull))
        for x, y in rng.uniform(-1.5, 1.5, (10, 2)):
            edge = hull.exterior.distance(shapely.Point(x, y))
            wanted = -edge if hull.contains(shapely.Point(x, y)) else edge
            assert point_to_polygon(x, y, corners) == pytest.approx(wanted, abs=1e-14)


def test_kernels_are_the_same_without_a_compiler() -> None:
    code = (
        "import sys, hashlib, numpy as np\n"
        "if sys.argv[1] == 'plain': sys.modules['numba'] = None\n"
        "from parcours_navigation.ground.clearance import clearance, first_touch, least_on_way\n"
        "from parcours_navigation.ground.footprint import footprint_least\n"
        "from parcours_navigation.ground.ground import lay_ground\n"
        "from parcours_navigation.sensing.scan import scan\n"
        "packed = lay_ground([[0, 0, 2, 1]], [[1, 3, 0.5]], [[[3, 0], [4, 0], [3, 2]]], [-1, -1, 5, 5]).pack()\n"
        "car = np.array([[-0.3, -0.2], [0.5, -0.2], [0.5, 0.2], [-0.3, 0.2]])\n"
        "ranges = np.empty(20)\n"
        "scan(packed, np.array([[2.0, 2.0, 0.25]]), 0.3, 1.2, 0.4, -3.0, 0.3, 10.0, ranges)\n"
        "found = [clearance(packed, 0.3, 1.2), first_touch(packed, 0.3, 1.2, 3.5, 1.0, 0.2),\n"
        "         least_on_way(packed, 0.3, 1.2, 0.5, 1.3, 0.2, np.inf),\n"
        "         footprint_least(packed, car, 0.3, 1.2, 0.1, 0.5, 1.3, 0.4, np.inf)]\n"
        "print(hashlib.sha256(packed.tobytes() + np.array(found).tobytes() + ranges.tobytes()).hexdigest())\n"
    )
    found = {
        subprocess.run([sys.executable, "-c", code, how], stdout=subprocess.PIPE, text=True, check=True).stdout
        for how in ("compiled", "plain")
    }
    assert len(found) == 1

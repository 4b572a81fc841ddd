"""Distances to walls: against brute force over squares, and lookups against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from parcours_navigation.planners.distance import FAR, MOST_CELLS, NO_WALLS, is_clear, look, signed_distances, walls_of
from parcours_navigation.protocol import Floats, Map


def brute(cells: Floats, resolution: float) -> Floats:
    """Return signed distances by looking at every square from every centre."""
    out = np.empty(cells.shape)
    for i, j in np.ndindex(cells.shape):
        occupied = cells[i, j] == 100
        others = np.argwhere((cells == 100) != occupied)
        if len(others) == 0:
            out[i, j] = -FAR if occupied else FAR
            continue
        aside = np.maximum(np.abs(others - (i, j)) - 0.5, 0.0)
        least = math.sqrt(float(np.square(aside).sum(axis=1).min())) * resolution
        out[i, j] = -least if occupied else least
    return out


@pytest.mark.parametrize("seed", range(12))
def test_distances_are_those_of_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 24, 2).tolist())
    cells = (rng.random(shape) < rng.choice([0.02, 0.2, 0.7])).astype(np.uint8) * 100
    out = np.empty(shape)
    signed_distances(cells.astype(np.uint8), 0.05, out)
    assert out == pytest.approx(brute(cells, 0.05), abs=1e-12)


@pytest.mark.parametrize(("cell", "distance"), [(0, FAR), (100, -FAR)])
def test_a_map_of_one_kind_is_as_far_as_can_be(cell: int, distance: float) -> None:
    out = np.empty((3, 4))
    signed_distances(np.full((3, 4), cell, np.uint8), 0.1, out)
    assert (out == distance).all()


def test_unknown_cells_are_no_walls() -> None:
    walls = walls_of(Map(np.array([[255, 0, 65, 64]], np.uint8), 1.0, (0.0, 0.0)))
    assert walls.distances.tolist() == [[1.5, 0.5, -0.5, 0.5]]


def test_a_lookup_is_bilinear_and_its_gradient_that_of_differences() -> None:
    rng = np.random.default_rng(3)
    distances, frame = rng.normal(size=(7, 9)), np.array([-0.4, 0.3, 0.1])
    assert look(distances, frame, -0.4 + 0.2, 0.3 + 0.5)[0] == pytest.approx(distances[5, 2])
    for _ in range(200):
        x, y = rng.uniform(-0.35, 0.35), rng.uniform(0.35, 0.85)
        d, gx, gy = look(distances, frame, x, y)
        on_edge = min(abs((x + 0.4) * 10 % 1), abs((y - 0.3) * 10 % 1)) < 1e-3
        if not on_edge:
            assert gx == pytest.approx((look(distances, frame, x + 1e-6, y)[0] - d) / 1e-6, abs=1e-3)
            assert gy == pytest.approx((look(distances, frame, x, y + 1e-6)[0] - d) / 1e-6, abs=1e-3)


def test_outside_of_the_map_it_is_as_at_the_nearest_place_in_it() -> None:
    distances, frame = np.array([[0.0, 1.0], [2.0, 3.0]]), np.array([0.0, 0.0, 1.0])
    assert look(distances, frame, 9.0, 9.0)[0] == 3.0
    assert look(distances, frame, -9.0, 0.0)[0] == 0.0
    assert look(np.array([[4.0]]), frame, 0.3, 0.2) == (4.0, 0.0, 0.0)
    assert look(NO_WALLS.distances, NO_WALLS.frame, 0.0, 0.0) == (FAR, 0.0, 0.0)


def test_a_way_is_clear_if_all_its_places_have_room() -> None:
    rng, answers = np.random.default_rng(4), []
    walls = walls_of(Map((rng.random((40, 40)) < 0.006).astype(np.uint8) * np.uint8(100), 0.05, (0.0, 0.0)))
    for _ in range(300):
        x0, y0, x1, y1 = rng.uniform(0.1, 1.9, 4).tolist()
        places = np.linspace(0.0, 1.0, 400)
        rooms = [look(walls.distances, walls.frame, x0 + t * (x1 - x0), y0 + t * (y1 - y0))[0] for t in places]
        clear = is_clear(walls.distances, walls.frame, x0, y0, x1, y1, 0.1)
        answers.append(clear)
        if min(rooms) > 0.1 or min(rooms) < 0.08:
            assert clear == (min(rooms) >= 0.1)
    assert 20 < sum(answers) < 280


def test_the_same_map_is_read_once_and_a_changed_one_again() -> None:
    ground = Map(np.zeros((5, 5), np.uint8), 0.1, (0.0, 0.0))
    first = walls_of(ground)
    assert walls_of(ground, first) is first
    ground.cells[2, 2] = 100
    second = walls_of(ground, first)
    assert second is not first and second.distances[2, 2] < 0.0 < first.distances[2, 2]


def test_a_large_map_is_made_coarser_and_loses_no_wall() -> None:
    cells = np.zeros((900, 601), np.uint8)
    cells[899, 600] = cells[0, 300] = 100
    walls = walls_of(Map(cells, 0.01, (1.0, 2.0)))
    assert walls.distances.size <= MOST_CELLS
    for x, y in ((1.0 + 6.005, 2.0 + 8.995), (1.0 + 3.005, 2.0 + 0.005)):
        assert look(walls.distances, walls.frame, x, y)[0] < 0.01


def test_faces_are_the_occupied_squares_beside_free_ones() -> None:
    cells = np.zeros((6, 6), np.uint8)
    cells[1:5, 1:5] = 100
    assert len(walls_of(Map(cells, 0.1, (0.0, 0.0))).faces) == 12

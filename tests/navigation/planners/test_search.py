"""A*: its costs against Dijkstra's in plain Python, its ways, and where they lead if there is none."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest

from parcours_navigation.planners.distance import walls_of
from parcours_navigation.planners.search import along, edge_cost, search, stand_in
from parcours_navigation.protocol import Floats, Map

RADIUS, SOFT, WEIGHT, SIDE = 0.12, 0.3, 2.0, 0.05


def neighbours(shape: tuple[int, ...], cell: int) -> list[tuple[int, float]]:
    i, j = divmod(cell, shape[1])
    around = [(i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1) if di or dj]
    return [
        (a * shape[1] + b, SIDE * math.hypot(a - i, b - j))
        for a, b in around
        if 0 <= a < shape[0] and 0 <= b < shape[1]
    ]


def dijkstra(room: Floats, start: int) -> dict[int, float]:
    """Return the cost of the cheapest way to every cell that can be reached."""
    done: dict[int, float] = {}
    queue = [(0.0, start)]
    while queue:
        cost, cell = heapq.heappop(queue)
        if cell in done:
            continue
        done[cell] = cost
        for to, length in neighbours(room.shape, cell):
            step = edge_cost(room, cell, to, length, RADIUS, SOFT, WEIGHT)
            if step < math.inf and to not in done:
                heapq.heappush(queue, (cost + step, to))
    return done


def random_room(rng: np.random.Generator) -> Floats:
    shape = rng.integers(8, 40, 2)
    cells = (rng.random(shape) < rng.choice([0.005, 0.02, 0.04])).astype(np.uint8) * np.uint8(100)
    return walls_of(Map(cells, SIDE, (0.0, 0.0))).distances


@pytest.mark.parametrize("seed", range(30))
def test_the_way_is_as_cheap_as_dijkstras(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    for _ in range(3):
        start, goal = rng.integers(room.size, size=2).tolist()
        way = np.empty(room.size, np.int64)
        n, reached, cost = search(room, SIDE, RADIUS, SOFT, WEIGHT, start, goal, way)
        costs = dijkstra(room, start)
        assert reached == (goal in costs)
        assert way[0] == start and way[n - 1] == (goal if reached else way[n - 1])
        assert cost == pytest.approx(costs[int(way[n - 1])], rel=1e-12, abs=1e-12)
        driven = 0.0
        for a, b in zip(way[: n - 1].tolist(), way[1:n].tolist(), strict=True):
            driven += edge_cost(room, a, b, dict(neighbours(room.shape, a))[b], RADIUS, SOFT, WEIGHT)
        assert driven == pytest.approx(cost, rel=1e-12, abs=1e-12)


def test_without_a_way_it_leads_to_the_nearest_place_that_can_be_reached() -> None:
    cells = np.zeros((40, 40), np.uint8)
    cells[:, 20] = 100
    room = walls_of(Map(cells, SIDE, (0.0, 0.0))).distances
    way = np.empty(room.size, np.int64)
    n, reached, _ = search(room, SIDE, RADIUS, SOFT, WEIGHT, 20 * 40 + 3, 20 * 40 + 35, way)
    assert not reached
    i, j = divmod(int(way[n - 1]), 40)
    assert i == 20 and room[i, j] >= RADIUS > room[i, j + 1]


def test_from_a_place_without_room_it_leads_out() -> None:
    cells = np.zeros((30, 30), np.uint8)
    cells[:, 0] = 100
    room = walls_of(Map(cells, SIDE, (0.0, 0.0))).distances
    way = np.empty(room.size, np.int64)
    n, reached, _ = search(room, SIDE, RADIUS, SOFT, WEIGHT, 15 * 30 + 1, 15 * 30 + 25, way)
    assert reached and n == 25


def test_ties_are_broken_the_same_way_whatever_ran_before() -> None:
    room, ways = np.full((25, 25), 9.0), []
    for _ in range(2):
        way = np.empty(room.size, np.int64)
        n, _, _ = search(room, SIDE, RADIUS, SOFT, WEIGHT, 0, 24 * 25 + 12, way)
        ways.append(way[:n].tolist())
        search(room, SIDE, RADIUS, SOFT, WEIGHT, 600, 3, np.empty(room.size, np.int64))
    assert ways[0] == ways[1]


def test_a_standing_disc_takes_room_as_a_wall_does() -> None:
    room, frame = np.full((20, 20), 9.0), np.array([0.0, 0.0, 0.1])
    stand_in(room, frame, 1.0, 1.0, 0.2, 0.3)
    assert room[10, 10] == pytest.approx(-0.2)
    assert room[10, 14] == pytest.approx(0.2)
    assert room[10, 17] == 9.0
    stand_in(room, frame, 50.0, -50.0, 0.2, 0.3)


def test_the_point_to_head_for_is_in_sight() -> None:
    cells = np.zeros((40, 40), np.uint8)
    cells[:25, 20] = 100
    walls = walls_of(Map(cells, 0.05, (0.0, 0.0)))
    points = np.array([[0.5, 0.5], [0.6, 0.9], [0.8, 1.5], [1.2, 1.5], [1.5, 0.5]])
    nearest, off, ahead, left = along(points, 0, 0.5, 0.4, 5.0, walls.distances, walls.frame, 0.1)
    assert (nearest, ahead) == (0, 2)
    assert off == pytest.approx(0.1)
    assert left == pytest.approx(0.4 + math.hypot(0.3, 1.0))
    assert along(points, 0, 0.5, 0.4, 0.1, walls.distances, walls.frame, 0.1)[2] == 1

"""TEB: its band matrix against numpy, its derivatives against differences, and how bands are laid and resized."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.planners.band import (
    TIME,
    WIDTH,
    Setting,
    begin_at,
    lay,
    resize,
    solve,
    speeds_of,
    tighten,
    weigh,
)
from parcours_navigation.planners.distance import walls_of
from parcours_navigation.planners.teb import Teb, first_met
from parcours_navigation.protocol import Floats, Map

LIMITS = np.array([0.25, 1.5, 1.0, 2.0, math.inf])
CAR = np.array([0.25, 1.5, 1.0, 2.0, 3.0])


def setting_of(limits: Floats = LIMITS) -> Setting:
    cells = np.zeros((60, 60), np.uint8)
    cells[:, 50] = 100
    walls = walls_of(Map(cells, 0.05, (-1.0, -1.0)))
    return np.array([0.1, 0.2]), limits, np.array([5.0, 20.0, 1000.0, 60.0]), 0.145, 0.05, walls.distances, walls.frame


def memory(n: int) -> tuple[Floats, Floats]:
    return np.zeros((4 * n, WIDTH)), np.zeros(4 * n)


def test_the_band_solver_gives_what_numpy_gives() -> None:
    rng = np.random.default_rng(1)
    for n in (4, 12, 40):
        factor = np.tril(np.triu(rng.normal(size=(n, n)), -(WIDTH - 1)))
        full = factor @ factor.T + np.eye(n)
        matrix = np.array([[full[i, i - k] if i >= k else 0.0 for k in range(WIDTH)] for i in range(n)])
        right = rng.normal(size=n)
        expected = np.linalg.solve(full, right)
        assert solve(matrix, right, n)
        assert right == pytest.approx(expected, rel=1e-8, abs=1e-10)
    assert not solve(np.zeros((4, WIDTH)), np.zeros(4), 4)


@pytest.mark.parametrize("limits", [LIMITS, CAR])
def test_the_right_side_is_half_the_slope_of_the_cost(limits: Floats) -> None:
    rng, setting = np.random.default_rng(2), setting_of(limits)
    standing = np.array([[0.3, 0.1, 0.0, 0.0, 0.0, 0.1]])
    checked = 0
    for _ in range(30):
        n = 6
        band = np.zeros((n, 4))
        band[:, 0] = np.linspace(0.0, 0.6, n) + rng.normal(0.0, 0.03, n)
        band[:, 1], band[:, 2] = rng.normal(0.0, 0.05, n), rng.normal(0.0, 0.4, n)
        band[:, TIME] = rng.uniform(0.2, 0.6, n)
        matrix, right = memory(n)
        weigh(band, n, standing, setting, matrix, right)
        slope = right.copy()
        diagonal = matrix[:, 0].copy()
        for k in range(4 * n):
            costs = []
            for h in (-1e-6, 1e-6):
                other = band.copy()
                other.ravel()[k] += h
                costs.append(weigh(other, n, standing, setting, *memory(n)))
            numeric = -0.5 * (costs[1] - costs[0]) / 2e-6
            if abs(numeric - slope[k]) > 1e-3 * max(1.0, abs(numeric)):
                pytest.fail(f"variable {k}: {slope[k]}, by differences {numeric}")
            checked += 1
        assert (diagonal >= 0.0).all()
    assert checked == 30 * 24


def test_tightening_never_costs_more_and_keeps_both_ends() -> None:
    rng, setting = np.random.default_rng(3), setting_of()
    for _ in range(10):
        band = np.zeros((40, 4))
        n = lay(band, np.array([[0.0, 0.0], [0.4, 0.5], [1.2, 0.2]]), 0.5, LIMITS, 0.35)
        band[1 : n - 1, :3] += rng.normal(0.0, 0.05, (n - 2, 3))
        first, end = band[0, :3].copy(), band[n - 1, :2].copy()
        obstacles = np.array([[*rng.uniform(0.2, 1.0, 2), 0.0, 0.1, 0.0, 0.1]])
        costs = [tighten(band, n, obstacles, setting, 1, *memory(40)) for _ in range(15)]
        assert all(b <= a for a, b in itertools.pairwise(costs))
        assert np.array_equal(band[0, :3], first) and np.array_equal(band[n - 1, :2], end)
        assert band[: n - 1, TIME].min() > 0.0


def test_a_tight_band_in_an_empty_world_drives_straight_at_about_top_speed() -> None:
    band = np.zeros((40, 4))
    n = lay(band, np.array([[0.0, 0.0], [0.5, 0.4], [1.0, 0.0]]), 0.0, LIMITS, 0.35)
    for _ in range(20):
        n = resize(band, n, 0.35, 4)
        tighten(band, n, np.empty((0, 6)), setting_of(), 10, *memory(40))
    assert np.abs(band[:n, 1]).max() < 0.02
    assert band[: n - 1, TIME].sum() == pytest.approx(4.0, rel=0.1)
    v, w = speeds_of(band)
    assert v == pytest.approx(0.25, abs=0.08) and abs(w) < 0.1


def test_a_band_is_laid_along_its_way_with_a_turn_first() -> None:
    band = np.zeros((40, 4))
    n = lay(band, np.array([[0.0, 0.0], [0.0, 1.0]]), 0.0, LIMITS, 0.35)
    assert band[0].tolist()[:3] == [0.0, 0.0, 0.0]
    assert band[1, :2].tolist() == [0.0, 0.0] and band[1, 2] == pytest.approx(math.pi / 2)
    assert band[n - 1, :2] == pytest.approx([0.0, 1.0])
    assert band[: n - 1, TIME].sum() == pytest.approx(4.0 + math.pi / 2 / 1.5, rel=0.01)
    assert lay(band, np.array([[0.0, 0.0], [900.0, 0.0]]), 0.0, LIMITS, 0.35) <= 40
    assert lay(band, np.zeros((2, 2)), 0.0, LIMITS, 0.35) >= 3


def test_resizing_keeps_the_way_and_its_time() -> None:
    band = np.zeros((40, 4))
    n = lay(band, np.array([[0.0, 0.0], [1.0, 0.0]]), 0.0, LIMITS, 0.35)
    time = band[: n - 1, TIME].sum()
    for wanted in (0.1, 0.1, 1.0, 1.0, 1.0):
        n = resize(band, n, wanted, 4)
        assert 4 <= n <= 40
        assert band[: n - 1, TIME].sum() == pytest.approx(time)
        assert (np.diff(band[:n, 0]) > 0.0).all()


def test_a_band_begins_where_the_robot_is_now() -> None:
    band = np.zeros((40, 4))
    n = lay(band, np.array([[0.0, 0.0], [1.0, 0.0]]), 0.0, LIMITS, 0.35)
    m = begin_at(band, n, 0.2, 0.01, 0.05, 1.1, 0.0)
    assert m < n
    assert band[0, :3].tolist() == [0.2, 0.01, 0.05] and band[m - 1, :2].tolist() == [1.1, 0.0]


def test_the_first_obstacle_on_a_way_is_found_where_it_will_be() -> None:
    way = np.array([[0.0, 0.0], [2.0, 0.0]])
    rows = np.array([[1.5, 0.0, 0.0, 0.0, 0.0, 0.1], [1.0, -0.8, math.pi / 2, 0.2, 0.0, 0.1]])
    which, leg, x, y = first_met(way, rows, 0.25, 0.2)
    assert (which, leg) == (1, 1) and x == pytest.approx(1.0) and -0.3 < y < 0.3
    assert first_met(way, rows[:0], 0.25, 0.2)[0] == -1


@pytest.mark.parametrize(("name", "value"), [("most_poses", 3), ("rounds", 0.5), ("comfort", 0.0), ("gaps", True)])
def test_a_parameter_out_of_its_range_is_refused_by_name(name: str, value: object) -> None:
    parameters = {name: value}
    with pytest.raises(BadRequest, match=rf"planner teb, {name}: .*\[planner-parameter\]"):
        Teb(**parameters)  # type: ignore[arg-type]

"""Grounds by seed: the same bits, a way for the robot, and what cannot be had is said."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable

import numpy as np
import pytest

from parcours_navigation.ground.clearance import clearance
from parcours_navigation.ground.connected import is_apart, is_connected
from parcours_navigation.ground.generators.fields import (
    BARN_SETS,
    barn,
    barn_world,
    cylinders,
    smoothed,
    warehouse,
)
from parcours_navigation.ground.generators.indoor import corridor, doorway, office
from parcours_navigation.ground.generators.site import Site
from parcours_navigation.ground.ground import lay_ground
from parcours_navigation.ground.outlines import BadGround

GENERATORS: list[Callable[..., Site]] = [corridor, doorway, office, cylinders, barn, warehouse]
each = pytest.mark.parametrize("generator", GENERATORS, ids=lambda generator: generator.__name__)


def digest(site: Site) -> str:
    return hashlib.sha256(site.ground.pack().tobytes() + repr((site.start, site.goal)).encode()).hexdigest()


@each
def test_a_seed_gives_the_same_site_and_another_seed_another(generator: Callable[..., Site]) -> None:
    assert digest(generator(3)) == digest(generator(3))
    assert len({digest(generator(seed)) for seed in range(6)}) >= 5


@each
def test_start_and_goal_are_free_and_a_disc_gets_from_one_to_the_other(generator: Callable[..., Site]) -> None:
    for seed in range(12):
        site = generator(seed, radius=0.2)
        packed = site.ground.pack()
        assert clearance(packed, *site.start[:2]) > 0.2
        assert clearance(packed, *site.goal) > 0.2
        assert is_connected(packed, site.area, site.start[:2], site.goal, 0.2)
        assert site.area[0] < site.start[0] < site.area[2] and -math.pi <= site.start[2] <= math.pi


@each
def test_a_seed_that_is_none_is_refused(generator: Callable[..., Site]) -> None:
    with pytest.raises(BadGround, match=rf"{generator.__name__}: a seed is a whole number.*-1 was given \[seed\]"):
        generator(-1)


@each
def test_a_radius_that_is_none_is_refused(generator: Callable[..., Site]) -> None:
    for radius in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(BadGround, match=r"\[ground-range\]"):
            generator(0, radius=radius)


def test_a_field_that_no_disc_gets_through_is_said_to_be_one_after_a_bounded_number_of_draws(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("parcours_navigation.ground.generators.site._MOST_DRAWN", 10_000)
    with pytest.raises(BadGround, match=r"barn: a disc of 0.25 m must .* in none of 11 .*fewer.*\[ground-connected\]"):
        barn(0, fill=0.6, smoothing=2)


def test_parameters_out_of_range_are_refused_by_name() -> None:
    with pytest.raises(BadGround, match=r"barn, fill: it must be from 0 to 1, but is 1.5 \[ground-range\]"):
        barn(0, fill=1.5)
    with pytest.raises(BadGround, match=r"doorway, door: it must be from 0.6 to 1000, but is 0.5 \[ground-range\]"):
        doorway(0, door=0.5)


def test_the_automaton_is_the_rule_applied_cell_by_cell() -> None:
    filled = np.random.default_rng(0).random((9, 7)) < 0.4
    wanted = np.zeros_like(filled)
    for row in range(9):
        for column in range(7):
            around = filled[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].sum() - filled[row, column]
            wanted[row, column] = around >= 5 or (filled[row, column] and around > 1)
    assert (smoothed(filled) == wanted).all()


def test_worlds_like_barn_come_in_twelve_sets_and_get_denser() -> None:
    assert len(BARN_SETS) == 12
    sparse = np.mean([len(barn_world(number).ground.discs) for number in range(0, 75, 15)])
    dense = np.mean([len(barn_world(number).ground.discs) for number in range(225, 300, 15)])
    assert dense > 1.5 * sparse
    assert digest(barn_world(7, seed=1)) != digest(barn_world(7))
    with pytest.raises(BadGround, match=r"worlds have whole numbers from 0 to 299, but 300 was given \[ground-range\]"):
        barn_world(300)


def test_no_ground_is_both_connected_and_apart_and_narrow_gaps_are_decided() -> None:
    area = np.array([0.0, 0.0, 4.0, 4.0])
    ends = ((0.5, 2.0), (3.5, 1.3))
    for gap, yes, no in (
        (0.30, False, True),
        (0.36, False, None),
        (0.40, False, None),
        (0.46, None, False),
        (0.5, True, False),
    ):
        packed = lay_ground([[2.0, 0.0, 2.0, 2.0 - gap / 2], [2.0, 2.0 + gap / 2, 2.0, 4.0]], bounds=area).pack()
        found = is_connected(packed, area, *ends, 0.2), is_apart(packed, area, *ends, 0.2)
        assert found != (True, True)
        assert yes is None or found[0] == yes
        assert no is None or found[1] == no
        fine = is_connected(packed, area, *ends, 0.2, spacing=0.01), is_apart(packed, area, *ends, 0.2, spacing=0.01)
        assert fine == (gap > 0.42, gap < 0.38) or gap == 0.4
    for seed in range(12):  # some need several attempts
        site = cylinders(seed, n=26, size=4.0, radius=0.2)
        assert not is_apart(site.ground.pack(), site.area, site.start[:2], site.goal, 0.2)


def test_a_goal_counts_as_reached_within_its_tolerance() -> None:
    area = np.array([0.0, 0.0, 4.0, 4.0])
    packed = lay_ground(discs=[[3.0, 2.0, 0.3]], bounds=area).pack()
    ends = ((1.0, 2.0), (3.0, 2.0))
    assert is_apart(packed, area, *ends, 0.2) and not is_connected(packed, area, *ends, 0.2)
    assert is_connected(packed, area, *ends, 0.2, tolerance=0.7) and not is_apart(packed, area, *ends, 0.2, 0.7)
    with pytest.raises(BadGround, match=r"spacing: .* points, but 1e-09 m is given.*\[map-size\]"):
        is_connected(packed, area, *ends, 0.2, spacing=1e-9)


def test_a_gap_is_a_way_where_it_is_wide_enough() -> None:
    area = np.array([0.0, 0.0, 4.0, 4.0])

    def through(gap: float) -> bool:
        packed = lay_ground([[2.0, 0.0, 2.0, 2.0 - gap / 2], [2.0, 2.0 + gap / 2, 2.0, 4.0]], bounds=area).pack()
        return is_connected(packed, area, (0.5, 2.0), (3.5, 1.3), 0.2)

    assert through(0.5)
    assert not through(0.4)
    assert not is_connected(np.empty(0), area, (0.5, 0.5), (9.0, 9.0), 0.2), "the goal is not in the area"
    assert not is_connected(lay_ground(discs=[[0.5, 0.5, 0.3]]).pack(), area, (0.5, 0.5), (3.0, 3.0), 0.2)

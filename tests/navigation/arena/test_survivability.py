"""Survivability: the closed form against small steps through time, and cases whose answer is plain."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.kernels import Record
from parcours_navigation.arena.obstacles import OBSTACLE, place_at
from parcours_navigation.arena.survivability import survivability, time_to_hit
from parcours_navigation.cases.family import SystemCases

SECOND = 1_000_000_000


def obstacle(x: float, y: float, heading: float, speed: float, turn: float, start: float, stop: float) -> Record:
    case = np.zeros((1, 1), OBSTACLE)
    case["x0"], case["y0"], case["heading0"], case["speed"], case["turn"] = x, y, heading, speed, turn
    case["start"], case["stop"], case["radius"] = round(start * SECOND), round(stop * SECOND), 0.1
    return case


def stepped(one: Record, x: float, y: float, step: float = 0.002) -> tuple[float, float]:
    """Return (first time seen within reach, least distance beyond reach before) by looking every `step` [s]."""
    nearest = math.inf
    for k in range(int(21.0 / step) + 1):
        ox, oy = place_at(one, round(k * step * SECOND))
        gap = math.hypot(x - ox, y - oy) - 0.225
        if gap <= 0.0:
            return k * step, nearest
        nearest = min(nearest, gap)
    return math.inf, nearest


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-math.pi, math.pi),
    st.floats(0.05, 0.5),
    st.floats(-1.6, 1.6) | st.sampled_from([0.0, 1e-8, -1e-6, 1e-4]),
    st.floats(0.0, 8.0),
    st.floats(0.0, 12.0),
    st.floats(0.2, 1.8),
    st.floats(0.2, 1.8),
)
def test_the_closed_form_is_what_small_steps_find(
    heading: float, speed: float, turn: float, start: float, lasts: float, x: float, y: float
) -> None:
    one = obstacle(1.0, 1.0, heading, speed, turn, start, start + lasts).view(np.recarray)[0, 0]
    seen, nearest = stepped(one, x, y)
    found = time_to_hit(one, 0.125, x, y)
    if math.isinf(seen):
        # one that only grazes between two looks may be missed by them: it comes no deeper than this
        assert math.isinf(found) or nearest < 1e-6
    else:
        # the hit is found no later than it is seen, and no earlier than one step, but for a graze missed before
        assert found <= seen + 1e-9
        assert found >= seen - 0.002 - 1e-6 or nearest < 1e-6


def test_a_robot_in_the_line_of_a_straight_runner_is_hit_when_the_gap_is_closed() -> None:
    one = obstacle(0.0, 1.0, 0.0, 0.5, 0.0, 2.0, 9.0).view(np.recarray)[0, 0]
    assert time_to_hit(one, 0.125, 1.225, 1.0) == pytest.approx(2.0 + 1.0 / 0.5, abs=1e-12)
    assert math.isinf(time_to_hit(one, 0.125, 1.0, 1.3))
    assert math.isinf(time_to_hit(one, 0.125, -0.5, 1.0)), "behind it"


def test_one_that_turns_in_a_circle_hits_what_is_behind_it_in_the_end() -> None:
    radius = 0.4
    one = obstacle(1.0, 1.0, 0.0, radius * 1.0, 1.0, 0.0, 7.0).view(np.recarray)[0, 0]
    half = 2.0 * math.asin(0.225 / (2.0 * radius))
    behind = 1.2 * half
    x, y = 1.0 - radius * math.sin(behind), 1.4 - radius * math.cos(behind)
    assert time_to_hit(one, 0.125, x, y) == pytest.approx(2.0 * math.pi - behind - half, abs=1e-9)
    shorter = obstacle(1.0, 1.0, 0.0, radius * 1.0, 1.0, 0.0, 4.0).view(np.recarray)[0, 0]
    assert math.isinf(time_to_hit(shorter, 0.125, x, y))


def test_standing_obstacles_hit_nobody_but_cover_places() -> None:
    found = survivability(obstacle(1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 21.0))[0]
    assert (found["survived"], found["hit"]) == (1.0, 0.0)
    middles = (np.arange(16) + 0.5) / 8.0
    covered = np.hypot(middles[:, None] - 1.0, middles[None, :] - 1.0) <= 0.225
    assert found["places"] == 256 - covered.sum()


def test_where_every_place_is_covered_nothing_is_known() -> None:
    found = survivability(obstacle(1.0, 1.0, 0.0, 0.1, 0.0, 0.0, 5.0), robot_radius=3.0)[0]
    assert found["places"] == 0
    assert math.isnan(found["survived"]) and math.isnan(found["hit"])


def test_faster_obstacles_leave_less_time() -> None:
    cases = SystemCases(2).obstacles(np.arange(100))
    slow = cases.copy()
    slow["speed"] *= 0.5
    slow["turn"] *= 0.5  # the same ways, half as fast, so half as far
    assert (survivability(slow)["survived"] >= survivability(cases)["survived"] - 1e-12).all()
    assert survivability(slow)["survived"].mean() > survivability(cases)["survived"].mean() + 0.01


def test_more_obstacles_leave_less_time_where_all_places_stay_open() -> None:
    cases = SystemCases(2).obstacles(np.arange(200))
    two, three = survivability(cases[:, :2]), survivability(cases)
    assert (three["places"] < two["places"]).all()
    assert two["survived"].mean() > three["survived"].mean()


def test_the_number_of_a_case_does_not_depend_on_the_others() -> None:
    cases = SystemCases(2).obstacles(np.arange(40))
    order = np.random.default_rng(0).permutation(40)
    assert (survivability(cases[order]) == survivability(cases)[order]).all()


def test_a_bad_request_is_refused_by_name() -> None:
    with pytest.raises(BadRequest, match=r"survivability, places: .* is 0 .*\[solvability-range\]"):
        survivability(np.zeros((1, 0), OBSTACLE), places=0)

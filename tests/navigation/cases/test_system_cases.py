"""System cases: start vectors that come true, blocks that are hit, ids and numbers that stay."""

from __future__ import annotations

import math

import numpy as np
import pytest

from parcours.data import cover
from parcours.errors import BadRequest
from parcours_navigation.cases.family import PROTOCOLS, STATIC, SystemCases, input_model, start_cases
from parcours_navigation.cases.published import PUBLISHED, folder_of, total

SECOND = 1_000_000_000
NUMBERS = np.arange(270)
VECTORS = {(0, a, a + b) for a in range(3) for b in range(3)}


def offset(before: np.void, this: np.void) -> int:
    """Return how the second obstacle set out: 0 with the first, 1 while that moved, 2 after it had stopped."""
    if this["start"] == before["start"]:
        return 0
    assert this["start"] > before["start"]
    return 1 if this["start"] < before["stop"] else 2


@pytest.mark.parametrize("seed", [0, 7])
def test_the_drawn_durations_bring_about_the_order_that_the_start_vector_says(seed: int) -> None:
    cases = SystemCases(seed)
    obstacles = cases.obstacles(NUMBERS)
    for number in NUMBERS:
        first, second, third = obstacles[number]
        one = offset(first, second)
        assert (0, one, one + offset(second, third)) == cases.vector(int(number))


def test_all_nine_start_vectors_take_turns() -> None:
    cases = SystemCases(0)
    assert {cases.vector(k) for k in range(9)} == VECTORS
    assert all(cases.vector(k) == cases.vector(k + 9) for k in range(50))


@pytest.mark.parametrize("seed", [0, 7])
@pytest.mark.parametrize("abstract", range(9))
def test_each_choice_is_met_for_every_abstract_case_by_its_first_three_rows_and_any_three_after(
    seed: int, abstract: int
) -> None:
    model = input_model()
    for first in (0, 3, 27):
        numbers = abstract + 9 * np.arange(first, first + 3)
        coverage = cover(model, SystemCases(seed).values(numbers))
        assert coverage.is_complete, coverage.uncovered


def test_obstacles_begin_apart_off_the_robot_and_head_for_it() -> None:
    obstacles = SystemCases(0).obstacles(NUMBERS)
    for i in range(3):
        for j in range(i):
            gaps = np.hypot(
                obstacles["x0"][:, i] - obstacles["x0"][:, j], obstacles["y0"][:, i] - obstacles["y0"][:, j]
            )
            assert gaps.min() >= 0.2
    assert np.hypot(obstacles["x0"], obstacles["y0"]).min() >= 0.225
    aside = np.arctan2(-obstacles["y0"], -obstacles["x0"]) - obstacles["heading0"]
    assert np.abs(np.remainder(aside + math.pi, math.tau) - math.pi).max() < 1e-9


def test_all_values_lie_in_the_ranges_of_table_vii() -> None:
    obstacles = SystemCases(0).obstacles(NUMBERS)
    for name, low, high in (
        ("x0", 0.5, 2.0),
        ("y0", 0.5, 2.0),
        ("speed", 0.0, 0.5),
        ("turn", -math.pi / 2, math.pi / 2),
    ):
        assert obstacles[name].min() >= low
        assert obstacles[name].max() <= high
    waits = obstacles["start"] / SECOND - STATIC
    lasts = (obstacles["stop"] - obstacles["start"]) / SECOND
    for duration in (waits, lasts):
        assert duration.min() >= 0.0
        assert duration.max() <= 10.0


def test_a_case_is_the_same_alone_in_a_crowd_and_in_another_order() -> None:
    for protocol in PROTOCOLS:
        cases = SystemCases(5, protocol)
        together = cases.obstacles(NUMBERS)
        assert cases.obstacles(NUMBERS[::-1])[::-1].tobytes() == together.tobytes()
        for number in (0, 8, 100, 269):
            assert cases.obstacles(np.array([number]))[0].tobytes() == together[number].tobytes()


def test_another_seed_draws_other_values_and_the_same_seed_the_same() -> None:
    assert SystemCases(1).obstacles(NUMBERS).tobytes() == SystemCases(1).obstacles(NUMBERS).tobytes()
    assert not (SystemCases(1).values(NUMBERS) == SystemCases(2).values(NUMBERS)).any()


def test_ids_are_stable_and_no_two_cases_share_one() -> None:
    cases = SystemCases(0, study="ramp_system")
    assert cases.id(0) == "ramp_system/together-tp11.tp21.tp31-0.0.0/0"
    assert cases.id(904) == "ramp_system/together-tp11.tp21.tp31-0.1.2/100"
    assert SystemCases(99, study="ramp_system").id(904) == cases.id(904)
    for protocol in PROTOCOLS:
        ids = [SystemCases(0, protocol).id(k) for k in range(905)]
        assert len(set(ids)) == 905
    for abstract in start_cases():
        assert any(abstract.id in id for id in [cases.id(k) for k in range(9)])


def test_the_published_protocol_runs_as_many_tests_with_as_long_delays_as_the_authors_did() -> None:
    counts = [sum(folder_of(k) is runs for k in range(905)) for runs in PUBLISHED]
    assert counts == [114, 137, 238, 17, 100, 99, 100, 100]
    assert sum(counts) == total("n") == 905
    obstacles = SystemCases(0, "published").obstacles(np.arange(905))
    delays = [folder_of(k).delays for k in range(905)]
    assert np.array_equal(obstacles["start"] / SECOND - STATIC, np.array(delays, dtype=float))


def test_a_published_obstacle_moves_twelve_seconds_straight_or_half_a_turn_or_five_seconds() -> None:
    obstacles = SystemCases(0, "published").obstacles(np.arange(905))
    lasts = (obstacles["stop"] - obstacles["start"]) / SECOND
    turning = np.abs(obstacles["turn"]) > 0.01
    assert lasts[~turning] == pytest.approx(12.0)
    assert lasts[turning] == pytest.approx(np.minimum(5.0, math.pi / obstacles["turn"][turning]))
    assert obstacles["turn"].min() >= 0.0
    assert obstacles["x0"].min() >= 0.75


def test_published_results_are_consistent_with_each_other() -> None:
    for runs in PUBLISHED:
        assert runs.stuck <= runs.halted <= runs.n
        assert max(runs.reached, runs.feasible) <= runs.n
    assert total("stuck") / 905 == pytest.approx(0.077, abs=0.0005)
    assert total("halted") / 905 == pytest.approx(0.308, abs=0.0005)


def test_an_unknown_protocol_is_refused_by_name() -> None:
    with pytest.raises(BadRequest, match=r"table-7.*unknown-protocol"):
        SystemCases(0, "table-7")  # type: ignore[arg-type]

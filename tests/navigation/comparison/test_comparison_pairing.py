"""Paired tests against published examples, against enumeration, and against what must hold of any such test."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.verdict.statistics import holm, rate_difference
from parcours_navigation.comparison.pairing import time_difference


def table(both: int, first: int, second: int, neither: int) -> tuple[list[bool], list[bool]]:
    pairs = [(True, True)] * both + [(True, False)] * first + [(False, True)] * second + [(False, False)] * neither
    return [a for a, _ in pairs], [b for _, b in pairs]


@pytest.mark.parametrize(
    ("counts", "low", "high"),
    [
        ((36, 12, 2, 0), 0.0569, 0.3404),  # Newcombe 1998, table III, method 10
        ((0, 0, 0, 1), -0.7935, 0.7935),  # nothing known: the Wilson limits of 0 of 1
    ],
)
def test_the_interval_of_a_rate_difference_is_newcombes(
    counts: tuple[int, int, int, int], low: float, high: float
) -> None:
    found = rate_difference(*table(*counts))
    assert (found.low, found.high) == pytest.approx((low, high), abs=2e-4)


@given(st.tuples(*[st.integers(0, 30)] * 4).filter(any))
def test_swapping_the_planners_turns_the_difference_round(counts: tuple[int, int, int, int]) -> None:
    a, b = table(*counts)
    one, two = rate_difference(a, b), rate_difference(b, a)
    assert (one.difference, one.low, one.high) == pytest.approx((-two.difference, -two.high, -two.low))
    assert one.pairs.p_value == two.pairs.p_value
    assert -1.0 <= one.low <= one.difference + 1e-12 and one.difference - 1e-12 <= one.high <= 1.0


def signed_rank_by_enumeration(gaps: list[float]) -> float:
    """The two-sided p-value over all assignments of signs, without ties or zeros."""
    ranks = [sorted(map(abs, gaps)).index(abs(g)) + 1 for g in gaps]
    seen = sum(r for r, g in zip(ranks, gaps, strict=True) if g > 0)
    middle = sum(ranks) / 2.0
    sums = [sum(itertools.compress(ranks, signs)) for signs in itertools.product([0, 1], repeat=len(ranks))]
    return sum(abs(s - middle) >= abs(seen - middle) for s in sums) / len(sums)


@pytest.mark.parametrize("gaps", [[1.0, -2.0, 3.0, 4.0, 5.0, 6.5], [-0.5, 1.5, -2.5, 3.5], [9.0, 8.0, 7.0, 6.0, 5.5]])
def test_times_are_compared_by_the_exact_signed_rank_test_where_cases_are_few(gaps: list[float]) -> None:
    found = time_difference(gaps, [0.0] * len(gaps))
    assert found.p_value == pytest.approx(signed_rank_by_enumeration(gaps))
    assert found.median == pytest.approx(float(np.median(gaps)))


def test_cases_that_only_one_planner_finished_have_no_part_in_times() -> None:
    found = time_difference([1.0, math.nan, 3.0, 9.0], [2.0, 5.0, math.nan, 11.0])
    assert found.n == 2 and found.median == -1.5


def test_equal_times_and_no_times_say_nothing_against_chance() -> None:
    equal, none = time_difference([1.0, 2.0], [1.0, 2.0]), time_difference([math.nan], [1.0])
    assert (equal.p_value, equal.rank_biserial, equal.median) == (1.0, 0.0, 0.0)
    assert (none.n, none.p_value) == (0, 1.0) and math.isnan(none.median)


def test_the_median_interval_covers_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(400):
        found = time_difference(rng.exponential(size=25), np.zeros(25))
        held += found.low <= math.log(2.0) <= found.high
    assert held >= 0.93 * 400


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_holm_never_helps_keeps_the_order_and_stays_within_bonferroni(p_values: list[float]) -> None:
    corrected = holm(p_values)
    for (p, c), (q, d) in itertools.product(zip(p_values, corrected, strict=True), repeat=2):
        assert p <= c <= min(1.0, len(p_values) * p)
        assert c <= d or p >= q


def test_a_p_value_beyond_one_and_results_of_other_cases_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"but 1.5 given \[p-value\]"):
        holm([0.1, 1.5])
    with pytest.raises(BadRequest, match=r"shapes are \(2,\) and \(1,\).*\[pairs-shape\]"):
        time_difference([1.0, 2.0], [1.0])

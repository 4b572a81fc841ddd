"""Rates, paired tests and comparisons agree with published figures and with their own definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.verdict.statistics import compare_pairs, compare_with_published, mcnemar, quantiles, wilson

COUNTS = st.integers(1, 5000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@pytest.mark.parametrize(
    ("count", "n", "low", "high"),
    [
        (70, 905, 0.0617, 0.0966),  # the paper's stuck cases
        (72, 905, 0.0637, 0.0990),
        # R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_intervals_are_the_published_ones(count: int, n: int, low: float, high: float) -> None:
    rate = wilson(count, n)
    assert (round(rate.low, 4), round(rate.high, 4)) == (low, high)


@given(COUNTS, st.floats(0.5, 0.999))
def test_an_interval_holds_the_share_and_solves_the_score_equation(counts: tuple[int, int], confidence: float) -> None:
    from scipy.stats import norm

    count, n = counts
    rate = wilson(count, n, confidence)
    assert 0 <= rate.low <= rate.share + 1e-12 and rate.share - 1e-12 <= rate.high <= 1
    z = norm.ppf(0.5 + confidence / 2)
    for end in (rate.low, rate.high):
        if 1e-9 < end < 1 - 1e-9:
            assert abs(abs(rate.share - end) / math.sqrt(end * (1 - end) / n) - z) < 1e-4


@given(COUNTS)
def test_more_confidence_and_fewer_cases_widen_the_interval(counts: tuple[int, int]) -> None:
    count, n = counts
    rate, surer, more = wilson(count, n), wilson(count, n, 0.99), wilson(4 * count, 4 * n)
    assert surer.high - surer.low > rate.high - rate.low > more.high - more.low


def test_without_cases_nothing_is_known() -> None:
    rate = wilson(0, 0)
    assert (rate.low, rate.high) == (0.0, 1.0) and math.isnan(rate.share)


@pytest.mark.parametrize(("count", "n"), [(-1, 5), (6, 5), (0, -1)])
def test_impossible_counts_are_refused(count: int, n: int) -> None:
    with pytest.raises(BadRequest, match="counts"):
        wilson(count, n)


def test_confidence_must_be_a_probability() -> None:
    for confidence in (0.0, 1.0, 95.0, math.nan):
        with pytest.raises(BadRequest, match="confidence"):
            wilson(1, 2, confidence)


@given(st.integers(0, 60), st.integers(0, 60))
def test_mcnemar_is_the_two_sided_binomial_tail(first_only: int, second_only: int) -> None:
    n, k = first_only + second_only, min(first_only, second_only)
    tail = sum(math.comb(n, i) for i in range(k + 1)) / 2**n
    assert mcnemar(first_only, second_only) == pytest.approx(min(1.0, 2 * tail))


@given(st.lists(st.tuples(st.booleans(), st.booleans()), max_size=40))
def test_pairs_are_counted_each_once_and_swap_with_their_order(pairs: list[tuple[bool, bool]]) -> None:
    first, second = [a for a, _ in pairs], [b for _, b in pairs]
    found, swapped = compare_pairs(first, second), compare_pairs(second, first)
    assert (found.both, found.first_only, found.second_only, found.neither) == (
        pairs.count((True, True)),
        pairs.count((True, False)),
        pairs.count((False, True)),
        pairs.count((False, False)),
    )
    assert found.n == len(pairs)
    assert (swapped.first_only, swapped.second_only) == (found.second_only, found.first_only)
    assert swapped.p_value == found.p_value


def test_pairs_of_different_campaigns_are_refused() -> None:
    with pytest.raises(BadRequest, match="pairs-shape"):
        compare_pairs([True], [True, False])


def test_a_like_rate_is_near_the_published_and_a_far_one_is_not() -> None:
    like = compare_with_published(770, 10_000, 70, 905)
    assert like.p_value > 0.9 and abs(like.difference) < 0.001
    far = compare_with_published(10, 905, 70, 905)
    assert far.p_value < 1e-9 and far.difference < 0


@given(COUNTS, COUNTS)
def test_fisher_is_symmetric(a: tuple[int, int], b: tuple[int, int]) -> None:
    here, there = compare_with_published(*a, *b), compare_with_published(*b, *a)
    assert here.p_value == pytest.approx(there.p_value)
    assert 0 <= here.p_value <= 1 + 1e-9


def test_comparing_with_nothing_says_nothing() -> None:
    empty = compare_with_published(0, 0, 70, 905)
    assert empty.p_value == 1.0 and math.isnan(empty.difference)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_quantiles_ascend_from_the_least_to_the_greatest_value(values: list[float]) -> None:
    found = quantiles(values, at=[0.0, 0.25, 0.5, 0.75, 1.0])
    assert found[0] == min(values) and found[-1] == max(values)
    assert list(found) == sorted(found) or np.allclose(found, sorted(found))


def test_missing_values_are_left_out_and_none_at_all_gives_nan() -> None:
    assert quantiles([1.0, math.nan, 3.0], at=[0.5]) == (2.0,)
    assert all(math.isnan(q) for q in quantiles([math.nan]))
    assert len(quantiles([])) == 5


def test_a_share_beyond_one_is_refused() -> None:
    with pytest.raises(BadRequest, match="quantile-share"):
        quantiles([1.0], at=[50])

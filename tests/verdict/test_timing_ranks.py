"""What repeats allow to say of a quantile, against sums of binomial probabilities written out."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import accumulate

import numpy as np
import pytest

from parcours.verdict.timing.ranks import chance_of_largest, greatest_miss_rate, quantile_ranks, repeats_needed


def at_most(n: int, p: Fraction) -> list[Fraction]:
    """Probabilities of at most 0, 1, ... n of n, exactly."""
    return list(accumulate(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(n + 1)))


@pytest.mark.parametrize("quantile", [Fraction(1, 2), Fraction(9, 10), Fraction(95, 100), Fraction(99, 100)])
@pytest.mark.parametrize("n", [1, 2, 10, 59, 60, 120])
@pytest.mark.parametrize("error", [Fraction(1, 100), Fraction(1, 20), Fraction(1, 4)])
def test_ranks_are_the_tightest_that_keep_the_error(quantile: Fraction, n: int, error: Fraction) -> None:
    low, high = quantile_ranks(n, float(quantile), float(error))
    chances = at_most(n, quantile)
    assert low == sum(chance <= error for chance in chances)
    assert high == 1 + sum(chance < 1 - error for chance in chances)


@pytest.mark.parametrize(("misses", "percent"), [(0, 99), (1, 99), (5, 99), (0, 95), (3, 90), (40, 50)])
def test_so_many_repeats_are_enough_and_one_less_is_not(misses: int, percent: int) -> None:
    n = repeats_needed(percent / 100, 0.05, misses)
    assert quantile_ranks(n, percent / 100, 0.05)[1] <= n - misses
    assert quantile_ranks(n - 1, percent / 100, 0.05)[1] > n - 1 - misses


def test_known_sample_sizes_are_met() -> None:
    # one-sided nonparametric tolerance limits, 95 %: 59 for 95 %, 299 for 99 %, 2995 for 99.9 % (S. S. Wilks, 1941)
    assert [repeats_needed(p, 0.05) for p in (0.95, 0.99, 0.999)] == [59, 299, 2995]
    assert repeats_needed(0.999999999, 0.05) > 2_000_000_000, "found without counting up to it"


def test_a_greatest_miss_rate_leaves_just_the_error() -> None:
    for misses, n in ((0, 1), (0, 300), (3, 300), (250, 300)):
        rate = greatest_miss_rate(misses, n, 0.05)
        assert float(at_most(n, Fraction(rate))[misses]) == pytest.approx(0.05, rel=1e-9)
    assert greatest_miss_rate(300, 300, 0.05) == 1.0
    assert greatest_miss_rate(0, 1000, 0.05) == pytest.approx(3 / 1000, rel=0.01), "the rule of three"


def test_the_quantile_lies_beyond_its_limits_no_more_often_than_said() -> None:
    # steps and ties included: durations of two values only
    rng = np.random.default_rng(5)
    for n, quantile, draw, true in (
        (80, 0.95, lambda n: rng.exponential(1.0, n), -math.log(0.05)),
        (299, 0.99, lambda n: rng.pareto(1.1, n), 0.01 ** (-1 / 1.1) - 1.0),
        (299, 0.99, lambda n: np.where(rng.random(n) < 0.989, 1.0, 7.0), 7.0),
    ):
        low, high = quantile_ranks(n, quantile, 0.05)
        samples = np.sort([draw(n) for _ in range(4000)], axis=1)
        assert np.mean(samples[:, low - 1] > true) < 0.05 + 0.01
        assert np.mean(samples[:, high - 1] < true) < 0.05 + 0.01


def test_a_chance_of_ranks_is_the_share_of_orders() -> None:
    assert chance_of_largest(2, 3, 2) == pytest.approx(math.comb(3, 2) / math.comb(5, 2))
    assert chance_of_largest(0, 3, 2) == 1.0
    assert chance_of_largest(3, 3, 2) == pytest.approx(1 / math.comb(5, 3))

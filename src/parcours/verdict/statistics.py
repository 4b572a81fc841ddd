"""Counts of verdicts become rates with intervals, paired tests and comparisons with published counts.

Intervals are Wilson's (E. B. Wilson, JASA 22, 1927), which stay inside [0, 1] and hold near 0; schedules run
on the same cases are compared by McNemar's exact test on the pairs that disagree (Q. McNemar, Psychometrika
12, 1947), with Newcombe's interval for the difference of paired rates (R. G. Newcombe, Statist. Med. 17, 1998, method
10); two independent campaigns by Fisher's exact test.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest


@dataclass(frozen=True, slots=True)
class Rate:
    """How often something happened: `count` of `n`, with the interval [low, high] that holds the true rate.

    With n = 0 nothing is known: `share` is NaN and the interval is [0, 1].
    """

    count: int
    n: int
    low: float
    high: float
    confidence: float

    @property
    def share(self) -> float:
        """The observed rate, count / n; NaN without any case."""
        return self.count / self.n if self.n else math.nan


def wilson(count: int, n: int, confidence: float = 0.95) -> Rate:
    """Return the rate count / n with its Wilson score interval.

    Args:
        count: how often it happened, 0 <= count <= n.
        n: number of cases.
        confidence: probability that such an interval holds the true rate, in (0, 1).

    Raises:
        BadRequest: the counts are negative or count exceeds n, or the confidence is not between 0 and 1.

    Example: the published system was stuck in 70 of 905 cases.

    >>> stuck = wilson(70, 905)
    >>> f"{stuck.share:.1%} [{stuck.low:.2%}, {stuck.high:.2%}]"
    '7.7% [6.17%, 9.66%]'
    >>> half_open = wilson(72, 905)
    >>> f"{half_open.low:.2%} {half_open.high:.2%}"
    '6.37% 9.90%'
    """
    _check_counts(count, n)
    if not 0.0 < confidence < 1.0:
        raise BadRequest("confidence", f"it must lie between 0 and 1, but {confidence:g} given", slug="confidence")
    if n == 0:
        return Rate(0, 0, 0.0, 1.0, confidence)
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    middle, half = count + 0.5 * z * z, z * math.sqrt(count * (n - count) / n + 0.25 * z * z)
    low = 0.0 if count == 0 else (middle - half) / (n + z * z)
    high = 1.0 if count == n else (middle + half) / (n + z * z)
    return Rate(count, n, low, high, confidence)


@dataclass(frozen=True, slots=True)
class Pairs:
    """Two yes/no results of the same cases: how many agree, how many differ, and McNemar's exact p-value."""

    both: int
    first_only: int
    second_only: int
    neither: int
    p_value: float

    @property
    def n(self) -> int:
        """The number of pairs."""
        return self.both + self.first_only + self.second_only + self.neither


def mcnemar(first_only: int, second_only: int) -> float:
    """Return the two-sided p-value of McNemar's exact test: that both results are equally likely.

    Args:
        first_only: pairs where only the first result is yes.
        second_only: pairs where only the second is.

    Raises:
        BadRequest: a count is negative.

    Example: of 10 pairs that differ, 9 favour the first: 2 (10 + 1) / 2**10.

    >>> round(mcnemar(9, 1), 6)
    0.021484
    >>> mcnemar(0, 0)
    1.0
    """
    _check_counts(min(first_only, second_only), first_only + second_only)
    if first_only + second_only == 0:
        return 1.0
    from scipy.special import bdtr  # scipy.stats takes half a second to load

    # The lesser count, or less: as likely as the same on the other side, since both sides are alike.
    return min(2.0 * float(bdtr(min(first_only, second_only), first_only + second_only, 0.5)), 1.0)


def compare_pairs(first: ArrayLike, second: ArrayLike) -> Pairs:
    """Return how two yes/no results of the same cases agree.

    Args:
        first: truth values, shape (n_cases,).
        second: truth values of the same cases in the same order, shape (n_cases,).

    Raises:
        BadRequest: the two differ in length.

    >>> pairs = compare_pairs([1, 1, 1, 0], [1, 0, 0, 0])
    >>> pairs.both, pairs.first_only, pairs.second_only, pairs.neither, pairs.p_value
    (1, 2, 0, 1, 0.5)
    """
    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    if a.shape != b.shape or a.ndim != 1:
        raise BadRequest(
            "paired results",
            f"both must have one value per case, but their shapes are {a.shape} and {b.shape}",
            "compare the same cases in the same order",
            slug="pairs-shape",
        )
    both, of_first, of_second = (int(np.count_nonzero(one)) for one in (a & b, a, b))
    first_only, second_only = of_first - both, of_second - both
    return Pairs(both, first_only, second_only, len(a) - both - first_only - second_only,
                 mcnemar(first_only, second_only))  # fmt: skip


@dataclass(frozen=True, slots=True)
class RateDifference:
    """How often something happened in one run and not in another, on the same cases."""

    pairs: Pairs  # the four counts, and McNemar's exact p-value
    difference: float  # share of the first minus share of the second; NaN without any case
    low: float  # its interval of 95 %
    high: float

    @property
    def odds_ratio(self) -> float | None:
        """Cases that only the first has over cases that only the second has; None where the second has none."""
        return self.pairs.first_only / self.pairs.second_only if self.pairs.second_only else None


def rate_difference(first: ArrayLike, second: ArrayLike) -> RateDifference:
    """Return how two truth values of the same cases, shape (n_cases,), differ; BadRequest if they differ in length.

    >>> found = rate_difference([1, 1, 1, 1, 0], [1, 0, 0, 0, 0])
    >>> round(found.difference, 3), round(found.pairs.p_value, 3), found.odds_ratio
    (0.6, 0.25, None)
    """
    pairs = compare_pairs(first, second)
    if not pairs.n:
        return RateDifference(pairs, math.nan, -1.0, 1.0)
    low, high = _newcombe(pairs)
    return RateDifference(pairs, (pairs.first_only - pairs.second_only) / pairs.n, low, high)


def _newcombe(pairs: Pairs) -> tuple[float, float]:
    """Return the interval of the difference of two paired rates, from their Wilson intervals and their correlation."""
    #                    second yes  second no
    #        first yes       a           b        only b and c say which of the two is better
    #        first no        c           d
    a, b, c, d, n = pairs.both, pairs.first_only, pairs.second_only, pairs.neither, pairs.n
    one, two = wilson(a + b, n), wilson(a + c, n)
    margins = (a + b) * (c + d) * (a + c) * (b + d)
    product = a * d - b * c
    corrected = max(product - n / 2, 0.0) if product > 0 else float(product)
    phi = corrected / math.sqrt(margins) if margins else 0.0

    def reach(x: float, y: float) -> float:
        return math.sqrt(max(x * x - 2.0 * phi * x * y + y * y, 0.0))

    middle = (b - c) / n
    low, high = reach(one.share - one.low, two.high - two.share), reach(one.high - one.share, two.share - two.low)
    return middle - low, middle + high


@dataclass(frozen=True, slots=True)
class RateComparison:
    """Our rate beside a published one, and how likely such a gap is by chance alone."""

    ours: Rate
    published: Rate
    p_value: float

    @property
    def difference(self) -> float:
        """Our rate minus the published one; NaN if either has no case."""
        return self.ours.share - self.published.share


def compare_with_published(
    count: int, n: int, published_count: int, published_n: int, confidence: float = 0.95
) -> RateComparison:
    """Return our `count` of `n` beside the published counts, with Fisher's exact test, two-sided.

    Raises:
        BadRequest: a count is negative or exceeds its number of cases.

    Example: the tea tasting (R. A. Fisher, The Design of Experiments, 1935): 3 of 4 against 1 of 4.

    >>> tea = compare_with_published(3, 4, 1, 4)
    >>> round(tea.p_value, 4), tea.difference
    (0.4857, 0.5)
    """
    ours = wilson(count, n, confidence)
    published = wilson(published_count, published_n, confidence)
    if n == 0 or published_n == 0:
        return RateComparison(ours, published, 1.0)
    from scipy.stats import fisher_exact

    table = [[count, n - count], [published_count, published_n - published_count]]
    return RateComparison(ours, published, float(fisher_exact(np.array(table)).pvalue))


def quantiles(values: ArrayLike, at: Sequence[float] = (0.1, 0.25, 0.5, 0.75, 0.9)) -> tuple[float, ...]:
    """Return the quantiles of the values, linear between order statistics; NaN if there are no values.

    Args:
        values: any unit, any shape; NaN stands for a missing value and is left out.
        at: shares in [0, 1], shape (n_quantiles,).

    Raises:
        BadRequest: a share lies outside [0, 1].

    >>> quantiles([1.0, 2.0, 3.0, 4.0, 5.0], at=[0.0, 0.5, 0.9])
    (1.0, 3.0, 4.6)
    >>> quantiles([], at=[0.5])
    (nan,)
    """
    for share in at:
        if not 0.0 <= share <= 1.0:
            raise BadRequest("quantiles", f"a share must lie in [0, 1], but {share:g} given", slug="quantile-share")
    known: NDArray[np.float64] = np.asarray(values, dtype=np.float64).ravel()
    known = known[~np.isnan(known)]
    if known.size == 0:
        return tuple(math.nan for _ in at)
    return tuple(float(q) for q in np.quantile(known, np.asarray(at, dtype=np.float64)))


def mean_of_log_normal(values: ArrayLike, confidence: float = 0.95) -> tuple[float, float]:
    """Return an interval for the mean of what is log-normally distributed (Cox's; Olsson, J. Stat. Educ. 13, 2005).

    The interval of the mean logarithm alone is one of the median, which lies below the mean. Zeros have no logarithm:
    where there are some, the upper end is that of the others, which is too high, and the lower end that of a gamma
    distribution with the mean and variance of all (Fay, Feuer, Statistics in Medicine 16, 1997).

    Args:
        values: independent of each other, not negative, shape (n,).

    >>> low, high = mean_of_log_normal([1e-4, 2e-4, 1.5e-4, 0.8e-4])
    >>> f"{low:.2g} {high:.2g}"
    '6.8e-05 0.00027'
    >>> mean_of_log_normal([1e-4])  # nothing is known of how they spread
    (0.0, inf)
    >>> low, high = mean_of_log_normal([1e-4, 0.0, 1e-4, 2e-4])
    >>> f"{low:.2g} {high:.2g}"
    '3.7e-05 0.00039'
    """
    from scipy.special import gammaincinv, stdtrit

    found = np.asarray(values, np.float64)
    logs = np.log(found[found > 0.0])
    n, tail = len(logs), (1.0 - confidence) / 2
    if 0 < n < len(found):
        mean, spread = float(found.mean()), float(found.var(ddof=1)) / len(found)
        low = spread / mean * float(gammaincinv(mean**2 / spread, tail))
        return low, mean_of_log_normal(found[found > 0.0], confidence)[1]
    if n < 2:
        return 0.0, math.inf
    spread = float(logs.var(ddof=1))
    half = float(stdtrit(n - 1, 1.0 - tail)) * math.sqrt(spread / n + spread**2 / (2 * (n - 1)))
    middle = float(logs.mean()) + spread / 2
    return math.exp(middle - half), math.exp(middle + half)


def _check_counts(count: int, n: int) -> None:
    """Raise BadRequest unless 0 <= count <= n."""
    if not 0 <= count <= n:
        raise BadRequest(
            "counts",
            f"a count must lie between 0 and the number of cases, but {count} of {n} given",
            slug="counts",
        )


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return the p-values of a family of tests, corrected for their number; in the order given.

    Args:
        p_values: in [0, 1], one a test.

    Raises:
        BadRequest: one lies outside [0, 1].

    Example: four tests, of which the smallest counts fourfold, the next threefold, and none less than the one before.

    >>> [round(p, 2) for p in holm([0.01, 0.04, 0.03, 0.005])]
    [0.03, 0.06, 0.06, 0.02]
    """
    if wrong := [p for p in p_values if not 0.0 <= p <= 1.0]:
        raise BadRequest("Holm's correction", f"a p-value lies in [0, 1], but {wrong[0]:g} given", slug="p-value")
    corrected = [0.0] * len(p_values)
    worst = 0.0
    for place, k in enumerate(sorted(range(len(p_values)), key=lambda at: p_values[at])):
        worst = max(worst, min(1.0, (len(p_values) - place) * p_values[k]))
        corrected[k] = worst
    return tuple(corrected)

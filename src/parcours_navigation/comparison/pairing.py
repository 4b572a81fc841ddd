"""How the times of two planners differ on the same cases: a paired test, its effect size and interval.

Rates are compared by `parcours.verdict.statistics.rate_difference`; times by Wilcoxon's signed-rank test on the
cases where both have one, with the rank-biserial correlation (D. S. Kerby, 2014) and the distribution-free interval of
the median difference; many tests by Holm's step-down rule (S. Holm, Scand. J. Statist. 6, 1979).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest


@dataclass(frozen=True, slots=True)
class TimeDifference:
    """How two planners' times differ on the cases where both have one; negative: the first is faster."""

    n: int  # cases where both have a time
    median: float  # of the differences, first minus second [s]; NaN without any
    low: float  # its distribution-free interval of at least 95 % [s]; infinite where there are too few cases
    high: float
    rank_biserial: float  # effect size in [-1, 1]: rank sums that favour longer times of the first, less the others
    p_value: float  # of Wilcoxon's signed-rank test, two-sided; 1 where no pair differs


def time_difference(first: ArrayLike, second: ArrayLike) -> TimeDifference:
    """Return how two times of the same cases [s], NaN where there is none, shape (n_cases,), differ.

    Zeros take part in the ranking and are then dropped (Pratt). The p-value is exact up to 50 pairs without ties or
    zeros, and normal beyond. Raises BadRequest if the two differ in length.

    >>> found = time_difference([5.0, 6.0, 7.0, 9.0, 11.0, float("nan")], [6.0, 8.0, 10.0, 13.0, 16.0, 1.0])
    >>> found.n, found.median, found.rank_biserial, found.p_value
    (5, -3.0, -1.0, 0.0625)
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if a.shape != b.shape or a.ndim != 1:
        rule = f"both must have one value per case, but their shapes are {a.shape} and {b.shape}"
        raise BadRequest("paired times", rule, "compare the same cases in the same order", slug="pairs-shape")
    gaps = np.sort((a - b)[~np.isnan(a - b)])
    if not gaps.size:
        return TimeDifference(0, math.nan, -math.inf, math.inf, 0.0, 1.0)
    low, high = _median_interval(gaps)
    if not gaps.any():
        return TimeDifference(gaps.size, 0.0, low, high, 0.0, 1.0)
    from scipy.stats import rankdata, wilcoxon

    ranks = rankdata(np.abs(gaps))
    above, below = float(ranks[gaps > 0].sum()), float(ranks[gaps < 0].sum())
    p_value = min(float(wilcoxon(gaps, zero_method="pratt").pvalue), 1.0)
    return TimeDifference(gaps.size, float(np.median(gaps)), low, high, (above - below) / (above + below), p_value)


def _median_interval(ordered: NDArray[np.float64]) -> tuple[float, float]:
    """Return two order statistics between which the median lies with a probability of at least 95 %."""
    from scipy.stats import binom

    k = int(binom.ppf(0.025, ordered.size, 0.5))
    while k > 0 and binom.cdf(k - 1, ordered.size, 0.5) > 0.025:
        k -= 1
    if k == 0:
        return -math.inf, math.inf
    return float(ordered[k - 1]), float(ordered[ordered.size - k])

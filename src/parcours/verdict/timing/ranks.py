"""What numbers of repeats and of misses allow to say about a quantile, whatever the distribution.

Of n independent durations, the number that lie below the p-quantile is binomial (n, p). So the durations of certain
ranks bound that quantile with a confidence that holds for every distribution (H. A. David & H. N. Nagaraja, Order
Statistics, 3rd ed., 2003, section 7.1); with ties or steps the confidence is only greater. The same computation on
misses is the interval of C. J. Clopper and E. S. Pearson (Biometrika 26, 1934).
"""

from __future__ import annotations

import functools

import numpy as np

_ROUNDING = 1.0 + 1e-9
"""A probability that equals the error up to rounding is within it."""


@functools.lru_cache(maxsize=256)
def quantile_ranks(n: int, quantile: float, error: float) -> tuple[int, int]:
    """Return the ranks of the durations that bound a quantile from below and from above, each alone.

    The duration of rank `low` (counted from 1, the least first) exceeds the quantile with a probability of at most
    `error`; so does the quantile exceed the duration of rank `high`.

    Args:
        n: number of durations, at least 1.
        quantile: in (0, 1).
        error: in (0, 0.5].

    Returns:
        low, 0 if no duration bounds the quantile from below, and high, n + 1 if none bounds it from above.

    >>> quantile_ranks(298, 0.99, 0.05), quantile_ranks(299, 0.99, 0.05)
    ((292, 299), (293, 299))
    """
    from scipy.special import bdtr

    at_most = bdtr(np.arange(n + 1.0), n, quantile)
    low = int(np.searchsorted(at_most, error * _ROUNDING, side="right"))
    return low, 1 + int(np.searchsorted(at_most, 1.0 - error * _ROUNDING))


@functools.lru_cache(maxsize=256)
def repeats_needed(quantile: float, error: float, misses: int = 0) -> int:
    """Return the least number of repeats that shows, with this number of misses, that a quantile is within its limit.

    Args:
        quantile: in (0, 1).
        error: probability of being wrong, in (0, 0.5].
        misses: repeats beyond the limit.

    >>> repeats_needed(0.99, 0.05), repeats_needed(0.95, 0.05), repeats_needed(0.99, 0.05, misses=1)
    (299, 59, 473)
    """
    from scipy.special import betainc

    def shown(n: int) -> bool:
        # the probability of no more misses, if the quantile were just at the limit
        return bool(betainc(n - misses, misses + 1.0, quantile) <= error * _ROUNDING)

    most = misses + 1
    while not shown(most):
        most *= 2
    least = most // 2
    while most - least > 1:
        middle = (least + most) // 2
        least, most = (least, middle) if shown(middle) else (middle, most)
    return most


def greatest_miss_rate(misses: int, n: int, error: float) -> float:
    """Return the greatest rate of misses that so few in n repeats leave possible (Clopper and Pearson, one-sided).

    Without any miss this is 1 - error ** (1/n), about 3/n for an error of 5 %: the rule of three.

    Args:
        misses: 0..n.
        n: number of repeats, at least 1.
        error: probability that the true rate is greater still, in (0, 0.5].

    >>> round(greatest_miss_rate(0, 300, 0.05), 5)
    0.00994
    """
    if misses == n:
        return 1.0
    from scipy.special import betaincinv

    return float(betaincinv(misses + 1, n - misses, 1.0 - error))


def chance_of_largest(k: int, n: int, others: int) -> float:
    """Return how likely the k largest of n + others equally distributed values all belong to the n.

    Args:
        k: 0..n.
        n: number of values of the one kind.
        others: number of the other.

    >>> chance_of_largest(1, 300, 5700), chance_of_largest(2, 300, 300) < 0.25
    (0.05, True)
    """
    chance = 1.0
    for i in range(k):
        chance *= (n - i) / (n + others - i)
    return chance

"""How many independent repeats a row of durations is worth, when slow ones come in spells.

Ranks (`ranks.py`) count repeats as independent draws. A spell in which ten repeats in a row are slow is one draw, not
ten:

    repeats   . . . . x x x x x x x x x x . . . . . . . . .      300 repeats, 10 misses, but 1 spell
    counted                 1                                     300 / 10 = 30 draws, 1 miss

Whether there are spells is asked of the repeats beyond a threshold: given how many there are, the number of runs that
they form has a known distribution if their order is arbitrary (A. Wald & J. Wolfowitz, Annals of Mathematical
Statistics 11, 1940), so the test is exact however durations are distributed. If there are, the number of repeats is
divided by the factor by which dependence inflates the variance of their count, 1 + 2 (rho_1 + rho_2 + ...), where the
sum of autocorrelations ends at the first pair that is not positive (C. J. Geyer, Statistical Science 7, 1992), or by
the longest run, if that is more: a factor estimated from one or two spells is often too small, and a true bound failed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SIGNIFICANCE = 0.05
"""How often independent repeats are taken for dependent ones, over both thresholds together."""

_UPPER = 0.9
"""The quantile beyond which repeats are slow for this run. Near the limit, their spells show before one misses."""


@dataclass(frozen=True, slots=True)
class Dependence:
    """What the order of repeats says.

    Attributes:
        p_value: how likely as few runs of slow repeats are by chance; 1 if too few are slow to tell.
        spell: how many repeats count as one draw, at least 1; 1 where no dependence is seen.
    """

    p_value: float
    spell: float

    @property
    def is_seen(self) -> bool:
        """Whether the repeats depend on each other."""
        return self.spell > 1.0


def dependence(times: NDArray[np.int64], last: int) -> Dependence:
    """Return what the order of durations says: of those beyond the limit, and of the slowest tenth.

    Args:
        times: [ns], in the order in which they were measured, shape (n_repeats,).
        last: the longest duration within the limit [ns].

    >>> one_spell = [1] * 190 + [9] * 10 + [1] * 100
    >>> round(dependence(np.array(one_spell), last=5).spell), dependence(np.arange(300) % 7, last=9).spell
    (10, 1.0)
    """
    tenth = int(np.quantile(times, _UPPER, method="inverted_cdf"))
    least, spell = 1.0, 1.0
    # Spells of repeats that take less than half the limit say nothing about misses: a machine may warm up.
    for threshold in {last, tenth} if tenth > last // 2 else {last}:
        beyond = times > threshold
        p_value = chance_of_runs(beyond)
        least = min(least, p_value)
        if p_value <= SIGNIFICANCE / 2.0:
            spell = max(spell, inflation(beyond), float(longest_run(beyond)))
    return Dependence(least, spell)


def chance_of_runs(beyond: NDArray[np.bool_]) -> float:
    """Return how likely so few runs of True, or fewer, are if every order is equally likely.

    With m True of n, r runs have the probability C(m - 1, r - 1) C(n - m + 1, r) / C(n, m).

    >>> chance_of_runs(np.array([False, True, True, False]))     # 3 of the 6 orders have one run
    0.5
    """
    n, m = len(beyond), int(np.count_nonzero(beyond))
    runs = int(beyond[0]) + int(np.count_nonzero(beyond[1:] & ~beyond[:-1])) if n else 0
    if m < 2 or m == n:
        return 1.0
    whole = _log_choose(n, m)
    fewest = range(1, runs + 1)
    chance = math.fsum(math.exp(_log_choose(m - 1, r - 1) + _log_choose(n - m + 1, r) - whole) for r in fewest)
    return float(f"{min(chance, 1.0):.12g}")


def inflation(beyond: NDArray[np.bool_]) -> float:
    """Return the factor by which dependence inflates the variance of the number of True; at least 1.

    >>> round(inflation(np.array([False] * 290 + [True] * 10)))
    10
    """
    n = len(beyond)
    centred = beyond - beyond.mean()
    # All autocovariances at once: the power spectrum, padded so that the row does not wrap round onto itself.
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    covariance = np.fft.irfft(spectrum)[:n]
    if covariance[0] <= 0.0:
        return 1.0
    correlation = covariance / covariance[0]
    # Geyer's initial positive sequence, on the pairs (rho_1 + rho_2), (rho_3 + rho_4), ...
    pairs = correlation[1 : n - (n - 1) % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    factor = 1.0 + 2.0 * float(pairs[: ends[0] if len(ends) else len(pairs)].sum())
    return min(max(1.0, factor), float(n))


def longest_run(beyond: NDArray[np.bool_]) -> int:
    """Return how many True stand in a row at most.

    >>> longest_run(np.array([True, False, True, True, False]))
    2
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _log_choose(n: int, k: int) -> float:
    return -math.inf if k < 0 or k > n else math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)

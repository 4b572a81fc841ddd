"""Intervals of a rate that may be looked at after every case: they hold the true rate at all times at once.

An ordinary interval holds it with 95 % at one time fixed beforehand. Who looks again and again, and stops when it looks
good, is wrong far more often. A confidence sequence is not: the evidence against a rate p, the likelihood of what was
seen under a mixture of rates over that under p, has an expectation of 1 under p whenever one looks, and reaches 20 ever
with a probability of at most 1 / 20 (J. Ville, 1939). The mixture is a beta distribution about p (S. R. Howard et al.,
Annals of Statistics 49, 2021, the beta-binomial mixture).

                 B(rp + count, r(1-p) + n - count)            the interval: all p of which M < 1 / (1 - confidence)
    M(p)  =  -----------------------------------------
             B(rp, r(1-p))  p^count  (1-p)^(n - count)

Cases that are spread evenly over blocks, instead of drawn like coin tosses, scatter less, and the level is kept
(W. Hoeffding, Annals of Mathematical Statistics 27, 1956).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest
from parcours.verdict.statistics import Rate

CONCENTRATION = 100.0
"""How narrow the mixture is by default: intervals are tightest after about eight times as many cases."""

_HALVINGS = 60

Values = NDArray[np.float64]


def log_evidence(share: ArrayLike, count: ArrayLike, n: ArrayLike, concentration: float = CONCENTRATION) -> Values:
    """Return log M: how much `count` of `n` speaks against a true rate.

    Args:
        share: the rate spoken against, in (0, 1).
        count: how often it happened, 0 <= count <= n; all three are broadcast together.
        n: number of cases.
        concentration: r, of the beta distribution that rates are mixed by; fixed before the first case.

    >>> float(log_evidence(0.5, 0, 0))
    0.0
    >>> [bool(log_evidence(0.5, count, 100) >= np.log(20)) for count in (60, 80)]
    [False, True]
    """
    p, s, m = np.asarray(share, float), np.asarray(count, float), np.asarray(n, float)
    a, b = concentration * p, concentration * (1.0 - p)
    hits, misses = np.where(s > 0, s * np.log(p), 0.0), np.where(m > s, (m - s) * np.log1p(-p), 0.0)
    mixed = _log_gamma(a + s) + _log_gamma(b + (m - s)) - _log_gamma(concentration + m)
    return mixed - (_log_gamma(a) + _log_gamma(b) - _log_gamma(concentration)) - hits - misses


def _log_gamma(x: ArrayLike) -> Values:  # scipy.special would take a tenth of a start to load, for a few numbers
    return np.asarray(_lgamma(np.maximum(x, 1e-300)), float)


_lgamma = np.frompyfunc(math.lgamma, 1, 1)


def bounds_at_any_time(
    count: ArrayLike, n: ArrayLike, confidence: float = 0.95, concentration: float = CONCENTRATION
) -> tuple[Values, Values]:
    """Return the ends of the intervals of many counts, each of the shape of `count` and `n`.

    Args:
        count, n, concentration: as of `log_evidence`.
        confidence: probability that the true rate lies in the intervals of a campaign at all times, in (0, 1).
    """
    s, m = np.broadcast_arrays(np.asarray(count, float), np.asarray(n, float))
    seen = np.where(m > 0, s / np.maximum(m, 1.0), 0.5)
    limit = -np.log1p(-confidence)
    ends = []
    for end, at_end in ((0.0, s == 0), (1.0, s == m)):
        outside, inside = np.full(s.shape, end), seen.copy()
        for _ in range(_HALVINGS):
            middle = 0.5 * (outside + inside)
            with np.errstate(all="ignore"):
                out = log_evidence(middle, s, m, concentration) >= limit
            outside, inside = np.where(out, middle, outside), np.where(out, inside, middle)
        ends.append(np.where(at_end, end, outside))
    return ends[0], ends[1]


def rate_at_any_time(count: int, n: int, confidence: float = 0.95, concentration: float = CONCENTRATION) -> Rate:
    """Return the rate count / n with its interval of a confidence sequence.

    Raises BadRequest: a count or the confidence is out of its range.

    >>> stuck = rate_at_any_time(70, 905)
    >>> f"{stuck.share:.1%} [{stuck.low:.2%}, {stuck.high:.2%}]"
    '7.7% [5.29%, 10.69%]'
    """
    if not (0 <= count <= n and 0.0 < confidence < 1.0):
        rule = (
            f"0 <= count <= n and a confidence between 0 and 1 are needed, but {count} of {n} at {confidence:g} given"
        )
        raise BadRequest("rate at any time", rule, slug="counts")
    low, high = bounds_at_any_time(count, n, confidence, concentration)
    return Rate(count, n, float(low), float(high), confidence)

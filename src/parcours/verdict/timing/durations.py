"""How long an interaction takes, how much that varies, and how often it is too late.

Quantiles are durations that occurred (the inverse of the empirical distribution, type 1 of Hyndman and Fan, The
American Statistician 50, 1996), so none lies between a fast and a slow mode where nothing ever was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest
from parcours.run.trace import Trace
from parcours.verdict.statistics import Rate, wilson
from parcours.verdict.timing.bounds import Bound

NEVER = 2**63 - 1
"""The duration of a repeat that did not end [ns]: later than any limit. Leave no such repeat out."""


@dataclass(frozen=True, slots=True)
class Timing:
    """The durations of an interaction, summed up. Times are in ns; with repeats that never ended, `NEVER`.

    Attributes:
        n: number of repeats, those that never ended included.
        unended: how many never ended.
        p50, p95, p99, max: quantiles, the greatest for `max`.
        jitter: p99 less the least duration: the delay variation of RFC 5481 (section 4.2), at its 99 %.
        peak_to_peak: greatest less least duration: the absolute finishing jitter of G. C. Buttazzo (Hard Real-Time
            Computing Systems, 3rd ed., 2011, section 4.1); it grows with the number of repeats.
        relative_jitter: the greatest difference of two repeats in a row, his relative finishing jitter; 0 if n is 1.
        misses: how many did not keep the limit, with Wilson's interval; None without a bound.
    """

    n: int
    unended: int
    p50: int
    p95: int
    p99: int
    max: int
    jitter: int
    peak_to_peak: int
    relative_jitter: int
    misses: Rate | None = None


def summary(durations: ArrayLike, bound: Bound | None = None) -> Timing:
    """Return the durations of one interaction, summed up.

    Args:
        durations: [ns], shape (n_repeats,), in the order in which they were measured; warm-up left out.
        bound: its limit says what a miss is.

    Raises:
        BadRequest: there is no duration, or one is negative or not a number.

    >>> from parcours.verdict.timing.bounds import parse_bound
    >>> timing = summary([2_000_000, 3_000_000, 9_000_000, 2_000_000], parse_bound("every < 5 ms"))
    >>> timing.p50, timing.max, timing.relative_jitter, timing.misses.count
    (2000000, 9000000, 7000000, 1)
    """
    times = checked(durations)
    ordered = np.sort(times)
    p50, p95, p99 = (ordered_quantile(ordered, share) for share in (0.5, 0.95, 0.99))
    least, greatest = int(ordered[0]), int(ordered[-1])
    ended = np.diff(times[times != NEVER])
    steps = NEVER if greatest == NEVER else int(np.abs(ended).max(initial=0))
    unended = int(np.count_nonzero(times == NEVER))
    misses = None if bound is None else wilson(int(np.count_nonzero(times > bound.last)), len(times))
    return Timing(
        len(times), unended, p50, p95, p99, greatest, _less(p99, least), _less(greatest, least), steps, misses
    )


def _less(time: int, least: int) -> int:
    return NEVER if time == NEVER else time - least


def checked(durations: ArrayLike) -> NDArray[np.int64]:
    """Return durations as whole nanoseconds, shape (n_repeats,).

    Raises:
        BadRequest: there is no duration, or one is negative or not a number.
    """
    given = np.asarray(durations)
    if given.size == 0:
        raise BadRequest("durations", "at least one repeat is needed, but none was given", slug="empty-trace")
    sort = type(given.flat[0])
    numbers = given.ndim == 1 and issubclass(sort, np.integer | np.floating)
    # a float never is 2**63 - 1; NaN is not at least 0
    if not (numbers and (given >= 0).all() and (given <= (NEVER if issubclass(sort, np.integer) else 2.0**62)).all()):
        raise BadRequest(
            "durations",
            "they are a row of numbers of nanoseconds, none negative, but these are not",
            "give a repeat that never ended as NEVER",
            slug="timing-durations",
        )
    return given.astype(np.int64)


def ordered_quantile(ordered: NDArray[np.int64], share: float) -> int:
    """Return the least of the durations that `share` of them do not exceed.

    Args:
        ordered: increasing, at least one, shape (n,).
        share: in (0, 1].

    >>> ordered_quantile(np.array([1, 2, 3, 50]), 0.75), ordered_quantile(np.array([1, 2, 3, 50]), 0.76)
    (3, 50)
    """
    # a share of 0.99 is a little more than 99 %, and of 100 repeats it is rank 99 all the same
    rank = int(np.ceil(share * len(ordered) - 1e-9))
    return int(ordered[max(rank, 1) - 1])


def duration(trace: Trace) -> int:
    """Return the time from the first to the last event of a trace [ns].

    Raises:
        BadRequest: the trace was made on a simulated clock, or has no events.
    """
    if trace.clock != "wall":
        raise BadRequest(
            f"trace of {trace.case or 'a case'}",
            f"durations are judged on wall time only, but its clock is {trace.clock!r}",
            "run the case on a wall-clock host",
            slug="simulated-duration",
        )
    if not trace.events:
        raise BadRequest(f"trace of {trace.case or 'a case'}", "it has no events to time", slug="empty-trace")
    return trace.events[-1].time - trace.events[0].time

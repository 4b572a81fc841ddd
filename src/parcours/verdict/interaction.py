"""Traces of component interactions -> verdicts: was the order kept, did it take no longer than it may.

A bound on durations means nothing on a simulated clock, so those traces are refused.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from parcours.errors import BadRequest
from parcours.run.trace import Trace
from parcours.verdict.judgement import Judgement, Verdict


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


def within(durations: Sequence[int], limit: float, quantile: float = 0.95) -> Judgement:
    """Judge repeated durations of one interaction against an upper limit.

    Args:
        durations: [ns], shape (n_repeats,), at least one.
        limit: upper limit [s].
        quantile: the share of repeats that must stay within it.

    >>> within([1_000_000, 2_000_000], 0.005).why
    '95 % of 2 repeats took at most 1.950 ms, limit 5.0 ms'
    """
    if len(durations) == 0:
        raise BadRequest("durations", "at least one repeat is needed, but none was given", slug="empty-trace")
    reached = float(np.quantile(np.asarray(durations, dtype=float), quantile)) * 1e-9
    verdict = Verdict.PASS if reached <= limit else Verdict.FAIL
    why = f"{quantile:.0%} of {len(durations)} repeats took at most {reached * 1e3:.3f} ms, limit {limit * 1e3:.1f} ms"
    return Judgement(verdict, why.replace("%", " %", 1))

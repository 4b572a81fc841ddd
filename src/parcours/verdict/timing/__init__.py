"""Repeated durations, a bound in words and the noise beside them become a timing verdict one can defend."""

from parcours.verdict.timing.bounds import Bound, parse_bound
from parcours.verdict.timing.durations import (
    NEVER,
    PeriodJitter,
    Timing,
    duration,
    period_jitter,
    summary,
    wall_durations,
)
from parcours.verdict.timing.judging import judge

__all__ = [
    "NEVER",
    "Bound",
    "PeriodJitter",
    "Timing",
    "duration",
    "judge",
    "parse_bound",
    "period_jitter",
    "summary",
    "wall_durations",
]

"""Timing verdicts that can be defended, from repeated durations, a bound in words and the noise beside them."""

from parcours.verdict.timing.bounds import Bound, parse_bound
from parcours.verdict.timing.durations import NEVER, Timing, duration, summary
from parcours.verdict.timing.judging import judge

__all__ = [
    "NEVER",
    "Bound",
    "Timing",
    "duration",
    "judge",
    "parse_bound",
    "summary",
]

"""Timing verdicts that can be defended, from repeated durations, a bound in words and the noise beside them."""

from parcours.verdict.timing.bounds import Bound, parse_bound
from parcours.verdict.timing.chains import Chain, chain
from parcours.verdict.timing.durations import NEVER, Timing, duration, summary
from parcours.verdict.timing.judging import judge, quantile_interval

__all__ = [
    "NEVER",
    "Bound",
    "Chain",
    "Timing",
    "chain",
    "duration",
    "judge",
    "parse_bound",
    "quantile_interval",
    "summary",
]

"""Durations summed up: what a quantile, jitter and a miss are, and which traces have no durations."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.run.clocks import ClockName
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.statistics import wilson
from parcours.verdict.timing import NEVER, duration, parse_bound, summary

rows = st.lists(st.integers(0, 10**12), min_size=1, max_size=300)


def trace(clock: ClockName, *taken: tuple[int, str]) -> Trace:
    return Trace(clock, tuple(TraceEvent(time, "take", "A", name) for time, name in taken), case="c1")


@given(rows)
def test_a_quantile_is_a_duration_that_occurred_and_the_least_that_so_many_keep(times: list[int]) -> None:
    timing = summary(times)
    for percent, quantile in ((50, timing.p50), (95, timing.p95), (99, timing.p99)):
        assert quantile in times
        assert 100 * sum(time <= quantile for time in times) >= percent * len(times)
        assert 100 * sum(time < quantile for time in times) < percent * len(times)
    assert timing.max == max(times)


@given(rows)
def test_jitter_is_what_its_definitions_say(times: list[int]) -> None:
    timing = summary(times)
    assert timing.peak_to_peak == max(times) - min(times) >= timing.jitter == timing.p99 - min(times)
    steps = [abs(b - a) for a, b in pairwise(times)]
    assert timing.relative_jitter == max(steps, default=0) <= timing.peak_to_peak


@given(rows, st.sampled_from(["every < 500 s", "p99 <= 500 s"]))
def test_misses_are_counted_against_the_limit_with_their_interval(times: list[int], text: str) -> None:
    bound = parse_bound(text)
    kept = [time < bound.limit or (not bound.strict and time == bound.limit) for time in times]
    assert summary(times, bound).misses == wilson(kept.count(False), len(times))
    assert summary(times).misses is None


def test_repeats_that_never_ended_are_late_and_counted() -> None:
    timing = summary([3, 5, NEVER, 4], parse_bound("every < 10 ns"))
    assert (timing.n, timing.unended, timing.max, timing.p50) == (4, 1, NEVER, 4)
    assert timing.misses is not None and timing.misses.count == 1
    assert timing.jitter == timing.peak_to_peak == timing.relative_jitter == NEVER


def test_long_durations_do_not_overflow() -> None:
    assert summary([0, NEVER - 1]).peak_to_peak == NEVER - 1


def test_durations_of_simulated_time_are_refused_by_name() -> None:
    simulated = trace("simulated", (0, "p1"), (3, "p2"))
    with pytest.raises(BadRequest, match=r"trace of c1: .*its clock is 'simulated'.*\[simulated-duration\]"):
        duration(simulated)


def test_durations_of_wall_time_are_told() -> None:
    wall = trace("wall", (2, "p1"), (5, "p2"), (9, "p1"), (10, "p2"))
    assert duration(wall) == 8
    with pytest.raises(BadRequest, match=r"\[empty-trace\]"):
        duration(trace("wall"))

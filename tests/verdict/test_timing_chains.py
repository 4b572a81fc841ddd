"""Chains: shares add up to the reaction, lost messages have no effect, and clocks are never mixed."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.run.trace import REPEAT, Trace, TraceEvent
from parcours.verdict.timing import chain
from parcours.verdict.timing.chains import reactions

WAY = ("a", "b", "c")


def passed(*said: tuple[int, str, str, int]) -> list[TraceEvent]:
    return [TraceEvent(time, kind, channel=channel, message=number) for time, kind, channel, number in said]  # type: ignore[arg-type]


def test_a_message_that_was_lost_had_no_effect_and_each_message_begins_a_reaction() -> None:
    events = passed(
        (0, "receive", "a", 0), (1, "send", "b", 1), (2, "drop", "b", 1), (3, "receive", "a", 2), (5, "send", "b", 3),
        (6, "receive", "b", 3), (9, "send", "c", 4), (10, "receive", "a", 5),
    )  # fmt: skip
    assert list(reactions(events, WAY)) == [(5, 1, 3), (2, 1, 3)]


def test_no_reaction_reaches_across_repeats() -> None:
    begun = passed((0, "receive", "a", 0), (1, "send", "b", 1), (1, "receive", "b", 1))
    ended = passed((7, "send", "c", 2))
    assert list(reactions([*begun, *ended], WAY)) == [(1, 0, 6)]
    assert list(reactions([*begun, TraceEvent(5, "note", text=REPEAT), *ended], WAY)) == []


@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from(WAY), st.booleans()), max_size=25))
@settings(max_examples=60, deadline=None)
def test_shares_are_never_negative_and_agree_with_a_search_of_all_ways(said: list[tuple[int, str, bool]]) -> None:
    times = itertools.accumulate(gap for gap, _, _ in said)
    events = [
        event for number, (time, (_, channel, arrives)) in enumerate(zip(times, said, strict=True))
        for event in passed((time, "send", channel, number), *([(time, "receive", channel, number)] if arrives else []))
    ]  # fmt: skip
    naive = []
    for k, begin in enumerate(events):
        if (begin.kind, begin.channel) != ("receive", "a"):
            continue
        for sent in range(k + 1, len(events) - 1):
            if [(one.kind, one.channel) for one in events[sent : sent + 2]] == [("send", "b"), ("receive", "b")]:
                last = next((one for one in events[sent + 2 :] if (one.kind, one.channel) == ("send", "c")), None)
                naive += [last.time - begin.time] if last else []
                break
    rows = list(reactions(events, WAY))
    assert [sum(row) for row in rows] == naive
    assert all(share >= 0 for row in rows for share in row)


def test_times_of_two_clocks_are_refused() -> None:
    with pytest.raises(BadRequest, match=r"one clock only, but 4 ns follows 9 ns.*clock-domains"):
        chain("stop", Trace("wall", tuple(passed((9, "receive", "a", 0), (4, "send", "b", 1)))), WAY)

"""Plans of faults as data and text: inverses, and refusals that say what was given."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.run.faults import (
    HOWS,
    ChannelFault,
    ComponentFault,
    Fault,
    FaultPlan,
    parse_fault,
    parse_plan,
    read_plan,
    signals,
)
from parcours.run.faults.plan import CHANNEL_KINDS, COMPONENT_KINDS, ChannelKind, ComponentKind

_TIMES = st.integers(0, 10**13)
_NAMES = st.from_regex(r"[A-Za-z_/][A-Za-z0-9_/]{0,12}", fullmatch=True)


@st.composite
def channel_faults(draw: st.DrawFn) -> ChannelFault:
    kind: ChannelKind = draw(st.sampled_from(CHANNEL_KINDS))
    least = 1 if kind in ("delay", "jitter", "reorder") else 0
    amount = draw(st.integers(least, 10**12)) if kind not in ("drop", "corrupt") else 0
    begin = draw(_TIMES)
    first = draw(st.integers(0, 10**6))
    return ChannelFault(
        draw(_NAMES),
        kind,
        draw(st.floats(1e-6, 1.0, exclude_min=True).map(lambda share: round(share, 9))),
        amount,
        draw(st.sampled_from(HOWS)) if kind == "corrupt" else "any",
        begin,
        draw(st.none() | st.integers(begin + 1, begin + 10**12)),
        draw(st.none() | st.integers(first, first + 10**6).map(lambda last: (first, last))),
    )


@st.composite
def component_faults(draw: st.DrawFn) -> ComponentFault:
    kind: ComponentKind = draw(st.sampled_from(COMPONENT_KINDS))
    lasts = None if kind == "crash" else draw(st.none() | st.integers(1, 10**12))
    factor = round(draw(st.floats(1.001, 1e5)), 6) if kind == "slow_down" else 1.0
    return ComponentFault(draw(_NAMES), kind, draw(_TIMES), lasts, factor)


@given(channel_faults() | component_faults())
def test_the_text_of_a_fault_says_all_of_it(fault: Fault) -> None:
    assert parse_fault(str(fault)) == fault


@given(channel_faults(), component_faults(), st.integers(0, 2**63 - 1), st.integers(1, 10**9))
def test_the_text_of_a_plan_is_read_back_as_the_same_plan(
    one: ChannelFault, other: ComponentFault, seed: int, work: int
) -> None:
    plan = FaultPlan(seed, (one, other), work)
    assert parse_plan(str(plan)) == plan


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("best_trajectory: drop 30 % from 2 s to 5 s", "best_trajectory: drop 30 % from 2 s to 5 s"),
        ("obstacles:delay 0.2s", "obstacles: delay 200 ms"),
        ("obstacles: delay 50 % by 200 ms for 1 s", "obstacles: delay 50 % by 200 ms to 1 s"),
        ("update: corrupt, nan, 5 %, messages 3", "update: corrupt nan 5 % messages 3 to 3"),
        ("Planner: freeze from 3 s until 4 s", "Planner: freeze at 3 s for 1 s"),
        ("TrajectoryEvaluation: slow down 5 x from 2 s", "TrajectoryEvaluation: slow down 5 x at 2 s"),
        ("Planner: crash at 5 s", "Planner: crash at 5 s"),
    ],
)
def test_people_may_write_a_fault_in_more_ways_than_one(line: str, said: str) -> None:
    assert str(parse_fault(line)) == said


@pytest.mark.parametrize(
    ("text", "slug", "said"),
    [
        ("obstacles", "fault-line", "NAME: KIND"),
        ("obstacles: dorp 30 %", "fault-line", "did you mean 'drop'"),
        ("obstacles: drop 30", "fault-line", "cannot read '30'"),
        ("obstacles: drop 30 % 40 %", "fault-line", "appears twice"),
        ("obstacles: drop 130 %", "fault-range", "at most 100 %"),
        ("obstacles: drop 0 %", "fault-range", "above 0"),
        ("obstacles: delay", "fault-range", "delay 200 ms"),
        ("obstacles: drop 200 ms", "fault-range", "left out"),
        ("obstacles: drop nan", "fault-range", "only a corruption"),
        ("obstacles: delay 0.5 ns", "fault-line", "whole nanoseconds"),
        ("work: 1.5 ns", "fault-line", "whole nanoseconds"),
        ("obstacles: drop from 5 s to 2 s", "fault-range", "end after it begins"),
        ("obstacles: drop messages 5 to 2", "fault-range", "before the last"),
        ("Planner: crash at 5 s for 1 s", "fault-range", "write freeze"),
        ("Planner: slow down at 5 s", "fault-range", "factor"),
        ("Planner: freeze 5 x", "fault-range", "factor"),
        ("Planner: freeze 30 %", "fault-line", "says nothing of a freeze"),
        ("Planner: freeze at 2 s to 3 s for 1 s", "fault-line", "says nothing"),
        ("obstacles: delay 999999999999999 s", "fault-range", "must be above 0"),
        (": drop 30 %", "fault-name", "a name has"),
        ("a b: drop 30 %", "fault-name", "a name has"),
        ("seed: 99999999999999999999", "fault-line", "must be a fault"),
        ("seed: 9999999999999999999", "fault-range", "2**63"),
    ],
)
def test_what_is_no_fault_is_refused_with_what_was_given(text: str, slug: str, said: str) -> None:
    with pytest.raises(BadRequest) as refused:
        parse_plan(f"# a plan\n{text}")
    assert refused.value.slug == slug
    assert said in str(refused.value)
    assert "line 2" in str(refused.value) or text.startswith("seed")


@pytest.mark.parametrize(
    "text",
    [
        "a: drop 30 %; a: drop 20 % from 5 s",
        "a: delay 1 s to 3 s; a: delay 2 s from 2 s",
        "A: freeze at 1 s for 2 s; A: slow down 2 x at 2 s",
        "A: crash at 1 s; A: freeze at 3 s for 1 s",
    ],
)
def test_two_faults_that_contradict_each_other_are_refused(text: str) -> None:
    with pytest.raises(BadRequest, match="fault-overlap"):
        parse_plan(text)


def test_faults_that_follow_each_other_or_differ_in_kind_are_one_plan() -> None:
    plan = parse_plan(
        "a: drop 30 % to 2 s; a: drop 20 % from 2 s; a: delay 1 s; A: freeze at 1 s for 1 s; A: crash at 2 s\n"
        "b: drop messages 3 to 4; b: drop messages 5"
    )
    assert len(plan.faults) == 7
    assert [fault.kind for fault in plan.of_components] == ["freeze", "crash"]


def test_a_plan_tells_when_it_begins_and_whether_it_is_ever_over() -> None:
    assert parse_plan("a: drop from 2 s to 5 s; A: freeze at 1 s for 1 s").begins_ns == 10**9
    assert parse_plan("a: drop from 2 s to 5 s; A: freeze at 1 s for 1 s").until_ns == 5 * 10**9
    assert parse_plan("a: drop from 2 s to 5 s; A: crash at 1 s").until_ns is None


def test_names_that_the_system_does_not_have_are_refused_with_the_nearest() -> None:
    with pytest.raises(BadRequest, match=r"no channel is called 'obstacle'; did you mean 'obstacles'"):
        parse_plan("obstacle: drop").check(["obstacles"], ["Planner"])
    with pytest.raises(BadRequest, match=r"no component is called 'planner'; did you mean 'Planner'"):
        parse_plan("planner: crash at 1 s").check(["obstacles"], ["Planner"])


def test_a_command_line_gives_lines_or_a_file_of_lines(tmp_path: Path) -> None:
    plan = parse_plan("seed: 3\na: drop 30 %\nA: crash at 5 s")
    lines = tmp_path / "faults.txt"
    lines.write_text(str(plan))
    assert read_plan(str(plan)) == read_plan(str(lines)) == plan


@pytest.mark.parametrize(
    ("content", "slug"),
    [
        (b"\xff\xfe", "fault-file"),
        (b"{", "fault-line"),
        (b"[" * 100_000, "fault-line"),
        (b"{" * 100_000, "fault-line"),
        (b"#" * 1_000_001, "fault-many"),
        (b"a: drop messages 1;" * 1002, "fault-many"),
    ],
)
def test_a_file_from_outside_is_read_or_refused_and_nothing_else(tmp_path: Path, content: bytes, slug: str) -> None:
    path = tmp_path / "faults"
    path.write_bytes(content)
    with pytest.raises(BadRequest) as refused:
        read_plan(str(path))
    assert refused.value.slug == slug


def test_an_absent_file_is_named() -> None:
    with pytest.raises(BadRequest, match=r"no file is called 'faults\.txt'"):
        read_plan("faults.txt")


@given(st.text(max_size=60))
def test_any_line_is_a_fault_or_refused(text: str) -> None:
    try:
        fault = parse_fault(text)
    except BadRequest:
        return
    assert parse_fault(str(fault)) == fault


def test_a_slowed_down_process_runs_for_its_share_of_the_time() -> None:
    plan = parse_plan("A: slow down 5 x at 1 s for 2 s; B: crash at 2 s; A: freeze at 4 s for 1 s")
    told = list(signals(plan, "A"))
    stopped = sum(b.time - a.time for a, b in zip(told[:-2:2], told[1:-2:2], strict=True))
    assert stopped == pytest.approx(0.8 * 2e9)
    assert [(one.time, one.act) for one in told[-2:]] == [(4 * 10**9, "stop"), (5 * 10**9, "continue")]
    assert [one.act for one in told] == ["stop", "continue"] * (len(told) // 2)
    assert [one.time for one in told] == sorted(one.time for one in told)
    assert [(one.time, one.act) for one in signals(plan, "B")] == [(2 * 10**9, "kill")]
    assert not list(signals(plan, "C"))


def test_a_component_that_is_frozen_without_end_is_not_continued() -> None:
    assert [one.act for one in signals(parse_plan("A: freeze at 4 s"), "A")] == ["stop"]

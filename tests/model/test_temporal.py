"""What a model says of time is read, written, checked, and left open by the untimed step relation."""

from __future__ import annotations

import math

import pytest

from parcours.errors import BadModel
from parcours.model import Cefsm, Component, Machine, Transition, enabled, findings, initial, parse_model, step
from parcours.model.writing import write_model

TIMER = """
parcours: model/1
name: timer
components:
  Timer:
    variables: {x: {type: clock}, n: {type: int, initial: 0}}
    machines:
      run:
        initial: idle
        final: [idle]
        invariants: {busy: x <= 5}
        transitions:
          t1: {from: idle, to: busy, action: x := 0, duration: [0.005, inf], weight: 0.5}
          t2: {from: busy, to: idle, guard: x >= 2 && n == 0}
"""

MEETING = """
parcours: model/1
name: pair
messages:
  Word: {fields: {n: {type: int}}}
channels:
  c: {from: Both, to: Both, message: Word, capacity: 0}
components:
  Both:
    variables: {heard: {type: int, initial: 0}}
    machines:
      left: {initial: a, transitions: {l1: {from: a, to: b, message: c(7)}, l2: {from: b, to: a, event: c(w)}}}
      right: {initial: r, transitions: {r1: {from: r, to: r, event: c(w), action: heard := w.n}}}
"""


def refused(old: str, new: str) -> str:
    with pytest.raises(BadModel) as caught:
        parse_model(TIMER.replace(old, new), "timer.yaml")
    return str(caught.value)


def test_a_written_model_reads_back_with_its_times() -> None:
    timer = parse_model(TIMER)
    assert parse_model(write_model(timer)) == timer
    machine = timer.components[0].machines[0]
    assert machine.final == ("idle",)
    assert machine.transitions[0].duration == (0.005, math.inf)
    assert machine.transitions[0].weight == 0.5


@pytest.mark.parametrize(("guard", "count"), [("x < 0", 0), ("x < 3", 1), ("x > -3", 1), ("x + n < 3", 1)])
def test_no_clock_is_negative(guard: str, count: int) -> None:
    timer = parse_model(TIMER.replace("action: x := 0,", f"guard: {guard},"))
    moves = enabled(timer, initial(timer))
    assert len(moves) == count and all(dict(move.inputs)["Timer.x"] >= 0 for move in moves)  # type: ignore[operator]


def test_untimed_a_clock_may_have_any_value() -> None:
    timer = parse_model(TIMER)
    here = initial(timer)
    assert here.values == (0,)  # n; the clock is not stored
    [start] = enabled(timer, here)
    [stop] = enabled(timer, step(timer, here, start))
    assert stop.transition == "t2"
    assert dict(stop.inputs)["Timer.x"] >= 2  # type: ignore[operator]


@pytest.mark.parametrize(
    ("old", "new", "slug"),
    [
        ("x := 0", "x := n", "[clock]"),
        ("x := 0", "x := -1", "[clock]"),
        ("x := 0", "n := floor(x)", "[clock]"),
        ("{type: clock}", "{type: clock, role: input}", "[clock]"),
        ("busy: x <= 5", "busy: n <= 5", "[invariant]"),
        ("busy: x <= 5", "busy: x + 5", "[type]"),
        ("busy: x <= 5", "bussy: x <= 5", "[unknown-state]"),
        ("final: [idle]", "final: [idel]", "[unknown-state]"),
        ("[0.005, inf]", "[2, 1]", "[duration]"),
        ("[0.005, inf]", "[inf, inf]", "[duration]"),
        ("[0.005, inf]", "[1]", "[duration]"),
        ("[0.005, inf]", "[-1, 1]", "[value]"),
        ("weight: 0.5", "weight: -0.5", "[value]"),
        ("weight: 0.5", "weight: inf", "[value]"),
    ],
)
def test_what_is_wrong_with_time_is_said_with_its_line(old: str, new: str, slug: str) -> None:
    said = refused(old, new)
    assert slug in said
    assert "timer.yaml:" in said


def test_a_model_made_in_python_is_checked_too() -> None:
    machine = Machine("f", "s", ("s",), (Transition("t", "s", "s", duration=(1.0, math.nan)),), final=("end",))
    assert {each.rule for each in findings(Cefsm("m", (Component("A", (machine,)),)))} >= {"duration", "unknown-state"}


def test_two_machines_of_one_component_meet_but_none_meets_itself() -> None:
    pair = parse_model(MEETING)
    [move] = enabled(pair, initial(pair))
    assert str(move) == "l1+r1"
    after = step(pair, initial(pair), move)
    assert after.states == ("b", "r")
    assert after.values == (7,)
    assert enabled(pair, after) == ()


def test_one_machine_has_nobody_to_meet_in_its_own_component() -> None:
    alone = MEETING.split("      right:")[0]
    with pytest.raises(BadModel, match=r"\[rendezvous\]"):
        parse_model(alone)

"""Data of a trace against what the model says: each planted fault is named with its formula and its values."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from parcours.model import parse_model
from parcours.run.port import StepReport
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.conformance import check
from parcours.verdict.contracts import Contracts, judged
from parcours.verdict.judgement import Verdict

MODEL = parse_model("""
parcours: model/1
name: cart
constants: {v_max: 2.0}
messages:
  Order: {fields: {target: {type: int}}}
  State: {fields: {v: {type: real}}}
  Track: {fields: {way: {type: State, shape: [n]}, place: {type: int}}}
channels:
  ask: {from: environment, to: Cart, message: Order, topic: /go}
  reply:
    from: Cart
    to: environment
    message: Track
    topic: /go
    ensures:
      speed: "all s in it.way: abs(s.v) <= v_max"
      arrives: it.place == request.target
      goes on: it.place >= last.place
  note: {from: Cart, to: environment, message: Order}
components:
  Cart:
    variables: {at: {type: int, initial: 0}, ready: {type: bool, role: input}, trips: {type: int, initial: 0}}
    invariants: {bounded: at <= 9}
    machines:
      m:
        initial: idle
        transitions:
          c1: {from: idle, to: busy, event: ask(it), guard: ready, action: at := it.target; log(), ensures: {moves: old.at != at}}
          c2: {from: busy, to: idle, guard: at < 8, message: reply; note(at), ensures: {says so: note.target == reply.place}}
""")  # noqa: E501 - a transition a line
CONTRACTS = Contracts(MODEL)


def trip(target: int, variables: dict[str, object] | None = None) -> list[TraceEvent]:
    """Return the events of a sound trip."""
    known = {"at": target, "ready": True, "trips": 0} if variables is None else variables
    reply = {"way": [{"v": 1.0}, {"v": -2.0}], "place": target}
    return [
        TraceEvent(0, "receive", "Cart#0", channel="ask", payload={"target": target}),
        TraceEvent(1, "take", "Cart#0", "c1", payload=StepReport(known, ("log",))),
        TraceEvent(2, "take", "Cart#0", "c2", payload=StepReport(known, ())),
        TraceEvent(2, "send", "Cart#0", channel="reply", payload=reply),
        TraceEvent(2, "send", "Cart#0", channel="note", payload={"target": target}),
    ]


def verdict(events: list[TraceEvent]) -> str:
    """Return what is wrong; empty if nothing is."""
    violation, _ = CONTRACTS.judge(Trace("simulated", tuple(events)))
    return str(violation) if violation else ""


def with_payload(k: int, change: Callable[[object], object]) -> list[TraceEvent]:
    """Return a sound trip with the payload of one event changed."""
    events = trip(3)
    events[k] = replace(events[k], payload=change(events[k].payload))
    return events


def test_sound_trips_break_nothing_and_everything_is_judged() -> None:
    violation, tally = CONTRACTS.judge(Trace("simulated", (*trip(3), *trip(5))))
    assert violation is None
    assert [check for check, made in judged(CONTRACTS.checks, [CONTRACTS.mask(tally)]).items() if not made] == []


@pytest.mark.parametrize(
    ("k", "change", "said"),
    [
        (3, lambda m: {**m, "way": [{"v": 1.0}, {"v": -2.5}]}, "s = it.way[1]: abs(s.v) is 2.5, but must be <= 2"),
        (3, lambda m: {**m, "place": "3"}, "message of reply: it.place must be int, but is '3'"),
        (3, lambda m: {**m, "way": [{"v": True}]}, "it.way[0].v must be real, but is True"),
        (3, lambda m: {**m, "wrong": 1}, "it must be a Track, which has no 'wrong'"),
        (3, lambda m: {**m, "place": 4}, "it.place is 4, but must be == request.target is 3"),
        (4, lambda m: {"target": 4}, "message note of c2: target must be at, which is 3, but is 4"),
        (
            1,
            lambda r: StepReport({**r.variables, "at": 4}, r.operations),
            "at must be 3 after it, but is reported as 4",
        ),
        (1, lambda r: StepReport({**r.variables, "ready": False}, r.operations), "guard of c1: ready is false, so"),
        (1, lambda r: StepReport(r.variables, ()), "performs log, but the component reports none"),
        (2, lambda r: StepReport({**r.variables, "trips": 1}, ()), "leaves trips at 0, but the component reports 1"),
        (2, lambda r: StepReport(r.variables, ("log",)), "performs none, but the component reports log"),
    ],
)
def test_a_planted_fault_is_named_with_its_values(k: int, change: Callable[[object], object], said: str) -> None:
    assert said in verdict(with_payload(k, change))


@pytest.mark.parametrize(
    ("events", "said"),
    [
        (trip(9), 'guard of c2: at is 9, but must be < 8, so "at < 8" does not hold'),
        (trip(12), "Cart/bounded"),
        (trip(0), "c1/moves"),
        ([*trip(5), *trip(3)], "it.place is 3, but must be >= last.place is 5"),
    ],
)
def test_what_a_whole_trip_breaks_is_named(events: list[TraceEvent], said: str) -> None:
    assert said in verdict(events)


def test_what_nobody_reports_is_not_judged_and_said_so() -> None:
    events = [replace(event, payload=None) if event.kind == "take" else event for event in trip(3)]
    violation, tally = CONTRACTS.judge(Trace("simulated", tuple(events)))
    made = judged(CONTRACTS.checks, [CONTRACTS.mask(tally)])
    assert violation is None
    assert not made["guard of c1"] and not made["actions of c1"] and not made["c1/moves"]
    assert made["reply/speed"] and made["reply/arrives"]


def test_conformance_finds_the_same() -> None:
    def read(channel: str, payload: object) -> dict[str, object] | None:
        return payload if isinstance(payload, dict) else None

    events = with_payload(3, lambda m: {"way": [{"v": 9.0}], "place": 3})
    found = check(Trace("simulated", tuple(events)), MODEL, fields=read)
    assert found.judgement.verdict is Verdict.FAIL
    assert "reply/speed" in found.judgement.why
    assert check(Trace("simulated", tuple(trip(3))), MODEL, fields=read).judgement.verdict is Verdict.PASS


def test_a_transition_taken_while_one_that_it_excludes_was_enabled_is_named() -> None:
    model = parse_model("""
parcours: model/1
name: pump
components:
  Pump:
    variables: {level: {type: int, role: input}, ready: {type: bool, role: input}}
    machines:
      m:
        initial: idle
        exclusive: [[fill, drain]]
        transitions:
          fill: {from: idle, to: idle, guard: ready && level < 3}
          drain: {from: idle, to: idle, guard: level >= 3}
""")
    for level, said in ((2, ""), (7, 'fill excludes drain: level is 7, so "level >= 3" of drain holds, too')):
        told = StepReport({"level": level}, ())  # whether it was ready is not reported: its own guard cannot be judged
        taken = TraceEvent(0, "take", "Pump#0", "fill", payload=told)
        violation, _ = Contracts(model).judge(Trace("simulated", (taken,)))
        assert said in str(violation or "") and bool(said) == bool(violation)

"""Silence against what the model owes: a message that must come has a timeout, one that need not come has none."""

from __future__ import annotations

from collections.abc import Iterator
from time import sleep
from typing import get_args

import pytest

from parcours.abtc import abstract_cases, serialise
from parcours.model import parse_model
from parcours.run.clocks import WallClock
from parcours.run.in_process import execute
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.conformance import Checker, check
from parcours.verdict.conformance.tracking import Observes
from parcours.verdict.judgement import Verdict
from parcours_ramp.planner.messages import PlannerStep

MS = 1_000_000

WORKER = parse_model("""
parcours: model/1
name: worker
messages:
  Note: {fields: {text: {type: text}}}
channels:
  job: {from: environment, to: Worker, message: Note}
  done: {from: Worker, to: environment, message: Note}
  chat: {from: Worker, to: environment, message: Note}
  beat: {from: Heart, to: environment, message: Note}
components:
  Heart:
    machines:
      beating:
        initial: still
        transitions:
          pump: {from: still, to: full, guard: "true"}
          beat_it: {from: full, to: still, message: beat('b')}
  Worker:
    variables:
      ready: {type: bool, role: input, initial: false}
    machines:
      working:
        initial: idle
        transitions:
          begin: {from: idle, to: busy, event: job(j)}
          go_on: {from: busy, to: busy, guard: "!ready"}
          end: {from: busy, to: idle, guard: ready, message: done('d')}
          talk: {from: idle, to: idle, message: chat('c')}
          rest: {from: idle, to: asleep}
          rise: {from: asleep, to: idle, event: job(j)}
""")


def events(*lines: tuple[int, str, str]) -> tuple[TraceEvent, ...]:
    """(time [ms], take/send/receive/supply, name): of Worker, a supplied message coming from the environment."""
    found: list[TraceEvent] = []
    for number, (time, kind, name) in enumerate(lines):
        if kind == "take":
            found.append(TraceEvent(time * MS, "take", "Worker", name))
        elif kind == "send":
            found.append(TraceEvent(time * MS, "send", "Worker", "", name, number))
            found.append(TraceEvent(time * MS, "receive", "environment", "", name, number))
        else:
            found.append(TraceEvent(time * MS, "send", "environment", "", name, number))
            found.append(TraceEvent(time * MS, "receive", "Worker", "", name, number))
    return tuple(found)


BUSY = ((5, "supply", "job"), (5, "take", "begin"), (10, "take", "go_on"))


def watch(lines: tuple[tuple[int, str, str], ...], until: int, observes: Observes = "transitions") -> Checker:
    checker = Checker(WORKER, component="Worker", observes=observes, quiescence={"done": 20 * MS, "chat": 1 * MS})
    for event in events(*lines):
        checker.observe(event)
    checker.quiet(until * MS)
    return checker


@pytest.mark.parametrize("observes", ["transitions", "messages"])
def test_a_component_that_may_rest_may_be_silent_for_ever(observes: Observes) -> None:
    assert watch((), 10_000, observes).deviation is None


@pytest.mark.parametrize(("until", "late"), [(25, False), (26, True)])
def test_an_answer_that_is_owed_has_until_its_timeout(until: int, late: bool) -> None:
    found = watch(BUSY, until).deviation
    assert (found is not None) is late
    if found is not None:
        assert (found.time, found.event, found.component) == (25 * MS, None, "Worker")
        assert found.rule == "nothing came on done within 20 ms, but must"
        assert [str(each) for each in found.expected] == ["take end", "take go_on"]
        assert found.path == ("begin", "go_on")


def test_working_on_does_not_put_the_timeout_off() -> None:
    lines = (*BUSY, *((t, "take", "go_on") for t in range(11, 40)))
    found = watch(lines, 40).deviation
    assert found is not None
    assert found.time == 25 * MS


def test_a_late_answer_is_found_where_its_time_was_over() -> None:
    found = watch((*BUSY, (30, "take", "end"), (30, "send", "done")), 30).deviation
    assert found is not None
    assert (found.time, found.position) == (25 * MS, 4)


def test_an_answer_in_time_settles_the_debt() -> None:
    assert watch((*BUSY, (25, "take", "end"), (25, "send", "done")), 10_000).deviation is None


def test_from_messages_alone_an_answer_is_owed_only_where_the_worker_cannot_be_asleep() -> None:
    assert watch(((5, "supply", "job"),), 10_000, "messages").deviation is None  # it may have slept, and risen


def test_a_message_that_comes_again_and_again_is_owed_anew_each_time() -> None:
    def beats(*times: int) -> Trace:
        found = []
        for number, time in enumerate(times):
            found += [TraceEvent(time * MS, "take", "Heart", name) for name in ("pump", "beat_it")]
            found.append(TraceEvent(time * MS, "send", "Heart", "", "beat", number))
            found.append(TraceEvent(time * MS, "receive", "environment", "", "beat", number))
        return Trace("wall", tuple(found))

    owed = {"beat": 10 * MS}
    assert check(beats(9, 18, 27), WORKER, quiescence=owed).judgement.passed
    found = check(beats(9, 18, 29), WORKER, quiescence=owed)
    assert found.judgement.verdict is Verdict.FAIL
    assert found.deviation is not None
    assert found.deviation.time == 28 * MS
    assert not check(beats(9), WORKER, quiescence=owed, until=20 * MS).judgement.passed
    assert check(beats(9), WORKER, quiescence=owed, until=19 * MS).judgement.passed


def test_a_component_that_never_appears_is_missed_if_it_was_named() -> None:
    nothing = Trace("wall", ())
    assert not check(nothing, WORKER, component="Heart", quiescence={"beat": MS}, until=2 * MS).judgement.passed
    assert check(nothing, WORKER, quiescence={"beat": MS}, until=2 * MS).judgement.verdict is Verdict.INCONCLUSIVE


SHOP = parse_model("""
parcours: model/1
name: shop
messages: {Note: {fields: {text: {type: text}}}}
channels:
  ask: {from: Client, to: Server, message: Note}
  reply: {from: Server, to: Client, message: Note}
components:
  Client:
    machines:
      m:
        initial: idle
        transitions:
          put: {from: idle, to: waiting, message: ask('a')}
          get: {from: waiting, to: idle, event: reply(r)}
  Server:
    machines:
      m:
        initial: idle
        transitions:
          hear: {from: idle, to: busy, event: ask(a)}
          answer: {from: busy, to: idle, message: reply('r')}
      log:
        initial: empty
        transitions:
          keep: {from: empty, to: empty}
""")


class Part:
    """A component of SHOP that answers a poll or a message with fixed steps, after a while [s]."""

    name = "part"

    def __init__(
        self, poll: tuple[PlannerStep, ...] = (), message: tuple[PlannerStep, ...] = (), after: float = 0.0
    ) -> None:
        self._poll, self._message, self._after = poll, message, after

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[PlannerStep]:
        sleep(self._after)
        yield from self._poll if channel is None else self._message

    def wake(self, now: int) -> Iterator[PlannerStep]:
        yield from ()

    def next_wake(self) -> int | None:
        return None

    def reset(self) -> None:
        pass


def gated(server: Part) -> Trace:
    case = next(case for case in abstract_cases(SHOP) if "keep" not in str(serialise(case)))
    client = Part((PlannerStep("put", (("ask", "a"),)),), (PlannerStep("get"),))
    made = {"Client": client, "Server": server}
    done = execute(serialise(case), lambda name: made[name], lambda event: "", clock=WallClock())
    assert done.completed == (done.trace.events[-1].kind != "deviation")
    return done.trace


HEAR, ANSWER = PlannerStep("hear"), PlannerStep("answer", (("reply", "r"),))


def test_a_component_that_is_silent_at_its_turn_fails_where_the_model_wants_an_answer() -> None:
    assert check(gated(Part((), (HEAR, ANSWER))), SHOP).judgement.passed
    for server, path in ((Part(after=0.02), ()), (Part((), (HEAR,)), ("hear",))):
        found = check(gated(server), SHOP)
        assert found.judgement.verdict is Verdict.FAIL
        assert found.deviation is not None
        assert (found.deviation.event, found.deviation.component) == (None, "Server#1")
        assert "nothing came on reply within" in found.deviation.rule
        assert found.path == path


def test_the_time_that_a_silent_component_was_given_is_said() -> None:
    silence = TraceEvent(505 * MS, "deviation", "Server#1", "hear", text="nothing within 0.5 s")
    put = (
        TraceEvent(1 * MS, "take", "Client#0", "put"), TraceEvent(1 * MS, "send", "Client#0", "", "ask", 0),
        TraceEvent(1 * MS, "hold", "Client#0", "", "ask", 0), TraceEvent(5 * MS, "release", "Server#1", "", "ask", 0),
    )  # fmt: skip
    for observes in get_args(Observes):
        found = check(Trace("wall", (*put, silence)), SHOP, observes=observes)
        assert found.judgement.verdict is Verdict.FAIL
        assert found.deviation is not None
        assert found.deviation.rule == "nothing came on reply within 500 ms of its turn, but must"
        assert str(found.deviation).startswith("event 4 at 505.000 ms, Server#1:")


@pytest.mark.parametrize(
    ("component", "transition", "text"),
    [
        ("Server#1", "hear", "the model lets it be silent there"),  # nothing was handed to it
        ("Server#1", "keep", "the model lets it be silent there"),  # a machine that sends nothing
        ("Server#1", "", "the host stopped the case"),  # something else came, which the model may allow
        ("Server#1", "absent", "the host stopped the case"),
        ("Robot#3", "hear", "the host stopped the case"),
    ],
)
def test_silence_that_the_model_may_allow_is_undecided(component: str, transition: str, text: str) -> None:
    lines = (TraceEvent(0, "take", "Client#0", "put"), TraceEvent(0, "send", "Client#0", "", "ask", 0),
             TraceEvent(0, "hold", "Client#0", "", "ask", 0))  # fmt: skip
    found = check(Trace("wall", (*lines, TraceEvent(MS, "deviation", component, transition, text="x"))), SHOP)
    assert found.judgement.verdict is Verdict.INCONCLUSIVE
    assert text in found.judgement.why


def test_a_silent_component_without_a_timeout_is_undecided_and_told_which_option_decides() -> None:
    heard = (TraceEvent(0, "send", "environment", "", "job", 0), TraceEvent(0, "receive", "Worker", "", "job", 0))
    found = check(Trace("wall", heard), WORKER)
    assert found.judgement.verdict is Verdict.INCONCLUSIVE
    nothing = check(Trace("wall", ()), WORKER, component="Heart")
    assert "Heart must send on beat: a timeout (--quiescence beat=MS) and --duration decide" in nothing.judgement.why
    assert "--component" in check(Trace("wall", ()), WORKER).judgement.why
    late = check(Trace("wall", ()), WORKER, component="Heart", quiescence={"beat": MS}, until=2 * MS)
    assert late.judgement.verdict is Verdict.FAIL

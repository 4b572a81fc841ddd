"""The checker against naive twins: configurations of the step relation, and words written out one by one."""

from __future__ import annotations

import itertools
import random

import pytest

from parcours.model import parse_model
from parcours.model.stepping import enabled, initial, step
from parcours.model.structure import Cefsm
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.conformance import Allowance, check
from parcours.verdict.judgement import Verdict


def taken(component: str, *names: str) -> Trace:
    return Trace("simulated", tuple(TraceEvent(0, "take", component, name) for name in names))


COUNTER = parse_model("""
parcours: model/1
name: counter
components:
  Counter:
    variables:
      n: {type: int, initial: 0, range: [0, 4]}
      go: {type: bool, role: input, initial: false}
    machines:
      count:
        initial: low
        transitions:
          up: {from: low, to: low, guard: "go && n < 3", action: n := n + 1}
          down: {from: low, to: low, guard: n > 0, action: n := n - 1}
          jump: {from: low, to: high, guard: n == 2, action: n := 4}
          drop: {from: high, to: low, guard: "!go", action: n := 0}
      other:
        initial: a
        transitions:
          ab: {from: a, to: b, guard: n > 1}
          ba: {from: b, to: a}
""")


def refused_at(cefsm: Cefsm, names: list[str]) -> int | None:
    """The naive twin: all configurations that the step relation leads to, one transition after the other."""
    here = {initial(cefsm)}
    for at, name in enumerate(names):
        here = {step(cefsm, each, move) for each in here for move in enabled(cefsm, each) if move.transition == name}
        if not here:
            return at
    return None


def test_transitions_are_refused_exactly_where_the_step_relation_refuses_them() -> None:
    draw = random.Random(5)
    names = [each.id for each in COUNTER.component("Counter").transitions()]
    seen: set[int | None] = set()
    for _ in range(300):
        word = [draw.choice(names) for _ in range(6)]
        found = check(taken("Counter", *word), COUNTER)
        at = found.deviation.position if found.deviation else None
        assert at == refused_at(COUNTER, word), word
        seen.add(at)
    assert len(seen) >= 5


def test_a_deviation_is_in_doubt_where_open_values_were_not_all_tried() -> None:
    model = parse_model("""
parcours: model/1
name: doubtful
components:
  A:
    variables:
      x: {type: real, role: input}
      y: {type: real, initial: 0.0}
    machines:
      m:
        initial: s
        transitions:
          sample: {from: s, to: t, action: y := x * x}
          hit: {from: t, to: s, guard: "y == 1764.0"}
          miss: {from: t, to: s, guard: "y != 1764.0"}
""")
    found = check(taken("A", "sample", "hit"), model)
    assert found.judgement.verdict is Verdict.INCONCLUSIVE
    assert found.deviation is not None
    assert "'x'" in found.deviation.doubt
    assert check(taken("A", "hit"), model).judgement.verdict is Verdict.FAIL


DESK = parse_model("""
parcours: model/1
name: desk
messages:
  Note: {fields: {text: {type: text}}}
channels:
  ask: {from: Guest, to: Desk, message: Note, topic: /desk, capacity: 5}
  reply: {from: Desk, to: Guest, message: Note, topic: /desk, capacity: 5}
  stop: {from: Guest, to: Desk, message: Note}
  bell: {from: Desk, to: Guest, message: Note, capacity: 5}
components:
  Guest:
    machines:
      sit:
        initial: here
        transitions: {rest: {from: here, to: here}}
  Desk:
    machines:
      work:
        initial: idle
        transitions:
          take: {from: idle, to: busy, event: ask(a)}
          think: {from: busy, to: ready}
          answer: {from: ready, to: idle, message: reply('yes')}
          forget: {from: busy, to: idle}
          halt: {from: busy, to: halted, event: stop(s), message: bell('off')}
      clock:
        initial: tick
        transitions:
          tock: {from: tick, to: tack}
          ring: {from: tack, to: rung, message: bell('on')}
""")

Place = tuple[tuple[str, str], tuple[int, int], str]
"""States of both machines, unread ask and stop, and the message under way (empty for none)."""


def hidden(places: set[Place]) -> set[Place]:
    """All that hidden steps of the desk lead to: its transitions, written out by hand."""
    found, waiting = set(places), list(places)
    while waiting:
        (work, clock), (asked, stopped), due = waiting.pop()
        if due:
            continue
        after: list[Place] = []
        if work == "idle" and asked:
            after.append((("busy", clock), (asked - 1, stopped), ""))
        if work == "busy":
            after += [(("ready", clock), (asked, stopped), ""), (("idle", clock), (asked, stopped), "")]
            if stopped:
                after.append((("halted", clock), (asked, stopped - 1), "bell"))
        if work == "ready":
            after.append((("idle", clock), (asked, stopped), "reply"))
        if clock == "tick":
            after.append(((work, "tack"), (asked, stopped), ""))
        if clock == "tack":
            after.append(((work, "rung"), (asked, stopped), "bell"))
        for place in after:
            if place not in found:
                found.add(place)
                waiting.append(place)
    return found


def is_allowed(word: tuple[str, ...]) -> bool:
    places = hidden({(("idle", "tick"), (0, 0), "")})
    for letter in word:
        if letter == "ask":
            places = {(states, (asked + 1, stopped), due) for states, (asked, stopped), due in places}
        elif letter == "stop":
            places = {(states, (asked, stopped + 1), due) for states, (asked, stopped), due in places}
        else:
            places = {(states, unread, "") for states, unread, due in places if due == letter}
        places = hidden(places)
    return bool(places)


def messages(word: tuple[str, ...]) -> Trace:
    events: list[TraceEvent] = []
    for number, letter in enumerate(word):
        if letter in ("ask", "stop"):
            events.append(TraceEvent(0, "send", "environment", "", letter, number))
            events.append(TraceEvent(0, "receive", "Desk", "", letter, number))
        else:
            events.append(TraceEvent(0, "send", "Desk", "", letter, number))
            events.append(TraceEvent(0, "receive", "environment", "", letter, number))
    return Trace("simulated", tuple(events))


def test_from_messages_alone_exactly_the_words_of_the_model_pass() -> None:
    n_allowed = 0
    for word in itertools.product(("ask", "stop", "reply", "bell"), repeat=5):
        found = check(messages(word), DESK, observes="messages")
        allowed = is_allowed(word)
        assert found.judgement.passed is allowed, word
        n_allowed += allowed
    assert 50 < n_allowed < 500


def test_from_messages_alone_the_path_is_what_was_seen() -> None:
    found = check(messages(("ask", "reply", "reply")), DESK, observes="messages")
    assert found.path == ("?ask", "!reply")
    assert [str(each) for each in found.expected] == ["receive ask", "send bell(text = 'on')"]
    assert found.deviation is not None
    assert found.deviation.rule == "reply was sent, but nothing that it may do now sends it"


def test_more_hidden_states_than_are_followed_make_a_deviation_doubtful() -> None:
    word = messages(("ask", "reply", "reply"))
    found = check(word, DESK, observes="messages", hidden=2)
    assert found.judgement.verdict is Verdict.INCONCLUSIVE
    assert found.deviation is not None
    assert found.deviation.doubt == "steps that nobody sees lead to more than 2 states"


@pytest.mark.parametrize(("asked", "replied", "passes"), [(8, 8, True), (8, 9, False), (30, 30, True), (30, 31, True)])
def test_of_more_than_eight_unread_messages_nobody_knows_how_many(asked: int, replied: int, passes: bool) -> None:
    word = ("ask",) * asked + ("reply",) * replied
    assert check(messages(word), DESK, observes="messages").judgement.passed is passes


def test_where_transitions_are_seen_unread_messages_are_counted_up_to_sixty_four() -> None:
    asked = messages(("ask",) * 30).events
    answered: list[TraceEvent] = []
    for number in range(31):
        answered += (TraceEvent(0, "take", "Desk", name) for name in ("take", "think", "answer"))
        answered.append(TraceEvent(0, "send", "Desk", "", "reply", 100 + number))
        answered.append(TraceEvent(0, "receive", "environment", "", "reply", 100 + number))
    found = check(Trace("simulated", (*asked, *answered)), DESK)
    assert found.deviation is not None
    assert found.deviation.rule == "take needs a message of ask, but none was there to take up"
    assert len(found.path) == 90


def test_where_unread_messages_are_no_longer_counted_none_need_be_left() -> None:
    word = messages(("ask",) * 12 + ("reply",) * 12)
    found = check(word, CALLER, component="Desk", observes="messages", quiescence={"reply": 5}, until=100)
    assert found.judgement.passed
    word = messages(("ask",) * 3 + ("reply",) * 2)
    found = check(word, CALLER, component="Desk", observes="messages", quiescence={"reply": 5}, until=100)
    assert found.judgement.verdict is Verdict.FAIL


def test_a_numbered_instance_runs_any_one_of_its_machines() -> None:
    assert check(taken("Desk#0", "tock"), DESK).judgement.passed
    found = check(taken("Desk#0", "tock", "think"), DESK)
    assert [str(each) for each in found.expected] == ["receive ask", "take ring"]  # in a whole case, all run


CONVERSING = Allowance(unmodelled=frozenset({"ask"}), conversations=True)

CALLER = parse_model("""
parcours: model/1
name: caller
messages:
  Note: {fields: {text: {type: text}}}
channels:
  ask: {from: Caller, to: Desk, message: Note, topic: /desk}
  reply: {from: Desk, to: Caller, message: Note, topic: /desk}
components:
  Desk:
    machines: {m: {initial: s, transitions: {d: {from: s, to: s, event: ask(a), message: reply('yes')}}}}
  Caller:
    machines:
      m:
        initial: idle
        transitions:
          call: {from: idle, to: waiting, message: ask('well?')}
          heed: {from: waiting, to: waiting, event: reply(r)}
          leave: {from: waiting, to: idle}
""")


def talk(text: str) -> Trace:
    """`call` takes and asks, `aside` asks outside the model, `told` brings an answer; else a transition."""
    events: list[TraceEvent] = []
    for number, word in enumerate(text.split()):
        if word == "call":
            events.append(TraceEvent(0, "take", "Caller", "call"))
        if word in ("call", "aside"):
            events.append(TraceEvent(0, "send", "Caller", "", "ask", number))
            events.append(TraceEvent(0, "receive", "environment", "", "ask", number))
        elif word == "told":
            events.append(TraceEvent(0, "send", "environment", "", "reply", number))
            events.append(TraceEvent(0, "receive", "Caller", "", "reply", number))
        else:
            events.append(TraceEvent(0, "take", "Caller", word))
    return Trace("simulated", tuple(events))


@pytest.mark.parametrize(
    ("text", "allowance", "passes"),
    [
        ("call told heed leave", Allowance(), True),
        ("call aside", Allowance(), False),
        ("call aside told leave", CONVERSING, True),
        ("call aside told heed", CONVERSING, False),  # the answer is for the question asked aside
        ("call aside told call told heed", CONVERSING, False),  # a call from waiting
        ("call told leave call heed", Allowance(), True),  # the first answer still waits in its queue
        ("call told leave call heed", CONVERSING, False),  # ... and is void, since a new question was asked
        ("call told leave call told heed heed", CONVERSING, False),
    ],
)
def test_an_answer_counts_for_the_latest_question_where_conversations_are_kept(
    text: str, allowance: Allowance, passes: bool
) -> None:
    assert check(talk(text), CALLER, component="Caller", allowance=allowance).judgement.passed is passes

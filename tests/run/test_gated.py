"""Gated execution: the 67 cases of the RAMP components on obedient toys; every kind of deviation found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest

from parcours.abtc import Event, abstract_cases, serialise
from parcours.abtc.sequencing import Emission, Reception
from parcours.errors import BadRequest
from parcours.model.model_file import read_model
from parcours.model.structure import Cefsm
from parcours.run.clocks import WallClock
from parcours.run.enforcement import Execution, instance_name
from parcours.run.hosts.battery import ToyStep
from parcours.run.in_process import execute
from parcours.run.port import Send, Step
from parcours.run.trace import held, transitions


@pytest.fixture(scope="module")
def ramp() -> Cefsm:
    return read_model(Path(str(files("parcours_ramp") / "components" / "model.yaml")))


class Obedient:
    """Takes whatever transitions its script says: those after a receive follow in the same breath."""

    def __init__(self, name: str, script: tuple[Event, ...]) -> None:
        self.name, self._script, self._at = name, script, 0
        self.got: list[tuple[str, object]] = []

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if channel is not None:
            self.got.append((channel, message))
        first = True
        while self._at < len(self._script):
            event = self._script[self._at]
            if event.receives is not None and not (first and event.receives.channel == channel):
                return
            self._at += 1
            first = False
            yield ToyStep(event.transition, tuple((e.channel, f"from {event.position}") for e in event.sends))

    def next_wake(self) -> int | None:
        return None

    def wake(self, now: int) -> Iterator[Step]:
        return iter(())

    def reset(self) -> None:
        self._at = 0


def obedient(events: tuple[Event, ...]) -> tuple[Callable[[str], Obedient], dict[int, Obedient]]:
    order = iter(dict.fromkeys(event.reference for event in events))
    made: dict[int, Obedient] = {}

    def make(name: str) -> Obedient:
        reference = next(order)
        made[reference] = Obedient(name, tuple(event for event in events if event.reference == reference))
        return made[reference]

    return make, made


def test_all_67_component_cases_run_in_their_order_and_hold_each_message_until_its_turn(ramp: Cefsm) -> None:
    cases = list(abstract_cases(ramp))
    for case in cases:
        events = serialise(case)
        make, made = obedient(events)
        done = execute(events, make, lambda event: f"supplied {event.position}", case=case.id)
        assert done.completed, str(done.deviation)
        assert transitions(done.trace) == tuple(event.transition for event in events)
        gated = [e for e in events if e.receives is not None and e.receives.event is not None]
        assert len(held(done.trace)) == len(gated)
        assert all(time > 0 for time in held(done.trace).values())
        for event in events:
            part = made[event.reference]
            if event.receives is not None:
                source = event.receives.event
                expected = f"supplied {event.position}" if source is None else f"from {source}"
                assert (event.receives.channel, expected) in part.got
    assert len(cases) == 67


def event(
    position: int,
    component: str,
    transition: str,
    receives: Reception | None = None,
    sends: tuple[Emission, ...] = (),
) -> Event:
    reference = "AB".index(component)
    return Event(
        position=position,
        turn=position,
        reference=reference,
        visit=reference,
        component=component,
        machine="m",
        path="tp",
        transition=transition,
        receives=receives,
        sends=sends,
    )


ASK = (
    event(0, "A", "a1", sends=(Emission("ask", "reference", 1),)),
    event(1, "A", "a2"),
    event(2, "B", "b1", Reception("ask", 0)),
    event(3, "B", "b2", sends=(Emission("out"),)),
    event(4, "B", "b3", Reception("data")),
)


class Plain:
    """Answers a poll, a message or a wake with fixed steps."""

    def __init__(self, name: str, *, poll: tuple[Step, ...] = (), wakes: tuple[Step, ...] = (),
                 messages: dict[str, tuple[Step, ...]] | None = None, due: int = 0) -> None:  # fmt: skip
        self.name, self._poll, self._wakes, self._messages, self._due = name, poll, wakes, messages or {}, due

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if message == "poison":
            raise ZeroDivisionError("poisoned")
        yield from self._poll if channel is None else self._messages.get(channel, ())

    def next_wake(self) -> int | None:
        return self._due or None

    def wake(self, now: int) -> Iterator[Step]:
        assert now >= self._due
        self._due = 0
        yield from self._wakes

    def reset(self) -> None:
        self._due = 0


def steps(*taken: str | tuple[str, Send]) -> tuple[Step, ...]:
    return tuple(ToyStep(one) if isinstance(one, str) else ToyStep(one[0], (one[1],)) for one in taken)


GOOD_A = Plain("A", poll=steps(("a1", ("ask", 1)), "a2"))
GOOD_B = Plain("B", messages={"ask": steps("b1", ("b2", ("out", 5))), "data": steps("b3")})


def run(a: Plain = GOOD_A, b: Plain = GOOD_B, data: object = "data", events: tuple[Event, ...] = ASK) -> Execution:
    return execute(events, lambda name: {"A": a, "B": b}[name], lambda received: data)


def test_a_completed_case_has_the_tester_receive_what_leaves_the_case() -> None:
    done = run()
    assert done.completed and transitions(done.trace) == ("a1", "a2", "b1", "b2", "b3")
    assert [(e.channel, e.payload) for e in done.trace.events
            if e.kind == "receive" and e.component == "environment"] == [("out", 5)]  # fmt: skip
    assert held(done.trace) == {0: 2_000_000}  # sent with the first event, released with the third
    assert transitions(done.trace, instance_name(ASK[2])) == ("b1", "b2", "b3")


@pytest.mark.parametrize(
    ("a", "b", "data", "position", "expected", "got"),
    [
        (Plain("A", poll=steps("a9")), GOOD_B, 0, 0, "a1", "a9"),
        (Plain("A"), GOOD_B, 0, 0, "a1", "no transition"),
        (Plain("A", poll=steps("a1")), GOOD_B, 0, 0, "a1 to send ask", "a1 sending nothing"),
        (Plain("A", poll=steps(("a1", ("oops", 1)))), GOOD_B, 0, 0, "a1 to send ask", "a1 sending oops"),
        (GOOD_A, Plain("B", messages={"ask": steps("b1", ("b2", ("out", 5)), "b3")}), 0, 4,
         "b3 on receiving data", "it unasked"),
        (GOOD_A, Plain("B", messages={"ask": steps("b1", ("b2", ("out", 5)), "b7")}), 0, 4, "b3", "b7"),
        (GOOD_A, GOOD_B, "poison", 4, "b3", "ZeroDivisionError: poisoned"),
        (GOOD_A, Plain("B", messages={"ask": (3,)}), 0, 2, "b1", "AttributeError: 'int'"),  # type: ignore[dict-item]
    ],
)  # fmt: skip
def test_the_first_deviation_is_named_with_the_path_that_led_there(
    a: Plain, b: Plain, data: object, position: int, expected: str, got: str
) -> None:
    done = run(a, b, data)
    found = done.deviation
    assert found is not None and not done.completed
    assert found.event.position == position and found.expected == expected and found.got.startswith(got)
    own = tuple(e.transition for e in ASK[:position] if e.reference == ASK[position].reference)
    assert found.path == own
    assert done.trace.events[-1].kind == "deviation"
    assert f"expected {expected}, got {got}" in str(found)


def test_what_is_held_when_an_execution_deviates_is_listed() -> None:
    found = run(Plain("A", poll=steps(("a1", ("ask", 1)), "a8"))).deviation
    assert found is not None and [(one.channel, one.sent_by) for one in found.held] == [("ask", 0)]
    assert "held back: ask from event 0" in str(found)


def test_an_instance_that_acts_by_time_is_woken_when_polling_moves_nothing() -> None:
    late = Plain("A", wakes=steps(("a1", ("ask", 1)), "a2"), due=70_000_000)
    done = run(late)
    assert done.completed
    assert done.trace.events[0].time == 70_000_000


def test_on_the_wall_clock_the_trace_says_so() -> None:
    done = execute(ASK, lambda name: {"A": GOOD_A, "B": GOOD_B}[name], lambda event: 0, clock=WallClock())
    assert done.completed and done.trace.clock == "wall"
    assert [e.time for e in done.trace.events] == sorted(e.time for e in done.trace.events)


def test_input_variables_can_be_set_before_each_transition() -> None:
    seen: list[tuple[int, str]] = []
    execute(ASK, lambda name: {"A": GOOD_A, "B": GOOD_B}[name], lambda event: 0,
            prepare=lambda event, part: seen.append((event.position, part.name)))  # fmt: skip
    assert seen == [(0, "A"), (1, "A"), (2, "B"), (3, "B"), (4, "B")]


def test_a_sequence_that_receives_before_it_sends_is_refused() -> None:
    wrong = (event(0, "B", "b1", Reception("ask", 3)),)
    with pytest.raises(BadRequest, match="gate-order"):
        run(events=wrong)


def test_a_message_that_never_came_to_its_gate_is_a_deviation() -> None:
    astray = (replace(ASK[0], sends=(Emission("ask"),)), *ASK[1:])
    found = run(events=astray).deviation
    assert found is not None and found.got == "no message from event 0"

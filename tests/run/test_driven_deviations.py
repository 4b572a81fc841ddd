"""Driven nodes that do something else than the case demands: what is found, where, after which path, what is held."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from parcours.abtc import Emission, Event, Reception
from parcours.errors import HostFailure
from parcours.run.enforcement import Deviation, Execution, Held, enforce
from parcours.run.hosts.live_enforcement import DrivenInstances
from parcours.run.hosts.node_program import Plain, nodes_of
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.port import Component, Link, Send, Step
from parcours.run.trace import held

LINKS = (
    Link("start", "environment", "Asker"),
    Link("ask", "Asker", "Answerer"),
    Link("more", "Asker", "Answerer"),
    Link("answer", "Answerer", "Asker"),
    Link("noise", "Answerer", "Asker"),
)


@dataclass(frozen=True)
class Taken:
    transition: str
    sends: tuple[Send, ...] = ()


class Toy:
    """Asker: a1 asks and says more, a2 hears the answer. Answerer: b1 takes it, b2 answers, b3 takes the rest."""

    def __init__(self, name: str, how: str = "") -> None:
        self.name, self._how = name, how

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if self.name == "Asker":
            yield Taken("a1", (("ask", message), ("more", 5))) if channel == "start" else Taken("a2")
        elif channel == "more":
            yield Taken("b3")
        else:
            yield from self._answers(message)

    def _answers(self, message: object) -> Iterator[Step]:
        first, second = Taken("b1"), Taken("b2", (("answer", message),))
        match self._how:
            case "raises":
                raise ValueError("broken")
            case "is silent":
                return
            case "skips":
                yield second
            case "repeats":
                yield from (first, first, second)
            case "goes on unasked":
                yield from (first, second, Taken("b3"))
            case "sends on another channel":
                yield from (first, Taken("b2", (("noise", 1),)))
            case "sends nothing":
                yield from (first, Taken("b2"))
            case "sends twice":
                yield from (first, Taken("b2", (("answer", 1), ("answer", 2))))
            case "sends what is no message":
                yield from (first, Taken("b2", (("answer", object()),)))
            case "yields what is no step":
                yield from (first, "b2")  # type: ignore[misc]
            case "exits":
                sys.exit(3)
            case "is killed":
                os.kill(os.getpid(), signal.SIGKILL)
            case "is frozen":
                yield first
                os.kill(os.getpid(), signal.SIGSTOP)
                yield second
            case "hangs":
                while True:
                    time.sleep(1.0)
            case _:
                yield from (first, second)

    def next_wake(self) -> int | None:
        return None

    def wake(self, now: int) -> Iterator[Step]:
        return iter(())

    def reset(self) -> None:
        pass


class NodeProgram(Plain):
    """A toy that is spoilt if the case says so."""

    def __init__(self, component: str) -> None:
        super().__init__(component, {})
        self._name = component

    def instance(self, case: bytes) -> Component:
        name, how = json.loads(case)
        if how == "cannot be made" and name == self._name:
            raise ValueError("no such case")
        return Toy(self._name, how if name == self._name else "")


class Stimuli:
    """Tells the nodes who of them is spoilt, and how."""

    def __init__(self, name: str, how: str) -> None:
        self._told = name, how

    def case(self) -> bytes:
        return json.dumps(self._told).encode()

    def prompt(self, event: Event) -> str:
        return "poll"

    def given(self, event: Event) -> None:
        return None

    def settling(self, event: Event) -> Sequence[tuple[str, object]]:
        return ()


def event(position: int, component: str, transition: str, after: tuple[int, ...], receives: Reception,
          *sends: Emission) -> Event:  # fmt: skip
    reference = int(component == "Answerer")
    return Event(position, position, reference, 0, component, component, "p", transition, receives, sends, after)


CASE = (
    event(0, "Asker", "a1", (), Reception("start"), Emission("ask", "reference", 1), Emission("more", "reference", 1)),
    event(1, "Answerer", "b1", (0,), Reception("ask", 0)),
    Event(2, 2, 1, 0, "Answerer", "Answerer", "p", "b2", None, (Emission("answer", "reference", 0),), (1,)),
    event(3, "Asker", "a2", (0, 2), Reception("answer", 2)),
    event(4, "Answerer", "b3", (2, 3), Reception("more", 0)),
)


@pytest.fixture(scope="module")
def start() -> Iterator[Callable[[], ProcessTransport]]:
    """Nodes find this module by its bare name."""
    opened: list[ProcessTransport] = []
    sys.path.insert(0, str(Path(__file__).parent))

    def start() -> ProcessTransport:
        opened.append(ProcessTransport(nodes_of(LINKS, ["Asker", "Answerer"], "test_driven_deviations:NodeProgram")))
        return opened[-1]

    yield start
    sys.path.remove(str(Path(__file__).parent))
    for one in opened:
        one.close()


@pytest.fixture(scope="module")
def transport(start: Callable[[], ProcessTransport]) -> ProcessTransport:
    return start()


def executed(transport: ProcessTransport, how: str, *, strict: bool = True, patience: int = 5_000_000_000,
             supply: Callable[[Event], object] = lambda event: 7) -> Execution:  # fmt: skip
    instances = DrivenInstances(transport, Plain("", {}), Stimuli("Answerer", how))
    return enforce(CASE, instances, supply, case=how, strict=strict, patience=patience)


def found(execution: Execution) -> Deviation:
    assert execution.deviation is not None and not execution.completed
    last = execution.trace.events[-1]
    assert (last.kind, last.text) == ("deviation", str(execution.deviation))
    return execution.deviation


@pytest.mark.parametrize("strict", [True, False])
def test_sound_components_complete_the_case_and_what_waits_is_held(transport: ProcessTransport, strict: bool) -> None:
    execution = executed(transport, "", strict=strict)
    assert execution.completed, execution.deviation
    taken = [(e.component, e.transition) for e in execution.trace.events if e.kind == "take"]
    assert taken == [("Asker#0", "a1"), ("Answerer#1", "b1"), ("Answerer#1", "b2"), ("Asker#0", "a2"),
                     ("Answerer#1", "b3")]  # fmt: skip
    payloads = {e.channel: e.payload for e in execution.trace.events if e.kind == "receive"}
    assert payloads == {"start": 7, "ask": 7, "answer": 7, "more": 5}
    times = {(e.kind, e.transition or e.channel): e.time for e in execution.trace.events}
    more = next(e.message for e in execution.trace.events if e.channel == "more")
    assert held(execution.trace)[more] == times["release", "more"] - times["send", "more"]
    assert times["release", "more"] >= times["take", "a2"], "released before its start vector allows"


DEVIATIONS = {
    "skips": (1, "b1", "b2"),
    "repeats": (2, "b2", "b1"),
    "goes on unasked": (4, "b3 on receiving more", "it unasked"),
    "sends on another channel": (2, "b2 to send answer", "b2 sending noise"),
    "sends nothing": (2, "b2 to send answer", "b2 sending nothing"),
    "sends twice": (2, "b2 to send answer", "b2 sending answer, answer"),
    "sends what is no message": (2, "b2", "TypeError: Encoding objects of type object is unsupported"),
    "yields what is no step": (2, "b2", "AttributeError: 'str' object has no attribute 'sends'"),
    "raises": (1, "b1", "ValueError: broken"),
    "is silent": (1, "b1", "no transition"),
    "cannot be made": (1, "b1", "ValueError: no such case"),
}
PATHS: dict[int, tuple[str, ...]] = {1: (), 2: ("b1",), 4: ("b1", "b2")}


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("how", DEVIATIONS)
def test_a_deviation_names_event_expectation_path_and_held_messages(
    transport: ProcessTransport, how: str, strict: bool
) -> None:
    position, expected, got = DEVIATIONS[how]
    deviation = found(executed(transport, how, strict=strict))
    assert (deviation.event.position, deviation.expected, deviation.got) == (position, expected, got)
    assert deviation.path == PATHS[position]
    waiting = [] if position == 4 else [("more", 0)]
    sent_in_vain = [("answer", 2)] * 2 if how == "sends twice" else []
    assert [(one.channel, one.sent_by) for one in deviation.held] == waiting + sent_in_vain
    assert executed(transport, "").completed, "the nodes must be as good as new for the next case"


def test_a_frozen_node_says_nothing_and_serves_the_next_case_when_it_is_let_go_on(transport: ProcessTransport) -> None:
    deviation = found(executed(transport, "is frozen", patience=300_000_000))
    assert (deviation.event.position, deviation.got, deviation.path) == (2, "nothing within 0.3 s", ("b1",))
    assert executed(transport, "").completed


ENDS = {
    "exits": "its process ended: exit status 3",
    "is killed": "its process ended: killed by SIGKILL",
    "hangs": "nothing within 0.3 s",
}


@pytest.mark.parametrize("how", ENDS)
def test_a_node_that_is_lost_fails_its_case_and_the_next_case_says_so_at_once(
    start: Callable[[], ProcessTransport], how: str
) -> None:
    transport = start()
    patience = 300_000_000 if how == "hangs" else 5_000_000_000
    deviation = found(executed(transport, how, patience=patience))
    assert (deviation.event.position, deviation.got, deviation.path) == (1, ENDS[how], ())
    assert deviation.held == (Held(2, "more", 0),)
    begun = time.monotonic()
    with pytest.raises(HostFailure, match=r"node Answerer.*process ended"):
        executed(transport, "")
    assert time.monotonic() - begun < 5.0
    transport.close()


@pytest.mark.parametrize("strict", [True, False])
def test_a_node_that_dies_while_it_waits_is_found_dead_not_silent(
    start: Callable[[], ProcessTransport], strict: bool
) -> None:
    transport = start()

    def supply(event: Event) -> object:
        transport.signal("Answerer", signal.SIGKILL)
        while Path(f"/proc/{transport.pids['Answerer']}").exists():
            time.sleep(0.001)
        return 7

    deviation = found(executed(transport, "", strict=strict, supply=supply))
    assert deviation.got == "its process ended: killed by SIGKILL"
    assert deviation.event.position == 1
    transport.close()


def test_a_component_without_a_node_is_named(start: Callable[[], ProcessTransport]) -> None:
    with (
        ProcessTransportOf(["Asker"]) as transport,
        pytest.raises(HostFailure, match=r"Answerer has none.*node-missing"),
    ):
        executed(transport, "")


class ProcessTransportOf:
    """A transport of some of the nodes only."""

    def __init__(self, names: Sequence[str]) -> None:
        self._transport = ProcessTransport(nodes_of(LINKS, names, "test_driven_deviations:NodeProgram"))

    def __enter__(self) -> ProcessTransport:
        return self._transport

    def __exit__(self, *error: object) -> None:
        self._transport.close()

"""Nodes that live in real time: what a tester in their middle sees, and that nothing they do takes the run from it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from parcours.errors import BadRequest, HostFailure
from parcours.run.faults import parse_plan
from parcours.run.hosts.node_program import Plain, nodes_of
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.slots import Answer, silence
from parcours.run.port import ENVIRONMENT, Component, Link, LinkKind, Send, Step
from parcours.run.trace import Trace, TraceEvent

MS, S = 1_000_000, 1_000_000_000
LONG = 60.0  # seconds: more than the busiest machine takes, less than a run that nothing ends
LINKS = (
    Link("numbers", "Source", "Sink", 50_000, LinkKind.SERVICE),
    Link("news", "Source", "Sink", 3),
    Link("given", ENVIRONMENT, "Sink", 50_000, LinkKind.SERVICE),
    Link("seen", "Sink", ENVIRONMENT, 50_000),
    Link("there", ENVIRONMENT, "Local"),
    Link("back", "Local", ENVIRONMENT),
)


@dataclass(frozen=True)
class Taken:
    transition: str
    sends: tuple[Send, ...] = ()


class Part:
    """A component that only answers."""

    def __init__(self, name: str) -> None:
        self.name = name

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        yield Taken("k", (("seen", message),))

    def next_wake(self) -> int | None:
        return None

    def wake(self, now: int) -> Iterator[Step]:
        return iter(())

    def reset(self) -> None:
        pass


class Source(Part):
    """Sends so many numbers at once."""

    def __init__(self, n: int, channel: str) -> None:
        super().__init__("Source")
        self._n, self._channel = n, channel

    def next_wake(self) -> int | None:
        return 0 if self._n else None

    def wake(self, now: int) -> Iterator[Step]:
        n, self._n = self._n, 0
        yield Taken("s", tuple((self._channel, k) for k in range(n)))


class Restless(Part):
    """Is always due, and sends each time, or never."""

    def __init__(self, name: str, sends: tuple[Send, ...]) -> None:
        super().__init__(name)
        self._sends = sends

    def next_wake(self) -> int | None:
        return 0

    def wake(self, now: int) -> Iterator[Step]:
        yield Taken("r", self._sends)


class Slow(Part):
    """Works long at its first message."""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if message == 0 or self.name == "done":
            time.sleep(0.3)
        yield Taken("k", (("seen", message),))


class Picky(Part):
    """Raises at 6."""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if message == 6:
            raise IndexError("six")
        return super().handle(channel, message, now)


class Hung(Part):
    """Never comes back from its first message."""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        while True:
            time.sleep(1.0)
        yield


class NodeProgram(Plain):
    """What the case tells the source and the sink to be."""

    def __init__(self, component: str) -> None:
        super().__init__(component, {})
        self._name = component

    def instance(self, case: bytes) -> Component:
        told = json.loads(case)
        if self._name == "Source":
            if told.get("restless"):
                return Restless("Source", (("numbers", 1),))
            return Source(told.get("n", 0), told.get("channel", "numbers"))
        kind = told.get("sink", "Part")
        if kind == "unmade":
            raise ValueError("no such case")
        return {"Part": Part, "Slow": Slow, "Picky": Picky, "Hung": Hung}[kind]("Sink")


def opened() -> ProcessTransport:
    return ProcessTransport(nodes_of(LINKS[:4], ["Source", "Sink"], "test_realtime_host:NodeProgram"))


@pytest.fixture(scope="module")
def here() -> Iterator[None]:
    """Nodes find this module by its bare name."""
    sys.path.insert(0, str(Path(__file__).parent))
    yield
    sys.path.remove(str(Path(__file__).parent))


@pytest.fixture(scope="module")
def transport(here: None) -> Iterator[ProcessTransport]:
    transport = opened()
    yield transport
    transport.close()


class Run:
    """One run on the transport, and what the tester saw."""

    def __init__(self, transport: ProcessTransport, *, until: int = 200 * S, plan: str = "",
                 local: Sequence[Component] = (), inject: Sequence[tuple[object, int]] = (), answer: Answer = silence,
                 rest: bool = True,
                 listener: Callable[[TraceEvent], None] | None = None, **case: object) -> None:  # fmt: skip
        self.seen: list[object] = []

        def tester(channel: str, payload: object, now: int) -> Sequence[Send]:
            self.seen.append(payload)
            return tuple(answer(channel, payload, now))

        self.host = RealTimeHost(
            transport, LINKS, Plain("", {}), case=json.dumps(case).encode(), environment=tester, local=local,
            faults=parse_plan(plan) if plan else None, listener=listener,
        )  # fmt: skip
        for payload, at in inject:
            self.host.inject("given", payload, at)
        begun = time.monotonic()
        self.host.run(until)
        self.seconds = time.monotonic() - begun
        if rest:
            self.host.rest()
        self.trace: Trace = self.host.trace()
        self.deaths = dict(self.host.deaths)

    def of(self, kind: str, channel: str = "", component: str = "") -> list[object]:
        return [
            e.payload
            for e in self.trace.events
            if (e.kind, e.channel) == (kind, channel or e.channel) and component in ("", e.component)
        ]


def test_a_run_ends_when_nothing_is_left_that_could_happen(transport: ProcessTransport) -> None:
    run = Run(transport, n=5)
    assert run.seen == [0, 1, 2, 3, 4] and run.seconds < LONG and run.deaths == {}
    assert {event.kind for event in run.trace.events} == {"take", "send", "receive"}


def test_a_flood_on_a_service_loses_nothing_and_keeps_its_order(transport: ProcessTransport) -> None:
    run = Run(transport, n=5000)
    assert run.seen == list(range(5000))
    assert run.of("receive", "numbers") == list(range(5000)) and run.of("drop") == []


def test_a_full_topic_loses_its_oldest_messages(transport: ProcessTransport) -> None:
    run = Run(transport, n=40, channel="news", sink="Slow")
    got, lost = run.of("receive", "news"), run.of("drop", "news")
    assert run.seen == got and got[-3:] == [37, 38, 39]
    assert sorted([*got, *lost]) == list(range(40)) and got == sorted(got) and lost == sorted(lost)  # type: ignore[type-var]
    assert {event.text for event in run.trace.events if event.kind == "drop"} == {"overrun"}


def test_a_message_of_five_megabytes_arrives_whole(transport: ProcessTransport) -> None:
    big = bytes(range(250)) * 20_000
    run = Run(transport, inject=[(big, 0), ("small", 0)])
    assert run.seen == [big, "small"]


def test_a_message_larger_than_any_frame_may_be_is_refused_by_name(transport: ProcessTransport) -> None:
    with pytest.raises(HostFailure, match=r"64 MiB.*frame-size"):
        Run(transport, inject=[(b"x" * (65 * 1024 * 1024), 0)])
    assert Run(transport, inject=[(1, 0)]).seen == [1]


def test_a_frozen_node_takes_nothing_from_the_tester_and_hears_all_when_it_goes_on(transport: ProcessTransport) -> None:
    big = b"x" * 3_000_000
    plan = "Sink: freeze at 1 ms for 400 ms"
    ticks: list[int] = []

    class Clock(Part):
        """Wakes every 10 ms."""

        def next_wake(self) -> int | None:
            return len(ticks) * 10 * MS if len(ticks) < 30 else None

        def wake(self, now: int) -> Iterator[Step]:
            ticks.append(now)
            return iter(())

    run = Run(transport, plan=plan, inject=[(big, 20 * MS)] * 10, local=[Clock("Local")])
    assert len(ticks) == 30 and run.seen == [big] * 10
    notes = [(e.component, e.text, e.time) for e in run.trace.events if e.kind == "note"]
    assert [note[:2] for note in notes] == [("Sink", "fault: stop"), ("Sink", "fault: continue")]
    assert min(e.time for e in run.trace.events if e.kind == "receive") >= 401 * MS > ticks[-1]


def test_a_component_that_raises_is_noted_and_all_others_go_on(transport: ProcessTransport) -> None:
    run = Run(transport, n=20, sink="Picky", inject=[(100, 300 * MS)])
    assert run.deaths == {"Sink": "raised IndexError: six"} and run.seen == [0, 1, 2, 3, 4, 5]
    assert [e.text for e in run.trace.events if e.kind == "note"] == ["died: raised IndexError: six"]
    assert run.of("drop", "given") == [100] and run.seconds < LONG
    assert Run(transport, n=3).seen == [0, 1, 2], "its process lives, and serves the next run"


def test_a_component_that_cannot_be_made_is_noted(transport: ProcessTransport) -> None:
    run = Run(transport, sink="unmade", n=2)
    assert run.deaths == {"Sink": "raised ValueError: no such case"}
    assert Run(transport, n=3).seen == [0, 1, 2]


def test_a_message_that_cannot_be_read_is_dropped_and_says_why(transport: ProcessTransport) -> None:
    plan = "seed: 1; numbers: corrupt length messages 1 to 2; seen: corrupt length messages 0"
    run = Run(transport, n=4, plan=plan)
    drops = [(e.component, e.channel) for e in run.trace.events if e.kind == "drop" and "unreadable" in e.text]
    assert run.deaths == {} and set(drops) <= {("Sink", "numbers"), (ENVIRONMENT, "seen")}
    assert len(run.of("receive")) + len(drops) == len(run.of("send"))


@pytest.mark.parametrize("local", [Restless("Local", ()), Restless("Local", (("back", 1),))])
def test_a_local_component_that_is_always_due_does_not_deafen_the_tester(
    transport: ProcessTransport, local: Component
) -> None:
    run = Run(transport, n=5, local=[local], until=300 * MS)
    assert run.of("receive", "seen") == [0, 1, 2, 3, 4]
    assert run.seconds < LONG


def test_an_endless_conversation_in_the_testers_own_process_ends_with_the_run(transport: ProcessTransport) -> None:
    class Echo(Part):
        def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
            yield Taken("e", (("back", 1),))

        def next_wake(self) -> int | None:
            return None if self.begun else 0

        def wake(self, now: int) -> Iterator[Step]:
            self.begun = True
            yield Taken("e", (("back", 1),))

        begun = False

    run = Run(transport, local=[Echo("Local")], answer=lambda channel, payload, now: (("there", 1),), until=100 * MS)
    assert run.seconds < LONG and len(run.of("receive", "back")) > 10


def test_a_node_that_never_stops_sending_is_brought_to_rest(transport: ProcessTransport) -> None:
    run = Run(transport, restless=True, until=100 * MS, rest=False)
    assert run.seconds < LONG
    for until in range(200, 20_000, 100):
        run.host.run(until * MS)
        if run.seen:
            break
    assert set(run.seen) == {1}, "the receiver of a flood gets to work nevertheless"
    run.host.rest()
    assert run.host.deaths == {}
    assert Run(transport, n=3).seen == [0, 1, 2]


def test_a_node_that_does_not_come_to_rest_is_killed_and_counts_as_dead(here: None) -> None:
    transport = opened()
    run = Run(transport, sink="Hung", inject=[(1, 0)], until=100 * MS)
    assert run.deaths == {"Sink": "hung: it did not come to rest within 5 s"}
    assert [e.text for e in run.trace.events if e.kind == "note"] == [f"died: {run.deaths['Sink']}"]
    with pytest.raises(HostFailure, match=r"Sink: killed by SIGKILL.*node-gone"):
        Run(transport, n=1)
    transport.close()


def test_what_cannot_be_injected_is_refused_by_name(transport: ProcessTransport) -> None:
    host = RealTimeHost(transport, LINKS, Plain("", {}))
    for channel, slug in (("nothing", "unknown-channel"), ("numbers", "foreign-channel")):
        with pytest.raises(BadRequest, match=slug):
            host.inject(channel, 1)
    host.run(S)
    with pytest.raises(BadRequest, match="time-backwards"):
        host.inject("given", 1, 0)


def test_a_closed_host_refuses_to_run_and_keeps_its_trace(here: None) -> None:
    transport = opened()
    run = Run(transport, n=2)
    run.host.close()
    run.host.close()
    assert run.host.trace() == run.trace
    with pytest.raises(HostFailure, match="host-closed"):
        run.host.run(S)


def test_what_an_abandoned_run_left_is_not_heard_by_the_next(transport: ProcessTransport) -> None:
    Run(transport, restless=True, until=50 * MS, rest=False)
    run = Run(transport, n=3)
    assert run.seen == [0, 1, 2] and run.of("send", "numbers") == [0, 1, 2]


def test_the_listener_hears_all_that_stands_in_the_trace_with_payloads(transport: ProcessTransport) -> None:
    heard: list[TraceEvent] = []
    run = Run(transport, n=30, plan="numbers: drop 30 %", listener=heard.append)
    assert sorted(heard, key=lambda event: event.time) == list(run.trace.events) != []
    assert all(event.payload is not None for event in heard if event.channel and event.message >= 0)
    assert run.of("drop") and run.seen

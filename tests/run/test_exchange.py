"""The rules by which hosts run: order of simultaneous events, full queues, losses, failures by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest, HostFailure
from parcours.run.faults import parse_plan
from parcours.run.hosts.battery import Counting, Sink, Source, ToyStep
from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.port import ENVIRONMENT, Link, LinkKind, Send, Step
from parcours.run.trace import durations, transitions
from parcours.verdict.timing import chain


class Scripted:
    """A component that does what its functions say."""

    def __init__(
        self,
        name: str,
        on_message: Callable[[str | None, object, int], Iterator[Step]] = lambda c, m, n: iter(()),
        wakes: tuple[int, ...] = (),
        on_wake: Callable[[int], Iterator[Step]] = lambda n: iter(()),
    ) -> None:
        self.name = name
        self._on_message, self._on_wake, self._all, self._wakes = on_message, on_wake, wakes, list(wakes)

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        return self._on_message(channel, message, now)

    def next_wake(self) -> int | None:
        return self._wakes[0] if self._wakes else None

    def wake(self, now: int) -> Iterator[Step]:
        self._wakes.pop(0)
        return self._on_wake(now)

    def reset(self) -> None:
        self._wakes = list(self._all)


def takes(transition: str, *sends: Send) -> Iterator[Step]:
    yield ToyStep(transition, sends)


def ping_pong(rounds: int) -> tuple[Scripted, Scripted, tuple[Link, Link]]:
    def ping(channel: str | None, message: object, now: int) -> Iterator[Step]:
        assert isinstance(message, int)
        yield ToyStep("p2", (("ball", message + 1),) if message < rounds else ())

    def pong(channel: str | None, message: object, now: int) -> Iterator[Step]:
        yield ToyStep("q1")
        yield ToyStep("q2", (("back", message),))

    return (
        Scripted("Ping", ping, (0,), lambda now: takes("p1", ("ball", 1))),
        Scripted("Pong", pong),
        (
            Link("ball", "Ping", "Pong", 1, LinkKind.SERVICE),
            Link("back", "Pong", "Ping", 1, LinkKind.SERVICE),
        ),
    )


def test_a_transition_is_taken_and_its_messages_leave_when_its_execution_time_is_over() -> None:
    one, two, links = ping_pong(2)
    host = SimulatedHost(
        (one, two),
        links,
        faults=parse_plan("ball: delay 7 ns"),
        execution=lambda c, t: {"q1": 10, "q2": 100}.get(t, 0),
    )
    host.run(10_000)
    story = [(e.time, e.kind, e.transition or e.channel) for e in host.trace().events]
    assert [one for one in story if one[1] != "note"][:7] == [
        (0, "take", "p1"), (0, "send", "ball"), (7, "receive", "ball"), (17, "take", "q1"),
        (117, "take", "q2"), (117, "send", "back"), (117, "receive", "back"),
    ]  # fmt: skip
    assert durations(host.trace(), "q1", "q2") == (100, 100)
    assert host.trace().clock == "simulated"
    rounds = chain("round", host.trace(), ("ball", "back", "ball"))
    assert (rounds.clock, rounds.steps, rounds.rows) == ("simulated", ("Pong", "on back", "Ping"), ((110, 0, 0),))


@given(seed=st.integers(0, 2**32), spread=st.integers(1, 1000))
@settings(max_examples=30, deadline=None)
def test_the_same_seed_gives_the_same_trace_and_reset_repeats_it(seed: int, spread: int) -> None:
    def run() -> SimulatedHost:
        one, two, links = ping_pong(8)
        each = "; ".join(f"{link.channel}: jitter {spread} ns; {link.channel}: drop 5 %" for link in links)
        host = SimulatedHost((one, two), links, faults=parse_plan(f"seed: {seed}; {each}"))
        host.run(10**6)
        return host

    host = run()
    first = host.trace()
    assert run().trace() == first
    host.reset()
    host.run(10**6)
    assert host.trace() == first


def test_stopping_in_between_does_not_change_what_happens() -> None:
    def story(stops: tuple[int, ...]) -> object:
        one, two, links = ping_pong(5)
        host = SimulatedHost((one, two), links, execution=lambda c, t: 3)
        for stop in (*stops, 1000):
            host.run(stop)
        return host.trace()

    assert story(()) == story((0, 1, 5, 6, 7, 30))


def test_a_full_topic_drops_the_oldest_and_a_full_service_holds_the_sender() -> None:
    seen: list[object] = []

    def tester(channel: str, payload: object, now: int) -> tuple[Send, ...]:
        seen.append(payload)
        return ()

    def run(kind: LinkKind) -> list[object]:
        seen.clear()
        links = (Link("numbers", "Source", "Sink", 1, kind), Link("seen", "Sink", ENVIRONMENT, 9))
        slow = {"k1": 35}
        host = SimulatedHost((Source(5, 10), Sink()), links, environment=tester, execution=lambda c, t: slow.get(t, 0))
        host.run(10_000)
        drops = [e for e in host.trace().events if e.kind == "drop"]
        assert len(seen) + len(drops) == 10
        assert all((e.component, e.text) == ("Sink", "overrun") for e in drops)
        return list(seen)

    assert run(LinkKind.SERVICE) == list(range(10))
    newest = run(LinkKind.TOPIC)
    assert newest == [0, 7, 9]  # taken at 0, at 35 and at 70 ns; what was newest then


def test_a_rendezvous_holds_the_sender_until_the_receiver_takes_the_message_up() -> None:
    busy = Scripted("B", lambda c, m, n: takes(f"b{m}"), wakes=(0,), on_wake=lambda n: takes("work"))
    giver = Scripted("A", wakes=(1, 2), on_wake=lambda n: takes(f"a{n}", ("give", n)))
    link = Link("give", "A", "B", 0, LinkKind.RENDEZVOUS)
    host = SimulatedHost((giver, busy), (link,), execution=lambda c, t: 50 if t == "work" else 0)
    host.run(100)
    times = {e.transition: e.time for e in host.trace().events if e.kind == "take"}
    # A wakes at 1 and is held until B is free at 50; its second wake, due at 2, is late.
    assert (times["a1"], times["b1"]) == (1, 50)
    assert times["a50"] == 50


def test_a_message_at_the_very_deadline_comes_before_the_timer() -> None:
    log: list[str] = []
    part = Scripted("A", lambda c, m, n: takes("message"), wakes=(5,), on_wake=lambda n: takes("timer"))
    host = SimulatedHost((part,), (Link("in", ENVIRONMENT, "A"),))
    host.inject("in", 1, at=5)
    host.run(10)
    log.extend(transitions(host.trace()))
    assert log == ["message", "timer"]


def test_simultaneous_wakes_follow_the_order_of_the_components() -> None:
    parts = [Scripted(name, wakes=(3,), on_wake=lambda n, name=name: takes(name)) for name in "CAB"]  # type: ignore[misc]
    for order in (parts, parts[::-1]):
        host = SimulatedHost(order, ())
        host.reset()
        host.run(3)
        assert transitions(host.trace()) == tuple(part.name for part in order)


def test_messages_overtake_only_where_that_is_allowed() -> None:
    def received(reorder: bool) -> list[int]:
        sink = Scripted("S", lambda c, m, n: takes("s"))
        link = Link("n", ENVIRONMENT, "S", 100)
        late = "reorder 50 % by 1 us" if reorder else "jitter 1 us"
        host = SimulatedHost((sink,), (link,), faults=parse_plan(f"seed: 3; n: {late}"))
        for k in range(30):
            host.inject("n", k, at=k)
        host.run(10_000)
        return [e.message for e in host.trace().events if e.kind == "receive"]

    assert received(False) == list(range(30))
    assert received(True) != list(range(30)) and sorted(received(True)) == list(range(30))


def test_a_lost_message_is_recorded_and_never_taken_up() -> None:
    host = SimulatedHost(
        (Counting(),),
        (Link("ask", ENVIRONMENT, "Counting", 50), Link("answer", "Counting", ENVIRONMENT)),
        faults=parse_plan("seed: 1; ask: drop 50 %"),
    )
    for _ in range(40):
        host.inject("ask", None)
    host.run(10)
    events = host.trace().events
    lost = {e.message for e in events if e.kind == "drop"}
    taken = {e.message for e in events if e.kind == "receive" and e.channel == "ask"}
    assert lost and taken and not lost & taken and len(lost | taken) == 40
    assert {e.text for e in events if e.kind == "drop"} == {"fault: lost"}


def test_a_deadlock_ends_the_run_and_is_noted() -> None:
    def two_at_once(to: str) -> Callable[[int], Iterator[Step]]:
        return lambda now: takes("go", (to, 1), (to, 2), (to, 3))

    links = (Link("ab", "A", "B", 1, LinkKind.SERVICE), Link("ba", "B", "A", 1, LinkKind.SERVICE))
    parts = (
        Scripted("A", wakes=(0,), on_wake=two_at_once("ab")),
        Scripted("B", wakes=(0,), on_wake=two_at_once("ba")),
    )
    host = SimulatedHost(parts, links, execution=lambda component, transition: 1)
    host.run(10)
    note = host.trace().events[-1]
    assert (note.kind, note.text) == ("note", "deadlock: A waits to send on ab, B waits to send on ba")


def test_the_tester_may_be_a_component_that_acts_by_itself() -> None:
    tester = Scripted(ENVIRONMENT, wakes=(4, 9), on_wake=lambda n: takes("", ("ask", n)))
    links = (Link("ask", ENVIRONMENT, "Counting"), Link("answer", "Counting", ENVIRONMENT))
    host = SimulatedHost((Counting(),), links, environment=tester)
    host.run(20)
    assert [(e.time, e.transition) for e in host.trace().events if e.kind == "take"] == [(4, "c2"), (9, "c1")]


def boom(now: int) -> Iterator[Step]:
    yield ToyStep("b1")
    raise ValueError("no room")


@pytest.mark.parametrize(
    ("part", "links", "says"),
    [
        (Scripted("A", wakes=(0,), on_wake=boom), (), r"'A'.*ValueError: no room.*b1 \[component-raised\]"),
        (Scripted("A", wakes=(0,), on_wake=lambda n: takes("a", ("x", 1))), (), r"'x'.*\[not-its-channel\]"),
        (
            Scripted("A", wakes=(0,), on_wake=lambda n: takes("a", ("x", 1))),
            (Link("x", "B", "A"),),
            r"component 'A'.*its own.*\[not-its-channel\]",
        ),
        (Scripted("A", wakes=(0,), on_wake=lambda n: iter([3])), (), r"component 'A'.*\[component-raised\]"),  # type: ignore[list-item]
        (Scripted("A", wakes=(0,) * 9000, on_wake=lambda n: takes("a")), (), r"'A'.*\[livelock\]"),
        (Scripted("A", wakes=(0,) * 9000), (), r"component 'A'.*\[livelock\]"),
    ],
)  # fmt: skip
def test_a_component_that_breaks_the_contract_is_named(
    part: Scripted, links: tuple[Link, ...], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("parcours.run.hosts.traffic.LIVELOCK", 2000)
    host = SimulatedHost((part,), links)
    with pytest.raises(HostFailure, match=says):
        host.run(1)


def test_requests_that_make_no_sense_are_refused() -> None:
    links = (Link("ask", ENVIRONMENT, "Counting"), Link("answer", "Counting", ENVIRONMENT))
    host = SimulatedHost((Counting(),), links)
    host.run(100)
    with pytest.raises(BadRequest, match="time-backwards"):
        host.inject("ask", 1, at=99)
    with pytest.raises(BadRequest, match=r"did you mean 'ask'.*\[unknown-channel\]"):
        host.inject("ak", 1)
    with pytest.raises(BadRequest, match="foreign-channel"):
        host.inject("answer", 1)
    with pytest.raises(HostFailure, match="host-names"):
        SimulatedHost((Counting(), Counting()), links)
    host.close()
    with pytest.raises(HostFailure, match="host-closed"):
        host.run(200)

"""Faults on the simulated host: what happens to messages and components there, and that it is the same every time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from parcours.errors import BadRequest, HostFailure
from parcours.run.faults import Effects, FaultPlan, parse_plan
from parcours.run.hosts.battery import Counting, Sink, Source
from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.port import ENVIRONMENT, Link, LinkKind, Step
from parcours.run.trace import Trace, transitions

MS = 1_000_000


class Numbers:
    """The flat form of messages that are one number; negative ones are refused."""

    def flatten(self, channel: str, payload: Any) -> tuple[object, ...]:
        return (float(payload),)

    def restore(self, channel: str, values: tuple[Any, ...]) -> object:
        if values[0] < 0.0:
            raise ValueError("below 0")
        return values[0]


class Picky(Sink):
    """Raises on the number 6."""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        if message == 6:
            raise IndexError("six")
        return super().handle(channel, message, now)


def pipe(
    plan: FaultPlan | str | None,
    *,
    kind: LinkKind = LinkKind.TOPIC,
    capacity: int = 100,
    sink: Callable[[], Sink] = Sink,
    execution: Callable[[str, str], int] | None = None,
    until: int = 100 * MS,
) -> tuple[list[tuple[int, object]], SimulatedHost]:
    """Send 0, 1, ..., two a millisecond, through the sink; return when it passed on what [ns], and the host."""
    seen: list[tuple[int, object]] = []

    def tester(channel: str, payload: object, now: int) -> Sequence[tuple[str, object]]:
        seen.append((now, payload))
        return ()

    host = SimulatedHost(
        (Source(20, MS), sink()),
        (Link("numbers", "Source", "Sink", capacity, kind), Link("seen", "Sink", ENVIRONMENT, 1000)),
        environment=tester,
        execution=execution,
        faults=parse_plan(plan) if isinstance(plan, str) else plan,
        codec=Numbers(),
    )
    host.run(until)
    return seen, host


def told(trace: Trace, kind: str = "note") -> list[tuple[int, str]]:
    return [(event.time, event.text) for event in trace.events if event.kind == kind]


def test_a_plan_without_faults_changes_nothing() -> None:
    plain, empty = pipe(None), pipe(FaultPlan())
    idle = pipe("seen: drop from 50 s; numbers: delay 1 ms messages 900")
    assert plain[1].trace() == empty[1].trace() == idle[1].trace()
    assert plain[0] == empty[0] == idle[0]


def test_messages_meet_the_effect_that_the_plan_foretells() -> None:
    plan = parse_plan("seed: 9\nnumbers: drop 30 %; numbers: delay 40 % by 2 ms; numbers: duplicate 30 % by 7 ms")
    effects = Effects(plan)
    due = []
    latest = 0
    for k in range(40):
        effect = effects.effect("numbers", k, k // 2 * MS)
        if effect.copies:
            latest = max(latest, k // 2 * MS + effect.copies[0])  # in order
            due += [(latest + later - effect.copies[0], k) for later in effect.copies]
    seen, host = pipe(plan)
    assert sorted(seen) == sorted(due)
    lost = [event.payload for event in host.trace().events if event.kind == "drop"]
    assert lost == [k for k in range(40) if not effects.effect("numbers", k, 0).copies]
    assert host.strikes == sum(bool(effects.effect("numbers", k, 0).why) for k in range(40))
    assert {text for _, text in told(host.trace(), "drop")} == {"fault: lost"}


@pytest.mark.parametrize("kind", [LinkKind.TOPIC, LinkKind.SERVICE, LinkKind.RENDEZVOUS])
def test_the_same_plan_gives_the_same_trace_and_reset_repeats_it(kind: LinkKind) -> None:
    text = "seed: 4\nnumbers: drop 20 %; numbers: jitter 3 ms; numbers: duplicate 20 %; numbers: corrupt 20 %\n"
    text += "Sink: freeze at 3 ms for 2 ms; Source: slow down 3 x at 6 ms; Sink: crash at 15 ms"
    _, host = pipe(text, kind=kind, capacity=0 if kind is LinkKind.RENDEZVOUS else 3)
    first = host.trace()
    assert pipe(text, kind=kind, capacity=0 if kind is LinkKind.RENDEZVOUS else 3)[1].trace() == first
    assert [death.component for death in host.deaths] == ["Sink"]
    host.reset()
    assert not host.deaths
    host.run(100 * MS)
    assert host.trace() == first
    assert pipe(text.replace("seed: 4", "seed: 5"), kind=kind, capacity=0 if kind is LinkKind.RENDEZVOUS else 3)[
        1
    ].trace() != first  # fmt: skip


def test_delayed_messages_keep_their_order_and_held_back_ones_are_overtaken() -> None:
    jittered, _ = pipe("numbers: jitter 8 ms")
    assert [payload for _, payload in jittered] == list(range(40))
    assert any(time != payload // 2 * MS for time, payload in jittered)  # type: ignore[operator]
    reordered, _ = pipe("numbers: reorder by 5 ms messages 3")
    order = [payload for _, payload in reordered]
    assert sorted(order) == list(range(40))  # type: ignore[type-var]
    assert order.index(3) > order.index(9)
    assert [n for n in order if n != 3] == [n for n in range(40) if n != 3]


def test_a_corrupt_message_arrives_changed_or_is_refused_by_its_receiver_and_the_trace_says_so() -> None:
    seen, host = pipe("numbers: corrupt scale messages 4; numbers: corrupt sign messages 7")
    assert (seen[4][1], len(seen)) in {(40.0, 39), (400.0, 39), (4000.0, 39)}
    assert 7 not in [payload for _, payload in seen]
    assert [text for _, text in told(host.trace()) if "times" in text]
    assert any("refused by its receiver, ValueError: below 0" in text for _, text in told(host.trace(), "drop"))


def test_a_crashed_component_takes_up_nothing_and_what_is_sent_to_it_is_lost() -> None:
    for kind, capacity in ((LinkKind.TOPIC, 2), (LinkKind.SERVICE, 2), (LinkKind.RENDEZVOUS, 0)):
        seen, host = pipe("Sink: crash at 5 ms", kind=kind, capacity=capacity)
        assert [payload for _, payload in seen] == list(range(10))
        assert (host.deaths[0].time, host.deaths[0].component, host.deaths[0].why) == (5 * MS, "Sink", "crash")
        assert told(host.trace()) == [(5 * MS, "fault: Sink dies, crash")]
        lost = [event.payload for event in host.trace().events if event.text == "fault: Sink has died"]
        assert lost == list(range(10, 40))  # and the source has gone on, whatever the kind of link
        assert len(transitions(host.trace(), "Source")) == 20


def test_a_crash_ends_the_transition_in_progress_and_loses_what_waits() -> None:
    seen, host = pipe("Sink: crash at 5500 us", execution=lambda c, t: MS if t == "k1" else 0)
    assert [payload for _, payload in seen] == [0, 1, 2, 3, 4]
    lost = [event.payload for event in host.trace().events if event.text == "fault: Sink has died"]
    assert lost[:3] == [6, 7, 8]
    assert max(event.time for event in host.trace().events if event.component == "Sink" and event.kind == "take") < (
        5500_000
    )


def test_a_frozen_component_goes_on_with_what_has_queued() -> None:
    seen, host = pipe("Sink: freeze at 5 ms for 4 ms")
    assert [payload for _, payload in seen] == list(range(40))
    assert [time for time, _ in seen] == [n // 2 * MS if n < 10 else max(n // 2, 9) * MS for n in range(40)]
    assert not host.deaths
    assert [text for _, text in told(host.trace())] == [
        "fault: Sink is frozen for 4 ms",
        "fault: Sink goes on as before",
    ]


def test_a_topic_overruns_and_a_service_waits_while_its_receiver_is_frozen() -> None:
    topic, _ = pipe("Sink: freeze at 5 ms for 4 ms", capacity=3)
    assert [payload for _, payload in topic] == [*range(10), 15, 16, 17, *range(18, 40)]
    service, host = pipe("Sink: freeze at 5 ms for 4 ms", kind=LinkKind.SERVICE, capacity=3)
    assert [payload for _, payload in service] == list(range(40))
    assert not told(host.trace(), "drop")


def test_a_transition_in_progress_ends_later_by_as_long_as_its_component_was_frozen() -> None:
    cost = {"k1": 4 * MS}
    seen, _ = pipe("Sink: freeze at 1 ms for 10 ms", execution=lambda c, t: cost.get(t, 0), until=15 * MS)
    assert seen == [(14 * MS, 0)]


def test_a_component_with_a_timer_catches_up_when_it_goes_on() -> None:
    _, host = pipe("Source: freeze at 5500 us for 4 ms")
    bursts = [event.time for event in host.trace().events if event.transition == "s1"]
    assert bursts == [t * MS for t in range(6)] + [9500_000] * 4 + [t * MS for t in range(10, 20)]


def test_a_component_that_is_frozen_for_ever_does_nothing_more() -> None:
    seen, host = pipe("Sink: freeze at 5 ms")
    assert len(seen) == 10
    assert not host.deaths


def test_slowed_down_work_takes_so_many_times_as_long_and_work_without_time_the_cost_that_the_plan_gives() -> None:
    seen, _ = pipe("work: 10 us\nSink: slow down 5 x at 1 ms for 2 ms")
    late = [time - payload // 2 * MS for time, payload in seen]  # type: ignore[operator]
    assert late[:2] == [0, 0]
    assert late[2:6] == [100_000, 200_000] * 2  # two transitions of 50 us each, one message after the other
    assert late[6:] == [0] * 34
    costly, _ = pipe("work: 10 us\nSink: slow down 5 x", execution=lambda c, t: 40_000 if t == "k1" else 0)
    assert costly[0][0] == 5 * 40_000 + 5 * 10_000


def test_under_a_plan_a_component_that_raises_has_died_and_all_others_go_on() -> None:
    seen, host = pipe("seen: delay 1 ms", sink=Picky)
    assert [payload for _, payload in seen] == list(range(6))
    assert [(death.time, death.component, death.why) for death in host.deaths] == [(3 * MS, "Sink", "IndexError: six")]
    assert (3 * MS, "fault: Sink dies, IndexError: six") in told(host.trace())
    assert len(transitions(host.trace(), "Source")) == 20
    with pytest.raises(HostFailure, match="IndexError: six"):
        pipe(None, sink=Picky)


def test_faults_that_the_host_cannot_do_are_refused_before_the_run() -> None:
    with pytest.raises(BadRequest, match="did you mean 'numbers'"):
        pipe("number: drop")
    with pytest.raises(BadRequest, match="did you mean 'Sink'"):
        pipe("sink: crash at 1 s")
    links = (Link("ask", ENVIRONMENT, "Counting"), Link("answer", "Counting", ENVIRONMENT))
    with pytest.raises(BadRequest, match="fault-codec"):
        SimulatedHost((Counting(),), links, faults=parse_plan("ask: corrupt"))


def test_a_message_without_a_flat_form_is_named_when_it_is_to_be_corrupted() -> None:
    class Formless(Numbers):
        def flatten(self, channel: str, payload: Any) -> tuple[object, ...]:
            raise KeyError(channel)

    links = (Link("ask", ENVIRONMENT, "Counting"), Link("answer", "Counting", ENVIRONMENT))
    host = SimulatedHost((Counting(),), links, faults=parse_plan("answer: corrupt"), codec=Formless())
    host.inject("ask", 1)
    with pytest.raises(HostFailure, match=r"channel 'answer': a message must have a flat form"):
        host.run(MS)

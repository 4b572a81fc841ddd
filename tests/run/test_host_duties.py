"""The simulated host against the battery, and the battery against hosts that break each duty."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import pytest

from parcours.errors import HostFailure
from parcours.run.faults import parse_plan
from parcours.run.hosts.battery import DUTIES, Factory, HostUnderTest
from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.hosts.slots import Answer
from parcours.run.port import Component, Link, Step
from parcours.run.trace import Trace, TraceEvent


def simulated(components: Sequence[Component], links: Sequence[Link], environment: Answer) -> HostUnderTest:
    return SimulatedHost(components, links, environment=environment)


def simulated_with_jitter(components: Sequence[Component], links: Sequence[Link], environment: Answer) -> HostUnderTest:
    return SimulatedHost(
        components,
        links,
        environment=environment,
        faults=parse_plan("seed: 11; " + "; ".join(f"{link.channel}: jitter 900 us" for link in links)),
        execution=lambda component, transition: 250_000 * len(component) // len(transition) % 500_000,
    )


@pytest.mark.parametrize("duty", DUTIES)
@pytest.mark.parametrize("make", [simulated, simulated_with_jitter])
def test_a_host_does_its_duty(make: Factory, duty: str) -> None:
    DUTIES[duty](make)


def shuffles(trace: Trace) -> Trace:
    received = [e.message for e in trace.events if e.kind == "receive" and e.channel == "numbers"]
    swapped = dict(zip(received, [received[1], received[0], *received[2:]], strict=True)) if len(received) > 1 else {}
    return replace(
        trace,
        events=tuple(
            replace(e, message=swapped.get(e.message, e.message)) if e.kind == "receive" else e for e in trace.events
        ),
    )


def doubles(trace: Trace) -> Trace:
    return replace(trace, events=tuple(e for event in trace.events for e in [event] * (1 + (event.message == 3))))


def loses(trace: Trace) -> Trace:
    return replace(trace, events=tuple(e for e in trace.events if (e.kind, e.transition) != ("take", "k2")))


def goes_back(trace: Trace) -> Trace:
    *most, last = trace.events or (TraceEvent(0, "note"),)
    return replace(trace, events=(*most, replace(last, time=-1)))


class Tampered:
    """A host whose record, reset or close is spoilt."""

    def __init__(
        self, host: HostUnderTest, spoil: Callable[[Trace], Trace], *, resets: bool = True, closes: bool = True
    ) -> None:
        self._host, self._spoil, self._resets, self._closes, self._closed = host, spoil, resets, closes, False
        self.inject, self.run = host.inject, host.run

    def trace(self) -> Trace:
        return self._spoil(self._host.trace())

    def reset(self) -> None:
        if self._resets:
            self._host.reset()

    def close(self) -> None:
        if self._closed and not self._closes:
            raise RuntimeError("already closed")
        self._closed = True
        self._host.close()


@pytest.mark.parametrize(
    ("duty", "spoil", "resets", "closes"),
    [
        ("keeps_order", shuffles, True, True),
        ("loses_and_doubles_nothing", doubles, True, True),
        ("loses_and_doubles_nothing", loses, True, True),
        ("never_runs_backwards", goes_back, True, True),
        ("resets_without_residue", lambda trace: trace, False, True),
        ("closes_twice", lambda trace: trace, True, False),
    ],
)
def test_the_battery_finds_a_host_that_breaks_its_duty(
    duty: str, spoil: Callable[[Trace], Trace], resets: bool, closes: bool
) -> None:
    def make(components: Sequence[Component], links: Sequence[Link], environment: Answer) -> HostUnderTest:
        return Tampered(simulated(components, links, environment), spoil, resets=resets, closes=closes)

    with pytest.raises(HostFailure, match=r"\[host-duty\]"):
        DUTIES[duty](make)


def test_the_battery_finds_a_component_state_that_outlives_reset() -> None:
    class Forgetful:
        """Resets the host but keeps the components as they are."""

        def __init__(self, components: Sequence[Component], links: Sequence[Link], environment: Answer) -> None:
            self._parts = components, links
            self._environment = environment
            self.reset()

        def inject(self, channel: str, message: object, at: int | None = None) -> None:
            self._host.inject(channel, message, at)

        def run(self, until: int) -> None:
            self._host.run(until)

        def trace(self) -> Trace:
            return self._host.trace()

        def reset(self) -> None:
            self._host = SimulatedHost(*self._parts, environment=self._environment)

        def close(self) -> None:
            self._host.close()

    with pytest.raises(HostFailure, match="reset leaves no residue"):
        DUTIES["resets_without_residue"](Forgetful)


class Sleeper:
    """Takes news up only while it is awake: every 10 us."""

    name = "B"

    def __init__(self) -> None:
        self.heard: list[tuple[int, object]] = []
        self.reset()

    def reset(self) -> None:
        self._wakes, self._asleep = 10_000, True

    @property
    def deaf(self) -> tuple[str, ...]:
        return ("news",) if self._asleep else ()

    def next_wake(self) -> int | None:
        return self._wakes

    def wake(self, now: int) -> Iterator[Step]:
        self._asleep = not self._asleep
        self._wakes = now if not self._asleep else now + 10_000
        yield from ()

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        self.heard.append((now, message))
        yield from ()


def test_what_a_component_is_deaf_to_waits_and_only_the_newest_of_a_topic_is_kept() -> None:
    sleeper = Sleeper()
    links = (Link("news", "environment", "B", 1), Link("call", "environment", "B", 1))
    host = SimulatedHost((sleeper,), links)
    for at, channel, message in ((1_000, "news", "old"), (2_000, "news", "new"), (3_000, "call", "now")):
        host.inject(channel, message, at)
    host.run(15_000)
    assert sleeper.heard == [(3_000, "now"), (10_000, "new")]
    assert [event.text for event in host.trace().events if event.kind == "drop"] == ["overrun"]


def test_messages_take_their_time_and_none_overtakes_another() -> None:
    heard = Sleeper()
    takes = {"call": iter([5_000, 1_000, 0])}
    host = SimulatedHost(
        (heard,), (Link("call", "environment", "B", 8),), transport=lambda channel: next(takes[channel])
    )
    for at, message in ((1_000, "first"), (2_000, "second"), (9_000, "third")):
        host.inject("call", message, at)
    host.run(9_500)
    assert heard.heard == [(6_000, "first"), (6_000, "second"), (9_000, "third")]

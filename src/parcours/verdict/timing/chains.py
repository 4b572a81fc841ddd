"""Reaction times along a chain of channels: how long from a message to its effect, and whose share of it is how long.

Each message on the first channel begins a reaction: the first message that is sent on the next channel after it was
received, and that is received itself, passes it on, until the last channel is sent on. These are the immediate forward
chains of M. Dürr, G. von der Brüggen, K.-H. Chen & J.-J. Chen (End-to-End Timing Analysis of Sporadic Cause-Effect
Chains in Distributed Systems, ACM TECS 18, 2019): a component that works on an earlier message at that time answers
that one first, and the reaction is counted as shorter than it is.

    from ─receive► Filter ─send─ plan ─receive► Follower ─send► to
          |--- Filter ---|--- on plan ---|--- Follower ---|
"""

from __future__ import annotations

import bisect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from parcours.errors import BadRequest
from parcours.run.clocks import ClockName
from parcours.run.trace import REPEAT, Trace, TraceEvent


@dataclass(frozen=True, slots=True)
class Chain:
    """The reactions along a chain of channels.

    Attributes:
        name: of the chain.
        steps: what takes its share: components, and between them `on CHANNEL`, from sending to receipt.
        rows: one reaction each, in order: the shares [ns], as many as there are steps.
        clock: which all times are from.
    """

    name: str
    steps: tuple[str, ...]
    rows: tuple[tuple[int, ...], ...]
    clock: ClockName = "wall"

    @property
    def totals(self) -> tuple[int, ...]:
        """How long each reaction took [ns]."""
        return tuple(map(sum, self.rows))


def chain(name: str, trace: Trace, channels: Sequence[str]) -> Chain:
    """Return the reactions of a run along channels; a message without an effect by the end of its repeat begins none.

    Args:
        name: of the chain.
        trace: of any clock; only times of the wall clock can be judged.
        channels: at least two.

    Raises:
        BadRequest: times of the trace decrease: they are from more than one clock.

    >>> seen = ((0, "receive", "a", 0), (4, "send", "b", 1), (5, "receive", "b", 1), (9, "send", "c", 2))
    >>> events = tuple(TraceEvent(t, kind, "AB"[t > 4], channel=c, message=m) for t, kind, c, m in seen)
    >>> found = chain("stop", Trace("simulated", events), ("a", "b", "c"))
    >>> found.steps, found.rows
    (('A', 'on b', 'B'), ((4, 1, 4),))
    """
    receivers = {event.channel: event.component for event in reversed(trace.events) if event.kind == "receive"}
    steps = [receivers.get(channels[0], "")]
    for channel in channels[1:-1]:
        steps += [f"on {channel}", receivers.get(channel, "")]
    return Chain(name, tuple(steps), tuple(reactions(trace.events, channels, name)), trace.clock)


def reactions(events: Iterable[TraceEvent], channels: Sequence[str], name: str = "") -> Iterator[tuple[int, ...]]:
    """Yield the shares of each reaction [ns]: of components, with the ways between them, alternately.

    Args:
        events: times never decreasing.
        channels: at least two.
        name: of the chain, for messages.

    Raises:
        BadRequest: times decrease: they are from more than one clock.
    """
    part: list[TraceEvent] = []
    last = 0
    for event in events:
        if event.time < last:
            rule = f"times are compared on one clock only, but {event.time} ns follows {last} ns"
            remedy = "stamp all events in one process"
            raise BadRequest(f"timing chain {name!r}", rule, remedy, slug="clock-domains")
        last = event.time
        if event.kind == "note" and event.text == REPEAT:
            yield from _forward(part, channels)
            part = []
        elif event.channel in channels:
            part.append(event)
    yield from _forward(part, channels)


def _forward(events: Sequence[TraceEvent], channels: Sequence[str]) -> Iterator[tuple[int, ...]]:
    """Yield the reactions of one repeat. Places in the order of events decide, since simulated times may be equal."""
    received: dict[tuple[str, int], int] = {}
    for place, event in enumerate(events):
        if event.kind == "receive":
            received.setdefault((event.channel, event.message), place)
    passed: dict[str, list[tuple[int, int]]] = {channel: [] for channel in channels}
    for place, event in enumerate(events):
        if event.kind == "send":
            arrived = received.get((event.channel, event.message), -1)
            if event.channel == channels[-1]:
                passed[event.channel].append((place, place))
            elif arrived >= 0:  # what was lost had no effect
                passed[event.channel].append((place, arrived))
    begins = [place for (channel, _), place in received.items() if channel == channels[0]]
    for begin in begins:
        here, row = begin, list[int]()
        for channel in channels[1:]:
            way = passed[channel]
            k = bisect.bisect(way, (here, len(events)))
            if k == len(way):
                break
            sent, arrived = way[k]
            row += [events[sent].time - events[here].time, events[arrived].time - events[sent].time]
            here = arrived
        else:
            yield tuple(row[:-1])  # the last message is over when it is sent

"""Messages that components send -> events in order of time, the trace of them, and what waits at the receivers.

The part of an exchange that is about links: room on them, passages, faults, arrival. Its components' work is the other.
"""

from __future__ import annotations

import heapq
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

from parcours.errors import HostFailure
from parcours.run.clocks import Clock
from parcours.run.hosts.passage import Passage, Streams
from parcours.run.hosts.seats import Lane, Message, Seat
from parcours.run.hosts.striking import Striker
from parcours.run.port import ENVIRONMENT, LinkKind
from parcours.run.trace import Kind, TraceEvent

STRIKE, END, ARRIVE, WAKE = range(-1, 3)
"""What happens first of what happens at the same time."""

LIVELOCK = 100_000
"""So many events at one instant of simulated time are taken for an endless loop."""


class Traffic(ABC):
    """Messages under way. `Exchange` makes it, and works off what arrives."""

    _clock: Clock
    _seats: dict[str, Seat]
    _environment: Seat
    _lanes: dict[str, Lane]
    _passages: Mapping[str, Passage]
    _streams: Streams
    _striker: Striker | None
    _recording: bool

    def _clear(self) -> None:
        self._heap: list[tuple[int, int, int, int, Callable[[], None]]] = []
        self._events: list[TraceEvent] = []
        self._caused = self._sent = self._instant = self._at_instant = 0
        self._acting = ""

    @abstractmethod
    def _work(self, seat: Seat, *, rung: bool = False) -> None:
        """Let a component go on until it waits for time, for room, or for something to do."""

    def _watch(self, now: int) -> None:
        self._at_instant = self._at_instant + 1 if now == self._instant else 0
        self._instant = now
        self._count(self._at_instant, self._acting)

    def _count(self, turns: int, name: str) -> None:
        """Raise HostFailure if a component took so many turns at one instant that they will never end."""
        if turns <= LIVELOCK:
            return
        rule = f"time must pass, but {LIVELOCK} events followed one another at {self._clock.now()} ns"
        remedy = "let next_wake advance after wake, or give its work a duration"
        raise HostFailure(f"component {name!r}", rule, remedy, slug="livelock")

    def _push(self, time: int, rank: int, order: int, act: Callable[[], None]) -> None:
        self._caused += 1
        heapq.heappush(self._heap, (time, rank, order, self._caused, act))

    def _record(self, kind: Kind, seat: Seat | None = None, message: Message | None = None,
                transition: str = "", text: str = "") -> None:  # fmt: skip
        if not self._recording:
            return
        channel, number, payload = (message.channel, message.number, message.payload) if message else ("", -1, None)
        name = seat.name if seat else ENVIRONMENT if message else ""
        self._events.append(TraceEvent(self._clock.now(), kind, name, transition, channel, number, text, payload))

    def _drain(self, seat: Seat) -> None:
        while seat.outbox and not seat.waits:
            channel, payload = seat.outbox.popleft()
            lane = self._lanes.get(channel)
            if lane is None or not (lane.link.sender == seat.name or self._stands_in(seat, lane)):
                rule = f"sends only on channels that are its own, but used {channel!r}"
                own = ", ".join(c for c, other in self._lanes.items() if other.link.sender == seat.name)
                raise HostFailure(f"component {seat.name!r}", rule, f"its channels: {own}", slug="not-its-channel")
            self._send(seat, lane, payload)

    def _stands_in(self, seat: Seat, lane: Lane) -> bool:
        return seat is self._environment and lane.link.sender not in self._seats

    def _send(self, seat: Seat | None, lane: Lane, payload: object) -> None:
        message = Message(lane.link.channel, self._sent, payload, seat)
        self._sent += 1
        self._record("send", seat, message)
        waits = lane.link.kind is not LinkKind.TOPIC and lane.link.receiver in self._seats
        if waits and lane.open >= max(lane.link.capacity, 1):
            lane.parked.append(message)
            if seat is not None:
                seat.waits = lane.link.channel
        else:
            self._dispatch(lane, message)

    def _dispatch(self, lane: Lane, message: Message) -> None:
        channel = lane.link.channel
        passage, delay = self._passages.get(channel), 0
        if passage is not None:
            rng = self._streams[f"channel {channel}"]
            # Both numbers are drawn for every message: a changed drop rate does not shift the latencies.
            lost = rng.random() < passage.drop
            delay = not_negative(passage.latency(rng), f"latency of {channel}")
            if lost:
                self._record("drop", message.sender, message, text="lost")
                return
        copies: tuple[int, ...] = (0,)
        overtaken = passage is not None and passage.reorder
        if self._striker is not None:
            fate = self._striker.meet(message)
            copies, overtaken = fate.copies, overtaken or fate.reorder
            if not copies:
                return
        if lane.link.kind is LinkKind.RENDEZVOUS and message.sender is not None and self._receiver(lane) is not None:
            message.sender.waits = channel
        arrival = self._clock.now() + delay + copies[0]
        if not overtaken:
            lane.last_arrival = arrival = max(arrival, lane.last_arrival)
        for later in copies:
            lane.open += 1
            self._push(arrival + later - copies[0], ARRIVE, lane.index, lambda one=message: self._arrive(lane, one))  # type: ignore[misc]
            message = Message(channel, message.number, message.payload)  # a further copy keeps no sender waiting

    def _receiver(self, lane: Lane) -> Seat | None:
        return self._seats.get(lane.link.receiver)

    def _arrive(self, lane: Lane, message: Message) -> None:
        seat = self._receiver(lane) or self._environment
        waiting = [other for other in seat.inbox if other.channel == message.channel] if seat.inbox else []
        if lane.link.kind is LinkKind.TOPIC and seat is not self._environment and len(waiting) >= lane.link.capacity:
            seat.inbox.remove(waiting[0])
            lane.open -= 1
            self._record("drop", seat, waiting[0], text="overrun")
        if seat.dead:
            self.discard(seat, message, f"fault: {seat.name} has died")
            return
        message.arrived = self._clock.now()
        seat.inbox.append(message)
        self._work(seat)

    def _make_room(self, message: Message) -> None:
        lane = self._lanes[message.channel]
        lane.open -= 1
        if lane.link.kind is LinkKind.RENDEZVOUS:
            self._resume(message.sender)
        if lane.parked:
            parked = lane.parked.popleft()
            self._dispatch(lane, parked)
            if lane.link.kind is not LinkKind.RENDEZVOUS:
                self._resume(parked.sender)

    def _resume(self, seat: Seat | None) -> None:
        if seat is not None and seat.waits:
            seat.waits = ""
            self._push(self._clock.now(), END, seat.index, lambda: self._flush(seat))

    def _flush(self, seat: Seat) -> None:
        if not seat.is_out:
            self._drain(seat)
            self._work(seat)

    def discard(self, seat: Seat, message: Message, text: str) -> None:
        """Record that a message to the seat is lost, and give its place on the link free."""
        self._record("drop", seat, message, text=text)
        self._make_room(message)

    def write(self, kind: Kind, seat: Seat | None = None, message: Message | None = None, text: str = "") -> None:
        """Write into the trace."""
        self._record(kind, seat, message, text=text)


def not_negative(time: int, what: str) -> int:
    """Return the time [ns]. Raises HostFailure if it is below 0."""
    if time < 0:
        raise HostFailure(what, f"time never runs backwards, but {time} ns was drawn", slug="time-backwards")
    return time

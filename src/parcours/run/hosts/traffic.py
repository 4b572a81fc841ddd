"""The part of the simulated host that is about links: room on them, delays, faults, arrival, and the trace."""

from __future__ import annotations

import heapq
from abc import ABC, abstractmethod
from collections.abc import Callable

from parcours.errors import HostFailure
from parcours.run.clocks import SimulatedClock
from parcours.run.faults import UNTOUCHED
from parcours.run.hosts.component_faults import Striker
from parcours.run.hosts.slots import Message, Queue, Slot
from parcours.run.port import ENVIRONMENT, LinkKind
from parcours.run.trace import Kind, TraceEvent

STRIKE, END, ARRIVE, WAKE = range(-1, 3)
"""What happens first of what happens at the same time."""

LIVELOCK = 100_000
"""More events at one instant of simulated time are taken for an endless loop."""


class Traffic(ABC):
    """Messages under way; `SimulatedHost` works off what arrives."""

    _clock: SimulatedClock
    _slots: dict[str, Slot]
    _environment: Slot
    _queues: dict[str, Queue]
    _striker: Striker | None
    _transport: Callable[[str], int] | None
    _recording: bool

    def _clear(self) -> None:
        self._heap: list[tuple[int, int, int, int, Callable[[], None]]] = []
        self._events: list[TraceEvent] = []
        self._caused = self._sent = self._instant = self._at_instant = 0
        self._acting = ""

    @abstractmethod
    def _work(self, slot: Slot, *, rung: bool = False) -> None:
        """Let a component go on until it waits for time, for room, or for something to do."""

    def _watch(self, now: int) -> None:
        self._at_instant = self._at_instant + 1 if now == self._instant else 0
        self._instant = now
        self._count(self._at_instant, self._acting)

    def _count(self, turns: int, name: str) -> None:
        """Raise HostFailure if a component takes turns at one instant without end."""
        if turns <= LIVELOCK:
            return
        rule = f"time must pass, but {LIVELOCK} events followed one another at {self._clock.now()} ns"
        remedy = "let next_wake advance after wake, or give its work a duration"
        raise HostFailure(f"component {name!r}", rule, remedy, slug="livelock")

    def _push(self, time: int, rank: int, order: int, act: Callable[[], None]) -> None:
        self._caused += 1
        heapq.heappush(self._heap, (time, rank, order, self._caused, act))

    def _record(self, kind: Kind, slot: Slot | None = None, message: Message | None = None,
                transition: str = "", text: str = "", payload: object = None) -> None:  # fmt: skip
        if not self._recording:
            return
        channel, number = (message.channel, message.number) if message else ("", -1)
        payload = message.payload if message else payload
        name = slot.name if slot else ENVIRONMENT if message else ""
        self._events.append(TraceEvent(self._clock.now(), kind, name, transition, channel, number, text, payload))

    def _drain(self, slot: Slot) -> None:
        while slot.outbox and not slot.waits:
            channel, payload = slot.outbox.popleft()
            queue = self._queues.get(channel)
            if queue is None or not (queue.link.sender == slot.name or self._stands_in(slot, queue)):
                rule = f"sends only on channels that are its own, but used {channel!r}"
                own = ", ".join(c for c, other in self._queues.items() if other.link.sender == slot.name)
                raise HostFailure(f"component {slot.name!r}", rule, f"its channels: {own}", slug="not-its-channel")
            self._send(slot, queue, payload)

    def _stands_in(self, slot: Slot, queue: Queue) -> bool:
        return slot is self._environment and queue.link.sender not in self._slots

    def _send(self, slot: Slot | None, queue: Queue, payload: object) -> None:
        message = Message(queue.link.channel, self._sent, payload, slot)
        self._sent += 1
        self._record("send", slot, message)
        waits = queue.link.kind is not LinkKind.TOPIC and queue.link.receiver in self._slots
        if waits and queue.open >= max(queue.link.capacity, 1):
            queue.parked.append(message)
            if slot is not None:
                slot.waits = queue.link.channel
        else:
            self._dispatch(queue, message)

    def _dispatch(self, queue: Queue, message: Message) -> None:
        effect = UNTOUCHED if self._striker is None else self._striker.meet(message)
        if not effect.copies:
            return
        if queue.link.kind is LinkKind.RENDEZVOUS and message.sender is not None and queue.link.receiver in self._slots:
            message.sender.waits = message.channel
        arrival = self._clock.now() + effect.copies[0]
        if self._transport is not None:
            arrival += self._transport(message.channel)
        if not effect.reorder:
            queue.last_arrival = arrival = max(arrival, queue.last_arrival)
        for later in effect.copies:
            queue.open += 1
            when = arrival + later - effect.copies[0]
            self._push(when, ARRIVE, queue.index, lambda one=message: self._arrive(queue, one))  # type: ignore[misc]
            # A further copy keeps no sender waiting: it has none.
            message = Message(message.channel, message.number, message.payload)

    def _arrive(self, queue: Queue, message: Message) -> None:
        slot = self._slots.get(queue.link.receiver, self._environment)
        waiting = [other for other in slot.inbox if other.channel == message.channel] if slot.inbox else []
        if queue.link.kind is LinkKind.TOPIC and slot is not self._environment and len(waiting) >= queue.link.capacity:
            slot.inbox.remove(waiting[0])
            queue.open -= 1
            self._record("drop", slot, waiting[0], text="overrun")
        if slot.dead:
            self.discard(slot, message, f"fault: {slot.name} has died")
            return
        message.arrived = self._clock.now()
        slot.inbox.append(message)
        self._work(slot)

    def _make_room(self, message: Message) -> None:
        queue = self._queues[message.channel]
        queue.open -= 1
        if queue.link.kind is LinkKind.RENDEZVOUS:
            self._resume(message.sender)
        if queue.parked:
            parked = queue.parked.popleft()
            self._dispatch(queue, parked)
            if queue.link.kind is not LinkKind.RENDEZVOUS:
                self._resume(parked.sender)

    def _resume(self, slot: Slot | None) -> None:
        if slot is not None and slot.waits:
            slot.waits = ""
            self._push(self._clock.now(), END, slot.index, lambda: self._flush(slot))

    def _flush(self, slot: Slot) -> None:
        if not slot.is_out:
            self._drain(slot)
            self._work(slot)

    def discard(self, slot: Slot, message: Message, text: str) -> None:
        """Record that a message to the slot is lost, and give its place on the link free."""
        self._record("drop", slot, message, text=text)
        self._make_room(message)

    def write(self, kind: Kind, slot: Slot | None = None, message: Message | None = None, text: str = "") -> None:
        """Write into the trace."""
        self._record(kind, slot, message, text=text)

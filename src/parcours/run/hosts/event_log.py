"""Collects what a live run's nodes and tester report as the events of its trace, with decoded payloads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from parcours.errors import BadRequest
from parcours.run.hosts.frames import Wire
from parcours.run.hosts.node_program import Codec
from parcours.run.trace import Kind, TraceEvent


class EventLog:
    """The events of one run."""

    def __init__(self, codec: Codec, listener: Callable[[TraceEvent], None] | None) -> None:
        self._codec, self._listener = codec, listener
        self._events: list[TraceEvent] = []
        self._payloads: dict[int, object] = {}

    def record(self, kind: Kind, when: int, *, component: str = "", wire: Wire | None = None, number: int = -1,
               transition: str = "", text: str = "") -> None:  # fmt: skip
        """Write an event down; `when` is its time [ns], `number` that of the message in `wire`."""
        channel = wire.channel if wire else ""
        event = TraceEvent(when, kind, component, transition, channel, number, text, wire)
        self._events.append(event)
        if self._listener is not None:
            self._listener(self._opened(event))

    def events(self) -> tuple[TraceEvent, ...]:
        """Return the events in order of time, payloads opened."""
        return tuple(sorted(map(self._opened, self._events), key=lambda event: event.time))

    def _opened(self, event: TraceEvent) -> TraceEvent:
        if not isinstance(event.payload, Wire):
            return event
        return replace(event, payload=self._payload(event.payload))

    def _payload(self, wire: Wire) -> object:
        """Return what was sent; events of one message share it."""
        if id(wire) not in self._payloads:
            try:
                payload = self._codec.decode(wire.channel, wire.data)
            except BadRequest:
                payload = None  # corrupted on purpose: no message any more
            self._payloads[id(wire)] = payload
        return self._payloads[id(wire)]

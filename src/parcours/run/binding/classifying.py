"""Tells from observed messages what the model's messages are, and which transitions were taken.

A transition for which the binding names an event is seen by that event. Of the others, one that sends is seen by the
first message it sends, one that only receives by the delivery of what it receives, and one that does neither is not
seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from parcours.model.structure import Transition
from parcours.run.binding.compiling import Compiled
from parcours.run.binding.structure import Event

Side = Literal["sent", "delivered"]
"""Whether a message was heard from its sender, or handed to its receiver."""


@dataclass(frozen=True, slots=True)
class Observed:
    """What one message says.

    Args:
        channel: where it was observed.
        side: heard from its sender, or handed to its receiver.
        values: the fields of the model's message that the binding maps, in its order.
        options: for each machine that took a step, the transitions that explain the message, in the order of the model;
            which of several it was, only the state of the machine can tell.
    """

    channel: str
    side: Side
    values: tuple[tuple[str, object], ...]
    options: tuple[tuple[str, ...], ...]

    @property
    def taken(self) -> tuple[str, ...]:
        """The transitions that were certainly taken."""
        return tuple(option[0] for option in self.options if len(option) == 1)


class Classifier:
    """Tells what observed messages mean; it remembers the last message of each channel."""

    def __init__(self, compiled: Compiled) -> None:
        self.compiled = compiled
        self._last: dict[str, object] = {}
        self._held: dict[str, bool] = {}
        events = {event.transition: event for event in compiled.binding.events}
        self._seen: dict[tuple[str, Side], list[list[tuple[str, Event | None]]]] = {}
        for component in compiled.binding.model.components:
            for machine in component.machines:
                self._take_up(machine.transitions, events)

    def _take_up(self, transitions: tuple[Transition, ...], events: Mapping[str, Event]) -> None:
        here: dict[tuple[str, Side], list[tuple[str, Event | None]]] = {}
        for transition in transitions:
            event = events.get(transition.id)
            if event is not None:
                here.setdefault((event.on, self._side(event, transition)), []).append((transition.id, event))
            elif transition.sends:
                here.setdefault((transition.sends[0].channel, "sent"), []).append((transition.id, None))
            elif transition.event is not None:
                here.setdefault((transition.event.channel, "delivered"), []).append((transition.id, None))
        for key, found in here.items():
            self._seen.setdefault(key, []).append(found)

    def _side(self, event: Event, transition: Transition) -> Side:
        binding = self.compiled.binding
        sender = next((one.sender for one in binding.model.channels if one.name == event.on), None)
        is_ours = sender is not None and binding.process_of(sender) is None
        receives = transition.event is not None and transition.event.channel == event.on
        return "delivered" if is_ours or receives else "sent"

    def reset(self) -> None:
        """Forget everything observed: a new case begins."""
        self._last.clear()
        self._held.clear()

    def observe(self, channel: str, message: object, side: Side = "sent") -> Observed:
        """Return what a message says.

        An event counts when its message is handed over, if its transition receives it or the tester makes it, and else
        when it is heard from its sender; and if its condition holds over this message and the last of every other
        channel. A condition over a channel that has had no message yet does not hold.

        Args:
            channel: a channel of the binding.
            message: an object of the channel's type.
            side: heard from its sender, or handed to its receiver.

        Raises:
            HostFailure: the message has too few items for a place of the binding.
            BadModel: a formula cannot be computed, as when it divides by zero.
        """
        self._last[channel] = message
        own = {channel: message}
        values = tuple((name, reading.value(own)) for name, reading in self.compiled.fields.get(channel, {}).items())
        options = []
        for machine in self._seen.get((channel, side), ()):
            option = tuple(id for id, event in machine if event is None or self._happens(event))
            if option:
                options.append(option)
        return Observed(channel, side, values, tuple(options))

    def inputs(self) -> dict[str, object]:
        """Return the value of each input variable of the model that the last messages tell."""
        readings = self.compiled.inputs.items()
        return {name: reading.value(self._last) for name, reading in readings if reading.channels <= self._last.keys()}

    def _happens(self, event: Event) -> bool:
        reading = self.compiled.conditions.get(event.transition)
        holds = reading is None or (reading.channels <= self._last.keys() and reading.value(self._last) is True)
        before = self._held.get(event.transition, False)
        self._held[event.transition] = holds
        return holds and not (before and event.edge == "rise")

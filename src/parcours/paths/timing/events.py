"""The events of a sequence of transitions: who moves, and which send each receive takes."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from parcours.errors import BadRequest, one_of
from parcours.model.structure import ENVIRONMENT, Cefsm, Component, Machine, Transition

Place = tuple[int, str, str]
"""One running machine: the instance of its component, the component and the machine."""


@dataclass(frozen=True, slots=True)
class TimedEvent:
    """A transition taken.

    Attributes:
        number: its position in the sequence, from 1; 0 is the start.
        instance: which copy of its component moves.
        component: the component's name.
        machine: the machine's name.
        transition: what it does.
        send: the number of the event whose message it takes; 0 if the tester supplies it, or it takes none.
        meets: whether it happens at the same time as that event: a rendezvous.
    """

    number: int
    instance: int
    component: str
    machine: str
    transition: Transition
    send: int = 0
    meets: bool = False

    @property
    def place(self) -> Place:
        """The running machine that moves."""
        return self.instance, self.component, self.machine

    def __str__(self) -> str:
        return f"{self.transition.id!r} (step {self.number})"


def events_of(
    cefsm: Cefsm, transition_ids: Sequence[str], instances: Sequence[int] = (), sends: Sequence[int | None] = ()
) -> tuple[TimedEvent, ...]:
    """Return the events of a sequence over one machine or several, each from its initial state on.

    Args:
        transition_ids: what is taken, in order. A rendezvous is its send followed by its receive.
        instances: for each transition which copy of its component takes it; empty if there is one of each.
        sends: for each transition the position, from 0, of the one whose message it takes, or None if the
            tester supplies it; empty for first in, first out on every channel inside the model.

    Raises BadRequest: an id is unknown, a machine would go on from a state where it does not stand, or a receive
    would take a message that was not sent before.
    """
    owners = _owners(cefsm)
    channels = {channel.name: channel for channel in cefsm.channels}
    inner = {name for name, each in channels.items() if ENVIRONMENT not in (each.sender, each.receiver)}
    stands: dict[Place, str] = {}
    waiting: dict[str, deque[int]] = {}
    found: list[TimedEvent] = []
    for position, id in enumerate(transition_ids):
        if id not in owners:
            rule = f"must name transitions of {cefsm.name!r}, but {id!r} is not one"
            raise BadRequest(f"sequence, entry {position}", rule, one_of(id, list(owners)), slug="foreign-transition")
        component, machine, transition = owners[id]
        place = (instances[position] if instances else 0, component.name, machine.name)
        state = stands.get(place, machine.initial)
        if transition.source != state:
            rule = f"{id!r} starts in {transition.source!r}, but {machine.name!r} stands in {state!r}"
            remedy = "name every transition on the way, from the initial state on"
            raise BadRequest(f"sequence, entry {position}", rule, remedy, slug="broken-sequence")
        stands[place] = transition.target
        channel = transition.event.channel if transition.event is not None else ""
        send = 0
        if channel and sends:
            send = _said(sends, position, channel, found)
        elif channel in inner and waiting.get(channel):
            send = waiting[channel].popleft()
        meets = bool(send) and channels[channel].capacity == 0
        found.append(TimedEvent(position + 1, place[0], component.name, machine.name, transition, send, meets))
        for sent in transition.sends:
            waiting.setdefault(sent.channel, deque()).append(position + 1)
    return tuple(found)


def places_of(cefsm: Cefsm, events: Sequence[TimedEvent]) -> list[Place]:
    """Return the machines of all components that take part: also those that stand still, for time passes there too."""
    return [
        (instance, component, machine.name)
        for instance, component in dict.fromkeys((event.instance, event.component) for event in events)
        for machine in cefsm.component(component).machines
    ]


def taken_messages(events: Sequence[TimedEvent]) -> set[tuple[int, str]]:
    """Return the messages that some event takes from another, as (number of the sending event, channel)."""
    return {(each.send, each.transition.event.channel) for each in events if each.send and each.transition.event}


def _owners(cefsm: Cefsm) -> dict[str, tuple[Component, Machine, Transition]]:
    return {
        transition.id: (component, machine, transition)
        for component in cefsm.components
        for machine in component.machines
        for transition in machine.transitions
    }


def _said(sends: Sequence[int | None], position: int, channel: str, found: Sequence[TimedEvent]) -> int:
    send = sends[position]
    if send is None:
        return 0
    if not 0 <= send < len(found) or channel not in {each.channel for each in found[send].transition.sends}:
        rule = f"takes the message of entry {send}, but that one comes later or does not send on {channel!r}"
        raise BadRequest(f"sequence, entry {position}", rule, "correct `sends`", slug="broken-sequence")
    return send + 1

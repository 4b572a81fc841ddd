"""A model and its internal paths -> who can meet whom on which channel (rendezvous; paper, section IV-B).

A rendezvous pair is a transition that sends on a channel and one that receives from it. Two paths meet
where they hold such a pair between them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from parcours.abtc.interactions import component_graph
from parcours.model.structure import Cefsm, Channel, Transition
from parcours.paths.internal import InternalPath


@dataclass(frozen=True, slots=True)
class Rendezvous:
    """A send and the receive it can meet, by transition id; `receive` is None where nobody receives."""

    channel: str
    send: str
    receive: str | None

    def __str__(self) -> str:
        return f"{self.send} -> {self.receive or '(nobody)'} on {self.channel}"


@dataclass(frozen=True, slots=True)
class Meeting:
    """Two internal paths that meet on a channel.

    A `stand_in` is a receiver without a receive transition: the model has none for the channel, and this
    path is the one of the receiving component that talks with the sender on other channels.
    """

    channel: str
    sender: InternalPath
    receiver: InternalPath
    stand_in: bool = False


def sends_on(transition: Transition, channel: str) -> bool:
    """Return whether the transition sends a message on the channel."""
    return any(send.channel == channel for send in transition.sends)


def receives_from(transition: Transition, channel: str) -> bool:
    """Return whether the transition is triggered by a message on the channel."""
    return transition.event is not None and transition.event.channel == channel


def rendezvous_pairs(cefsm: Cefsm) -> tuple[Rendezvous, ...]:
    """Return all rendezvous pairs between components, by channel in file order, sends without partner too.

    >>> from parcours.model.structure import Component, Machine, Receive, Send
    >>> client = Machine("m", "s", ("s",), (Transition("a1", "s", "s", sends=(Send("ask"),)),))
    >>> server = Machine("m", "s", ("s",), (Transition("b1", "s", "s", event=Receive("ask")),))
    >>> ask = Channel("ask", "A", "B", "Text")
    >>> shop = Cefsm("shop", (Component("A", (client,)), Component("B", (server,))), (ask,))
    >>> [str(pair) for pair in rendezvous_pairs(shop)]
    ['a1 -> b1 on ask']
    """
    found: list[Rendezvous] = []
    for channel in _inner_channels(cefsm):
        receivers: list[str | None] = [
            t.id for t in _transitions(cefsm, channel.receiver) if receives_from(t, channel.name)
        ]
        for transition in _transitions(cefsm, channel.sender):
            if sends_on(transition, channel.name):
                found += [Rendezvous(channel.name, transition.id, receive) for receive in receivers or [None]]
    return tuple(found)


def meetings(cefsm: Cefsm, paths: Mapping[str, Sequence[InternalPath]]) -> tuple[Meeting, ...]:
    """Return every meeting of two internal paths, by channel in file order, stand-ins last.

    Args:
        cefsm: the model.
        paths: for each component its internal paths, as `parcours.paths.internal_paths` returns them.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> from parcours.paths import internal_paths
    >>> found = meetings(ramp, internal_paths(ramp))
    >>> [(m.sender.name, m.receiver.name) for m in found if m.stand_in]
    [('tp51', 'tp11'), ('tp42', 'tp11')]
    """
    found: list[Meeting] = []
    for channel in _inner_channels(cefsm):
        for sender in _senders(paths, channel):
            for receiver in paths.get(channel.receiver, ()):
                if any(receives_from(transition, channel.name) for transition in receiver.transitions):
                    found.append(Meeting(channel.name, sender, receiver))
    stand_ins: list[Meeting] = []
    for channel in _inner_channels(cefsm):
        if not any(receives_from(t, channel.name) for t in _transitions(cefsm, channel.receiver)):
            for receiver in _acquainted(found, channel):
                stand_ins += [Meeting(channel.name, sender, receiver, True) for sender in _senders(paths, channel)]
    return tuple(found + stand_ins)


def _acquainted(found: Sequence[Meeting], channel: Channel) -> list[InternalPath]:
    """Return the paths of the channel's receiver that meet its sender, either way, on some other channel."""
    ends = {channel.sender, channel.receiver}
    pairs = [(m.sender, m.receiver) for m in found if {m.sender.component, m.receiver.component} == ends]
    known = {path.name: path for pair in pairs for path in pair if path.component == channel.receiver}
    return list(known.values())


def _senders(paths: Mapping[str, Sequence[InternalPath]], channel: Channel) -> list[InternalPath]:
    return [p for p in paths.get(channel.sender, ()) if any(sends_on(t, channel.name) for t in p.transitions)]


def _inner_channels(cefsm: Cefsm) -> Iterator[Channel]:
    """Yield the channels between two components; the component graph holds them edge by edge."""
    inner = {channel.name for channels in component_graph(cefsm).values() for channel in channels}
    return (channel for channel in cefsm.channels if channel.name in inner)


def _transitions(cefsm: Cefsm, component: str) -> list[Transition]:
    return list(cefsm.component(component).transitions())

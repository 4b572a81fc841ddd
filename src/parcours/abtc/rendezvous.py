"""Who can meet whom on which channel: pairs of a send and a receive, and paths that hold such a pair (section IV-B)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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


def rendezvous_pairs(cefsm: Cefsm) -> tuple[Rendezvous, ...]:
    """Return all rendezvous pairs between components, by channel in file order, sends without partner too."""
    return tuple(
        Rendezvous(channel.name, transition.id, receive)
        for channel in _inner_channels(cefsm)
        for transition in cefsm.component(channel.sender).transitions()
        if sends_on(transition, channel.name)
        for receive in _receiving(cefsm.component(channel.receiver).transitions(), channel) or [None]
    )


def meetings(cefsm: Cefsm, paths: Mapping[str, Sequence[InternalPath]]) -> tuple[Meeting, ...]:
    """Return every meeting of two of the components' internal paths, by channel in file order, stand-ins last."""
    channels = _inner_channels(cefsm)
    found = [
        Meeting(channel.name, sender, receiver)
        for channel in channels
        for sender in _senders(paths, channel)
        for receiver in paths.get(channel.receiver, ())
        if _receiving(receiver.transitions, channel)
    ]
    stand_ins = [
        Meeting(channel.name, sender, receiver, True)
        for channel in channels
        if not _receiving(cefsm.component(channel.receiver).transitions(), channel)
        for receiver in _acquainted(found, channel)
        for sender in _senders(paths, channel)
    ]
    return tuple(found + stand_ins)


def _acquainted(found: Sequence[Meeting], channel: Channel) -> list[InternalPath]:
    # The paths of the channel's receiver that meet its sender, either way, on some other channel.
    ends = {channel.sender, channel.receiver}
    pairs = [(m.sender, m.receiver) for m in found if {m.sender.component, m.receiver.component} == ends]
    return list({path.name: path for pair in pairs for path in pair if path.component == channel.receiver}.values())


def _senders(paths: Mapping[str, Sequence[InternalPath]], channel: Channel) -> list[InternalPath]:
    return [p for p in paths.get(channel.sender, ()) if any(sends_on(t, channel.name) for t in p.transitions)]


def _receiving(transitions: Iterable[Transition], channel: Channel) -> list[str | None]:
    return [each.id for each in transitions if each.event is not None and each.event.channel == channel.name]


def _inner_channels(cefsm: Cefsm) -> list[Channel]:
    inner = {channel.name for channels in component_graph(cefsm).values() for channel in channels}
    return [channel for channel in cefsm.channels if channel.name in inner]

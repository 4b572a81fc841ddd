"""What the components of a model can say to each other, and the messages delivered along a run.

A message is delivered when a transition receives it; on a channel to the environment, or one that nobody reads, when it
is sent. A rendezvous is a transition that sends, with the one that receives what it sent: of a queue, the oldest
message waiting (Taylor, Levine & Kelly, Structural testing of concurrent programs, IEEE TSE 18, 1992).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

from parcours.model.structure import ENVIRONMENT, Cefsm, Channel
from parcours.paths.criteria.requirement import CoverageRequirement, RequirementCounter, RequirementLimits

NOBODY = ""
"""The partner of a transition in a delivery from or to the environment."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """Who sends and receives on each channel that is used, as (machine, transition) in file order.

    Attributes:
        channels: by name.
        senders, receivers: for each channel's name.
        receives: the channel that a transition receives from, if any.
        sends: the channels that a transition sends on.
    """

    channels: dict[str, Channel]
    senders: dict[str, list[tuple[str, str]]]
    receivers: dict[str, list[tuple[str, str]]]
    receives: dict[str, str]
    sends: dict[str, tuple[str, ...]]

    def is_read(self, channel: str) -> bool:
        """Whether messages sent on the channel wait for a transition of the model."""
        return bool(self.receivers[channel]) and self.channels[channel].receiver != ENVIRONMENT

    def rendezvous(self) -> Iterator[tuple[str, str, str]]:
        """Yield (channel, sending transition, receiving transition); a machine does not meet itself."""
        for name, channel in self.channels.items():
            for (sender, sending), (receiver, receiving) in product(self.senders[name], self.receivers[name]):
                if channel.capacity or sender != receiver:
                    yield name, sending, receiving


def wiring(cefsm: Cefsm) -> Wiring:
    """Return who sends and receives on which channel; channels that no transition uses are left out."""
    senders: dict[str, list[tuple[str, str]]] = {channel.name: [] for channel in cefsm.channels}
    receivers: dict[str, list[tuple[str, str]]] = {channel.name: [] for channel in cefsm.channels}
    receives: dict[str, str] = {}
    sends: dict[str, tuple[str, ...]] = {}
    for component in cefsm.components:
        for machine in component.machines:
            label = f"{component.name}.{machine.name}"
            for transition in machine.transitions:
                if transition.event is not None:
                    receives[transition.id] = transition.event.channel
                    receivers[transition.event.channel].append((label, transition.id))
                sends[transition.id] = tuple(send.channel for send in transition.sends)
                for name in dict.fromkeys(sends[transition.id]):
                    senders[name].append((label, transition.id))
    used = {channel.name: channel for channel in cefsm.channels if senders[channel.name] or receivers[channel.name]}
    return Wiring(used, senders, receivers, receives, sends)


def communications(
    cefsm: Cefsm, criterion: str, limits: RequirementLimits | None = None
) -> tuple[CoverageRequirement, ...]:
    """Return what a criterion over channels requires of a model.

    Args:
        criterion: channel, message or rendezvous.
        limits: how many requirements are too many.

    Raises BadRequest: there are too many.
    """
    wires = wiring(cefsm)
    if criterion == "rendezvous":
        tally = RequirementCounter(limits or RequirementLimits(), f"rendezvous of '{cefsm.name}'")
        pairs: dict[tuple[str, str], None] = {}
        for _, sending, receiving in wires.rendezvous():
            tally.add(2)
            pairs[sending, receiving] = None
        return tuple(CoverageRequirement("", "rendezvous", pair) for pair in pairs)
    if criterion == "channel":
        return tuple(CoverageRequirement("", "channel", (name,)) for name in wires.channels)
    classes = dict.fromkeys(channel.message for channel in wires.channels.values())
    return tuple(CoverageRequirement("", "message", (name,)) for name in classes)


def delivered(wires: Wiring, criterion: str, run: Iterable[str]) -> set[tuple[str, ...]]:
    """Return the steps of the requirements that a run of the whole model meets."""
    found = set(_deliveries(wires, run))
    if criterion == "rendezvous":
        return {(sending, receiving) for _, sending, receiving in found if NOBODY not in (sending, receiving)}
    if criterion == "channel":
        return {(channel,) for channel, _, _ in found}
    return {(wires.channels[channel].message,) for channel, _, _ in found}


def _deliveries(wires: Wiring, run: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Yield (channel, sending transition, receiving transition), NOBODY where the other end is not the model's.

    A queue holds what its channel holds: where more was sent than that, somebody not seen has taken the oldest.
    """
    waiting = {name: deque[str](maxlen=channel.capacity or 1) for name, channel in wires.channels.items()}
    for transition in run:
        if transition in wires.receives:
            queue = waiting[wires.receives[transition]]
            yield wires.receives[transition], queue.popleft() if queue else NOBODY, transition
        for channel in wires.sends[transition]:
            if wires.is_read(channel):
                waiting[channel].append(transition)
            else:
                yield channel, transition, NOBODY

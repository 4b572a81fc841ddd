"""What a system under test offers to a host, and the links between its components: structural types only.

A component does no input or output of its own. When it is given a message, or its time has come, it answers with the
transitions of the model that it really takes, one at a time; the host decides when the next one may happen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

from parcours.errors import BadRequest
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel

__all__ = ["ENVIRONMENT", "Component", "Link", "LinkKind", "Send", "Step", "StepReport", "links", "reported"]

Send = tuple[str, object]
"""What leaves a component: (channel, payload)."""


class StepReport(NamedTuple):
    """What a component says of itself with a transition that it took, so that guards and actions can be judged.

    `variables` are the model's: of inputs the value that the guard read, of others the value after the transition.
    `operations` are the names of the model's abstract operations that it performed, in order; None if it does not say.
    """

    variables: Mapping[str, object]
    operations: tuple[str, ...] | None = None


def reported(step: object) -> StepReport | None:
    """Return what a step reports: its attribute of that name; None if it has none."""
    found = getattr(step, "reported", None)
    return found if isinstance(found, StepReport) else None


class Step(Protocol):
    """One transition really taken, by its name in the model (p22), with what it sent, in order.

    It may have an attribute `reported`, too.
    """

    @property
    def transition(self) -> str:
        """The transition's name in the model; empty only for the environment, which has no model."""

    @property
    def sends(self) -> tuple[Send, ...]:
        """The messages that leave with this transition."""


class Component(Protocol):
    """A system under test, or a part of it. Times are whole nanoseconds since the host began.

    `handle` and `wake` return lazy iterators: each `next` performs exactly one transition. On the simulated host it may
    have an attribute `deaf`: the channels whose messages wait for now.
    """

    @property
    def name(self) -> str:
        """The component's name in the model."""

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Take up `message` from `channel`; channel None means polled with nothing present (p21)."""

    def next_wake(self) -> int | None:
        """The time [ns] at which `wake` is wanted; None is never."""

    def wake(self, now: int) -> Iterator[Step]:
        """Do what time alone demands."""

    def reset(self) -> None:
        """Return to the state at construction, with nothing left of what happened since."""


class LinkKind(Enum):
    """What happens when a message meets a full queue."""

    TOPIC = "topic"
    """The newest counts: the oldest waiting message is dropped."""
    SERVICE = "service"
    """Nothing is lost: the sender waits until there is room."""
    RENDEZVOUS = "rendezvous"
    """There is no queue: the sender waits until the receiver takes the message up."""


@dataclass(frozen=True, slots=True)
class Link:
    """A channel as a host sees it: who sends, who receives, how many may wait, and what if it is full."""

    channel: str
    sender: str
    receiver: str
    capacity: int = 1
    kind: LinkKind = LinkKind.TOPIC

    def __post_init__(self) -> None:
        if self.capacity < (0 if self.kind is LinkKind.RENDEZVOUS else 1):
            rule = f"a {self.kind.value} holds at least one message, but its capacity is {self.capacity}"
            remedy = "give a capacity of 1 or more, or make it a rendezvous"
            raise BadRequest(f"link {self.channel!r}", rule, remedy, slug="link-capacity")


def _kind(channel: Channel, cefsm: Cefsm) -> LinkKind:
    if channel.capacity == 0:
        return LinkKind.RENDEZVOUS
    returns = any(
        other.topic == channel.topic and (other.sender, other.receiver) == (channel.receiver, channel.sender)
        for other in cefsm.channels
    )
    return LinkKind.SERVICE if channel.topic and returns else LinkKind.TOPIC


def links(cefsm: Cefsm) -> tuple[Link, ...]:
    """Return the model's channels as links, in the model's order.

    Two channels of one topic in opposite directions are a service (request and response; Table I), capacity 0
    is a rendezvous, every other channel is a topic.

    Args:
        cefsm: a checked model.

    >>> model = Cefsm("m", (), (
    ...     Channel("ask", "A", "B", "Text", "/s"), Channel("reply", "B", "A", "Text", "/s"),
    ...     Channel("news", "A", "B", "Text", "/n", 3)))
    >>> [(link.channel, link.kind.value, link.capacity) for link in links(model)]
    [('ask', 'service', 1), ('reply', 'service', 1), ('news', 'topic', 3)]
    """
    return tuple(Link(c.name, c.sender, c.receiver, c.capacity, _kind(c, cefsm)) for c in cefsm.channels)

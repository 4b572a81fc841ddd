"""Says which topic or service of a ROS graph carries each channel of a model, and how it passes the tester.

Two channels of one topic in opposite directions are a service, the one that the model names first its request; any
other channel is a topic. The tester stands between sender and receiver:

    sender ── /parcours/out/TOPIC ──► tester ── /TOPIC ──► receiver

so without the tester nothing is moved, and the same nodes meet on the names of the model. Every message makes two hops:

      A ──hop 1──►┐           ┌──hop 2──► C
                  │  tester   │             records, holds, injects; faults strike between the hops
      B ◄──hop 2──┘           └◄──hop 1── D
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from parcours.errors import HostFailure
from parcours.model.structure import Cefsm, Channel
from parcours.run.port import Link

Role = Literal["topic", "request", "response"]

TESTER = "/parcours"
"""The tester's name on the graph."""


@dataclass(frozen=True, slots=True)
class Interface:
    """A channel as ROS sees it: `type` names a .msg file, or the .srv file of which it is request or response."""

    channel: str
    topic: str
    role: Role
    type: str
    sender: str
    receiver: str


@dataclass(frozen=True, slots=True)
class ChannelRoute:
    """How a channel travels.

    Attributes:
        interface: its topic, role, sender and receiver.
        kind: what the topic carries, or the service of which it is a half, as the graph's participants know it.
        other: the other half of the service; empty for a topic.
    """

    interface: Interface
    kind: Any
    other: str

    @property
    def out(self) -> str:
        """The name at which the sender publishes or calls."""
        return f"{TESTER}/out{self.interface.topic}"


def interfaces(cefsm: Cefsm, also: Sequence[Link] = ()) -> tuple[Interface, ...]:
    """Return the model's channels as topics and halves of services, in the model's order, then the other links.

    Raises HostFailure if a topic that goes both ways does not belong to exactly two channels.

    A channel without a topic gets one of its own name.

    Args:
        cefsm: a checked model.
        also: links of which some are not in the model: each of these becomes a topic, with a type of its own name.

    >>> model = Cefsm("m", (), (
    ...     Channel("ask", "A", "B", "Question", "/path_modification"),
    ...     Channel("reply", "B", "A", "Answer", "/path_modification"), Channel("news", "A", "B", "obstacle_list")))
    >>> for one in interfaces(model):
    ...     print(one.channel, one.topic, one.role, one.type)
    ask /path_modification request PathModification
    reply /path_modification response PathModification
    news /news topic ObstacleList
    """
    found = []
    for channel in cefsm.channels:
        topic = channel.topic or f"/{channel.name}"
        role = _role(channel, [other for other in cefsm.channels if channel.topic and other.topic == channel.topic])
        kind = camel_case(channel.message if role == "topic" else topic)
        found.append(Interface(channel.name, topic, role, kind, channel.sender, channel.receiver))
    known = {channel.name for channel in cefsm.channels}
    found += [
        Interface(link.channel, f"/{link.channel}", "topic", camel_case(link.channel), link.sender, link.receiver)
        for link in also
        if link.channel not in known
    ]
    return tuple(found)


def _role(channel: Channel, sharing: Sequence[Channel]) -> Role:
    if all((other.sender, other.receiver) != (channel.receiver, channel.sender) for other in sharing):
        return "topic"
    if len(sharing) != 2:
        rule = "a service has one request and one response, but shared by " + ", ".join(other.name for other in sharing)
        raise HostFailure(f"topic {channel.topic!r}", rule, "give other channels other topics", slug="topic-shared")
    return "request" if channel is sharing[0] else "response"


def camel_case(name: str) -> str:
    """Return the name as ROS writes types.

    >>> camel_case("/trajectory_generation"), camel_case("RampTrajectory")
    ('TrajectoryGeneration', 'RampTrajectory')
    """
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", name))


def routes(channels: Sequence[Interface], kinds: Mapping[str, object]) -> tuple[ChannelRoute, ...]:
    """Return the route of each channel, in order. Raises HostFailure if several channels would publish on one topic."""
    found = []
    for one in channels:
        sharing = [o.channel for o in channels if o.topic == one.topic and o is not one]
        if sharing and one.role == "topic":
            rule = f"carries one channel, or a request and its response, but: {one.channel}, {', '.join(sharing)}"
            raise HostFailure(f"topic {one.topic!r}", rule, "give each channel its own topic", slug="topic-shared")
        found.append(ChannelRoute(one, kinds[one.channel], sharing[0] if sharing else ""))
    return tuple(found)


def node_name(component: str) -> str:
    """Return what a component's node is called on the graph.

    >>> node_name("Planner"), command_topic("Planner"), report_topic("Planner")
    ('/Planner', '/parcours/Planner/command', '/parcours/Planner/report')
    """
    return f"/{component}"


def command_topic(component: str) -> str:
    """Return where a node hears the tester's commands."""
    return f"{TESTER}/{component}/command"


def report_topic(component: str) -> str:
    """Return where a node reports."""
    return f"{TESTER}/{component}/report"

"""A model's channels -> the ROS 2 topics and services that carry them, and how both ends of the transport call them.

A sender is moved to a name of its own under /parcours/out; the tester passes on what it hears there to the name in the
model, which the paper gives (Table I), where the receiver listens.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from parcours.errors import BadRequest
from parcours.model.structure import Cefsm
from parcours.run.port import Link

OUT = "/parcours/out"


@dataclass(frozen=True, slots=True)
class Topic:
    """Where a channel's messages travel: the name of a topic or service, and what its messages are called."""

    name: str
    message: str = ""


class Part(Enum):
    """What a channel is on the graph."""

    TOPIC = "topic"
    REQUEST = "request"
    RESPONSE = "response"


@dataclass(frozen=True, slots=True)
class Route:
    """How a channel's messages travel.

    Attributes:
        channel: its name in the model.
        part: a topic, or one way of a service.
        sender: the sending component.
        receiver: the receiving component.
        into: name of the topic or service at the receiver (of a response: of its request).
        out: name at the sender.
        message: what the messages are called.
        other: of a service, the channel of the other way.
    """

    channel: str
    part: Part
    sender: str
    receiver: str
    into: str
    out: str
    message: str
    other: str = ""


def topics_of(cefsm: Cefsm) -> dict[str, Topic]:
    """Return the topics that the model names, by channel.

    >>> from parcours.model.structure import Channel
    >>> topics_of(Cefsm("m", (), (Channel("news", "A", "B", "Text", "/n"), Channel("rest", "A", "B", "Text"))))
    {'news': Topic(name='/n', message='Text'), 'rest': Topic(name='/rest', message='Text')}
    """
    return {one.name: Topic(one.topic or f"/{one.name}", one.message) for one in cefsm.channels}


def routes(links: Sequence[Link], topics: Mapping[str, Topic]) -> dict[str, Route]:
    """Return each channel's route, in the order of the links.

    Two links of one topic in opposite directions are a service; the first of them carries the requests.

    Args:
        links: the channels.
        topics: of those that have one; others travel on a topic of their own name.

    Raises:
        BadRequest: a topic or service would carry channels that cannot be told apart.

    >>> both = routes([Link("ask", "A", "B"), Link("reply", "B", "A")], {"ask": Topic("/s"), "reply": Topic("/s")})
    >>> [(one.part.value, one.out, one.into, one.other) for one in both.values()]
    [('request', '/parcours/out/s', '/s', 'reply'), ('response', '/parcours/out/s', '/s', 'ask')]
    """
    found: dict[str, Route] = {}
    named: dict[str, list[Link]] = {}
    for link in links:
        named.setdefault(topics.get(link.channel, Topic(f"/{link.channel}")).name, []).append(link)
    for name, sharing in named.items():
        parts = [Part.TOPIC]
        if len(sharing) == 2 and (sharing[0].sender, sharing[0].receiver) == (sharing[1].receiver, sharing[1].sender):
            parts = [Part.REQUEST, Part.RESPONSE]
        if len(sharing) > len(parts):
            rule = f"carries one channel, or request and response, but: {', '.join(one.channel for one in sharing)}"
            raise BadRequest(f"topic {name!r}", rule, "give each channel a topic of its own", slug="ros2-topic-shared")
        for link, part, other in zip(sharing, parts, reversed(sharing), strict=True):
            message = topics.get(link.channel, Topic(name)).message or link.channel
            found[link.channel] = Route(link.channel, part, link.sender, link.receiver, name, OUT + name, message,
                                        "" if part is Part.TOPIC else other.channel)  # fmt: skip
    return {link.channel: found[link.channel] for link in links}


def command_topic(node: str) -> str:
    """Return where a node hears what it is told.

    >>> command_topic("Planner")
    '/parcours/Planner/command'
    """
    return f"/parcours/{node}/command"


def report_topic(node: str) -> str:
    """Return where a node reports.

    >>> report_topic("Planner")
    '/parcours/Planner/report'
    """
    return f"/parcours/{node}/report"

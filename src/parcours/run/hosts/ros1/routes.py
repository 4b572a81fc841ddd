"""A model's channels and their message classes -> how each travels between a node, the tester and another node.

A sender's end is moved from the paper's name to one under `/parcours/out`, where the tester hears it; the tester
offers the paper's name to the receiver. Without the tester nothing is moved, and the same nodes meet on those names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

from parcours.errors import HostFailure
from parcours.run.hosts.ros1 import no_ros
from parcours.run.hosts.ros1.endpoints import Kind
from parcours.run.hosts.ros1.interfaces import Interface, Role
from parcours.run.hosts.ros1.messages import Messages

TESTER = "/parcours"
"""The tester's name on the graph."""

OUT = "/parcours/out"
"""Under this senders speak."""

INLINE = b"="
"""Begins a message that travels within its frame, since there is no call that it could answer."""

CALL = b"?"
"""Announces a response that answers no call: the receiver's end makes one, with nothing in it."""


@dataclass(frozen=True, slots=True)
class Route:
    """How a channel travels.

    Attributes:
        out: where its sender speaks, or calls, or whose call it answers.
        into: where its receiver hears it, or is called.
        kind: of the topic, or of the service of which it is request or response.
        other: the other half of the service; empty for a topic.
    """

    channel: str
    role: Role
    sender: str
    receiver: str
    out: str
    into: str
    kind: Kind
    other: str


@dataclass(frozen=True, slots=True)
class Plan:
    """What a node needs to find its place: it is sent to its process."""

    master: str
    routes: tuple[Route, ...]
    frame: Kind
    """What commands and reports travel as."""


def routes(channels: Sequence[Interface], messages: Messages) -> tuple[Route, ...]:
    """Return the route of each channel, in order."""
    found = []
    for one in channels:
        classes = messages[one.channel]
        if one.role == "topic":
            kind = Kind(classes.message._type, classes.message._md5sum, classes.message._full_text)
            other = ""
        else:
            kind = Kind(classes.service._type, classes.service._md5sum)
            other = next(o.channel for o in channels if o.topic == one.topic and o.channel != one.channel)
        found.append(Route(one.channel, one.role, one.sender, one.receiver, OUT + one.topic, one.topic, kind, other))
    return tuple(found)


def frame_kind() -> Kind:
    """Return what frames travel as: `std_msgs/UInt8MultiArray`.

    Raises:
        HostFailure: there is no std_msgs.
    """
    try:
        array = import_module("std_msgs.msg").UInt8MultiArray
    except ImportError:
        raise no_ros("std-msgs") from None
    return Kind(array._type, array._md5sum, array._full_text)


_LAYOUT = 8
"""An empty layout before the bytes: no dimensions, no offset."""


def wrapped(frame: bytes) -> bytes:
    """Return the frame as a UInt8MultiArray.

    >>> unwrapped(wrapped(b"frame"))
    b'frame'
    """
    return bytes(_LAYOUT) + len(frame).to_bytes(4, "little") + frame


def unwrapped(message: bytes) -> bytes:
    """Return the bytes of a UInt8MultiArray with an empty layout.

    Raises:
        HostFailure: it is none.
    """
    size = int.from_bytes(message[_LAYOUT : _LAYOUT + 4], "little")
    if message[:_LAYOUT] != bytes(_LAYOUT) or size != len(message) - _LAYOUT - 4:
        raise HostFailure(
            "ROS 1 frame", f"is an array of bytes, but {len(message)} bytes are none", slug="frame-foreign"
        )
    return message[_LAYOUT + 4 :]


def node_name(component: str) -> str:
    """Return what a component's node is called on the graph.

    >>> node_name("Planner"), command_topic("Planner"), report_topic("Planner")
    ('/Planner', '/parcours/Planner/command', '/parcours/Planner/report')
    """
    return f"/{component}"


def command_topic(component: str) -> str:
    """Return where a node hears what it is told."""
    return f"{TESTER}/{component}/command"


def report_topic(component: str) -> str:
    """Return where a node reports."""
    return f"{TESTER}/{component}/report"

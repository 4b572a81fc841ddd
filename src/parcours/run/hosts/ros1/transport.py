"""Runs nodes as processes on a ROS 1 graph, each joined to the tester by the topics and services of the model."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from parcours.errors import HostFailure
from parcours.run.hosts.graph_line import GraphLine, Reply
from parcours.run.hosts.graph_transport import GraphTransport
from parcours.run.hosts.interfaces import TESTER, Interface, Route, node_name
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.ros1 import no_ros
from parcours.run.hosts.ros1.client import Client
from parcours.run.hosts.ros1.ends import Caller, Kind, Publisher, Subscriber
from parcours.run.hosts.ros1.graph import leave, require_free
from parcours.run.hosts.ros1.interfaces import package_routes, write_package, write_python
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.hosts.ros1.packing import Ros1Codec

_MASTER = 3.0
"""How long a master may take to answer [s]."""

_LAYOUT = 8
"""Length of the empty layout before the bytes of a frame: no dimensions, no offset."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a node needs to find its place: it is sent to its process."""

    master: str
    routes: tuple[Route, ...]
    frame: Kind
    """What commands and reports travel as."""


def frame_kind() -> Kind:
    """Return what frames travel as: `std_msgs/UInt8MultiArray`. Raises HostFailure if there is no std_msgs."""
    try:
        array = import_module("std_msgs.msg").UInt8MultiArray
    except ImportError:
        raise no_ros("std-msgs") from None
    return Kind(array._type, array._md5sum, array._full_text)


def wrapped(frame: bytes) -> bytes:
    """Return the frame as a UInt8MultiArray.

    >>> unwrapped(wrapped(b"frame"))
    b'frame'
    """
    return bytes(_LAYOUT) + len(frame).to_bytes(4, "little") + frame


def unwrapped(message: bytes) -> bytes:
    """Return the bytes of a UInt8MultiArray with an empty layout. Raises HostFailure for other bytes."""
    size = int.from_bytes(message[_LAYOUT : _LAYOUT + 4], "little")
    if message[:_LAYOUT] != bytes(_LAYOUT) or size != len(message) - _LAYOUT - 4:
        rule = f"is an array of bytes, but {len(message)} bytes are none"
        raise HostFailure("ROS 1 frame", rule, slug="frame-foreign")
    return message[_LAYOUT + 4 :]


class _FrameSpeaker:
    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher

    @property
    def is_matched(self) -> bool:
        return self._publisher.is_matched

    def send(self, *frames: bytes) -> None:
        self._publisher.send(*map(wrapped, frames))


class Ros1Participant(Client):
    """A node of Parcours' own, or their tester: it knows the name of each other end."""

    def __init__(self, name: str, master: str, frame: Kind, refused: Callable[[str], None] = lambda text: None) -> None:
        super().__init__(name, master, refused)
        self._frame = frame

    def speaker(self, topic: str, kind: Kind, peer: str) -> Publisher:
        """Publish a topic."""
        return self.publish(topic, kind, reader=peer)

    def listener(self, topic: str, kind: Kind, peer: str, heard: Callable[[bytes], None]) -> Subscriber:
        """Hear a topic of that peer."""
        return self.subscribe(topic, kind, heard, sender=peer)

    def server(self, service: str, kind: Kind, peer: str, asked: Callable[[bytes, Reply], None]) -> None:
        """Serve a service to that peer."""
        self.serve(service, kind, asked, client=peer)

    def caller(self, service: str, kind: Kind) -> Caller:
        """Call a service, over one connection."""
        return self.call(service, kind, lanes=1)

    def frame_speaker(self, topic: str, peer: str) -> _FrameSpeaker:
        """Publish frames."""
        return _FrameSpeaker(self.publish(topic, self._frame, reader=peer))

    def frame_listener(self, topic: str, peer: str, heard: Callable[[bytes], None],
                       lost: Callable[[], None]) -> Subscriber:  # fmt: skip
        """Hear frames."""
        return self.subscribe(topic, self._frame, lambda data: heard(unwrapped(data)), sender=peer, lost=lost)


def ros1_line(node: Node, plan: Plan) -> GraphLine:
    """Return a node's end of the transport. Raises HostFailure if master or tester is not there."""
    participant = Ros1Participant(node_name(node.component), plan.master, plan.frame)
    return GraphLine(node.component, plan.routes, participant)


class Ros1Transport(GraphTransport):
    """The tester's end.

    Raises HostFailure if there is no ROS 1 or no master, a name is taken on its graph, or a node did not start.

    Attributes:
        refusals: connections that were declined, and why.
        folder: of the messages' ROS package; its subfolder `python` on PYTHONPATH lets ROS's tools read them.
    """

    label = "ros1"

    def __init__(self, nodes: Sequence[Node], channels: Sequence[Interface], codec: Ros1Codec,
                 preload: Sequence[str] = (), *, master: str | None = None,
                 package: str = "parcours_messages") -> None:  # fmt: skip
        super().__init__(nodes, [__name__, *preload])
        self.refusals: list[str] = []
        with self._closing_on_failure():
            self.folder = Path(tempfile.mkdtemp(prefix="parcours-ros1-"))
            self._closing.callback(shutil.rmtree, self.folder, ignore_errors=True)
            write_package(self.folder, package, channels, codec.forms)
            write_python(self.folder)
            routes = package_routes(self.folder)
            if master is None:
                self.master = self._closing.enter_context(Master()).uri
            else:
                require_master(master, _MASTER)
                self.master = master
            names = [TESTER, *map(node_name, self.nodes)]
            require_free(self.master, names)
            if master is not None:
                self._closing.callback(leave, self.master, names)
            plan = Plan(self.master, routes, frame_kind())
            participant = Ros1Participant(TESTER, self.master, plan.frame, self.refusals.append)
            self._join(participant, routes, ros1_line, plan)

"""Runs nodes as processes on a ROS 1 graph, each joined to the tester by the topics and services of the model."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from parcours.run.hosts.graph_line import GraphLine
from parcours.run.hosts.graph_transport import GraphTransport
from parcours.run.hosts.interfaces import TESTER, ChannelRoute, Interface, node_name
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.ros1 import no_ros
from parcours.run.hosts.ros1.client import Ros1Node
from parcours.run.hosts.ros1.endpoints import Kind
from parcours.run.hosts.ros1.graph import leave, require_free
from parcours.run.hosts.ros1.interfaces import package_routes, write_package, write_python
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.hosts.ros1.packing import Ros1Codec

_MASTER = 3.0
"""How long a master may take to answer [s]."""


@dataclass(frozen=True, slots=True)
class NodePlan:
    """What a node needs to find its place: it is sent to its process."""

    master: str
    routes: tuple[ChannelRoute, ...]
    frame: Kind
    """What commands and reports travel as."""


def frame_kind() -> Kind:
    """Return what frames travel as: `std_msgs/UInt8MultiArray`. Raises HostFailure if there is no std_msgs."""
    try:
        array = import_module("std_msgs.msg").UInt8MultiArray
    except ImportError:
        raise no_ros("std-msgs") from None
    return Kind(array._type, array._md5sum, array._full_text)


def ros1_line(node: Node, plan: NodePlan) -> GraphLine:
    """Return a node's end of the transport. Raises HostFailure if master or tester is not there."""
    participant = Ros1Node(node_name(node.component), plan.master, frame_kind=plan.frame)
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
            plan = NodePlan(self.master, routes, frame_kind())
            participant = Ros1Node(TESTER, self.master, self.refusals.append, plan.frame)
            self._join(participant, routes, ros1_line, plan)

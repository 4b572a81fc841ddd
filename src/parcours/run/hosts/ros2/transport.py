"""Runs nodes as processes on a ROS 2 graph, each joined to the tester by topics and services of its own."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Sequence
from multiprocessing import connection

from parcours.errors import HostFailure
from parcours.run.hosts.graph_line import GraphLine
from parcours.run.hosts.graph_transport import GraphTransport
from parcours.run.hosts.interfaces import TESTER, ChannelRoute, Interface, routes
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.ros2.participant import Ros2Participant, Subscription

_PRELOAD = ("rclpy", "std_msgs.msg", "diagnostic_msgs.srv", __name__)


def ros2_line(node: Node, routes: tuple[ChannelRoute, ...], domain: int | None) -> GraphLine:
    """Return a node's end of the transport. Raises HostFailure if rclpy is not there, or the tester is not."""
    tester = multiprocessing.parent_process()
    if tester is not None:
        threading.Thread(target=_end_with, args=(tester.sentinel,), daemon=True).start()
    return GraphLine(node.component, routes, Ros2Participant(node.component, domain))


def _end_with(sentinel: int) -> None:
    """End this process as soon as the tester has ended: unlike a socket, a graph does not tell."""
    connection.wait([sentinel])
    os.kill(os.getpid(), signal.SIGKILL)


class Ros2Transport(GraphTransport):
    """The tester's end.

    Raises HostFailure if rclpy is not there, a node did not start, channels share a topic, or another tester's nodes
    have the same names.
    """

    label = "ros2"

    def __init__(self, nodes: Sequence[Node], channels: Sequence[Interface], preload: Sequence[str] = (), *,
                 domain: int | None = None) -> None:  # fmt: skip
        super().__init__(nodes, [*_PRELOAD, *preload])
        found = routes(channels, {one.channel: one.type for one in channels})
        with self._closing_on_failure():
            participant = Ros2Participant(TESTER[1:], domain)
            self._domain = participant.domain
            for name in self.nodes:
                self._closing.enter_context(claim(self._domain, name))
            self._join(participant, found, ros2_line, found, domain)

    def _is_connected(self) -> bool:
        if any(isinstance(end, Subscription) and end.speakers > 1 for end in self._reports):
            raise occupied(self._domain)
        return super()._is_connected()


def claim(domain: int, node: str) -> socket.socket:
    """Return a socket that holds the name of a node until it is closed.

    A graph is discovered bit by bit: looking for other testers may be too early. Abstract sockets belong to the
    network, as the graph on loopback does, and vanish with their process. Raises HostFailure if another tester holds
    it.
    """
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(f"\0parcours/ros2/{domain}/{node}")
    except OSError as error:
        held.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise occupied(domain) from error
    return held


def occupied(domain: int, strangers: Sequence[str] = ()) -> HostFailure:
    """Return what is wrong with a domain on which others are: strangers, or another tester's nodes of these names."""
    rule, remedy = "must be alone with its nodes, but", "use another ROS_DOMAIN_ID, or a network of your own"
    if strangers:
        rule = f"{rule} {', '.join(strangers[:5])}{' and others' if strangers[5:] else ''} run there already"
        remedy = f"{remedy} (--network own); list with 'running: true' what belongs to the system"
    else:
        rule = f"{rule} nodes of another tester report there, too"
    return HostFailure(f"ROS domain {domain}", rule, remedy, slug="ros2-occupied")

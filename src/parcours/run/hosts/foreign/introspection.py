"""Looks at a graph that runs, without a binding of it."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import time
from collections.abc import Sequence
from pathlib import Path

from parcours.errors import HostFailure
from parcours.model.structure import Cefsm
from parcours.run.binding import Binding, MessageTypes, RegisteredGraph
from parcours.run.binding.structure import Transport
from parcours.run.hosts.foreign.graph import open_graph

_LOOK, _SAME, _LONGEST = 0.2, 1.5, 10.0
"""How often to look, for how long nothing must have changed, and when to look no longer [s]."""


def transport_here() -> Transport:
    """Return ros2 if this interpreter imports rclpy, else ros1."""
    return "ros2" if importlib.util.find_spec("rclpy") else "ros1"


def address(master: str) -> str:
    """Return the address of a ROS 1 master: as given, that of the environment, or the usual one."""
    return master or os.environ.get("ROS_MASTER_URI", "") or "http://127.0.0.1:11311"


def graph_that_runs(
    transport: Transport, master: str = "", interfaces: Sequence[Path] = ()
) -> tuple[RegisteredGraph, MessageTypes]:
    """Return who is there, with the types of all services, and the message types that are known here.

    Args:
        transport: of the graph; on ROS 2 the domain is that of the environment.
        master: its address, on ROS 1.
        interfaces: folders of types that are not installed.

    Raises:
        HostFailure: there is no such ROS, no master answers, or nobody is there.
    """
    binding = Binding("graph", Cefsm("graph", ()), transport, (), (), interfaces=tuple(interfaces))
    with contextlib.closing(open_graph(binding, master)) as graph:
        found, since, begun = graph.state(), time.monotonic(), time.monotonic()
        while time.monotonic() - since < _SAME and time.monotonic() - begun < _LONGEST:
            graph.spin(time.perf_counter_ns() + round(_LOOK * 1e9))
            if (now := graph.state()) != found:
                found, since = now, time.monotonic()
        found = graph.state([name for name, nodes in found.servers.items() if nodes])
        if not any(nodes for table in (found.publishers, found.subscribers, found.servers) for nodes in table.values()):
            where = (
                f"ROS master {master}" if transport == "ros1" else f"ROS domain {graph.environment['ROS_DOMAIN_ID']}"
            )
            remedy = "start the nodes first, on this machine; on ROS 2 set the ROS_DOMAIN_ID that they have"
            raise HostFailure(where, "some node must run to be looked at, but none does", remedy, slug="graph-empty")
        return found, graph.types

"""Nodes -> processes on a ROS 1 graph, each joined to the tester by the topics and services of the model's channels.

The tester stands between a channel's sender and its receiver; commands announce the messages that travel by
themselves, and reports name those that have left.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import tempfile
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path

from msgspec import structs

from parcours.errors import HostFailure
from parcours.run.hosts.frames import Command, Deliver, Died, Quit, Ready, Report, Took, Turned, Wire, packed, report
from parcours.run.hosts.launching import Processes
from parcours.run.hosts.processes import ending
from parcours.run.hosts.resident import Node
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.interfaces import Field, Interface, write_package
from parcours.run.hosts.ros1.line import Ros1Line
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.hosts.ros1.messages import PYTHON, load
from parcours.run.hosts.ros1.participant import Caller, Participant, Publication, Reply, leave
from parcours.run.hosts.ros1.routes import (
    CALL,
    INLINE,
    TESTER,
    Plan,
    Route,
    command_topic,
    frame_kind,
    node_name,
    report_topic,
    routes,
    unwrapped,
    wrapped,
)

_START = 120.0
"""So long the nodes may take to say that they are there [s]; the first start on a machine compiles."""

_WATCH = 50_000_000
"""How often it is looked, at the start, whether a node has failed [ns]."""


class Ros1Fabric:
    """The tester's end.

    Args:
        nodes: what to start; their residents encode and decode as a `Ros1Codec` does.
        channels: what `interfaces` returned for the model.
        forms: channel -> fields of its flat form.
        preload: modules to load before the processes are forked.
        master: of a graph that runs, http://host:port; one of its own on a free port, if not given.
        package: what the messages' ROS package is called.

    Raises:
        HostFailure: there is no ROS 1 or no master, a name is taken on its graph, or a node did not start.
    """

    label = "ros1"

    def __init__(self, nodes: Sequence[Node], channels: Sequence[Interface], forms: Mapping[str, Sequence[Field]],
                 preload: Sequence[str] = (), *, master: str | None = None, package: str = "parcours_ramp") -> None:  # fmt: skip
        self.refusals: list[str] = []
        """Whose connections were declined, and why."""
        self._closing = contextlib.ExitStack()
        self._processes = Processes(["parcours.run.hosts.ros1.line", *preload])
        self._said: deque[tuple[str, Report]] = deque()
        self._incomplete: dict[str, deque[Report]] = {node.component: deque() for node in nodes}
        self._dead: set[str] = set()
        self._unsent: dict[str, list[bytes]] = {name: [] for name in self._incomplete}
        self._commands: dict[str, Publication] = {}
        self._speaking: dict[str, Publication] = {}
        self._callers: dict[str, Caller] = {}
        self._pending: dict[str, deque[Reply]] = {}
        self._answers: dict[str, deque[bytes]] = {}
        self._arrived: dict[str, deque[bytes]] = {one.channel: deque() for one in channels}
        try:
            self._build(nodes, channels, forms, package, master)
        except BaseException:
            self.close()
            raise

    def _build(self, nodes: Sequence[Node], channels: Sequence[Interface], forms: Mapping[str, Sequence[Field]],
               package: str, master: str | None) -> None:  # fmt: skip
        self.folder = Path(tempfile.mkdtemp(prefix="parcours-ros1-"))
        """The messages' ROS package; its subfolder `python` on PYTHONPATH lets ROS's tools read them."""
        self._closing.callback(shutil.rmtree, self.folder, ignore_errors=True)
        write_package(self.folder, package, channels, forms)
        self._routes = {route.channel: route for route in routes(channels, load(self.folder))}
        frame = frame_kind()
        if master is None:
            own = Master()
            self._closing.enter_context(own)
            self.master = own.uri
        else:
            require_master(master)
            self.master = master
        names = [TESTER, *map(node_name, self._incomplete)]
        _require_free(self.master, names)
        if master is not None:
            self._closing.callback(leave, self.master, names)
        self._participant = Participant(TESTER, self.master, self.refusals.append)
        self._closing.callback(self._participant.close)
        for name in self._incomplete:
            self._commands[name] = self._participant.publish(command_topic(name), frame, node_name(name))
            self._hear_from(name, report_topic(name), frame)
        for route in self._routes.values():
            self._connect(route)
        self._participant.join()
        self._closing.callback(self._processes.stop)
        self._closing.callback(self._say_quit)
        plan = Plan(self.master, tuple(self._routes.values()), frame)
        for node in nodes:
            self._processes.start(node, Ros1Line, plan)
        self._await_nodes()
        for caller in self._callers.values():
            caller.connect()

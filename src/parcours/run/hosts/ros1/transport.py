"""Nodes -> processes on a ROS 1 graph, each joined to the tester by the topics and services of the model's channels.

The tester stands between a channel's sender and its receiver; commands announce the messages that travel by
themselves, and reports name those that have left.
"""

from __future__ import annotations

import contextlib
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from msgspec import structs

from parcours.errors import HostFailure
from parcours.run.hosts.frames import Command, Deliver, Died, Quit, Ready, Report, Took, Turned, Wire, packed, report
from parcours.run.hosts.launching import Processes
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.processes import ending
from parcours.run.hosts.ros1.endpoints import Caller, Kind, Publication, Server, Subscription
from parcours.run.hosts.ros1.graph import leave, require_free
from parcours.run.hosts.ros1.interfaces import Interface, write_package
from parcours.run.hosts.ros1.line import Ros1Line
from parcours.run.hosts.ros1.master import Master, require_master
from parcours.run.hosts.ros1.messages import load
from parcours.run.hosts.ros1.packing import Ros1Codec
from parcours.run.hosts.ros1.participant import Participant
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

_MASTER = 3.0
"""So long a master may take to answer [s]."""

_START = 120.0
"""So long the nodes may take to say that they are there [s]; the first start on a machine compiles."""

_UNDER_WAY = 2_000_000_000
"""So long a message may come later than the report of it [ns]."""

_QUIT = 2.0
"""So long nodes may take to end by themselves [s]."""

_WATCH = 50_000_000
"""How often it is looked, at the start, whether a node has failed [ns]."""


class Ros1Transport:
    """The tester's end.

    Args:
        nodes: what to start; their programs encode and decode as `codec` does (`Ros1NodeProgram`).
        channels: what `interfaces` returned for the model.
        codec: of the messages' bytes, for the tester, too.
        preload: modules to load before the processes are forked.
        master: of a graph that runs, http://host:port; one of its own on a free port, if not given.
        package: what the messages' ROS package is called.

    Raises:
        HostFailure: there is no ROS 1 or no master, a name is taken on its graph, or a node did not start.
    """

    label = "ros1"

    def __init__(
        self,
        nodes: Sequence[Node],
        channels: Sequence[Interface],
        codec: Ros1Codec,
        preload: Sequence[str] = (),
        *,
        master: str | None = None,
        package: str = "parcours_ramp",
    ) -> None:
        self.codec = codec
        self.refusals: list[str] = []
        """Whose connections were declined, and why."""
        self._closing = contextlib.ExitStack()
        self._processes = Processes(["parcours.run.hosts.ros1.line", *preload])
        self._said: list[tuple[str, Report]] = []
        self._dead: set[str] = set()
        self._unsent: dict[str, list[bytes]] = {node.component: [] for node in nodes}
        self._commands: dict[str, Publication] = {}
        self._hearing: dict[str, Subscription | Server | Caller] = {}
        self._speaking: dict[str, Publication] = {}
        self._asking: dict[str, Caller] = {}
        self._answering: dict[str, Server] = {}
        self._owed: Counter[str] = Counter()
        try:
            self._build(nodes, channels, package, master)
        except BaseException:
            self.close()
            raise

    def _build(self, nodes: Sequence[Node], channels: Sequence[Interface], package: str, master: str | None) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="parcours-ros1-"))
        """The messages' ROS package; its subfolder `python` on PYTHONPATH lets ROS's tools read them."""
        self._closing.callback(shutil.rmtree, self.folder, ignore_errors=True)
        write_package(self.folder, package, channels, self.codec.forms)
        self._routes = {route.channel: route for route in routes(channels, load(self.folder))}
        frame = frame_kind()
        if master is None:
            own = Master()
            self._closing.enter_context(own)
            self.master = own.uri
        else:
            require_master(master, _MASTER)
            self.master = master
        names = [TESTER, *map(node_name, self._unsent)]
        require_free(self.master, names)
        if master is not None:
            self._closing.callback(leave, self.master, names)
        self._participant = Participant(TESTER, self.master, self.refusals.append)
        self._closing.callback(self._participant.close)
        for name in self._unsent:
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
        for caller in self._asking.values():
            caller.connect()

    def _hear_from(self, node: str, topic: str, kind: Kind) -> None:
        def heard(message: bytes) -> None:
            self._said.append((node, self._joined(report(unwrapped(message)))))

        self._participant.subscribe(topic, kind, node_name(node), heard, lambda: self._bury(node))

    def _connect(self, route: Route) -> None:
        """Make the tester's ends of a channel."""
        comes, goes = route.sender in self._commands, route.receiver in self._commands
        sender, receiver = node_name(route.sender), node_name(route.receiver)
        if route.role == "topic" and comes:
            self._hearing[route.channel] = self._participant.subscribe(route.out, route.kind, sender)
        if route.role == "topic" and goes:
            self._speaking[route.channel] = self._participant.publish(route.into, route.kind, receiver)
        if route.role == "request" and comes:
            server = self._participant.serve(route.out, route.kind, sender)
            self._hearing[route.channel] = self._answering[route.other] = server
        if route.role == "request" and goes:
            caller = self._participant.call(route.into, route.kind)
            self._asking[route.channel] = self._hearing[route.other] = caller

    def _joined(self, said: Report) -> Report:
        """Return the report with the messages that left before it: they are there, or nearly."""
        if isinstance(said, Turned) and (said.sends or said.asides):
            asides = tuple((when, self._taken(wire)) for when, wire in said.asides)
            return structs.replace(said, asides=asides, sends=tuple(map(self._taken, said.sends)))
        if isinstance(said, Took) and said.sends:
            return structs.replace(said, sends=tuple(map(self._taken, said.sends)))
        return said

    def _taken(self, wire: Wire) -> Wire:
        if wire.data:
            return Wire(wire.channel, wire.data.removeprefix(INLINE))
        data = self._hearing[wire.channel].take(time.perf_counter_ns() + _UNDER_WAY)
        if data is None:
            rule = f"must send what it reports within {_UNDER_WAY * 1e-9:g} s, but on {wire.channel} nothing came"
            raise HostFailure("ros1 host", rule, "is the machine overloaded?", slug="ros1-lost")
        route = self._routes[wire.channel]
        if route.role == "request":
            self._owed[route.other] += 1
        return Wire(wire.channel, data)

    def _decline(self, node: str) -> None:
        """End the calls of a node that has come to rest: nobody will answer them."""
        for channel, server in self._answering.items():
            if self._routes[channel].receiver == node:
                for _ in range(self._owed.pop(channel, 0)):
                    server.answer(None)

    @property
    def nodes(self) -> Sequence[str]:
        """The components that have a node."""
        return tuple(self._commands)

    @property
    def pids(self) -> dict[str, int]:
        """The processes' numbers, by component."""
        return self._processes.pids()

    def command(self, node: str, command: Command) -> None:
        """Tell a node; one that has ended hears nothing."""
        self._unsent[node].append(wrapped(packed(command)))
        self._tell(node)

    def _tell(self, node: str) -> None:
        frames, self._unsent[node] = self._unsent[node], []
        if node not in self._dead:
            self._commands[node].send(*frames)

    def deliver(self, channel: str, number: int, data: bytes) -> None:
        """Let the message reach the channel's receiver, if it is a node."""
        route = self._routes.get(channel)
        if route is None or route.receiver not in self._commands or route.receiver in self._dead:
            return
        announced = b""
        if route.role == "topic":
            self._speaking[channel].send(data)
        elif route.role == "request":
            try:
                self._asking[channel].ask(data)
            except HostFailure:
                if self._processes.status(route.receiver, within=1.0) is None:
                    raise
                return  # it has ended, which is reported as soon as it is heard
        else:
            self._answering[channel].answer(data)
            if self._owed[channel]:
                self._owed[channel] -= 1
            else:
                announced = CALL
        self._unsent[route.receiver].append(wrapped(packed(Deliver(number, Wire(channel, announced)))))

    def poll(self, until: int) -> Sequence[tuple[str, Report]]:
        """Return what nodes have said, waiting until the monotonic clock shows `until` [ns]."""
        for node, frames in self._unsent.items():
            if frames:
                self._tell(node)
        while not self._said:
            if not self._participant.spin(until) and time.perf_counter_ns() >= until:
                break
        said, self._said = self._said, []
        for node, one in said:
            if isinstance(one, Ready):
                self._decline(node)
        return said

    def _bury(self, node: str) -> None:
        if node not in self._dead:
            self._dead.add(node)
            status = self._processes.status(node, within=1.0)
            self._said.append((node, Died(time.perf_counter_ns(), 0 if status is None else status)))

    def signal(self, node: str, signal: int) -> None:
        """Send the node's process a signal."""
        self._processes.signal(node, signal)

    def close(self) -> None:
        """End all nodes, and wait until they have ended; leave the graph. Again: do nothing."""
        self._closing.close()

    def _say_quit(self) -> None:
        living = set(self._processes.pids()) - self._dead
        for node in living:
            with contextlib.suppress(ProcessLookupError):
                self._processes.signal(node, signal.SIGCONT)
            self.command(node, Quit())
        for node in living:
            self._processes.status(node, within=_QUIT)
        self._dead.update(self._commands)

    def _await_nodes(self) -> None:
        heard = [end for end in self._hearing.values() if isinstance(end, Subscription)]
        missing = set(self._commands)
        deadline = time.perf_counter_ns() + int(_START * 1e9)
        while missing or not all(end.streams for end in heard):
            said = self.poll(time.perf_counter_ns() + _WATCH)
            missing -= {node for node, what in said if isinstance(what, Ready)}
            for node in self._commands:
                status = self._processes.status(node)
                if status is not None:
                    raise HostFailure(f"node {node}", f"must start, but its process ended: {ending(status)}",
                                      "its own words stand above", slug="node-start")  # fmt: skip
            if time.perf_counter_ns() > deadline:
                rule = f"nodes must start within {_START:g} s, but there is no {', '.join(sorted(missing))}"
                raise HostFailure("ros1 host", rule, slug="node-start")

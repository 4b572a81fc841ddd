"""Nodes -> processes on a ROS 2 graph, each joined to the tester by topics and services of its own.

Commands announce the messages that travel by themselves, and reports name those that have left: the k-th announcement
belongs to the k-th message of its channel, since all topics are reliable and keep their order.
"""

from __future__ import annotations

import signal
import socket
import time
from collections import deque
from collections.abc import Mapping, Sequence

from msgspec import structs

from parcours.errors import HostFailure
from parcours.run.hosts.frames import (
    Broke,
    Command,
    Deliver,
    Died,
    Quit,
    Ready,
    Report,
    Took,
    Turned,
    Wire,
    report,
)
from parcours.run.hosts.launching import Processes
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.processes import ending
from parcours.run.hosts.ros2.claiming import claim, occupied
from parcours.run.hosts.ros2.line import CALL, Ros2Line, commands
from parcours.run.hosts.ros2.names import Part, Route, Topic, command_topic, report_topic, routes
from parcours.run.hosts.ros2.participant import Caller, Participant, Reply, Sender, Subscription

_START = 120.0
"""So long the nodes may take to say that they are there [s]; the first start on a machine compiles."""

_WATCH = 10_000_000
"""How often it is looked whether nodes still live [ns]."""

_LAST_WORDS = 200_000_000
"""So long what a node said before it ended may be under way [ns]."""

_PRELOAD = ("rclpy", "std_msgs.msg", "diagnostic_msgs.srv", "parcours.run.hosts.ros2.line")


class Ros2Transport:
    """The tester's end.

    Args:
        nodes: what to start.
        topics: where channels travel (`names.topics_of`); on topics of their own names, if not given.
        preload: modules to load before the processes are forked.
        domain: the graph's number; that of the environment, or 0, if not given.

    Raises:
        HostFailure: rclpy is not there, a node did not start, or another tester's nodes have the same names.
        BadRequest: channels share a topic.
    """

    label = "ros2"

    def __init__(self, nodes: Sequence[Node], topics: Mapping[str, Topic] | None = None, preload: Sequence[str] = (),
                 *, domain: int | None = None) -> None:  # fmt: skip
        topics = topics or {}
        links = {link.channel: link for node in nodes for link in node.links}
        self._routes = routes(tuple(links.values()), topics)
        self._said: deque[tuple[str, Report]] = deque()
        self._incomplete: dict[str, deque[Report]] = {node.component: deque() for node in nodes}
        self._arrived: dict[str, deque[bytes]] = {channel: deque() for channel in links}
        self._commands: dict[str, Sender] = {}
        self._senders: dict[str, Sender] = {}
        self._callers: dict[str, Caller] = {}
        self._calls: dict[str, deque[Reply]] = {}
        self._answers: dict[str, deque[bytes]] = {}
        self._unsent: dict[str, list[Command]] = {}
        self._dead: set[str] = set()
        self._dying: dict[str, int] = {}
        self._watched = 0
        self._closed = False
        self._processes = Processes([*_PRELOAD, *preload])
        self._participant = Participant("parcours", domain)
        self._claims: list[socket.socket] = []
        self._ends: list[Sender | Subscription | Caller] = []
        self._reports: list[Subscription] = []
        try:
            for node in nodes:
                self._join(node.component)
            for route in self._routes.values():
                if route.sender in self._incomplete:
                    self._hear_from(route)
                if route.receiver in self._incomplete:
                    self._speak_to(route)
            for node in nodes:
                self._processes.start(node, Ros2Line, dict(topics), domain)
            self._await_nodes()
        except BaseException:
            self._dead.update(self._incomplete)  # who hears them may belong to another
            for name in self._processes.pids():
                self._processes.signal(name, signal.SIGKILL)
            self.close()
            raise

    def _join(self, node: str) -> None:
        self._claims.append(claim(self._participant.domain, node))
        self._commands[node] = self._participant.publish(command_topic(node), "command")
        reports = self._participant.subscribe(report_topic(node), lambda data: self._hear(node, report(data)))
        self._ends += [self._commands[node], reports]
        self._reports.append(reports)

    def _hear_from(self, route: Route) -> None:
        if route.part is Part.TOPIC:
            self._ends.append(self._participant.subscribe(route.out, lambda data: self._arrive(route, data)))
        elif route.part is Part.REQUEST:
            calls, answers = self._calls, self._answers
            calls[route.other], answers[route.other] = deque(), deque()

            def asked(data: bytes, reply: Reply) -> None:
                if data:
                    self._arrive(route, data)
                if answers[route.other]:
                    reply(answers[route.other].popleft())
                else:
                    calls[route.other].append(reply)

            self._participant.serve(route.out, asked)

    def _speak_to(self, route: Route) -> None:
        if route.part is Part.TOPIC:
            self._senders[route.channel] = self._participant.publish(route.into, route.message)
            self._ends.append(self._senders[route.channel])
        elif route.part is Part.REQUEST:
            response = self._routes[route.other]

            def answered(data: bytes | None) -> None:
                if data is not None:
                    self._arrive(response, data)

            self._callers[route.channel] = self._participant.call(route.into, answered)
            self._ends.append(self._callers[route.channel])

    @property
    def nodes(self) -> Sequence[str]:
        """The components that have a node."""
        return tuple(self._incomplete)

    @property
    def pids(self) -> dict[str, int]:
        """The processes' numbers, by component."""
        return self._processes.pids()

    def command(self, node: str, command: Command) -> None:
        """Tell a node with the next `poll`, together with all else for it; one that has ended hears nothing."""
        if node not in self._dead:
            self._unsent.setdefault(node, []).append(command)

    def deliver(self, channel: str, number: int, data: bytes) -> None:
        """Let the message reach the channel's receiver, if it is a node."""
        route = self._routes.get(channel)
        if route is None or route.receiver not in self._incomplete or route.receiver in self._dead:
            return
        announced = b""
        if route.part is Part.TOPIC:
            self._senders[channel].send(data)
        elif route.part is Part.REQUEST:
            self._callers[channel].ask(data)
        elif self._calls[channel]:
            self._calls[channel].popleft()(data)
        else:
            self._answers[channel].append(data)
            announced = CALL
        self.command(route.receiver, Deliver(number, Wire(channel, announced)))

    def poll(self, until: int) -> Sequence[tuple[str, Report]]:
        """Return what nodes have said, waiting until the monotonic clock shows `until` [ns]."""
        self._flush()
        while not self._said:
            now = time.perf_counter_ns()
            if now >= self._watched:
                self._watched = now + _WATCH
                self._watch(now)
            if not self._participant.spin(min(until, self._watched)) and now >= until:
                break
        said = list(self._said)
        self._said.clear()
        return said

    def _flush(self) -> None:
        """Send commands, those for one node in one message: a message costs as much as what it carries."""
        for node, told in self._unsent.items():
            self._commands[node].send(commands(told))
        self._unsent.clear()

    def _watch(self, now: int) -> None:
        """Look who has ended; that is said a little later, since its last words may be under way."""
        for node in self._incomplete:
            if node not in self._dead and self._processes.status(node) is not None:
                if node not in self._dying:
                    self._dying[node] = now + _LAST_WORDS
                elif now >= self._dying[node]:
                    self._dead.add(node)
                    self._said.append((node, Died(self._dying[node] - _LAST_WORDS, self._processes.status(node) or 0)))

    def _hear(self, node: str, said: Report) -> None:
        self._incomplete[node].append(said)
        self._complete(node)

    def _arrive(self, route: Route, data: bytes) -> None:
        self._arrived[route.channel].append(data)
        self._complete(route.sender)

    def _complete(self, node: str) -> None:
        """Join reports with the messages that they name, as far as those have arrived, in their order."""
        waiting = self._incomplete[node]
        while waiting:
            first = self._filled(waiting[0])
            if first is None:
                return
            waiting.popleft()
            self._said.append((node, first))
            if isinstance(first, Ready):
                self._decline(node)

    def _filled(self, said: Report) -> Report | None:
        """Return the report with all its messages; None if one has not arrived yet."""
        if not isinstance(said, Turned | Took):
            return said
        asides = said.asides if isinstance(said, Turned) else ()
        wires = [*(wire for _, wire in asides), *said.sends]
        if not wires:
            return said
        lacking = [wire.channel for wire in wires if not wire.data]
        if any(lacking.count(channel) > len(self._arrived[channel]) for channel in set(lacking)):
            return None
        filled = [wire if wire.data else Wire(wire.channel, self._arrived[wire.channel].popleft()) for wire in wires]
        sends = tuple(filled[len(asides) :])
        if isinstance(said, Took):
            return structs.replace(said, sends=sends)
        times = (time for time, _ in asides)
        return structs.replace(said, sends=sends, asides=tuple(zip(times, filled, strict=False)))

    def _decline(self, node: str) -> None:
        """End the calls of a node that has come to rest; nobody will answer them."""
        for channel, calls in self._calls.items():
            if self._routes[channel].receiver == node:
                while calls:
                    calls.popleft()(None)

    def signal(self, node: str, signal: int) -> None:
        """Send the node's process a signal, after all that it was told before."""
        self._flush()
        self._processes.signal(node, signal)

    def close(self) -> None:
        """End all nodes, and wait until they have ended. Again: do nothing."""
        if self._closed:
            return
        self._closed = True
        for node in self._processes.pids():
            self._processes.signal(node, signal.SIGCONT)
            self._decline(node)
            self.command(node, Quit())
        self._flush()
        self._processes.stop()
        self._participant.close()
        for one in self._claims:
            one.close()
        self._dead.update(self._incomplete)

    def _await_nodes(self) -> None:
        missing = set(self._incomplete)
        deadline = time.perf_counter_ns() + int(_START * 1e9)
        while missing or not all(end.is_matched for end in self._ends):
            for node, said in self.poll(time.perf_counter_ns() + (_WATCH if missing else 1_000_000)):
                if isinstance(said, Broke):
                    raise HostFailure(f"node {node}", f"must start, but raised {said.text}", slug="node-start")
                if isinstance(said, Died):
                    raise HostFailure(f"node {node}", f"must start, but its process ended: {ending(said.status)}",
                                      "its own words stand above", slug="node-start")  # fmt: skip
                missing.discard(node)
            if any(one.speakers > 1 for one in self._reports):
                raise occupied(self._participant.domain)
            if time.perf_counter_ns() > deadline:
                who = ", ".join(sorted(missing)) or "all topics matched"
                rule = f"nodes must start within {_START:g} s, but there is no {who}"
                raise HostFailure("ROS 2 host", rule, slug="node-start")

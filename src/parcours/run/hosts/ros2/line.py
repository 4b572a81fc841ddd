"""A node's process -> its end of a ROS 2 graph: commands and messages joined, reports and messages parted."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from multiprocessing import connection

import msgspec
from msgspec import structs

from parcours.errors import HostFailure
from parcours.run.hosts.frames import (
    Begin,
    Command,
    Deliver,
    Quit,
    Report,
    Rest,
    Run,
    Took,
    Turned,
    Wire,
    command,
    packed,
)
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.ros2.names import Part, Route, Topic, command_topic, report_topic, routes
from parcours.run.hosts.ros2.participant import Caller, Participant, Reply, Sender, Subscription

MATCHING = 30.0
"""So long both ends of a topic may take to find each other [s]."""

CALL = b"call"
"""In the announcement of a response that answers nothing: the node calls first, so that there is a call to answer."""


def commands(told: Sequence[Command]) -> bytes:
    """Return the message that tells a node all these commands, one after the other."""
    return msgspec.msgpack.encode([msgspec.Raw(packed(one)) for one in told])


class Ros2Line:
    """A node's end of the transport.

    Args:
        node: whose.
        topics: where channels travel.
        domain: of the graph.

    Raises:
        HostFailure: rclpy is not there, or the tester does not show up.
    """

    def __init__(self, node: Node, topics: Mapping[str, Topic], domain: int | None) -> None:
        _end_with_tester()
        self._node = node.component
        self._routes = routes(node.links, topics)
        self._participant = Participant(node.component, domain)
        self._commands: deque[Command] = deque()
        self._messages: dict[str, deque[bytes]] = {}
        self._senders: dict[str, Sender] = {}
        self._callers: dict[str, Caller] = {}
        self._unanswered: dict[str, deque[Reply]] = {}
        self._reports = self._participant.publish(report_topic(self._node), "report")
        heard = self._participant.subscribe(command_topic(self._node), self._hear)
        self._ends: list[Sender | Subscription | Caller] = [self._reports, heard]
        for route in self._routes.values():
            if route.receiver == self._node:
                self._listen(route)
            if route.sender == self._node:
                self._speak(route)
        self._await_tester()

    def _hear(self, data: bytes) -> None:
        for one in map(command, msgspec.msgpack.decode(data, type=list[msgspec.Raw])):
            if isinstance(one, Quit):
                self._commands.clear()
            self._commands.append(one)

    def _listen(self, route: Route) -> None:
        messages = self._messages.setdefault(route.channel, deque())
        if route.part is Part.TOPIC:
            self._ends.append(self._participant.subscribe(route.into, messages.append))
        elif route.part is Part.REQUEST:
            unanswered = self._unanswered.setdefault(route.other, deque())

            def asked(data: bytes, reply: Reply) -> None:
                unanswered.append(reply)
                messages.append(data)

            self._participant.serve(route.into, asked)

    def _speak(self, route: Route) -> None:
        if route.part is Part.TOPIC:
            self._senders[route.channel] = self._participant.publish(route.out, route.message)
            self._ends.append(self._senders[route.channel])
        elif route.part is Part.REQUEST:
            messages = self._messages.setdefault(route.other, deque())

            def answered(data: bytes | None) -> None:
                if data is not None:
                    messages.append(data)

            self._callers[route.channel] = self._participant.call(route.out, answered)
            self._ends.append(self._callers[route.channel])

    def _await_tester(self) -> None:
        deadline = time.monotonic() + MATCHING
        while not all(end.is_matched for end in self._ends):
            if time.monotonic() > deadline:
                self._participant.close()
                rule = f"must find the tester on its topics within {MATCHING:g} s"
                raise HostFailure(f"node {self._node}", rule, "see docs/ros2.md", slug="ros2-discovery")
            self._participant.spin(time.perf_counter_ns() + 2_000_000)

    def poll(self, until: int | None) -> Command | None:
        """Return the next command, a message joined with its announcement; None at `until`."""
        while (found := self._next()) is None:
            if not self._participant.spin(until):
                return None
        if isinstance(found, Begin | Run | Rest):
            self._decline()
        elif isinstance(found, Quit):
            self._decline()
            self._participant.close()
        return found

    def _next(self) -> Command | None:
        if not self._commands:
            return None
        first = self._commands[0]
        if isinstance(first, Deliver):
            channel = first.message.channel
            if first.message.data == CALL:
                self._callers[self._routes[channel].other].ask(b"")
                self._commands[0] = structs.replace(first, message=Wire(channel))
            if not self._messages[channel]:
                return None
            self._commands.popleft()
            return Deliver(first.number, Wire(channel, self._messages[channel].popleft()))
        return self._commands.popleft()

    def report(self, report: Report) -> None:
        """Tell the tester; the messages in the report travel by themselves."""
        if isinstance(report, Turned) and (report.sends or report.asides):
            asides = tuple((time, self._sent(wire)) for time, wire in report.asides)
            report = structs.replace(report, asides=asides, sends=tuple(map(self._sent, report.sends)))
        elif isinstance(report, Took) and report.sends:
            report = structs.replace(report, sends=tuple(map(self._sent, report.sends)))
        self._reports.send(packed(report))

    def _sent(self, wire: Wire) -> Wire:
        """Let the message leave, and return what the report says of it.

        An answer to no call, and what belongs on no channel of this node, stays in the report.
        """
        if wire.channel in self._senders:
            self._senders[wire.channel].send(wire.data)
        elif wire.channel in self._callers:
            self._callers[wire.channel].ask(wire.data)
        elif self._unanswered.get(wire.channel):
            self._unanswered[wire.channel].popleft()(wire.data)
        else:
            return wire
        return Wire(wire.channel)

    def _decline(self) -> None:
        """Answer all calls that nobody will answer any more."""
        for waiting in self._unanswered.values():
            while waiting:
                waiting.popleft()(None)


def _end_with_tester() -> None:
    """End this process as soon as the tester has ended: unlike a socket, a graph does not tell."""
    tester = multiprocessing.parent_process()
    if tester is not None:
        threading.Thread(target=_watch, args=(tester.sentinel,), daemon=True).start()


def _watch(sentinel: int) -> None:
    connection.wait([sentinel])
    os.kill(os.getpid(), signal.SIGKILL)

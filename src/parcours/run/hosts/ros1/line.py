"""A node's end of a ROS 1 graph: commands joined with the messages that they announce, and reports with theirs apart.

The k-th announcement of a channel belongs to its k-th message, since both come from one sender in order.
"""

from __future__ import annotations

import time
from collections import deque

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
from parcours.run.hosts.resident import Node
from parcours.run.hosts.ros1.participant import Caller, Participant, Publication, Reply, Subscription
from parcours.run.hosts.ros1.routes import (
    CALL,
    INLINE,
    TESTER,
    Plan,
    Route,
    command_topic,
    node_name,
    report_topic,
    unwrapped,
    wrapped,
)

_JOIN = 20_000_000_000
"""So long a node may take to be connected with the tester [ns]."""


class Ros1Line:
    """A node's end.

    Args:
        node: what runs here.
        plan: where its channels are.

    Raises:
        HostFailure: the master does not answer, or the tester is not on its graph.
    """

    def __init__(self, node: Node, plan: Plan) -> None:
        name = node.component
        self._participant = Participant(node_name(name), plan.master)
        self._commands: deque[Command] = deque()
        self._arrived: dict[str, deque[bytes]] = {}
        self._owed: dict[str, deque[Reply]] = {}
        self._speaking: dict[str, Publication] = {}
        self._asking: dict[str, Caller] = {}
        self._opening: dict[str, Caller] = {}
        self._gone = False
        self._reports = self._participant.publish(report_topic(name), plan.frame, TESTER)
        hearing = [self._participant.subscribe(command_topic(name), plan.frame, TESTER, self._told, self._lost)]
        for route in plan.routes:
            if route.receiver == name:
                self._arrived[route.channel] = deque()
            if route.role == "topic" and route.sender == name:
                self._speaking[route.channel] = self._participant.publish(route.out, route.kind, TESTER)
            if route.role == "topic" and route.receiver == name:
                heard = self._arrived[route.channel].append
                hearing.append(self._participant.subscribe(route.into, route.kind, TESTER, heard))
        for route in plan.routes:
            if route.role == "request" and route.sender == name:
                self._call(route)
            if route.role == "request" and route.receiver == name:
                self._serve(route)
        self._enter(hearing)

    def _call(self, route: Route) -> None:
        def answered(data: bytes | None) -> None:
            if data is not None:
                self._arrived[route.other].append(data)

        caller = self._participant.call(route.out, route.kind, answered)
        self._asking[route.channel] = self._opening[route.other] = caller

    def _serve(self, route: Route) -> None:
        owed = self._owed[route.other] = deque()

        def asked(data: bytes, reply: Reply) -> None:
            self._arrived[route.channel].append(data)
            owed.append(reply)

        self._participant.serve(route.into, route.kind, TESTER, asked)

    def _enter(self, hearing: list[Subscription]) -> None:
        self._participant.join()
        for caller in self._asking.values():
            caller.connect()
        speaking = [self._reports, *self._speaking.values()]
        deadline = time.perf_counter_ns() + _JOIN
        while not (all(one.is_joined for one in hearing) and all(TESTER in one.peers for one in speaking)):
            if time.perf_counter_ns() > deadline:
                raise HostFailure(f"ROS 1 node {self._participant.name}", f"must be connected with {TESTER}, but is not",
                                  "it runs as a part of the ROS 1 host", slug="ros1-connect")  # fmt: skip
            self._participant.spin(time.perf_counter_ns() + 1_000_000)

    def _lost(self) -> None:
        self._gone = True

    def _told(self, message: bytes) -> None:
        said = command(unwrapped(message))
        if isinstance(said, Deliver) and said.message.data == CALL:
            self._opening[said.message.channel].ask(b"")
        self._commands.append(said)

    def poll(self, until: int | None) -> Command | None:
        """Return the next command; None at `until`. A tester that has gone says Quit."""
        while True:
            said = self._next()
            if said is not None:
                return said
            if self._gone or self._participant.is_ended:
                return Quit()
            if not self._participant.spin(until) and until is not None and time.perf_counter_ns() >= until:
                return None

    def _next(self) -> Command | None:
        """Return the first command, if the message that it announces has come, too."""
        if not self._commands:
            return None
        first = self._commands[0]
        if isinstance(first, Deliver):
            channel = first.message.channel
            waiting = self._arrived[channel]
            if not waiting:
                return None
            first = Deliver(first.number, Wire(channel, waiting.popleft()))
        elif isinstance(first, Begin | Run | Rest):
            for owed in self._owed.values():
                while owed:
                    owed.popleft()(None)
        self._commands.popleft()
        return first

    def report(self, report: Report) -> None:
        """Tell the tester; messages leave first, on their own ways."""
        if isinstance(report, Turned) and (report.sends or report.asides):
            asides = tuple((when, self._sent(wire)) for when, wire in report.asides)
            report = structs.replace(report, asides=asides, sends=tuple(map(self._sent, report.sends)))
        elif isinstance(report, Took) and report.sends:
            report = structs.replace(report, sends=tuple(map(self._sent, report.sends)))
        self._reports.send(wrapped(packed(report)), wait=True)

    def _sent(self, wire: Wire) -> Wire:
        """Send a message on its way, and return what announces it."""
        channel = wire.channel
        if channel in self._speaking:
            self._speaking[channel].send(wire.data, wait=True)
        elif self._owed.get(channel):
            self._owed[channel].popleft()(wire.data)
        elif channel in self._asking:
            self._asking[channel].ask(wire.data)
        else:
            return Wire(channel, INLINE + wire.data)
        return Wire(channel)

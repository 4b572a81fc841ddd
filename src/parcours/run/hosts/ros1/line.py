"""A node's end of a ROS 1 graph: commands joined with the messages that they announce, and reports with theirs apart.

The k-th announcement of a channel belongs to its k-th message, since both come from one sender in order.
"""

from __future__ import annotations

import time
from collections import Counter, deque

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
from parcours.run.hosts.ros1.endpoints import Caller, Publication, Server, Subscription
from parcours.run.hosts.ros1.participant import Participant
from parcours.run.hosts.ros1.routes import (
    CALL,
    INLINE,
    TESTER,
    Plan,
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
        self._hearing: dict[str, Subscription | Server | Caller] = {}
        self._speaking: dict[str, Publication] = {}
        self._asking: dict[str, Caller] = {}
        self._opening: dict[str, Caller] = {}
        self._answering: dict[str, Server] = {}
        self._owed: Counter[str] = Counter()
        self._calls_of = {route.channel: route.other for route in plan.routes if route.role == "request"}
        self._is_gone = False
        self._reports = self._participant.publish(report_topic(name), plan.frame, TESTER)
        joining = [self._participant.subscribe(command_topic(name), plan.frame, TESTER, self._told, self._lost)]
        for route in plan.routes:
            if route.role == "topic" and route.sender == name:
                self._speaking[route.channel] = self._participant.publish(route.out, route.kind, TESTER)
            if route.role == "topic" and route.receiver == name:
                subscription = self._participant.subscribe(route.into, route.kind, TESTER)
                self._hearing[route.channel] = subscription
                joining.append(subscription)
            if route.role == "request" and route.sender == name:
                caller = self._participant.call(route.out, route.kind)
                self._asking[route.channel] = self._opening[route.other] = self._hearing[route.other] = caller
            if route.role == "request" and route.receiver == name:
                server = self._participant.serve(route.into, route.kind, TESTER)
                self._hearing[route.channel] = self._answering[route.other] = server
        self._enter(joining)

    def _enter(self, joining: list[Subscription]) -> None:
        self._participant.join()
        for caller in self._asking.values():
            caller.connect()
        speaking = [self._reports, *self._speaking.values()]
        deadline = time.perf_counter_ns() + _JOIN
        while not (all(one.streams for one in joining) and all(TESTER in one.peers for one in speaking)):
            if time.perf_counter_ns() > deadline:
                rule = f"must be connected with {TESTER}, but is not after {_JOIN * 1e-9:g} s"
                raise HostFailure(f"ROS 1 node {self._participant.name}", rule, slug="ros1-connect")
            self._participant.spin(time.perf_counter_ns() + 1_000_000)

    def _lost(self) -> None:
        self._is_gone = True

    def _told(self, message: bytes) -> None:
        said = command(unwrapped(message))
        if isinstance(said, Deliver) and said.message.data == CALL:
            self._opening[said.message.channel].ask(b"")
        self._commands.append(said)

    def poll(self, until: int | None) -> Command | None:
        """Return the next command; None at `until`. A tester that has gone says Quit."""
        while not self._commands:
            if self._is_gone or self._participant.is_ended:
                return Quit()
            if not self._participant.spin(until) and until is not None and time.perf_counter_ns() >= until:
                return None
        said = self._commands[0]
        if isinstance(said, Deliver):
            data = self._taken(said.message, until)
            if data is None:
                self._participant.spin(0)
                return Quit() if self._is_gone or until is None else None
            said = Deliver(said.number, Wire(said.message.channel, data))
        elif isinstance(said, Begin | Run | Rest):
            self._decline()
        self._commands.popleft()
        return said

    def _taken(self, announced: Wire, until: int | None) -> bytes | None:
        """Return the message that is announced: it left before its announcement, and is there, or nearly."""
        data = self._hearing[announced.channel].take(until)
        if data is not None and announced.channel in self._calls_of:
            self._owed[self._calls_of[announced.channel]] += 1
        return data

    def _decline(self) -> None:
        """End the calls that were not answered: what they asked is forgotten."""
        for channel, server in self._answering.items():
            for _ in range(self._owed.pop(channel, 0)):
                server.answer(None)

    def report(self, report: Report) -> None:
        """Tell the tester; messages leave first, on their own ways. Return when all has left.

        The tester reads a message when it has read the report, so a message that is too long for the sockets between
        must not be waited for before its report.
        """
        if isinstance(report, Turned) and (report.sends or report.asides):
            asides = tuple((when, self._sent(wire)) for when, wire in report.asides)
            report = structs.replace(report, asides=asides, sends=tuple(map(self._sent, report.sends)))
        elif isinstance(report, Took) and report.sends:
            report = structs.replace(report, sends=tuple(map(self._sent, report.sends)))
        self._reports.send(wrapped(packed(report)))
        self._participant.flush(TESTER)

    def _sent(self, wire: Wire) -> Wire:
        """Send a message on its way, and return what announces it."""
        channel = wire.channel
        if channel in self._speaking:
            self._speaking[channel].send(wire.data)
        elif self._owed[channel]:
            self._owed[channel] -= 1
            self._answering[channel].answer(wire.data)
        elif channel in self._asking:
            self._asking[channel].ask(wire.data)
        else:
            return Wire(channel, INLINE + wire.data)
        return Wire(channel)

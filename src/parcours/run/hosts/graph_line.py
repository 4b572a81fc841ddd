"""A node's end of a ROS graph: joins commands with the messages that they announce, and parts reports from theirs.

The k-th announcement of a channel belongs to its k-th message, since both come from one sender in order.
"""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

from msgspec import structs

from parcours.errors import HostFailure
from parcours.run.hosts.frames import (
    Begin,
    Command,
    Deliver,
    Quit,
    Report,
    Rest,
    RunFreely,
    TransitionTaken,
    Turned,
    Wire,
    packed,
)
from parcours.run.hosts.frames import command as unpacked
from parcours.run.hosts.interfaces import TESTER, ChannelRoute, command_topic, report_topic

INLINE = b"="
"""Stands before a message that travels within its frame, since there is no call that it could answer."""

CALL = b"?"
"""Announces a response that answers no call: the receiver's end makes one, with nothing in it."""

_JOIN = 30.0
"""How long a node may take to be connected with its tester [s]."""

Reply = Callable[[bytes | None], None]
"""Answers a request with bytes, or refuses it with None; once, now or later."""

Answered = Callable[[bytes | None, str], None]
"""Gets the response of a call; or None, and why there is no response."""


class End(Protocol):
    """One end of a topic or service."""

    @property
    def is_matched(self) -> bool:
        """Whether the other end is connected."""


class Publisher(End, Protocol):
    """The end of a topic that publishes."""

    def send(self, *messages: bytes) -> object:
        """Publish."""


class Client(End, Protocol):
    """The end of a service that calls."""

    def ask(self, data: bytes, answered: Answered) -> None:
        """Send a request without waiting for the response."""


class Participant(Protocol):
    """A node of a ROS graph: the tester, or a node of its own. `peer` is the name of the node at the other end."""

    frame_kind: Any
    """The kind of the messages that frames travel in."""

    @property
    def is_ended(self) -> bool:
        """Whether a tool of the graph has ordered this node to end."""

    def publish(self, topic: str, kind: Any, peer: str) -> Publisher:
        """Publish a topic; `peer` misses nothing."""

    def subscribe(self, topic: str, kind: Any, heard: Callable[[bytes], None], peer: str, *,
                  lost: Callable[[], None] = lambda: None) -> End:  # fmt: skip
        """Hear a topic of that peer; `lost` is called when the peer has gone, where the graph notices that."""

    def serve(self, service: str, kind: Any, asked: Callable[[bytes, Reply], None], peer: str) -> None:
        """Serve a service to that peer."""

    def call(self, service: str, kind: Any) -> Client:
        """Call a service; requests and responses keep their order."""

    def wrap(self, frames: Sequence[bytes]) -> Sequence[bytes]:
        """Return the messages that carry these frames."""

    def unwrap(self, message: bytes) -> Sequence[bytes]:
        """Return the frames that a message carries. Raises HostFailure or BadRequest for other bytes."""

    def spin(self, until: int | None) -> bool:
        """Hear what arrives before the monotonic clock shows `until` [ns]; return whether anything happened."""

    def flush(self, peer: str) -> None:
        """Return once everything for that peer has left."""

    def close(self) -> None:
        """Leave the graph. Again: do nothing."""


class GraphLine:
    """A node's end. Raises HostFailure if the tester is not on the graph."""

    def __init__(self, component: str, routes: Sequence[ChannelRoute], participant: Participant) -> None:
        self._participant = participant
        self._commands: deque[Command] = deque()
        self._messages: dict[str, deque[bytes]] = defaultdict(deque)
        self._senders: dict[str, Publisher] = {}
        self._callers: dict[str, Client] = {}
        self._calls_for: dict[str, str] = {}
        self._unanswered: dict[str, deque[Reply]] = defaultdict(deque)
        self._is_gone = False
        kind = participant.frame_kind
        self._reports = participant.publish(report_topic(component), kind, TESTER)
        commands = participant.subscribe(command_topic(component), kind, self._hear, TESTER, lost=self._lose)
        self._ends: list[End] = [self._reports, commands]
        for route in routes:
            if route.interface.receiver == component:
                self._listen(route)
            if route.interface.sender == component:
                self._speak(route)
        self._await_tester(component)

    def _hear(self, message: bytes) -> None:
        for said in map(unpacked, self._participant.unwrap(message)):
            if isinstance(said, Quit):
                self._commands.clear()  # a message that was announced before may never come
            self._commands.append(said)

    def _lose(self) -> None:
        self._is_gone = True

    def _listen(self, route: ChannelRoute) -> None:
        one = route.interface
        messages = self._messages[one.channel]
        if one.role == "topic":
            self._ends.append(self._participant.subscribe(one.topic, route.kind, messages.append, TESTER))
        elif one.role == "request":
            unanswered = self._unanswered[route.other]

            def asked(data: bytes, reply: Reply) -> None:
                unanswered.append(reply)
                messages.append(data)

            self._participant.serve(one.topic, route.kind, asked, TESTER)

    def _speak(self, route: ChannelRoute) -> None:
        channel = route.interface.channel
        if route.interface.role == "topic":
            self._senders[channel] = self._participant.publish(route.out, route.kind, TESTER)
            self._ends.append(self._senders[channel])
        elif route.interface.role == "request":
            self._callers[channel] = self._participant.call(route.out, route.kind)
            self._calls_for[channel], self._calls_for[route.other] = route.other, channel
            self._ends.append(self._callers[channel])

    def _await_tester(self, component: str) -> None:
        deadline = time.monotonic() + _JOIN
        while not all(end.is_matched for end in self._ends):
            if time.monotonic() > deadline:
                self._participant.close()
                rule = f"must be connected with {TESTER}, but is not after {_JOIN:g} s"
                raise HostFailure(f"node {component}", rule, "is it in the same network?", slug="graph-tester")
            self._participant.spin(time.perf_counter_ns() + 2_000_000)

    def poll(self, until: int | None) -> Command | None:
        """Return the next command, a message joined with its announcement; None at `until`. Without a tester, Quit."""
        while (found := self._next()) is None:
            if self._is_gone or self._participant.is_ended:
                found = Quit()
                break
            if not self._participant.spin(until) and until is not None and time.perf_counter_ns() >= until:
                return None
        if isinstance(found, Begin | RunFreely | Rest | Quit):
            self._decline()
        if isinstance(found, Quit):
            self._participant.close()
        return found

    def _next(self) -> Command | None:
        if not self._commands:
            return None
        first = self._commands[0]
        if isinstance(first, Deliver):
            channel = first.message.channel
            if first.message.data == CALL:
                self._ask(self._calls_for[channel], b"")
                self._commands[0] = structs.replace(first, message=Wire(channel))
            if not self._messages[channel]:
                return None
            first = Deliver(first.number, Wire(channel, self._messages[channel].popleft()))
        self._commands.popleft()
        return first

    def _ask(self, channel: str, data: bytes) -> None:
        self._callers[channel].ask(data, partial(self._answered, self._calls_for[channel]))

    def _answered(self, channel: str, data: bytes | None, why: str) -> None:
        if data is not None:
            self._messages[channel].append(data)

    def report(self, report: Report) -> None:
        """Report to the tester; messages leave first, on their own ways. Return when everything has left."""
        self._reports.send(*self._participant.wrap([packed(with_wires(report, self._sent))]))
        self._participant.flush(TESTER)

    def _sent(self, wire: Wire) -> Wire:
        """Send a message on its way, and return what announces it."""
        channel = wire.channel
        if channel in self._senders:
            self._senders[channel].send(wire.data)
        elif channel in self._callers:
            self._ask(channel, wire.data)
        elif self._unanswered.get(channel):
            self._unanswered[channel].popleft()(wire.data)
        else:
            return Wire(channel, INLINE + wire.data)
        return Wire(channel)

    def _decline(self) -> None:
        """Refuse all calls that will not be answered any more."""
        for waiting in self._unanswered.values():
            while waiting:
                waiting.popleft()(None)


def with_wires(report: Report, change: Callable[[Wire], Wire]) -> Report:
    """Return the report with each of its messages changed, in the order in which they were sent."""
    if isinstance(report, Turned) and (report.sends or report.asides):
        asides = tuple((when, change(wire)) for when, wire in report.asides)
        return structs.replace(report, asides=asides, sends=tuple(map(change, report.sends)))
    if isinstance(report, TransitionTaken) and report.sends:
        return structs.replace(report, sends=tuple(map(change, report.sends)))
    return report

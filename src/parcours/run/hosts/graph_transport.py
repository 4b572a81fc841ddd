"""The tester's end of a ROS graph: nodes as processes, joined to the tester by topics and services.

Commands announce the messages that travel by themselves, and reports name those that have left: the k-th announcement
belongs to the k-th message of its channel, since all ends keep their order. A report waits until its messages are here.
"""

from __future__ import annotations

import contextlib
import signal
import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from functools import partial

from parcours.run.hosts.frames import (
    Command,
    Deliver,
    Died,
    Quit,
    Ready,
    Report,
    TransitionTaken,
    Turned,
    Wire,
    packed,
    report,
)
from parcours.run.hosts.graph_line import CALL, INLINE, Client, End, Participant, Publisher, Reply, with_wires
from parcours.run.hosts.interfaces import ChannelRoute, command_topic, node_name, report_topic
from parcours.run.hosts.launching import NodeProcesses
from parcours.run.hosts.node_program import Line, Node

_WATCH = 10_000_000
"""How often to look whether nodes still live [ns]."""

_LAST_WORDS = 200_000_000
"""How long what a node said before it ended may be under way [ns]."""


class GraphTransport(NodeProcesses):
    """The tester's end. Subclasses make the participant and the routes, then call `_join`."""

    def __init__(self, nodes: Sequence[Node], preload: Sequence[str]) -> None:
        super().__init__(nodes, preload)
        self._said: deque[tuple[str, Report]] = deque()
        self._incomplete: dict[str, deque[Report]] = {name: deque() for name in self.nodes}
        self._arrived: dict[str, deque[bytes]] = defaultdict(deque)
        self._routes: dict[str, ChannelRoute] = {}
        self._ends: list[End] = []
        self._reports: list[End] = []
        self._commands: dict[str, Publisher] = {}
        self._senders: dict[str, Publisher] = {}
        self._callers: dict[str, Client] = {}
        self._calls: dict[str, deque[Reply]] = defaultdict(deque)
        self._answers: dict[str, deque[bytes]] = defaultdict(deque)
        self._unsent: dict[str, list[bytes]] = {}
        self._dying: dict[str, int] = {}
        self._watched = 0
        self._closing = contextlib.ExitStack()
        """What is undone when the nodes have ended."""

    def _join(self, participant: Participant, routes: Sequence[ChannelRoute], line: Callable[..., Line],
              *arguments: object) -> None:  # fmt: skip
        """Make the tester's ends, start the nodes with their `line`, and wait until all are connected."""
        self._participant = participant
        self._closing.callback(participant.close)
        self._routes = {route.interface.channel: route for route in routes}
        for name in self.nodes:
            peer, kind = node_name(name), participant.frame_kind
            self._commands[name] = participant.publish(command_topic(name), kind, peer)
            reports = participant.subscribe(report_topic(name), kind, partial(self._hear, name), peer)
            self._reports.append(reports)
            self._ends += [self._commands[name], reports]
        for route in routes:
            if route.interface.sender in self._incomplete:
                self._hear_from(route)
            if route.interface.receiver in self._incomplete:
                self._speak_to(route)
        participant.spin(0)
        self._start(line, *arguments)
        self._await_nodes(self._is_connected)

    def _is_connected(self) -> bool:
        return all(end.is_matched for end in self._ends)

    def _hear_from(self, route: ChannelRoute) -> None:
        one = route.interface
        sender = node_name(one.sender)
        if one.role == "topic":
            arrive = partial(self._arrive, one.channel)
            self._ends.append(self._participant.subscribe(route.out, route.kind, arrive, sender))
        elif one.role == "request":

            def asked(data: bytes, reply: Reply) -> None:
                if data:
                    self._arrive(one.channel, data)
                if self._answers[route.other]:
                    reply(self._answers[route.other].popleft())
                else:
                    self._calls[route.other].append(reply)

            self._participant.serve(route.out, route.kind, asked, sender)

    def _speak_to(self, route: ChannelRoute) -> None:
        one = route.interface
        if one.role == "topic":
            speaker = self._participant.publish(one.topic, route.kind, node_name(one.receiver))
            self._senders[one.channel] = speaker
            self._ends.append(speaker)
        elif one.role == "request":
            self._callers[one.channel] = self._participant.call(one.topic, route.kind)
            self._ends.append(self._callers[one.channel])

    def command(self, node: str, command: Command) -> None:
        """Tell a node with the next `poll`, together with all else for it; one that has ended hears nothing."""
        if node not in self._dead:
            self._unsent.setdefault(node, []).append(packed(command))

    def deliver(self, channel: str, number: int, data: bytes) -> None:
        """Let the message reach the channel's receiver, if it is a node."""
        route = self._routes.get(channel)
        if route is None or route.interface.receiver not in self._incomplete or route.interface.receiver in self._dead:
            return
        announced = b""
        if route.interface.role == "topic":
            self._senders[channel].send(data)
        elif route.interface.role == "request":
            self._callers[channel].ask(data, partial(self._answered, route.other))
        elif self._calls[channel]:
            self._calls[channel].popleft()(data)
        else:
            self._answers[channel].append(data)
            announced = CALL
        self.command(route.interface.receiver, Deliver(number, Wire(channel, announced)))

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
        """Send the commands, those for one node together."""
        for node, frames in self._unsent.items():
            self._commands[node].send(*self._participant.wrap(frames))
        self._unsent.clear()

    def _watch(self, now: int) -> None:
        """Look which nodes have ended; that is reported a little later, since last words may be under way."""
        for node in self.nodes:
            status = None if node in self._dead else self._processes.status(node)
            if status is not None and now >= self._dying.setdefault(node, now + _LAST_WORDS):
                self._dead[node] = status
                self._said.append((node, Died(self._dying[node] - _LAST_WORDS, status)))

    def _hear(self, node: str, message: bytes) -> None:
        self._incomplete[node] += map(report, self._participant.unwrap(message))
        self._complete(node)

    def _arrive(self, channel: str, data: bytes) -> None:
        self._arrived[channel].append(data)
        self._complete(self._routes[channel].interface.sender)

    def _answered(self, channel: str, data: bytes | None, why: str) -> None:
        if data is not None:
            self._arrive(channel, data)

    def _complete(self, node: str) -> None:
        """Join reports with the messages that they name, as far as those have arrived, in their order."""
        waiting = self._incomplete[node]
        while waiting and self._has_all(waiting[0]):
            first = with_wires(waiting.popleft(), self._filled)
            self._said.append((node, first))
            if isinstance(first, Ready):
                self._decline(node)

    # A report overtakes, or is overtaken by, the messages that it names: they come on other connections.
    #
    #   reports of A:  Took(x), Took(x, y)        waits in _incomplete until
    #   topic x:       x1  x2                     _arrived has as many of each channel as it names
    #   topic y:       y1

    def _has_all(self, said: Report) -> bool:
        if not isinstance(said, Turned | TransitionTaken):
            return True
        asides = said.asides if isinstance(said, Turned) else ()
        named = [wire.channel for wire in (*(wire for _, wire in asides), *said.sends) if not wire.data]
        return all(named.count(channel) <= len(self._arrived[channel]) for channel in set(named))

    def _filled(self, wire: Wire) -> Wire:
        data = wire.data.removeprefix(INLINE) if wire.data else self._arrived[wire.channel].popleft()
        return Wire(wire.channel, data)

    def _decline(self, node: str) -> None:
        """End the calls of a node that has come to rest: they will not be answered."""
        for channel, calls in self._calls.items():
            if self._routes[channel].interface.receiver == node:
                while calls:
                    calls.popleft()(None)

    def signal(self, node: str, signal: int) -> None:
        """Send the node's process a signal, after all commands before."""
        self._flush()
        super().signal(node, signal)

    def close(self) -> None:
        """End all nodes, and wait until they have ended; leave the graph. Again: do nothing."""
        for node in self.pids:
            if node not in self._dead:
                self._processes.signal(node, signal.SIGCONT)
                self._decline(node)
                self.command(node, Quit())
        self._flush()
        self._processes.stop()
        self._dead = dict.fromkeys(self.nodes, 0) | self._dead
        self._closing.close()

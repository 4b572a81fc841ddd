"""Runs nodes as processes on this machine, each joined to the tester by a Unix socket.

Of what sleeps while it waits, a Unix socket has the shortest round trip (bench/bench_transport.py, docs/hosts.md).
"""

from __future__ import annotations

import select
import signal
import socket
import time
from collections import deque
from collections.abc import Sequence

from parcours.run.hosts.frames import Command, Deliver, Died, Quit, Report, Wire, command, packed, report
from parcours.run.hosts.launching import NodeProcesses
from parcours.run.hosts.node_program import Node
from parcours.run.hosts.sockets import FrameSocket


class SocketLine:
    """A node's end."""

    def __init__(self, node: Node, connection: socket.socket) -> None:
        self._socket = FrameSocket(connection)
        self._arrived: deque[bytes] = deque()

    def poll(self, until: int | None) -> Command | None:
        """Return the next command; None at `until`. A tester that has gone says Quit."""
        while not self._arrived:
            if until is None:
                self._socket.wait(None)
            self._arrived.extend(self._socket.frames())
            if self._arrived:
                break
            if self._socket.closed:
                return Quit()
            if until is not None and time.perf_counter_ns() >= until:
                return None
            self._socket.wait(until)
        return command(self._arrived.popleft())

    def report(self, report: Report) -> None:
        """Tell the tester."""
        self._socket.send(packed(report), wait=True)


class ProcessTransport(NodeProcesses):
    """The tester's end. Raises HostFailure if a node did not start."""

    label = "processes"

    def __init__(self, nodes: Sequence[Node], preload: Sequence[str] = ()) -> None:
        super().__init__(nodes, preload)
        self._sockets: dict[str, FrameSocket] = {}
        self._names: dict[FrameSocket, str] = {}
        self._news: list[tuple[str, Report]] = []
        self._receivers = {link.channel: link.receiver for node in nodes for link in node.links}
        with self._closing_on_failure():
            for node in nodes:
                mine, its = socket.socketpair()
                self._sockets[node.component] = FrameSocket(mine)
                self._names[self._sockets[node.component]] = node.component
                with its:
                    self._processes.start(node, SocketLine, its)
            self._await_nodes()

    def command(self, node: str, command: Command) -> None:
        """Tell a node; for one that has ended, what comes back is again that it has died."""
        if node in self._dead:
            self._news.append((node, Died(time.perf_counter_ns(), self._dead[node])))
        else:
            self._sockets[node].send(packed(command))

    def deliver(self, channel: str, number: int, data: bytes) -> None:
        """Let the message reach the channel's receiver, if it is a node."""
        receiver = self._sockets.get(self._receivers.get(channel, ""))
        if receiver is not None:
            receiver.send(packed(Deliver(number, Wire(channel, data))))

    def poll(self, until: int) -> Sequence[tuple[str, Report]]:
        """Return what nodes have said, waiting until the monotonic clock shows `until` [ns]."""
        while True:
            said, self._news = self._news, []
            there = [one for name, one in self._sockets.items() if name not in self._dead]
            full = [one for one in there if one.waits]
            for one in full:
                one.flush()
            left = until - time.perf_counter_ns()
            readable, _, _ = select.select(there, full, [], 0 if said else max(0, left) * 1e-9)
            for one in readable:
                said += self._hear(self._names[one])
            if said or left <= 0:
                return said

    def _hear(self, node: str) -> list[tuple[str, Report]]:
        connection = self._sockets[node]
        said: list[tuple[str, Report]] = [(node, report(frame)) for frame in connection.frames()]
        if connection.closed and node not in self._dead:
            status = self._processes.status(node, within=1.0)
            self._dead[node] = 0 if status is None else status
            said.append((node, Died(time.perf_counter_ns(), self._dead[node])))
        return said

    def close(self) -> None:
        """End all nodes, and wait until they have ended. Again: do nothing."""
        for name, connection in self._sockets.items():
            if not connection.closed:
                self._processes.signal(name, signal.SIGCONT)
                connection.send(packed(Quit()))
            connection.close()
            self._dead.setdefault(name, 0)
        self._processes.stop()

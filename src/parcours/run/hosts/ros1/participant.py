"""A name on a ROS 1 graph -> what it publishes, hears, serves and calls, as bytes, in the thread that waits for them.

Of rospy a process has one node for good, and its publishers stand still while a reader is frozen, or drop; each message
changes threads on its way. Here one thread reads all sockets itself, and others only form connections.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from collections.abc import Callable

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.doorway import Doorway
from parcours.run.hosts.ros1.endpoints import ANY, Caller, Kind, Publication, Server, Subscription, header_of, opened
from parcours.run.hosts.ros1.graph import WITHIN, Slave, ask, ask_all
from parcours.run.hosts.ros1.master import LOOPBACK
from parcours.run.hosts.ros1.streams import Stream, write_header

Heard = Callable[[bytes], None]
Lost = Callable[[], None]

_CLOSE = 2_000_000
"""An epoll waits by milliseconds: so near the time is waited for otherwise [ns]."""


class Participant:
    """A node of the graph, on loopback.

    Args:
        name: with its slash.
        master: http://host:port.
        refused: told, in any thread, of connections that were declined, and why.
    """

    def __init__(self, name: str, master: str, refused: Callable[[str], None] = lambda text: None) -> None:
        self.name, self.master, self._refused = name, master, refused
        self._publications: dict[str, Publication] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._servers: dict[str, Server] = {}
        self._watched: dict[int, tuple[Stream, Heard | None, Lost]] = {}
        self._crowded: set[Stream] = set()
        self._lock = threading.Lock()
        self._poll = select.epoll()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll.register(self._wake, select.EPOLLIN)
        self.is_ended = False
        """Whether somebody has told it to shut down (rosnode kill)."""
        self._closed = False
        self._door = Doorway(WITHIN, self._admit, refused)
        self._slave = Slave(master, {
            "requestTopic": self._where, "publisherUpdate": self._update,
            "getPublications": lambda: [[one.topic, one.kind.type] for one in self._publications.values()],
            "getSubscriptions": lambda: [[one.topic, one.kind.type] for one in self._subscriptions.values()],
            "getBusInfo": self._connections,
        }, self._end)  # fmt: skip

    # What it offers and wants; `join` tells the master.

    def publish(self, topic: str, kind: Kind, reader: str = "") -> Publication:
        """Offer a topic; `reader` misses nothing."""
        self._publications[topic] = Publication(self, topic, kind, reader)
        return self._publications[topic]

    def subscribe(self, topic: str, kind: Kind, sender: str, heard: Heard | None = None,
                  lost: Lost = lambda: None) -> Subscription:  # fmt: skip
        """Want a topic of that sender; without `heard`, its messages wait until they are taken."""
        self._subscriptions[topic] = Subscription(topic, kind, sender, heard, lost)
        return self._subscriptions[topic]

    def serve(self, service: str, kind: Kind, client: str) -> Server:
        """Offer a service to that client."""
        self._servers[service] = Server(self, service, kind, client)
        return self._servers[service]

    def call(self, service: str, kind: Kind) -> Caller:
        """Return what calls a service, once it is connected."""
        return Caller(self, service, kind)

    def join(self) -> None:
        """Enter the graph with all of it, and connect to those who publish already.

        Raises:
            HostFailure: the master does not answer, or refuses.
        """
        at, uri = f"rosrpc://{LOOPBACK}:{self._door.port}", self._slave.uri
        wanted = list(self._subscriptions.values())
        answers = ask_all(self.master, [
            *(("registerService", (self.name, one.service, at, uri)) for one in self._servers.values()),
            *(("registerPublisher", (self.name, one.topic, one.kind.type, uri)) for one in self._publications.values()),
            *(("registerSubscriber", (self.name, one.topic, one.kind.type, uri)) for one in wanted),
        ])  # fmt: skip
        if None in answers:
            raise HostFailure(f"ROS 1 node {self.name}", "must be let into the graph, but the master refuses",
                              slug="ros1-answer")  # fmt: skip
        for one, publishers in zip(wanted, answers[len(answers) - len(wanted) :], strict=True):
            self._connect(one, publishers)

    # The thread that waits.

    def spin(self, until: int | None) -> bool:
        """Hear what has arrived, or what arrives before the monotonic clock shows `until` [ns]; None waits for ever.

        Returns:
            whether anything happened.
        """
        left = _CLOSE + 1 if until is None else until - time.perf_counter_ns()
        if left > _CLOSE:
            events = self._poll.poll(None if until is None else (left - _CLOSE) * 1e-9)
        else:
            if left > 0:
                select.select([self._poll], [], [], left * 1e-9)
            events = self._poll.poll(0)
        for descriptor, what in events:
            watched = self._watched.get(descriptor)
            if watched is None:
                with contextlib.suppress(BlockingIOError):
                    os.eventfd_read(self._wake)
                continue
            stream, heard, lost = watched
            if what & select.EPOLLOUT:
                stream.flush()
                with self._lock:
                    if not stream.waits:
                        self._crowded.discard(stream)
                        self._poll.modify(descriptor, _wanted(stream, heard))
            if what & ~select.EPOLLOUT:
                stream.read()
                while heard and stream.arrived:
                    heard(stream.arrived.popleft()[1])
            if stream.closed:
                with self._lock:
                    del self._watched[descriptor]
                    self._poll.unregister(descriptor)
                self._crowded.discard(stream)
                stream.close()
                lost()
        return bool(events)

    def await_room(self, stream: Stream) -> None:
        """See to it that the stream sends on what waits, as soon as there is room."""
        with self._lock:
            self._crowded.add(stream)
            watched = self._watched.get(stream.fileno())
            if watched is not None:
                self._poll.modify(stream.fileno(), _wanted(stream, watched[1]))

    def flush(self, peer: str) -> None:
        """Wait until all that is meant for `peer` has left."""
        for stream in self._crowded:
            if stream.peer == peer:
                stream.flush(wait=True)
        self._crowded.clear()

    def watch(self, stream: Stream, heard: Heard | None, lost: Lost) -> None:
        """Call `heard` with each message of the stream, in the thread that spins; `lost` at its end.

        Without `heard` messages wait in the stream until they are taken, and only its end is noticed.
        """
        with self._lock:
            if self._closed:
                stream.close()
                return
            self._watched[stream.fileno()] = stream, heard, lost
            self._poll.register(stream.fileno(), _wanted(stream, heard))

    def close(self) -> None:
        """Leave: nothing is heard any more, and the threads end. The master is told by `leave`."""
        if self._closed:
            return
        with self._lock:
            self._closed = True
        self._slave.close()
        self._door.close()
        for stream, _, _ in self._watched.values():
            stream.close()
        self._watched.clear()
        self._poll.close()
        os.close(self._wake)

    # Other threads: connections are formed.

    def _where(self, topic: str, protocols: list[list[object]]) -> object:
        if topic not in self._publications:
            raise HostFailure(self.name, f"does not publish {topic}", slug="ros1-header")
        return ["TCPROS", LOOPBACK, self._door.port]

    def _update(self, topic: str, publishers: list[str]) -> int:
        if topic in self._subscriptions:
            self._connect(self._subscriptions[topic], publishers)
        return 0

    def _end(self) -> None:
        self.is_ended = True
        with contextlib.suppress(OSError):
            os.eventfd_write(self._wake, 1)

    def _connections(self) -> list[list[object]]:
        out = [(peer, "o", one.topic) for one in self._publications.values() for peer in one.peers]
        into = [(uri, "i", one.topic) for one in self._subscriptions.values() for uri in one.streams]
        return [[k, other, way, "TCPROS", topic, True] for k, (other, way, topic) in enumerate(out + into)]

    def _connect(self, sub: Subscription, publishers: list[str]) -> None:
        with sub.lock:
            for uri in publishers:
                if uri in sub.streams:
                    continue
                try:
                    stream = self._subscribed(sub, uri)
                except HostFailure as failure:
                    if not self._closed:
                        self._refused(f"{sub.topic}: its publisher at {uri} is not heard: {failure}")
                    continue
                if stream is None:
                    continue
                sub.streams[uri] = stream

                def lost(uri: str = uri) -> None:
                    if sub.heard is not None:
                        sub.streams.pop(uri, None)
                    sub.lost()

                self.watch(stream, sub.heard, lost)

    def _subscribed(self, sub: Subscription, uri: str) -> Stream | None:
        found = ask(uri, "requestTopic", self.name, sub.topic, [["TCPROS"]])
        header = header_of(self, sub.kind) | {"topic": sub.topic, "tcp_nodelay": "1"}
        connection, told = opened(str(found[1]), int(found[2]), header)
        sender = told.get("callerid", "?")
        if sender == sub.sender and sub.kind.fits(told):
            return Stream(connection, sender)
        connection.close()
        whose = f"it belongs to {sub.sender}" if sender != sub.sender else f"it carries {sub.kind.type}"
        self._refused(f"{sub.topic}: {sender} publishes {_named(told)} there, but {whose}; it is not heard")
        return None

    def _admit(self, connection: socket.socket, header: dict[str, str]) -> str:
        """Let the other end in, or return why not."""
        who = header.setdefault("callerid", "?")
        if "topic" in header:
            published = self._publications.get(header["topic"])
            if published is None:
                return f"{header['topic']}: {who} wants to hear it, but {self.name} does not publish it"
            if not published.kind.fits(header):
                return f"{published.topic}: carries {published.kind.type}, but {who} wants {_named(header)}"
            published.admit(connection, header)
            return ""
        server = self._servers.get(header.get("service", ""))
        if server is None:
            return f"{header.get('service', 'a connection')}: {who} calls it, but {self.name} does not serve it"
        if header.get("md5sum") not in (ANY, server.kind.md5sum):
            return f"{server.service}: is {server.kind.type}, but {who} calls {_named(header)}"
        if header.get("probe") == "1":
            write_header(connection, header_of(self, server.kind) | {"service": server.service})
            connection.close()
        elif server.client != who:
            return f"{server.service}: serves {server.client} only, but {who} calls it"
        else:
            server.admit(connection, header)
        return ""


def _wanted(stream: Stream, heard: Heard | None) -> int:
    """Return what an epoll shall tell of the stream."""
    return (select.EPOLLIN if heard else 0) | (select.EPOLLOUT if stream.waits else 0)


def _named(header: dict[str, str]) -> str:
    return f"{header.get('type', 'something')} (md5 {header.get('md5sum', 'unknown')})"

"""A name on a ROS 1 graph -> what it publishes, hears, serves and calls, as bytes, in the thread that waits for them.

rospy hands each message from a thread of its own to whoever waits for it: four such hand-overs lie in one call through
a relay, and each costs about as much as a component's whole turn. Here one thread reads all sockets itself; others
only form connections. A graph is not the process's, as in rospy: one process may have several, one after the other.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.graph import WITHIN, Slave, ask, ask_all
from parcours.run.hosts.ros1.master import LOOPBACK
from parcours.run.hosts.ros1.streams import ANSWERED, REFUSED, Stream, read_header, write_header

ANY = "*"
"""As a type or an md5 sum: whatever it is."""

Reply = Callable[[bytes | None], None]
"""Answers a request with bytes, or refuses it with None; later, too, but each once."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a topic or a service carries: `package/Type`, its md5 sum and, of a topic, the .msg file's text."""

    type: str
    md5sum: str
    definition: str = ""

    def fits(self, header: dict[str, str]) -> bool:
        """Whether another end means the same."""
        return header.get("md5sum") in (ANY, self.md5sum) and header.get("type", ANY) in (ANY, self.type)


class Publication:
    """A topic that is published. Of its readers `reader` misses nothing; others do if they are slow."""

    def __init__(self, owner: Participant, topic: str, kind: Kind, reader: str) -> None:
        self.topic, self.kind, self._owner, self._reader = topic, kind, owner, reader
        self._lock = threading.Lock()
        self._streams: tuple[Stream, ...] = ()

    def send(self, *messages: bytes, wait: bool = False) -> None:
        """Publish; `wait` until all has left."""
        with self._lock:
            streams = self._streams
        for stream in streams:
            if not stream.waits or stream.peer == self._reader:
                stream.send(*messages)
                if stream.waits:
                    self._owner.await_room(stream, wait=wait)

    def join(self, connection: socket.socket, header: dict[str, str]) -> Stream:
        """Let somebody listen."""
        with self._lock:  # nothing is published between the header and the first message that it gets
            write_header(connection, _header(self._owner.name, self.kind) | {"topic": self.topic, "latching": "0"})
            stream = Stream(connection, header["callerid"])
            self._streams += (stream,)
        return stream

    def leave(self, stream: Stream) -> None:
        """Forget somebody who listened."""
        with self._lock:
            self._streams = tuple(one for one in self._streams if one is not stream)

    @property
    def peers(self) -> set[str]:
        """Who listens."""
        return {stream.peer for stream in self._streams}


@dataclass(eq=False, slots=True)
class Subscription:
    """A topic that is heard, of `sender` only."""

    topic: str
    kind: Kind
    sender: str
    heard: Callable[[bytes], None]
    lost: Callable[[], None]
    streams: dict[str, Stream] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def is_joined(self) -> bool:
        """Whether its sender is connected."""
        return bool(self.streams)


@dataclass(eq=False, slots=True)
class Server:
    """A service that is served, to `client` only."""

    service: str
    kind: Kind
    client: str
    asked: Callable[[bytes, Reply], None]


class Caller:
    """A client of a service over one lasting connection, which is made anew if it breaks."""

    def __init__(self, owner: Participant, service: str, kind: Kind, answered: Callable[[bytes | None], None]) -> None:
        self.service, self.kind, self.answered, self._owner = service, kind, answered, owner
        self._stream: Stream | None = None

    def connect(self) -> None:
        """Find the server. Raises HostFailure if there is none, or it declines."""
        address = ask(self._owner.master, "lookupService", self._owner.name, self.service)
        header = _header(self._owner.name, self.kind) | {"service": self.service, "persistent": "1"}
        host, _, port = address.removeprefix("rosrpc://").rstrip("/").partition(":")
        connection, told = _opened(host, int(port), header)
        self._stream = Stream(connection, told.get("callerid", "?"), answers=True)
        self._owner.listen(self._stream, lambda mark, data: self.answered(data if mark == ANSWERED else None))

    def ask(self, data: bytes) -> None:
        """Send a request without waiting for the answer.

        Raises:
            HostFailure: the connection had broken, and cannot be made again.
        """
        if self._stream is None or self._stream.closed:
            self.connect()
        assert self._stream is not None
        self._stream.send(data)
        if self._stream.waits:
            self._owner.await_room(self._stream)


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
        self._streams: dict[int, tuple[Stream, Callable[[bytes, bytes], None], Callable[[], None]]] = {}
        self._lock = threading.Lock()
        self._poll = select.epoll()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll.register(self._wake, select.EPOLLIN)
        self.is_ended = False
        """Whether somebody has told it to shut down (rosnode kill)."""
        self._closed = False
        self._door = socket.create_server((LOOPBACK, 0))
        self._slave = Slave(master, {
            "requestTopic": self._where, "publisherUpdate": self._update, "shutdown": self._end,
            "getPublications": lambda: [[one.topic, one.kind.type] for one in self._publications.values()],
            "getSubscriptions": lambda: [[one.topic, one.kind.type] for one in self._subscriptions.values()],
            "getBusInfo": self._connections,
        })  # fmt: skip
        self.uri = self._slave.uri
        self._doorman = threading.Thread(target=self._receive, daemon=True, name="ros1-door")
        self._doorman.start()

    # What it offers and wants; `join` tells the master.

    def publish(self, topic: str, kind: Kind, reader: str = "") -> Publication:
        """Offer a topic; `reader` misses nothing."""
        self._publications[topic] = Publication(self, topic, kind, reader)
        return self._publications[topic]

    def subscribe(self, topic: str, kind: Kind, sender: str, heard: Callable[[bytes], None],
                  lost: Callable[[], None] = lambda: None) -> Subscription:  # fmt: skip
        """Call `heard` with each message of that sender, `lost` when it has gone."""
        self._subscriptions[topic] = Subscription(topic, kind, sender, heard, lost)
        return self._subscriptions[topic]

    def serve(self, service: str, kind: Kind, client: str, asked: Callable[[bytes, Reply], None]) -> None:
        """Call `asked` with each request of that client."""
        self._servers[service] = Server(service, kind, client, asked)

    def call(self, service: str, kind: Kind, answered: Callable[[bytes | None], None]) -> Caller:
        """Return what calls a service; `answered` hears None for a refusal."""
        return Caller(self, service, kind, answered)

    def join(self) -> None:
        """Enter the graph with all of it, and connect to those who publish already.

        Raises:
            HostFailure: the master does not answer, or refuses.
        """
        port = self._door.getsockname()[1]
        topics = [(one.topic, one.kind.type, self.uri) for one in self._publications.values()]
        services = [(one.service, f"rosrpc://{LOOPBACK}:{port}", self.uri) for one in self._servers.values()]
        wanted = list(self._subscriptions.values())
        answers = ask_all(self.master, [
            *(("registerService", (self.name, *one)) for one in services),
            *(("registerPublisher", (self.name, *one)) for one in topics),
            *(("registerSubscriber", (self.name, one.topic, one.kind.type, self.uri)) for one in wanted),
        ])  # fmt: skip
        if None in answers:
            raise HostFailure(f"ROS 1 node {self.name}", "must be let into the graph, but the master refuses",
                              slug="ros1-answer")  # fmt: skip
        for one, publishers in zip(wanted, answers[len(services) + len(topics) :], strict=True):
            self._connect(one, publishers)

    # The thread that waits.

    def spin(self, until: int | None) -> bool:
        """Hear what has arrived, or what arrives before the monotonic clock shows `until` [ns]; None waits for ever.

        Returns:
            whether anything happened.
        """
        events = self._poll.poll(0)
        if not events:
            left = None if until is None else (until - time.perf_counter_ns()) * 1e-9
            if left is not None and left <= 0:
                return False
            select.select([self._poll], [], [], left)  # to the microsecond; an epoll waits by milliseconds
            events = self._poll.poll(0)
        for descriptor, what in events:
            end = self._streams.get(descriptor)
            if end is None:
                with contextlib.suppress(BlockingIOError):
                    os.eventfd_read(self._wake)
                continue
            stream, heard, lost = end
            if what & select.EPOLLOUT:
                stream.flush()
                if not stream.waits:
                    self._poll.modify(descriptor, select.EPOLLIN)
            if what & ~select.EPOLLOUT:
                for mark, data in stream.messages():
                    heard(mark, data)
                if stream.closed:
                    self._drop(descriptor, stream)
                    lost()
        return bool(events)

    def await_room(self, stream: Stream, *, wait: bool = False) -> None:
        """See to it that the stream sends on what waits: now, or as soon as there is room."""
        if wait:
            stream.flush(wait=True)
        elif not stream.closed:
            self._poll.modify(stream.fileno(), select.EPOLLIN | select.EPOLLOUT)

    def listen(self, stream: Stream, heard: Callable[[bytes, bytes], None],
               lost: Callable[[], None] = lambda: None) -> None:  # fmt: skip
        """Call `heard` with (mark, message) of the stream, in the thread that spins; `lost` at its end."""
        with self._lock:
            if self._closed:
                stream.close()
                return
            self._streams[stream.fileno()] = stream, heard, lost
            self._poll.register(stream.fileno(), select.EPOLLIN)

    def _drop(self, descriptor: int, stream: Stream) -> None:
        with self._lock:
            del self._streams[descriptor]
            self._poll.unregister(descriptor)
        stream.close()

    def close(self) -> None:
        """Leave: nothing is heard any more, and the threads end. The master is told by `leave`."""
        if self._closed:
            return
        with self._lock:
            self._closed = True
        self._slave.close()
        with contextlib.suppress(OSError):
            self._door.shutdown(socket.SHUT_RDWR)
        self._doorman.join()
        self._door.close()
        for stream, _, _ in self._streams.values():
            stream.close()
        self._streams.clear()
        self._poll.close()
        os.close(self._wake)

    # Other threads: connections are formed.

    def _where(self, topic: str, protocols: list[list[object]]) -> object:
        if topic not in self._publications:
            raise HostFailure(self.name, f"does not publish {topic}", slug="ros1-header")
        return ["TCPROS", LOOPBACK, self._door.getsockname()[1]]

    def _update(self, topic: str, publishers: list[str]) -> int:
        if topic in self._subscriptions:
            self._connect(self._subscriptions[topic], publishers)
        return 0

    def _end(self, reason: str = "") -> int:
        self.is_ended = True
        with contextlib.suppress(OSError):
            os.eventfd_write(self._wake, 1)
        return 0

    def _connections(self) -> list[list[object]]:
        found: list[list[object]] = []
        for one in self._publications.values():
            found += [[len(found) + k, peer, "o", "TCPROS", one.topic, True] for k, peer in enumerate(one.peers)]
        for sub in self._subscriptions.values():
            found += [[len(found) + k, uri, "i", "TCPROS", sub.topic, True] for k, uri in enumerate(sub.streams)]
        return found

    def _connect(self, sub: Subscription, publishers: list[str]) -> None:
        with sub.lock:
            for uri in publishers:
                if uri in sub.streams:
                    continue
                try:
                    stream = self._subscribed(sub, uri)
                except HostFailure as failure:
                    if not self._closed:
                        self._refused(f"{sub.topic}: no connection to the publisher at {uri}: {failure}")
                    continue
                if stream is None:
                    continue
                sub.streams[uri] = stream

                def lost(uri: str = uri) -> None:
                    sub.streams.pop(uri, None)
                    sub.lost()

                self.listen(stream, lambda mark, data: sub.heard(data), lost)

    def _subscribed(self, sub: Subscription, uri: str) -> Stream | None:
        found = ask(uri, "requestTopic", self.name, sub.topic, [["TCPROS"]])
        header = _header(self.name, sub.kind) | {"topic": sub.topic, "tcp_nodelay": "1"}
        connection, told = _opened(str(found[1]), int(found[2]), header)
        sender = told.get("callerid", "?")
        if sender == sub.sender and sub.kind.fits(told):
            return Stream(connection, sender)
        connection.close()
        theirs = f"{told.get('type')}, md5 {told.get('md5sum')}"
        whose = f"it belongs to {sub.sender}" if sender != sub.sender else f"it carries {sub.kind.type}, not {theirs}"
        self._refused(f"{sub.topic}: {sender} publishes there, but {whose}; it is not heard")
        return None

    def _receive(self) -> None:
        while True:
            try:
                connection, _ = self._door.accept()
            except OSError:
                return
            threading.Thread(target=self._welcome, args=(connection,), daemon=True, name="ros1-welcome").start()

    def _welcome(self, connection: socket.socket) -> None:
        connection.settimeout(WITHIN)
        with contextlib.suppress(OSError):
            try:
                header = read_header(connection)
                complaint = self._admit(connection, header)
            except HostFailure as failure:
                header, complaint = {}, str(failure)
            if complaint:
                self._refused(complaint)
                with contextlib.suppress(OSError):
                    write_header(connection, {"error": complaint})
                connection.close()

    def _admit(self, connection: socket.socket, header: dict[str, str]) -> str:
        """Let the other end in, or return why not."""
        who = header.setdefault("callerid", "?")
        if "topic" in header:
            published = self._publications.get(header["topic"])
            if published is None:
                return f"{header['topic']}: {who} wants to hear it, but {self.name} does not publish it"
            if not published.kind.fits(header):
                return f"{published.topic}: carries {published.kind.type}, but {who} wants {_named(header)}"
            stream = published.join(connection, header)
            self.listen(stream, lambda mark, data: None, lambda: published.leave(stream))
            return ""
        server = self._servers.get(header.get("service", ""))
        if server is None:
            return f"{header.get('service', 'a connection')}: {who} calls it, but {self.name} does not serve it"
        if header.get("md5sum") not in (ANY, server.kind.md5sum):
            return f"{server.service}: is {server.kind.type}, but {who} calls {_named(header)}"
        if header.get("probe") == "1":
            write_header(connection, _header(self.name, server.kind) | {"service": server.service})
            connection.close()
            return ""
        if server.client != who:
            return f"{server.service}: serves {server.client} only, but {who} calls it"
        write_header(connection, _header(self.name, server.kind) | {"service": server.service})
        stream = Stream(connection, who)
        self.listen(stream, lambda mark, data: server.asked(data, self._replying(stream)))
        return ""

    def _replying(self, stream: Stream) -> Reply:
        def reply(data: bytes | None) -> None:
            stream.send(b"not answered" if data is None else data, mark=REFUSED if data is None else ANSWERED)
            if stream.waits:
                self.await_room(stream)

        return reply


def leave(master: str, names: list[str]) -> None:
    """Remove all that nodes of these names have registered, as far as the master lets it be."""
    with contextlib.suppress(HostFailure):
        publishers, subscribers, services = ask(master, "getSystemState", "/parcours")
        uris = dict(zip(names, ask_all(master, [("lookupNode", ("/parcours", name)) for name in names]), strict=True))
        calls: list[tuple[str, tuple[object, ...]]] = []
        for method, state in (("unregisterPublisher", publishers), ("unregisterSubscriber", subscribers)):
            calls += [(method, (who, topic, uris[who])) for topic, all_ in state for who in all_ if uris.get(who)]
        held = [(service, who) for service, all_ in services for who in all_ if who in uris]
        where = ask_all(master, [("lookupService", ("/parcours", service)) for service, _ in held])
        calls += [("unregisterService", (who, service, at)) for (service, who), at in zip(held, where, strict=True)]
        ask_all(master, calls)


def _header(name: str, kind: Kind) -> dict[str, str]:
    header = {"callerid": name, "type": kind.type, "md5sum": kind.md5sum}
    return header | {"message_definition": kind.definition} if kind.definition else header


def _named(header: dict[str, str]) -> str:
    return f"{header.get('type', 'something')}, md5 {header.get('md5sum', 'unknown')}"


def _opened(host: str, port: int, header: dict[str, str]) -> tuple[socket.socket, dict[str, str]]:
    """Return a connection after both headers. Raises HostFailure."""
    try:
        connection = socket.create_connection((host, port), WITHIN)
    except OSError as error:
        raise HostFailure(f"ROS 1 node at {host}:{port}", f"must be reachable, but: {error.strerror or error}",
                          slug="ros1-header") from error  # fmt: skip
    try:
        write_header(connection, header)
        told = read_header(connection)
    except (OSError, HostFailure):
        connection.close()
        raise
    if "error" in told:
        connection.close()
        raise HostFailure(f"ROS 1 node at {host}:{port}", f"declines: {told['error']}", slug="ros1-header")
    return connection, told

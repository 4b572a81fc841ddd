"""The ends of a graph of others: a topic said or heard, a service served or called, each with what it carries."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol
from urllib.parse import urlsplit

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.streams import ANSWERED, Stream, read_header, write_header

ANY = "*"

Reply = Callable[[bytes | None], None]
"""Answers a request with bytes, or refuses it with None; each once, later, too."""

Answered = Callable[[bytes | None, str], None]
"""Gets the response of a call, or None and why there is none."""

_MOST_CALLS = 64
"""So many calls of one service are open at once."""

WITHIN = 2.0
"""So long a connection may take to be made [s]."""


class Owner(Protocol):
    """The name on the graph to which ends belong."""

    name: str
    master: str

    def attend(self, stream: Stream, heard: Callable[[bytes, bytes], None], lost: Callable[[], None]) -> None:
        """Hear the stream."""

    def await_room(self, stream: Stream) -> None:
        """See to it that the stream sends on what waits."""

    def drop(self, stream: Stream) -> None:
        """Close the stream."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a topic or service carries: `package/Type`, its md5 sum and, of a topic, its full definition."""

    type: str
    md5: str
    definition: str = ""

    def agrees(self, header: Mapping[str, str]) -> bool:
        """Whether another end, by its header, carries the same."""
        theirs, mine = header.get("md5sum", ANY), self.md5
        return ANY in (theirs, mine) or theirs == mine

    def fields(self) -> dict[str, str]:
        """The header's fields."""
        told = {"type": self.type, "md5sum": self.md5}
        return told | ({"message_definition": self.definition} if self.definition else {})


class Publisher:
    """A topic that the tester publishes.

    Args:
        queue: so many messages wait for a reader that is slow; later ones are lost to it.
        latch: whether the last message is given to those who come later.
    """

    def __init__(self, owner: Owner, topic: str, kind: Kind, queue: int, latch: bool) -> None:
        self.topic, self.kind, self.latch = topic, kind, latch
        self._owner, self._queue = owner, queue
        self._lock = threading.Lock()
        self._last: bytes | None = None
        self._streams: dict[Stream, int] = {}

    def say(self, data: bytes) -> int:
        """Publish; return how many readers it was not handed to, since they do not keep up."""
        with self._lock:
            self._last = data if self.latch else None
            streams = list(self._streams)
        lost = 0
        for stream in streams:
            waiting = self._streams.get(stream, 0) if stream.waits else 0
            if waiting >= self._queue:
                lost += 1
                continue
            stream.send(data)
            self._streams[stream] = waiting + 1
            if stream.waits:
                self._owner.await_room(stream)
        return lost

    def join(self, connection: socket.socket, header: Mapping[str, str]) -> Stream:
        """Let somebody listen."""
        with self._lock:
            told = self.kind.fields() | {"topic": self.topic, "latching": "1" if self.latch else "0"}
            write_header(connection, {"callerid": self._owner.name, **told})
            stream = Stream(connection, header.get("callerid", "?"))
            self._streams[stream] = 0
            if self._last is not None:
                stream.send(self._last)
                if stream.waits:
                    self._owner.await_room(stream)
        return stream

    def leave(self, stream: Stream) -> None:
        """Forget somebody who listened."""
        with self._lock:
            self._streams.pop(stream, None)

    def forget(self) -> None:
        """Give nothing to those who come later."""
        with self._lock:
            self._last = None

    @property
    def peers(self) -> set[str]:
        """Who listens."""
        return {stream.peer for stream in list(self._streams)}


@dataclass(eq=False, slots=True)
class Subscriber:
    """A topic that the tester hears, of whoever publishes it. `heard` gets the publisher and the message.

    Attributes:
        publishers: the addresses that the master told last.
        streams: by the publisher's address.
    """

    topic: str
    kind: Kind
    heard: Callable[[str, bytes], None]
    joined: Callable[[Kind], None] = lambda kind: None
    publishers: frozenset[str] = frozenset()
    streams: dict[str, Stream] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def peers(self) -> set[str]:
        """Whose messages are heard."""
        return {stream.peer for stream in list(self.streams.values())}


@dataclass(eq=False, slots=True)
class ServiceServer:
    """A service that the tester serves. `asked` gets the client, the request and what answers it."""

    service: str
    kind: Kind
    asked: Callable[[str, bytes, Reply], None]


class Caller:
    """A service that the tester calls: lasting connections, as many as calls are open; one that broke is made anew."""

    def __init__(self, owner: Owner, service: str, kind: Kind) -> None:
        self.service, self.kind, self._owner = service, kind, owner
        self._idle: list[Stream] = []
        self._open: dict[Stream, Answered] = {}

    def ask(self, data: bytes, answered: Answered) -> None:
        """Send a request; `answered` gets the response, or None and why there is none. Never raises."""
        while self._idle:
            stream = self._idle.pop()
            if not stream.closed:
                self._send(stream, data, answered)
                return
        if len(self._open) >= _MOST_CALLS:
            answered(None, f"{_MOST_CALLS} calls are open already")
            return
        try:
            stream = self._connected()
        except HostFailure as failure:
            answered(None, failure.rule)
            return
        self._send(stream, data, answered)

    def connect(self) -> None:
        """Have one connection ready. Raises HostFailure if nobody serves it, or another type."""
        if not self._idle and not self._open:
            self._idle.append(self._connected())

    def _connected(self) -> Stream:
        address = ask(self._owner.master, "lookupService", self._owner.name, self.service, within=WITHIN)
        host, port = endpoint(str(address))
        header = {"callerid": self._owner.name, "service": self.service, "persistent": "1", "md5sum": self.kind.md5}
        connection, told = opened(host, port, header)
        stream = Stream(connection, told.get("callerid", "?"), answers=True)
        self._owner.attend(stream, lambda mark, answer: self._answered(stream, mark, answer),
                           lambda: self._lost(stream))  # fmt: skip
        return stream

    def _send(self, stream: Stream, data: bytes, answered: Answered) -> None:
        self._open[stream] = answered
        stream.send(data)
        if stream.waits:
            self._owner.await_room(stream)

    def _answered(self, stream: Stream, mark: bytes, data: bytes) -> None:
        answered = self._open.pop(stream, None)
        self._idle.append(stream)
        if answered is not None:
            answered(*((data, "") if mark == ANSWERED else (None, f"refused: {data.decode(errors='replace')[:200]}")))

    def _lost(self, stream: Stream) -> None:
        if stream in self._idle:
            self._idle.remove(stream)
        answered = self._open.pop(stream, None)
        if answered is not None:
            answered(None, "the server closed the connection")

    def abandon(self, answered: Answered) -> None:
        """Wait no longer for a response: close its connection."""
        for stream, waiting in list(self._open.items()):
            if waiting is answered:
                del self._open[stream]
                self._owner.drop(stream)


def opened(host: str, port: int, header: Mapping[str, str]) -> tuple[socket.socket, dict[str, str]]:
    """Return a connection after both headers.

    Raises:
        HostFailure: nobody is there, or it declines.
    """
    try:
        connection = socket.create_connection((host, port), WITHIN)
        connection.settimeout(WITHIN)
    except OSError as error:
        raise HostFailure(f"ROS 1 node at {host}:{port}", f"must be reachable, but: {error.strerror or error}",
                          slug="ros1-header") from error  # fmt: skip
    try:
        write_header(connection, header)
        told = read_header(connection)
    except (OSError, HostFailure) as error:
        connection.close()
        raise HostFailure(f"ROS 1 node at {host}:{port}", f"must answer with a header, but: {error}",
                          slug="ros1-header") from error  # fmt: skip
    if "error" in told:
        connection.close()
        raise HostFailure(f"ROS 1 node at {host}:{port}", f"declines: {told['error']}", slug="ros1-header")
    return connection, told


def probed(owner: str, master: str, service: str) -> dict[str, str]:
    """Return what a service says of itself: `type`, `md5sum`, `callerid`. Raises HostFailure if nobody serves it."""
    host, port = endpoint(str(ask(master, "lookupService", owner, service, within=WITHIN)))
    header = {"callerid": owner, "service": service, "md5sum": ANY, "probe": "1"}
    connection, told = opened(host, port, header)
    connection.close()
    return told


def endpoint(address: str) -> tuple[str, int]:
    """Return host and port of rosrpc://host:port. Raises HostFailure if it is none."""
    parts = urlsplit(address)
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or not port:
        raise HostFailure(f"ROS 1 service at {address!r:.80}", "must have an address", slug="ros1-header")
    return host, port

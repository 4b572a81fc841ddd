"""The ends of topics and services that a name on a ROS 1 graph has: messages as bytes, out and in."""

from __future__ import annotations

import socket
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from parcours.errors import HostFailure
from parcours.run.hosts.graph_line import Answered, Reply
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.streams import ANSWERED, Stream, read_header, write_header

if TYPE_CHECKING:
    from parcours.run.hosts.ros1.client import Ros1Node

ANY = "*"
"""As a type or an md5 sum: any."""

WITHIN = 2.0
"""How long a connection may take to be made [s]."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a topic or service carries: `package/Type`, its md5 sum and, of a topic, its full definition."""

    type: str
    md5: str
    definition: str = ""

    def agrees(self, header: Mapping[str, str]) -> bool:
        """Return whether another end, by its header, carries the same.

        >>> Kind("a/B", "12").agrees({"md5sum": "12"}), Kind("a/B", "12").agrees({"md5sum": "13"})
        (True, False)
        """
        theirs = header.get("md5sum", ANY)
        return ANY in (theirs, self.md5) or theirs == self.md5

    def fields(self) -> dict[str, str]:
        """Return the fields of a connection's header."""
        fields = {"type": self.type, "md5sum": self.md5}
        return fields | ({"message_definition": self.definition} if self.definition else {})


class Ros1Publisher:
    """A topic that is published.

    Args:
        owner: the name that publishes.
        topic: where.
        kind: of its messages.
        queue: how many messages wait for a slow reader; later ones are lost to it.
        latch: whether the last message is given to those who come later.
        reader: name of the reader that misses nothing, however slow.
    """

    def __init__(self, owner: Ros1Node, topic: str, kind: Kind, queue: int, latch: bool, reader: str) -> None:
        self.topic, self.kind, self.latch = topic, kind, latch
        self._owner, self._queue, self._reader = owner, queue, reader
        self._lock = threading.Lock()
        self._last: bytes | None = None
        self._waiting: dict[Stream, int] = {}

    def send(self, *messages: bytes) -> int:
        """Publish; return how many readers do not keep up, and have not got the messages."""
        with self._lock:
            self._last = messages[-1] if self.latch else None
            streams = list(self._waiting)
        lost = 0
        for stream in streams:
            waiting = self._waiting.get(stream, 0) if stream.waits else 0
            if waiting >= self._queue and stream.peer != self._reader:
                lost += 1
                continue
            self._waiting[stream] = waiting + len(messages)
            self._owner.send(stream, *messages)
        return lost

    def admit(self, connection: socket.socket, peer: str) -> None:
        """Let a reader listen."""
        with self._lock:  # nothing is published between the header and the first message that it gets
            header = self.kind.fields() | {"topic": self.topic, "latching": "1" if self.latch else "0"}
            write_header(connection, {"callerid": self._owner.name, **header})
            stream = Stream(connection, peer)
            self._waiting[stream] = 0
            if self._last is not None:
                stream.send(self._last)
        self._owner.attend(stream, lambda mark, data: None, lambda: self._forget(stream))

    def _forget(self, stream: Stream) -> None:
        with self._lock:
            self._waiting.pop(stream, None)

    def forget_last(self) -> None:
        """Give nothing to those who come later."""
        with self._lock:
            self._last = None

    @property
    def peers(self) -> set[str]:
        """The names of the readers."""
        return {stream.peer for stream in list(self._waiting)}

    @property
    def is_matched(self) -> bool:
        """Whether the reader that misses nothing is there, or any if none is named."""
        return self._reader in self.peers if self._reader else bool(self._waiting)


@dataclass(eq=False, slots=True)
class Subscriber:
    """A topic that is heard.

    Attributes:
        sender: name of the only publisher that is heard; all are if it is empty.
        heard: called with each message.
        joined: called, in any thread, with what each publisher says it carries.
        lost: called when a publisher has gone.
        publishers: their addresses, as the master listed them last.
        streams: by the publisher's address.
    """

    topic: str
    kind: Kind
    sender: str
    heard: Callable[[bytes], None]
    joined: Callable[[Kind], None]
    lost: Callable[[], None]
    publishers: frozenset[str] = frozenset()
    streams: dict[str, Stream] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def peers(self) -> set[str]:
        """The names of the publishers that are heard."""
        return {stream.peer for stream in list(self.streams.values())}

    @property
    def is_matched(self) -> bool:
        """Whether a publisher is heard."""
        return bool(self.streams)

    def is_heard(self, uri: str) -> bool:
        """Return whether the publisher at this address is heard."""
        known = self.streams.get(uri)
        return known is not None and not known.closed


@dataclass(frozen=True, slots=True)
class Server:
    """A service that is served, to one client only if `client` is its name; `asked` gets each request and its reply."""

    service: str
    kind: Kind
    asked: Callable[[bytes, Reply], None]
    client: str


class Ros1Client:
    """A service that is called over lasting connections; one that broke is made again.

    Args:
        owner: the name that calls.
        service: which.
        kind: of its requests and responses.
        lanes: how many connections are open at once, each with one call. Over a single one, calls follow each other
            without waiting, so that requests and responses keep their order.
    """

    def __init__(self, owner: Ros1Node, service: str, kind: Kind, lanes: int) -> None:
        self._owner, self._service, self._kind, self._lanes = owner, service, kind, lanes
        self._open: dict[Stream, deque[Answered]] = {}

    def ask(self, data: bytes, answered: Answered) -> None:
        """Send a request; `answered` gets the response, or None and why there is no response. Never raises."""
        living = {stream: waiting for stream, waiting in self._open.items() if not stream.closed}
        stream = next((stream for stream, waiting in living.items() if not waiting), None)
        if stream is None and len(living) < self._lanes:
            try:
                stream = self._connected()
            except HostFailure as failure:
                answered(None, failure.rule)
                return
        elif stream is None and self._lanes == 1:
            (stream,) = living
        if stream is None:
            answered(None, f"{self._lanes} calls are open already")
            return
        self._open[stream].append(answered)
        self._owner.send(stream, data)

    def connect(self) -> None:
        """Have one connection ready. Raises HostFailure if it is not served, or with another type."""
        if all(stream.closed for stream in self._open):
            self._connected()

    @property
    def is_matched(self) -> bool:
        """Whether a server is connected, after trying."""
        try:
            self.connect()
        except HostFailure:
            return False
        return True

    def _connected(self) -> Stream:
        header = self._kind.fields() | {"service": self._service, "persistent": "1"}
        connection, theirs = called(self._owner.name, self._owner.master, header)
        stream = Stream(connection, theirs.get("callerid", "?"), answers=True)
        self._open[stream] = deque()
        self._owner.attend(stream, lambda mark, answer: self._answered(stream, mark, answer),
                           lambda: self._lost(stream))  # fmt: skip
        return stream

    def _answered(self, stream: Stream, mark: bytes, data: bytes) -> None:
        if waiting := self._open.get(stream):
            refused = f"refused: {data.decode(errors='replace')[:200]}"
            waiting.popleft()(*((data, "") if mark == ANSWERED else (None, refused)))

    def _lost(self, stream: Stream) -> None:
        for answered in self._open.pop(stream, ()):
            answered(None, "the server closed the connection")

    def abandon(self, answered: Answered) -> None:
        """Wait no longer for a response: close its connection."""
        for stream, waiting in list(self._open.items()):
            if any(one is answered for one in waiting):
                del self._open[stream]
                self._owner.drop(stream)


def called(owner: str, master: str, header: Mapping[str, str]) -> tuple[socket.socket, dict[str, str]]:
    """Return a connection to the service that the header names, and the server's header. Raises HostFailure."""
    address = str(ask(master, "lookupService", owner, header["service"], within=WITHIN))
    parts = urlsplit(address)
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or not port:
        raise HostFailure(f"ROS 1 service at {address!r:.80}", "must have an address", slug="ros1-header")
    return opened(host, port, {"callerid": owner, **header})


def opened(host: str, port: int, header: Mapping[str, str]) -> tuple[socket.socket, dict[str, str]]:
    """Return a connection after both headers, and the other end's. Raises HostFailure if it is absent or declines."""
    where = f"ROS 1 node at {host}:{port}"
    try:
        connection = socket.create_connection((host, port), WITHIN)
    except OSError as error:
        rule = f"must be reachable, but: {error.strerror or error}"
        raise HostFailure(where, rule, slug="ros1-header") from error
    try:
        write_header(connection, header)
        theirs = read_header(connection)
    except (OSError, HostFailure) as error:
        connection.close()
        raise HostFailure(where, f"must answer with a header, but: {error}", slug="ros1-header") from error
    if "error" in theirs:
        connection.close()
        raise HostFailure(where, f"declines: {theirs['error']}", slug="ros1-header")
    return connection, theirs

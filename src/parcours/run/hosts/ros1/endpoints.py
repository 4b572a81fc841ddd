"""What a node of a ROS 1 graph has at its end of a topic or a service: messages as bytes, out and in."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.graph import WITHIN, ask
from parcours.run.hosts.ros1.streams import ANSWERED, REFUSED, Stream, read_header, write_header

ANY = "*"
"""As a type or an md5 sum: whatever it is."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a topic or a service carries: `package/Type`, its md5 sum and, of a topic, the .msg file's text."""

    type: str
    md5sum: str
    definition: str = ""

    def fits(self, header: dict[str, str]) -> bool:
        """Whether another end means the same.

        >>> Kind("a/B", "12").fits({"md5sum": "12", "type": "*"}), Kind("a/B", "12").fits({"md5sum": "13"})
        (True, False)
        """
        return header.get("md5sum") in (ANY, self.md5sum) and header.get("type", ANY) in (ANY, self.type)


class Owner(Protocol):
    """Whose ends they are."""

    @property
    def name(self) -> str:
        """Its name on the graph."""

    @property
    def master(self) -> str:
        """The graph's address."""

    def watch(self, stream: Stream, heard: Callable[[bytes], None] | None, lost: Callable[[], None]) -> None:
        """Call `heard` with what comes; without it, only look after the stream."""

    def await_room(self, stream: Stream) -> None:
        """See to it that what waits is sent on."""


class Publication:
    """A topic that is published. Of its readers `reader` misses nothing; others do if they are slow."""

    def __init__(self, owner: Owner, topic: str, kind: Kind, reader: str) -> None:
        self.topic, self.kind, self._owner, self._reader = topic, kind, owner, reader
        self._lock = threading.Lock()
        self._streams: tuple[Stream, ...] = ()

    def send(self, *messages: bytes) -> None:
        """Publish."""
        with self._lock:
            streams = self._streams
        for stream in streams:
            if not stream.waits or stream.peer == self._reader:
                stream.send(*messages)
                if stream.waits:
                    self._owner.await_room(stream)

    def admit(self, connection: socket.socket, header: dict[str, str]) -> None:
        """Let somebody listen."""
        with self._lock:  # nothing is published between the header and the first message that it gets
            write_header(connection, header_of(self._owner, self.kind) | {"topic": self.topic, "latching": "0"})
            stream = Stream(connection, header["callerid"])
            self._streams += (stream,)
        self._owner.watch(stream, lambda data: None, lambda: self._forget(stream))

    def _forget(self, stream: Stream) -> None:
        with self._lock:
            self._streams = tuple(one for one in self._streams if one is not stream)

    @property
    def peers(self) -> set[str]:
        """Who listens."""
        return {stream.peer for stream in self._streams}


@dataclass(eq=False, slots=True)
class Subscription:
    """A topic that is heard, of `sender` only.

    Attributes:
        heard: called with each message; if None, messages wait until they are taken.
        lost: called when the sender has gone.
        streams: by the sender's address.
    """

    topic: str
    kind: Kind
    sender: str
    heard: Callable[[bytes], None] | None
    lost: Callable[[], None]
    streams: dict[str, Stream] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def take(self, until: int | None) -> bytes | None:
        """Return the next message; None if there is none at `until` [ns]."""
        for stream in self.streams.values():
            arrival = stream.take(until)
            if arrival is not None:
                return arrival[1]
        return None


class Server:
    """A service that is served, to `client` only, over its lasting connection. Requests wait until they are taken.

    Requests and answers are told apart by their order alone, so answers may be given later.
    """

    def __init__(self, owner: Owner, service: str, kind: Kind, client: str) -> None:
        self.service, self.kind, self.client, self._owner = service, kind, client, owner
        self._admission = threading.Condition()
        self._stream: Stream | None = None

    def take(self, until: int | None) -> bytes | None:
        """Return the next request; None if there is none at `until` [ns]. Requests without content are skipped.

        A client that says elsewhere that it has asked may still be on its way in.
        """
        with self._admission:
            within = WITHIN if until is None else min(WITHIN, (until - time.perf_counter_ns()) * 1e-9)
            self._admission.wait_for(lambda: self._stream is not None, within)
            stream = self._stream
        while stream is not None:
            arrival = stream.take(until)
            if arrival is None or arrival[1]:
                return None if arrival is None else arrival[1]
        return None

    def answer(self, data: bytes | None) -> None:
        """Answer the oldest request that is not answered; None refuses it."""
        with self._admission:
            stream = self._stream
        if stream is not None:
            if data is None:
                stream.send(b"not answered", mark=REFUSED)
            else:
                stream.send(data, mark=ANSWERED)
            if stream.waits:
                self._owner.await_room(stream)

    def admit(self, connection: socket.socket, header: dict[str, str]) -> None:
        """Let the client in; one that comes again takes its own place."""
        with self._admission:  # who has read the header may ask, and is then heard
            write_header(connection, header_of(self._owner, self.kind) | {"service": self.service})
            stream = self._stream = Stream(connection, header["callerid"])
            self._admission.notify_all()
        self._owner.watch(stream, None, lambda: None)


class Caller:
    """A client of a service over one lasting connection, which is made anew if it breaks."""

    def __init__(self, owner: Owner, service: str, kind: Kind) -> None:
        self.service, self.kind, self._owner = service, kind, owner
        self._stream: Stream | None = None

    def connect(self) -> None:
        """Find the server. Raises HostFailure if there is none, or it declines."""
        address = ask(self._owner.master, "lookupService", self._owner.name, self.service)
        header = header_of(self._owner, self.kind) | {"service": self.service, "persistent": "1"}
        host, _, port = address.removeprefix("rosrpc://").rstrip("/").partition(":")
        connection, told = opened(host, int(port), header)
        self._stream = Stream(connection, told.get("callerid", "?"), answers=True)
        self._owner.watch(self._stream, None, lambda: None)

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

    def take(self, until: int | None) -> bytes | None:
        """Return the next answer; None if there is none at `until` [ns]. Refusals are skipped."""
        while self._stream is not None:
            arrival = self._stream.take(until)
            if arrival is None or arrival[0] == ANSWERED:
                return None if arrival is None else arrival[1]
        return None


def header_of(owner: Owner, kind: Kind) -> dict[str, str]:
    """Return the fields with which every connection begins."""
    header = {"callerid": owner.name, "type": kind.type, "md5sum": kind.md5sum}
    return header | {"message_definition": kind.definition} if kind.definition else header


def opened(host: str, port: int, header: dict[str, str]) -> tuple[socket.socket, dict[str, str]]:
    """Return a connection after both headers, and the other end's. Raises HostFailure if it is not let in."""
    where = f"ROS 1 node at {host}:{port}"
    try:
        connection = socket.create_connection((host, port), WITHIN)
    except OSError as error:
        rule = f"must be reachable, but: {error.strerror or error}"
        raise HostFailure(where, rule, slug="ros1-header") from error
    try:
        write_header(connection, header)
        told = read_header(connection)
        if "error" in told:
            raise HostFailure(where, f"declines: {told['error']}", slug="ros1-header")
    except (OSError, HostFailure):
        connection.close()
        raise
    return connection, told

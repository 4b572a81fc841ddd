"""TCPROS sockets <-> messages as bytes: a header of key=value fields each way, then a length and so many bytes.

`Stream` never blocks the thread that uses it: who reads slowly, or is frozen, is waited for by a queue.
"""

from __future__ import annotations

import select
import socket
import struct
import time
from collections import deque
from collections.abc import Mapping

from parcours.errors import HostFailure

Header = Mapping[str, str]

Arrival = tuple[bytes, bytes]
"""A mark and a message."""

_LENGTH = struct.Struct("<I")
_CHUNK = 1 << 16
_MOST = 1 << 26
_LONGEST_HEADER = 1 << 20
REFUSED, ANSWERED = b"\0", b"\1"
"""What a server's answer begins with."""


def write_header(connection: socket.socket, header: Header) -> None:
    """Send a header."""
    fields = [f"{key}={value}".encode() for key, value in header.items()]
    body = b"".join(_LENGTH.pack(len(field)) + field for field in fields)
    connection.sendall(_LENGTH.pack(len(body)) + body)


def read_header(connection: socket.socket) -> dict[str, str]:
    """Return the header that the other end sends.

    Raises:
        HostFailure: it sends something else, or nothing within the socket's timeout.
    """
    try:
        (size,) = _LENGTH.unpack(_exactly(connection, _LENGTH.size))
        if size > _LONGEST_HEADER:
            raise ValueError(f"{size} bytes")
        body = _exactly(connection, size)
        header: dict[str, str] = {}
        at = 0
        while at < size:
            (length,) = _LENGTH.unpack_from(body, at)
            at += _LENGTH.size + length
            key, equals, value = body[at - length : at].decode().partition("=")
            if at > size or not equals:
                raise ValueError(f"field {key!r:.40}")
            header[key] = value
    except (OSError, EOFError, struct.error, ValueError) as error:
        raise HostFailure("ROS 1 connection", f"begins with a header, but: {str(error) or 'it ended'}",
                          slug="ros1-header") from error  # fmt: skip
    return header


def _exactly(connection: socket.socket, n: int) -> bytes:
    data = b""
    while len(data) < n:
        chunk = connection.recv(n - len(data))
        if not chunk:
            raise EOFError
        data += chunk
    return data


class Stream:
    """A connection whose headers have been exchanged.

    Args:
        connection: it is closed with the stream.
        peer: the name of the node at the other end.
        answers: whether what arrives are a server's answers, which begin with a byte of their own.
    """

    def __init__(self, connection: socket.socket, peer: str, *, answers: bool = False) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.peer = peer
        self._socket = connection
        self._mark = 1 if answers else 0
        self._incoming = bytearray()
        self._outgoing: deque[memoryview] = deque()
        self.arrived: deque[Arrival] = deque()
        """What has been let in."""
        self.closed = False
        """Whether the other end has gone."""

    def fileno(self) -> int:
        """The file descriptor; -1 once closed."""
        return self._socket.fileno()

    @property
    def waits(self) -> bool:
        """Whether something is still to be sent."""
        return bool(self._outgoing)

    def send(self, *messages: bytes, mark: bytes = b"") -> None:
        """Send messages now as far as there is room, the rest with `flush`. `mark` is a server's first byte."""
        whole = b"".join([part for one in messages for part in (mark, _LENGTH.pack(len(one)), one)])
        if self._outgoing:
            self._outgoing.append(memoryview(whole))
            return
        try:
            sent = self._socket.send(whole)
        except BlockingIOError:
            sent = 0
        except OSError:
            self.closed = True
            return
        if sent < len(whole):
            self._outgoing.append(memoryview(whole)[sent:])

    def flush(self, *, wait: bool = False) -> None:
        """Send on what is still to be sent; `wait` until all is."""
        while self._outgoing and not self.closed:
            try:
                part = self._outgoing[0]
                sent = self._socket.send(part)
                if sent < len(part):
                    self._outgoing[0] = part[sent:]
                else:
                    self._outgoing.popleft()
            except BlockingIOError:
                if not wait:
                    return
                select.select([], [self._socket], [])
            except OSError:
                self.closed = True
        if self.closed:
            self._outgoing.clear()

    def take(self, until: int | None = 0) -> Arrival | None:
        """Return the next message, with its mark, which is empty except of answers.

        None if none has come whole when the monotonic clock shows `until` [ns] (None waits for ever), or ever will.
        """
        while not self.arrived:
            self.read()
            if self.arrived:
                break
            left = None if until is None else (until - time.perf_counter_ns()) * 1e-9
            if self.closed or (left is not None and left <= 0):
                return None
            select.select([self._socket], [], [], left)
        return self.arrived.popleft()

    def messages(self) -> list[Arrival]:
        """Return all that has come whole, without waiting."""
        self.read()
        there = list(self.arrived)
        self.arrived.clear()
        return there

    def read(self) -> None:
        """Let in what has come."""
        try:
            while not self.closed:
                chunk = self._socket.recv(_CHUNK)
                self._incoming += chunk
                if not chunk:
                    self.closed = True
                if len(chunk) < _CHUNK:
                    break
        except BlockingIOError:
            pass
        except OSError:
            self.closed = True
        self._cut()

    def _cut(self) -> None:
        buffer, mark, at = memoryview(self._incoming), self._mark, 0
        while len(buffer) - at >= mark + _LENGTH.size:
            (size,) = _LENGTH.unpack_from(buffer, at + mark)
            if size > _MOST:
                self.closed = True
                break
            end = at + mark + _LENGTH.size + size
            if len(buffer) < end:
                break
            self.arrived.append((bytes(buffer[at : at + mark]), bytes(buffer[end - size : end])))
            at = end
        buffer.release()
        del self._incoming[:at]

    def close(self) -> None:
        """Let go of the socket. Again: do nothing."""
        self.closed = True
        self._socket.close()

"""Accepts TCPROS connections, and exchanges the headers with which they start: fields key=value after their length."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Callable, Mapping

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.graph import LOOPBACK
from parcours.run.hosts.sockets import FrameSocket

_LENGTH = struct.Struct("<I")
_LONGEST_HEADER = 1 << 20
_PATIENCE = 10.0
"""How long the other end of a connection may take to send its header [s]."""

REFUSED, ANSWERED = b"\0", b"\1"
"""What stands before a server's answer."""


class Stream(FrameSocket):
    """A connection whose headers have been exchanged."""

    def __init__(self, connection: socket.socket, peer: str, *, answers: bool = False) -> None:
        super().__init__(connection, marked=answers)
        self.peer = peer


def write_header(connection: socket.socket, header: Mapping[str, str]) -> None:
    """Send a header."""
    fields = [f"{key}={value}".encode() for key, value in header.items()]
    body = b"".join(_LENGTH.pack(len(field)) + field for field in fields)
    connection.sendall(_LENGTH.pack(len(body)) + body)


def read_header(connection: socket.socket) -> dict[str, str]:
    """Return the header that the other end sends.

    Raises HostFailure if it sends something else, or nothing within the socket's timeout.
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


class Doorway:
    """Where other nodes connect, on loopback; each is let in, or not, in a thread of its own."""

    def __init__(self, admit: Callable[[socket.socket, Mapping[str, str]], str],
                 refused: Callable[[str], None]) -> None:  # fmt: skip
        self._admit, self._refused = admit, refused
        self._socket = socket.create_server((LOOPBACK, 0))
        self.port: int = self._socket.getsockname()[1]
        self._doorman = threading.Thread(target=self._receive, daemon=True, name="ros1-door")
        self._doorman.start()

    def close(self) -> None:
        """Accept no more."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._doorman.join()
        self._socket.close()

    def _receive(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._welcome, args=(connection,), daemon=True, name="ros1-welcome").start()

    def _welcome(self, connection: socket.socket) -> None:
        connection.settimeout(_PATIENCE)
        with contextlib.suppress(OSError):
            try:
                complaint = self._admit(connection, read_header(connection))
            except HostFailure as failure:
                complaint = str(failure)
            if complaint:
                self._refused(complaint)
                with contextlib.suppress(OSError):
                    write_header(connection, {"error": complaint})
                connection.close()

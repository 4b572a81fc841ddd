"""Reads and writes the headers with which TCPROS connections start: fields key=value, each after its length."""

from __future__ import annotations

import socket
import struct
from collections.abc import Mapping

from parcours.errors import HostFailure
from parcours.run.hosts.sockets import FrameSocket

_LENGTH = struct.Struct("<I")
_LONGEST_HEADER = 1 << 20
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

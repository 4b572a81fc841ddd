"""Sends and receives frames on a stream socket without ever blocking the tester.

A frame is its length and its bytes. A node may be frozen for as long as a test wants: what is meant for it waits here.
"""

from __future__ import annotations

import select
import socket
import struct
import time
from collections import deque

from parcours.errors import HostFailure

_LENGTH = struct.Struct("<I")
_MOST = 64 * 1024 * 1024
"""The largest frame [bytes]; a length beyond ends the connection."""

_BUFFER = 1 << 22
_CHUNK = 1 << 16


class FrameSocket:
    """One end of a connection. `fileno` lets one thread wait for many.

    Args:
        connection: closed with this object.
        marked: whether a byte stands before the length of each frame that arrives, as in answers of ROS 1 services.
    """

    def __init__(self, connection: socket.socket, *, marked: bool = False) -> None:
        connection.setblocking(False)
        if connection.family == socket.AF_UNIX:
            for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
                connection.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
        else:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connection
        self._n_marks = int(marked)
        self._incoming = bytearray()
        self._outgoing: deque[memoryview] = deque()
        self._readable = select.poll()
        self._readable.register(connection, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(connection, select.POLLOUT)
        self.closed = False
        """Whether the other end has gone."""

    def fileno(self) -> int:
        """The file descriptor; -1 once closed."""
        return self._socket.fileno()

    @property
    def waits(self) -> bool:
        """Whether something is still to be sent."""
        return bool(self._outgoing)

    def send(self, *frames: bytes, mark: bytes = b"", wait: bool = False) -> None:
        """Send frames now, as far as the other end has room; the rest with `flush`, unless `wait` is true.

        Raises HostFailure if a frame is larger than any that is read.
        """
        for frame in frames:
            if len(frame) > _MOST:
                rule = f"a frame has at most {_MOST >> 20} MiB, but this one has {len(frame)} bytes"
                raise HostFailure("node", rule, "send less at once", slug="frame-size")
        whole = b"".join([part for frame in frames for part in (mark, _LENGTH.pack(len(frame)), frame)])
        self._outgoing.append(memoryview(whole))
        self.flush(wait=wait)

    # Frames wait in a deque of memoryviews, so that what is sent in parts is never copied:
    #
    #   send ─► [ rest of 1 | 2 | 3 ] ─► socket ─► kernel buffer ─► other end
    #            grows while the other end is frozen; `waits` lets the tester select for room

    def flush(self, *, wait: bool = False) -> None:
        """Send what is still to be sent, as far as there is room; with `wait`, block until all has left."""
        while self._outgoing and not self.closed:
            part = self._outgoing[0]
            try:
                sent = self._socket.send(part)
            except BlockingIOError:
                if not wait:
                    return
                self._writable.poll()
            except OSError:
                self.closed = True
            else:
                if sent == len(part):
                    self._outgoing.popleft()
                else:
                    self._outgoing[0] = part[sent:]
        if self.closed:
            self._outgoing.clear()

    def frames(self) -> list[bytes]:
        """Return frames that have arrived, without waiting. Of one that floods, not all at once: others wait, too."""
        return [frame for _, frame in self.marked_frames()]

    def marked_frames(self) -> list[tuple[bytes, bytes]]:
        """Return the same, each with the mark before it, which is empty unless the connection has marks."""
        try:
            chunk = self._socket.recv(_CHUNK)
        except BlockingIOError:
            return []
        except OSError:
            chunk = b""
        self.closed = self.closed or not chunk
        self._incoming += chunk
        return self._cut()

    def _cut(self) -> list[tuple[bytes, bytes]]:
        whole: list[tuple[bytes, bytes]] = []
        buffer, at, head = self._incoming, 0, self._n_marks + _LENGTH.size
        while len(buffer) - at >= head:
            (size,) = _LENGTH.unpack_from(buffer, at + self._n_marks)
            if size > _MOST:
                self.closed = True
                break
            end = at + head + size
            if len(buffer) < end:
                break
            whole.append((bytes(buffer[at : at + self._n_marks]), bytes(buffer[at + head : end])))
            at = end
        del buffer[:at]
        return whole

    def wait(self, until: int | None) -> None:
        """Return once something has arrived, or the monotonic clock shows `until` [ns]; None waits without limit."""
        if until is None:
            self._readable.poll()
        else:
            select.select([self._socket], [], [], max(0, until - time.perf_counter_ns()) * 1e-9)

    def close(self) -> None:
        """Close the socket. Again: do nothing."""
        self._socket.close()
        self.closed = True

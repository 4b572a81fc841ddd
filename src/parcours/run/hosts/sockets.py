"""Frames <-> a Unix stream socket: a length and so many bytes, never blocking the tester.

A node may be frozen for as long as a test wants; what is meant for it waits here meanwhile.
"""

from __future__ import annotations

import select
import socket
import time
from collections import deque

from parcours.errors import HostFailure

_LENGTH = 4
_MOST = 64 * 1024 * 1024
"""No frame is larger [bytes]; a length beyond is none."""

_BUFFER = 1 << 22
_CHUNK = 1 << 16


class FrameSocket:
    """One end of a connection. `fileno` lets many be waited for at once."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._socket.setblocking(False)
        for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            self._socket.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
        self._incoming = bytearray()
        self._outgoing: deque[memoryview] = deque()
        self._readable = select.poll()
        self._readable.register(connection, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(connection, select.POLLOUT)
        self.closed = False
        """Whether the other end has gone."""

    def fileno(self) -> int:
        """The file descriptor."""
        return self._socket.fileno()

    @property
    def waits(self) -> bool:
        """Whether something is still to be sent."""
        return bool(self._outgoing)

    def send(self, frame: bytes, *, wait: bool = False) -> None:
        """Send a frame now, as far as the other end has room; the rest with `flush`, unless told to `wait`.

        Raises:
            HostFailure: the frame is larger than any that is read.
        """
        if len(frame) > _MOST:
            rule = f"a frame has at most {_MOST >> 20} MiB, but this one has {len(frame)} bytes"
            raise HostFailure("node", rule, "send less at once", slug="frame-size")
        whole = len(frame).to_bytes(_LENGTH, "little") + frame
        if not self._outgoing:
            try:
                sent = self._socket.send(whole)
            except BlockingIOError:
                sent = 0
            except OSError:
                self.closed = True
                return
            if sent == len(whole):
                return
            self._outgoing.append(memoryview(whole)[sent:])
        else:
            self._outgoing.append(memoryview(whole))
            self.flush()
        while wait and self._outgoing and not self.closed:
            self._writable.poll()
            self.flush()

    def flush(self) -> None:
        """Send on what waits."""
        try:
            while self._outgoing:
                part = self._outgoing[0]
                sent = self._socket.send(part)
                if sent < len(part):
                    self._outgoing[0] = part[sent:]
                else:
                    self._outgoing.popleft()
        except BlockingIOError:
            return
        except OSError:
            self.closed = True
            self._outgoing.clear()

    def frames(self) -> list[bytes]:
        """Return frames that have arrived, without waiting. Of one that floods, not all at once: others wait, too."""
        try:
            chunk = self._socket.recv(_CHUNK)
            self.closed = not chunk
            if not self._incoming and len(chunk) - _LENGTH == int.from_bytes(chunk[:_LENGTH], "little"):
                return [chunk[_LENGTH:]]  # as a rule it is just one
            self._incoming += chunk
        except BlockingIOError:
            pass
        except OSError:
            self.closed = True
        return self._cut()

    def _cut(self) -> list[bytes]:
        whole: list[bytes] = []
        buffer, at = self._incoming, 0
        while len(buffer) - at >= _LENGTH:
            size = int.from_bytes(buffer[at : at + _LENGTH], "little")
            if size > _MOST:
                self.closed = True
                break
            if len(buffer) - at - _LENGTH < size:
                break
            whole.append(bytes(buffer[at + _LENGTH : at + _LENGTH + size]))
            at += _LENGTH + size
        del buffer[:at]
        return whole

    def wait(self, until: int | None) -> None:
        """Return once something has arrived, or the monotonic clock shows `until` [ns]; None waits for ever."""
        left = None if until is None else max(0, until - time.perf_counter_ns()) * 1e-9
        if left is None:
            self._readable.poll()
        else:
            select.select([self._socket], [], [], left)

    def close(self) -> None:
        """Let go of the socket."""
        self._socket.close()
        self.closed = True

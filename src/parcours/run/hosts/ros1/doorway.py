"""Connections that others make on a ROS 1 graph -> let in by their header, or told why not; each in its own thread."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.master import LOOPBACK
from parcours.run.hosts.ros1.streams import read_header, write_header

Admit = Callable[[socket.socket, dict[str, str]], str]
"""Lets the other end of a connection in by its header; returns why not, else nothing."""


class Doorway:
    """Where others connect, on loopback.

    Args:
        within: so long the other end may take to say what it wants [s].
        admit: lets it in by its header, or returns the complaint.
        refused: told of each complaint.
    """

    def __init__(self, within: float, admit: Admit, refused: Callable[[str], None]) -> None:
        self._within, self._admit, self._refused = within, admit, refused
        self._socket = socket.create_server((LOOPBACK, 0))
        self.port: int = self._socket.getsockname()[1]
        self._doorman = threading.Thread(target=self._receive, daemon=True, name="ros1-door")
        self._doorman.start()

    def close(self) -> None:
        """Let nobody in any more."""
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
        connection.settimeout(self._within)
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

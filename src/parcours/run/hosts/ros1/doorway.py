"""Accepts the connections that other nodes of a ROS 1 graph make, and reads their headers, each in a thread."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Mapping

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.graph import LOOPBACK
from parcours.run.hosts.ros1.streams import read_header, write_header

_PATIENCE = 10.0
"""How long the other end of a connection may take to send its header [s]."""


class Doorway:
    """Where other nodes connect, on loopback."""

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

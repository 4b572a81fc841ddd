"""Makes the Unix socket that a program with `socket: true` connects to, and leaves nothing of it behind."""

from __future__ import annotations

import shutil
import socket
import tempfile


class SocketDoor:
    """A Unix socket in a folder of its own, which one program may connect to."""

    def __init__(self) -> None:
        self._folder = tempfile.mkdtemp(prefix="parcours-")
        self.path = f"{self._folder}/socket"
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.path)
        self.listener.listen(1)
        self.listener.setblocking(False)

    def accepted(self) -> socket.socket | None:
        """Return the connection, if somebody has connected."""
        try:
            connection = self.listener.accept()[0]
        except BlockingIOError:
            return None
        connection.setblocking(False)
        return connection

    def close(self) -> None:
        """Let nobody connect any more, and leave nothing behind."""
        self.listener.close()
        shutil.rmtree(self._folder, ignore_errors=True)

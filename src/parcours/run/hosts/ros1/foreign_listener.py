"""Connections that others make -> listeners of the tester's topics, clients of its services, or told why not."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping

from parcours.run.hosts.ros1.doorway import Doorway
from parcours.run.hosts.ros1.foreign_endpoints import Owner, Publisher, Reply, ServiceServer
from parcours.run.hosts.ros1.streams import ANSWERED, REFUSED, Stream, write_header

_PATIENCE = 10.0
"""So long who connects may take to say what it wants [s]."""


class Door:
    """Who may come in to the tester's ends, on loopback.

    Args:
        owner: to whom the ends belong.
        publishers: topic -> where the tester publishes.
        servers: service -> what the tester serves.
        refused: told of connections that were declined, and why.
    """

    def __init__(self, owner: Owner, publishers: Mapping[str, Publisher], servers: Mapping[str, ServiceServer],
                 refused: Callable[[str], None]) -> None:  # fmt: skip
        self._owner, self._publishers, self._servers = owner, publishers, servers
        self._doorway = Doorway(_PATIENCE, self._admit, refused)
        self.port = self._doorway.port

    def close(self) -> None:
        """Let nobody in any more."""
        self._doorway.close()

    def _admit(self, connection: socket.socket, header: dict[str, str]) -> str:
        """Let the other end in, or return why not."""
        who = header.setdefault("callerid", "?")
        if "topic" in header:
            publisher = self._publishers.get(header["topic"])
            if publisher is None:
                return f"{header['topic']}: {who} wants to hear it, but {self._owner.name} does not publish it"
            if not publisher.kind.agrees(header):
                theirs = f"{header.get('type', 'something')}, md5 {header.get('md5sum')}"
                return f"{publisher.topic}: carries {publisher.kind.type}, but {who} wants {theirs}"
            stream = publisher.join(connection, header)
            self._owner.attend(stream, lambda mark, data: None, lambda: publisher.leave(stream))
            return ""
        server = self._servers.get(header.get("service", ""))
        if server is None:
            return f"{header.get('service', 'a connection')}: {who} calls it, but {self._owner.name} does not serve it"
        told = server.kind.fields() | {"callerid": self._owner.name, "service": server.service}
        if not server.kind.agrees(header):
            return f"{server.service}: is {server.kind.type}, but {who} calls it with md5 {header.get('md5sum')}"
        write_header(connection, told)
        if header.get("probe") == "1":
            connection.close()
            return ""
        stream = Stream(connection, who)
        self._owner.attend(stream, lambda mark, data: server.asked(who, data, self._replying(stream)), lambda: None)
        return ""

    def _replying(self, stream: Stream) -> Reply:
        def reply(data: bytes | None) -> None:
            told = b"the call failed" if data is None else data
            stream.send(told, mark=REFUSED if data is None else ANSWERED)
            if stream.waits:
                self._owner.await_room(stream)

        return reply

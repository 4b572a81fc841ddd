"""Connections that others make -> listeners of the tester's topics, clients of its services, or told why not."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping

from parcours.run.hosts.ros1.doorway import Doorway
from parcours.run.hosts.ros1.foreign_ends import Counter, Mouth, Owner, Reply
from parcours.run.hosts.ros1.streams import ANSWERED, REFUSED, Stream, write_header

_PATIENCE = 10.0
"""So long who connects may take to say what it wants [s]."""


class Door:
    """Who may come in to the tester's ends, on loopback.

    Args:
        owner: to whom the ends belong.
        mouths: topic -> where the tester publishes.
        counters: service -> what the tester serves.
        refused: told of connections that were declined, and why.
    """

    def __init__(self, owner: Owner, mouths: Mapping[str, Mouth], counters: Mapping[str, Counter],
                 refused: Callable[[str], None]) -> None:  # fmt: skip
        self._owner, self._mouths, self._counters = owner, mouths, counters
        self._doorway = Doorway(_PATIENCE, self._admit, refused)
        self.port = self._doorway.port

    def close(self) -> None:
        """Let nobody in any more."""
        self._doorway.close()

    def _admit(self, connection: socket.socket, header: dict[str, str]) -> str:
        """Let the other end in, or return why not."""
        who = header.setdefault("callerid", "?")
        if "topic" in header:
            mouth = self._mouths.get(header["topic"])
            if mouth is None:
                return f"{header['topic']}: {who} wants to hear it, but {self._owner.name} does not publish it"
            if not mouth.kind.agrees(header):
                theirs = f"{header.get('type', 'something')}, md5 {header.get('md5sum')}"
                return f"{mouth.topic}: carries {mouth.kind.type}, but {who} wants {theirs}"
            stream = mouth.join(connection, header)
            self._owner.attend(stream, lambda mark, data: None, lambda: mouth.leave(stream))
            return ""
        counter = self._counters.get(header.get("service", ""))
        if counter is None:
            return f"{header.get('service', 'a connection')}: {who} calls it, but {self._owner.name} does not serve it"
        told = counter.kind.fields() | {"callerid": self._owner.name, "service": counter.service}
        if not counter.kind.agrees(header):
            return f"{counter.service}: is {counter.kind.type}, but {who} calls it with md5 {header.get('md5sum')}"
        write_header(connection, told)
        if header.get("probe") == "1":
            connection.close()
            return ""
        stream = Stream(connection, who)
        self._owner.attend(stream, lambda mark, data: counter.asked(who, data, self._replying(stream)), lambda: None)
        return ""

    def _replying(self, stream: Stream) -> Reply:
        def reply(data: bytes | None) -> None:
            told = b"the call failed" if data is None else data
            stream.send(told, mark=REFUSED if data is None else ANSWERED)
            if stream.waits:
                self._owner.await_room(stream)

        return reply

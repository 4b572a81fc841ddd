"""Messages of ROS 1 types <-> a ROS 1 bag, version 2.0 (wiki.ros.org/Bags/Format/2.0): chunks, indexes, connections."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import BinaryIO

from parcours.run.recording.compression import expand
from parcours.run.recording.topic import CHUNK, CHUNK_SPAN, Topic, damaged, put, require_time, taken, too_large

MAGIC = b"#ROSBAG V2.0\n"
_HEAD_SIZE = 4096
"""Of the bag's header with its padding, without the two lengths in it: tools write it anew in place [bytes]."""
_MESSAGE, _BAG, _INDEX, _CHUNK, _INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_BYTE = struct.Struct("<B")
_WORD = struct.Struct("<I")
_PLACE = struct.Struct("<Q")
_TIME = struct.Struct("<II")
_BILLION = 1_000_000_000


def _fields(**fields: bytes) -> bytes:
    parts = ((key.encode() + b"=" + value) for key, value in fields.items())
    return b"".join(_WORD.pack(len(part)) + part for part in parts)


def _record(header: bytes, data: bytes) -> bytes:
    return b"".join((_WORD.pack(len(header)), header, _WORD.pack(len(data)), data))


def _stamp(time: int) -> bytes:
    return _TIME.pack(*divmod(time, _BILLION))


class BagWriter:
    """Writes a bag, a chunk at a time; the last thing written says where its index lies.

    Args:
        file: empty, open for writing bytes, seekable.
        where: its name, for complaints.
    """

    def __init__(self, file: BinaryIO, where: str) -> None:
        self._file, self._where = file, where
        self._topics: dict[Topic, tuple[int, bytes]] = {}
        self._declared: list[bytes] = []
        self._infos: list[bytes] = []
        self._at = 0
        self._empty()
        self._put(MAGIC + self._head(0))

    def _empty(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._index: dict[int, list[int]] = {}
        self._first, self._last = 1 << 64, 0

    def _head(self, index: int) -> bytes:
        known = _fields(
            op=_BYTE.pack(_BAG),
            index_pos=_PLACE.pack(index),
            conn_count=_WORD.pack(len(self._topics)),
            chunk_count=_WORD.pack(len(self._infos)),
        )
        return _record(known, b" " * (_HEAD_SIZE - len(known)))

    def write(self, topic: Topic, time: int, content: bytes) -> None:
        """Write a message of the topic at the time [ns since the epoch].

        Raises:
            BadRequest: the time cannot be written.
        """
        require_time(self._where, time, _BILLION << 32)
        if self._size > CHUNK or time - self._first > CHUNK_SPAN:
            self.flush()
        number, prefix = self._topics.get(topic) or self._declare(topic)
        seconds, rest = divmod(time, _BILLION)
        self._index.setdefault(number, []).extend((seconds, rest, self._size))
        self._first, self._last = min(self._first, time), max(self._last, time)
        head = prefix + struct.pack("<III", seconds, rest, len(content))
        self._parts += (head, content)
        self._size += len(head) + len(content)

    def _declare(self, topic: Topic) -> tuple[int, bytes]:
        number = len(self._topics)
        fields = _fields(op=_BYTE.pack(_MESSAGE), conn=_WORD.pack(number), time=bytes(8))
        known = self._topics[topic] = number, _WORD.pack(len(fields)) + fields[:-8]
        texts = {
            "topic": topic.name,
            "type": topic.type,
            "md5sum": topic.md5,
            "message_definition": topic.definition,
            "callerid": "/parcours",
            "latching": str(int(topic.latched)),
        }
        data = _fields(**{key: text.encode(errors="backslashreplace") for key, text in texts.items()})
        name = topic.name.encode(errors="backslashreplace")
        record = _record(_fields(op=_BYTE.pack(_CONNECTION), conn=_WORD.pack(number), topic=name), data)
        self._declared.append(record)
        self._parts.append(record)
        self._size += len(record)
        return known

    def flush(self) -> None:
        """Let the file hold everything written so far, as a chunk of its own."""
        if not self._parts:
            return
        head = _fields(op=_BYTE.pack(_CHUNK), compression=b"none", size=_WORD.pack(self._size))
        parts = [_WORD.pack(len(head)), head, _WORD.pack(self._size), *self._parts]
        counts = []
        for number, entries in self._index.items():
            n = _WORD.pack(len(entries) // 3)
            index = _fields(op=_BYTE.pack(_INDEX), ver=_WORD.pack(1), conn=_WORD.pack(number), count=n)
            parts.append(_record(index, struct.pack(f"<{len(entries)}I", *entries)))
            counts.append(_WORD.pack(number) + n)
        info = _fields(
            op=_BYTE.pack(_INFO),
            ver=_WORD.pack(1),
            chunk_pos=_PLACE.pack(self._at),
            start_time=_stamp(self._first),
            end_time=_stamp(self._last),
            count=_WORD.pack(len(counts)),
        )
        self._infos.append(_record(info, b"".join(counts)))
        self._put(b"".join(parts))
        self._empty()

    def remark(self, name: str, entries: Mapping[str, str]) -> None:
        """Do nothing: a bag knows no remarks outside its topics."""

    def close(self) -> None:
        """Write the index and where it lies; the file is whole."""
        self.flush()
        index = self._at
        self._put(b"".join(self._declared + self._infos))
        self._file.seek(len(MAGIC))
        self._put(self._head(index))

    def _put(self, content: bytes) -> None:
        put(self._file, content)
        self._at += len(content)


class BagReader:
    """Reads the messages of a bag, record by record.

    Args:
        file: at its begin.
        size: of the file [bytes].
        where: its name, for complaints.
        most: no more than this is read, expanded [bytes].
    """

    def __init__(self, file: BinaryIO, size: int, where: str, most: int) -> None:
        self._file, self._size, self._where, self._left, self._most = file, size, where, most, most
        self._topics: dict[bytes, Topic] = {}
        self.cut = "it has no index"

    def messages(self) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield (topic, time [ns since the epoch], content) in the order of the file.

        Raises:
            BadResults: the file is damaged.
        """
        at = len(MAGIC)
        self._file.seek(at)
        while at < self._size:
            header = self._part(at)
            data = None if header is None else self._part(at + 4 + len(header))
            if header is None or data is None:
                self.cut = "its end is missing"
                return
            at += 8 + len(header) + len(data)
            try:
                yield from self._understood(_parsed(header), data)
            except (struct.error, UnicodeDecodeError, KeyError) as error:
                raise damaged(self._where, f"a record cannot be understood: {error}") from error

    def _part(self, at: int) -> bytes | None:
        """Return the bytes after their length at this place; None if the file ends before they do."""
        if at + 4 > self._size:
            return None
        (n,) = _WORD.unpack(taken(self._file, 4, self._where))
        return taken(self._file, n, self._where) if n <= self._size - at - 4 else None

    def _understood(self, header: dict[str, bytes], data: bytes) -> Iterator[tuple[Topic, int, bytes]]:
        (code,) = _BYTE.unpack(header["op"])
        if code == _BAG:
            self.cut = "" if any(header["index_pos"]) else self.cut
        elif code == _CHUNK:
            (size,) = _WORD.unpack(header["size"])
            self._left -= size
            if self._left < 0:
                raise too_large(self._where, self._most - self._left, self._most)
            content = expand(header["compression"].decode(), data, size, self._where)
            at = 0
            while at < len(content):
                head, at = _inner(content, at)
                body, at = _inner(content, at)
                yield from self._understood_inside(_parsed(head), body)
        elif code == _CONNECTION:
            self._connect(header, data)

    def _understood_inside(self, header: dict[str, bytes], data: bytes) -> Iterator[tuple[Topic, int, bytes]]:
        (code,) = _BYTE.unpack(header["op"])
        if code == _CONNECTION:
            self._connect(header, data)
        elif code == _MESSAGE:
            seconds, rest = _TIME.unpack(header["time"])
            if header["conn"] not in self._topics:
                raise damaged(self._where, "a connection has messages but was never declared")
            yield self._topics[header["conn"]], seconds * _BILLION + rest, data

    def _connect(self, header: dict[str, bytes], data: bytes) -> None:
        known = {key: value.decode() for key, value in _parsed(data).items()}
        self._topics[header["conn"]] = Topic(
            header["topic"].decode(),
            known["type"],
            known["md5sum"],
            known["message_definition"],
            known.get("latching") == "1",
        )


def _inner(content: bytes, at: int) -> tuple[bytes, int]:
    (n,) = _WORD.unpack_from(content, at)
    end = at + 4 + n
    if end > len(content):
        raise struct.error("it is longer than its chunk")
    return content[at + 4 : end], end


def _parsed(header: bytes) -> dict[str, bytes]:
    fields: dict[str, bytes] = {}
    at = 0
    while at < len(header):
        field, at = _inner(header, at)
        key, _, value = field.partition(b"=")
        fields[key.decode()] = value
    return fields

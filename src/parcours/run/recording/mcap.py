"""Messages of ROS 1 types <-> an MCAP file (mcap.dev/spec): chunks with their indexes, a summary, checksums."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import BinaryIO

from parcours.errors import BadResults
from parcours.run.recording.compression import expand
from parcours.run.recording.definition import md5_of
from parcours.run.recording.topic import (
    CHUNK,
    CHUNK_SPAN,
    Topic,
    damaged,
    put,
    require_time,
    taken,
    too_large,
)

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "parcours"

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = range(1, 9)
_STATISTICS, _METADATA, _METADATA_INDEX, _SUMMARY_OFFSET, _DATA_END = range(0x0B, 0x10)
_RECORD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_LENGTH = struct.Struct("<I")


def _text(text: str) -> bytes:
    encoded = text.encode(errors="backslashreplace")
    return _LENGTH.pack(len(encoded)) + encoded


def _map(entries: Mapping[str, str]) -> bytes:
    body = b"".join(_text(key) + _text(value) for key, value in entries.items())
    return _LENGTH.pack(len(body)) + body


def _record(code: int, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return _RECORD.pack(code, len(body)) + body


class McapWriter:
    """Writes an MCAP file, a chunk at a time.

    Args:
        file: empty, open for writing bytes.
        where: its name, for complaints.
    """

    def __init__(self, file: BinaryIO, where: str) -> None:
        self._file, self._where = file, where
        self._at = 0
        self._topics: dict[Topic, int] = {}
        self._declared: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._chunks: list[tuple[bytes, int, int]] = []
        self._remarks: list[bytes] = []
        self._empty()
        self._put(MAGIC + _record(_HEADER, _text("ros1"), _text(LIBRARY)))

    def _empty(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._index: dict[int, list[int]] = {}
        self._first, self._last = 1 << 64, 0

    def write(self, topic: Topic, time: int, content: bytes) -> None:
        """Write a message of the topic at the time [ns since the epoch].

        Raises:
            BadRequest: the time cannot be written.
        """
        require_time(self._where, time, 1 << 63)
        if self._size > CHUNK or time - self._first > CHUNK_SPAN:
            self.flush()
        number = self._topics.get(topic) or self._declare(topic)
        self._index.setdefault(number, []).extend((time, self._size))
        self._first, self._last = min(self._first, time), max(self._last, time)
        count = self._counts[number]
        self._counts[number] = count + 1
        head = _MESSAGE_HEAD.pack(_MESSAGE, 22 + len(content), number, count & 0xFFFFFFFF, time, time)
        self._parts += (head, content)
        self._size += len(head) + len(content)

    def _declare(self, topic: Topic) -> int:
        number = len(self._topics) + 1
        known = {"md5sum": topic.md5, "latching": str(int(topic.latched))}
        schema = _record(
            _SCHEMA, struct.pack("<H", number), _text(topic.type), _text("ros1msg"), _text(topic.definition)
        )
        channel = _record(
            _CHANNEL, struct.pack("<HH", number, number), _text(topic.name), _text("ros1"), _map(known)
        )  # fmt: skip
        self._topics[topic], self._counts[number] = number, 0
        self._declared += (schema, channel)
        self._parts += (schema, channel)
        self._size += len(schema) + len(channel)
        return number

    def flush(self) -> None:
        """Let the file hold everything written so far, as a chunk of its own."""
        if not self._parts:
            return
        body = b"".join(self._parts)
        head = _CHUNK_HEAD.pack(self._first, self._last, len(body), zlib.crc32(body))
        chunk = _record(_CHUNK, head, _text(""), struct.pack("<Q", len(body)), body)
        places, offsets = [], []
        end = len(chunk)
        for number, entries in self._index.items():
            offsets.append(struct.pack("<HQ", number, self._at + end))
            packed = struct.pack(f"<HI{len(entries)}Q", number, 8 * len(entries), *entries)
            places.append(_record(_MESSAGE_INDEX, packed))
            end += len(places[-1])
        table = b"".join(offsets)
        index = struct.pack("<4QI", self._first, self._last, self._at, len(chunk), len(table)) + table
        index += struct.pack("<Q", end - len(chunk)) + _text("") + struct.pack("<2Q", len(body), len(body))
        self._chunks.append((_record(_CHUNK_INDEX, index), self._first, self._last))
        self._put(chunk + b"".join(places))
        self._empty()

    def remark(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self.flush()
        record = _record(_METADATA, _text(name), _map(entries))
        self._remarks.append(_record(_METADATA_INDEX, struct.pack("<2Q", self._at, len(record)), _text(name)))
        self._put(record)

    def close(self) -> None:
        """Write the summary; the file is whole."""
        self.flush()
        self._put(_record(_DATA_END, _LENGTH.pack(0)))
        table = b"".join(struct.pack("<HQ", *one) for one in self._counts.items())
        first = min((one for _, one, _ in self._chunks), default=0)
        last = max((one for _, _, one in self._chunks), default=0)
        n = len(self._topics)
        statistics = struct.pack(
            "<QHIIIIQQI", sum(self._counts.values()), n, n, 0, len(self._remarks), len(self._chunks), first, last,
            len(table),
        )  # fmt: skip
        groups = {
            _SCHEMA: self._declared[::2],
            _CHANNEL: self._declared[1::2],
            _STATISTICS: [_record(_STATISTICS, statistics, table)],
            _METADATA_INDEX: self._remarks,
            _CHUNK_INDEX: [index for index, _, _ in self._chunks],
        }
        start, summary, offsets = self._at, b"", b""
        for code, records in groups.items():
            group = b"".join(records)
            if group:
                offset = struct.pack("<BQQ", code, start + len(summary), len(group))
                offsets += _record(_SUMMARY_OFFSET, offset)
                summary += group
        footer = _RECORD.pack(_FOOTER, 20) + struct.pack("<QQ", start, start + len(summary))
        tail = summary + offsets + footer
        self._put(tail + _LENGTH.pack(zlib.crc32(tail)) + MAGIC)

    def _put(self, content: bytes) -> None:
        put(self._file, content)
        self._at += len(content)


class McapReader:
    """Reads the messages of an MCAP file, record by record.

    Args:
        file: at its begin.
        size: of the file [bytes].
        where: its name, for complaints.
        most: no more than this is read, expanded [bytes].
    """

    def __init__(self, file: BinaryIO, size: int, where: str, most: int) -> None:
        self._file, self._size, self._where, self._left, self._most = file, size, where, most, most
        self._schemas: dict[int, tuple[str, str]] = {}
        self._topics: dict[int, Topic] = {}
        self.cut = "its end is missing"

    def messages(self) -> Iterator[tuple[Topic, int, bytes]]:
        """Yield (topic, time [ns since the epoch], content) in the order of the file.

        Raises:
            BadResults: the file is damaged, or of types that are not of ROS 1.
        """
        at = len(MAGIC)
        self._file.seek(at)
        while at + _RECORD.size <= self._size:
            code, length = _RECORD.unpack(taken(self._file, _RECORD.size, self._where))
            at += _RECORD.size
            if code == 0:
                raise damaged(self._where, f"the record at byte {at - _RECORD.size} is of no kind")
            if length > self._size - at:
                return
            if code == _FOOTER:
                self.cut = "" if self._size - at - length >= len(MAGIC) else self.cut
                return
            if code in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
                yield from self._understood(code, taken(self._file, length, self._where))
            else:
                self._file.seek(length, 1)
            at += length

    def _understood(self, code: int, body: bytes) -> Iterator[tuple[Topic, int, bytes]]:
        try:
            if code == _CHUNK:
                yield from self._chunk(body)
            else:
                self._count(len(body))
                yield from self._single(code, memoryview(body))
        except (struct.error, UnicodeDecodeError) as error:
            raise damaged(self._where, f"a record cannot be understood: {error}") from error

    def _chunk(self, body: bytes) -> Iterator[tuple[Topic, int, bytes]]:
        _, _, size, checksum = _CHUNK_HEAD.unpack_from(body)
        compression, at = _read_text(body, _CHUNK_HEAD.size)
        (length,) = struct.unpack_from("<Q", body, at)
        self._count(size)
        if length != len(body) - at - 8:
            raise damaged(self._where, f"a chunk of {len(body) - at - 8} bytes says it has {length}")
        content = expand(compression, body[at + 8 :], size, self._where)
        if checksum and zlib.crc32(content) != checksum:
            raise damaged(self._where, "a chunk has another checksum than it says")
        view = memoryview(content)
        at = 0
        while at < len(content):
            code, length = _RECORD.unpack_from(content, at)
            at += _RECORD.size
            if length > len(content) - at:
                raise damaged(self._where, "a record is longer than its chunk")
            yield from self._single(code, view[at : at + length])
            at += length

    def _single(self, code: int, body: memoryview) -> Iterator[tuple[Topic, int, bytes]]:
        if code == _MESSAGE:
            number, _, time, _ = _MESSAGE_FIELDS.unpack_from(body)
            if number not in self._topics:
                raise damaged(self._where, f"channel {number} has messages but was never declared")
            yield self._topics[number], time, bytes(body[_MESSAGE_FIELDS.size :])
        elif code == _SCHEMA:
            (number,) = struct.unpack_from("<H", body)
            name, at = _read_text(body, 2)
            _, at = _read_text(body, at)
            self._schemas[number] = name, _read_text(body, at)[0]
        elif code == _CHANNEL:
            number, schema = struct.unpack_from("<HH", body)
            name, at = _read_text(body, 4)
            encoding, at = _read_text(body, at)
            if schema not in self._schemas or encoding != "ros1":
                raise BadResults(
                    self._where,
                    f"messages are of ROS 1 types that the file defines, but those of {name[:60]!r} are not"
                    f" (encoding {encoding[:20]!r})",
                    "name a recording that Parcours wrote",
                    slug="recording-encoding",
                )
            self._topics[number] = _topic(name, *self._schemas[schema], _read_map(body, at))

    def _count(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise too_large(self._where, self._most - self._left, self._most)


def _topic(name: str, kind: str, definition: str, known: Mapping[str, str]) -> Topic:
    return Topic(name, kind, known.get("md5sum") or md5_of(definition, kind), definition, known.get("latching") == "1")


def _read_text(body: bytes | memoryview, at: int) -> tuple[str, int]:
    (n,) = _LENGTH.unpack_from(body, at)
    end = at + 4 + n
    if end > len(body):
        raise struct.error(f"a text of {n} bytes in {len(body) - at - 4}")
    return bytes(body[at + 4 : end]).decode(), end


def _read_map(body: memoryview, at: int) -> dict[str, str]:
    (n,) = _LENGTH.unpack_from(body, at)
    at, end = at + 4, at + 4 + n
    entries: dict[str, str] = {}
    while at < end:
        key, at = _read_text(body, at)
        entries[key], at = _read_text(body, at)
    return entries

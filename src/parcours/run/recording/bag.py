"""Writes ROS 1 bags (wiki.ros.org/Bags/Format/2.0) by the library `rosbags`, and reads them also where they were cut.

`rosbags` reads only bags with an index, which is what a killed writer did not write, and trusts it. So our own reader
goes from record to record, with the library's parser of their headers.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, cast

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as LibraryWriter
from rosbags.rosbag1.reader import Header, ReaderError, RecordType, read_uint32
from rosbags.typesys.msg import normalize_msgtype

from parcours.errors import BadResults
from parcours.run.recording.source import ByteSource, CutOff, damaged
from parcours.run.recording.topic import BAG_MAGIC, CHUNK, Message, Topic, TopicWriter, no_bag

_BILLION = 1_000_000_000


class BagWriter(TopicWriter):
    """Writes a bag; the last thing written says where its index lies."""

    latest = _BILLION << 32

    def __init__(self, file: BinaryIO, where: str) -> None:
        super().__init__(file, where)
        self._writer = LibraryWriter(Path(where, "new"))  # it wants a path where nothing lies
        self._writer.chunk_threshold = CHUNK
        self._writer.path = cast(Path, SimpleNamespace(open=lambda mode: file))
        self._writer.open()

    def _declared(self, topic: Topic) -> Connection:
        if topic.encoding != "ros1":
            raise no_bag(self._where)
        if "/" not in topic.type:
            raise damaged(self._where, f"the type {topic.type[:60]!r} names no package")
        return self._writer.add_connection(
            topic.name,
            normalize_msgtype(topic.type),
            msgdef=topic.definition.encode(errors="backslashreplace").decode(),
            md5sum=topic.md5,
            callerid="/parcours",
            latching=int(topic.latched),
        )

    def _add(self, known: Connection, time: int, content: bytes) -> None:
        self._writer.write(known, time, content)

    def _end_chunk(self) -> None:
        self._writer.write_chunk(self._writer.chunks[-1])
        self._file.flush()

    def close(self) -> None:
        """Write the index."""
        self._writer.close()


def bag_messages(source: ByteSource) -> Iterator[Message]:
    """Yield the messages of a bag; see `topic.messages`."""
    topics: dict[int, Topic] = {}
    source.read(len(BAG_MAGIC))
    indexed = False
    try:
        while source.left:
            stream: Any = source
            header = Header.read(stream)
            content = source.read(read_uint32(stream))
            match header.get_uint8("op"):
                case RecordType.BAGHEADER:
                    indexed = header.get_uint64("index_pos") > 0
                case RecordType.CHUNK:
                    size, compression = header.get_uint32("size"), header.get_string("compression")
                    yield from _chunk(source.expand(compression, content, size), topics, source.where)
                case RecordType.CONNECTION:
                    _connect(header, content, topics)
    except (BadResults, CutOff):
        raise
    except Exception as error:  # the library raises many things at a file that lies
        raise damaged(source.where, f"a record cannot be understood: {type(error).__name__}: {error}") from error
    if not indexed:
        raise CutOff("it has no index")


def _chunk(content: bytes, topics: dict[int, Topic], where: str) -> Iterator[Message]:
    stream = io.BytesIO(content)
    while stream.tell() < len(content):
        header = Header.read(stream)
        size = read_uint32(stream)
        data = stream.read(size)
        if len(data) != size:
            raise ReaderError("it is longer than its chunk")
        match header.get_uint8("op"):
            case RecordType.CONNECTION:
                _connect(header, data, topics)
            case RecordType.MSGDATA:
                number = header.get_uint32("conn")
                if number not in topics:
                    raise damaged(where, "a connection has messages but was never declared")
                yield topics[number], header.get_time("time"), data


def _connect(header: Header, content: bytes, topics: dict[int, Topic]) -> None:
    known = Header.read(io.BytesIO(len(content).to_bytes(4, "little") + content))
    topics[header.get_uint32("conn")] = Topic(
        header.get_string("topic"),
        known.get_string("type"),
        known.get_string("md5sum"),
        known.get_string("message_definition"),
        known.get("latching") == b"1",
    )

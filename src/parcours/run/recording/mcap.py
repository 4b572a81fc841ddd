"""Writes and reads messages of ROS 1 types in MCAP files, by the library `mcap`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, BinaryIO

from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType
from mcap.writer import Writer as LibraryWriter

from parcours.errors import BadResults
from parcours.run.recording.source import CutOff, Source, damaged
from parcours.run.recording.topic import CHUNK, Message, Topic, Writer


class McapWriter(Writer):
    """Writes an MCAP file."""

    latest = 1 << 63

    def __init__(self, file: BinaryIO, where: str) -> None:
        super().__init__(file, where)
        self._writer: Any = LibraryWriter(file, chunk_size=CHUNK, compression=CompressionType.NONE)
        self._writer.start("ros1", "parcours")

    def _declared(self, topic: Topic) -> int:
        definition = topic.definition.encode(errors="backslashreplace")
        schema = self._writer.register_schema(_valid(topic.type), "ros1msg", definition)
        known = {"md5sum": topic.md5, "latching": str(int(topic.latched))}
        channel: int = self._writer.register_channel(topic.name, "ros1", schema, known)
        return channel

    def _add(self, known: int, time: int, content: bytes) -> None:
        self._writer.add_message(known, time, content, time)

    def _end_chunk(self) -> None:
        self._writer.flush()

    def remark(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self._writer.add_metadata(name, {_valid(key): _valid(value) for key, value in entries.items()})

    def close(self) -> None:
        """Write the summary."""
        self._writer.finish()
        self._file.close()


def _valid(text: str) -> str:
    """Return the text as UTF-8 can hold it."""
    return text.encode(errors="backslashreplace").decode()


def mcap_messages(source: Source) -> Iterator[Message]:
    """Yield the messages of an MCAP file; see `topic.messages`."""
    stream: Any = source
    schemas: dict[int, Schema] = {}
    topics: dict[int, Topic] = {}
    try:
        for outer in StreamReader(stream, emit_chunks=True, record_size_limit=None).records:
            for record in _inside(outer, source) if isinstance(outer, Chunk) else (outer,):
                if isinstance(record, McapMessage):
                    if record.channel_id not in topics:
                        raise damaged(source.where, f"channel {record.channel_id} has messages but was never declared")
                    yield topics[record.channel_id], record.log_time, record.data
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    topics[record.id] = _topic(record, schemas.get(record.schema_id), source.where)
    except (BadResults, CutOff):
        raise
    except Exception as error:  # the library raises many things at a file that lies
        raise damaged(source.where, f"a record cannot be understood: {type(error).__name__}: {error}") from error


def _inside(chunk: Chunk, source: Source) -> list[McapRecord]:
    content = source.expand(chunk.compression, chunk.data, chunk.uncompressed_size)
    try:
        return breakup_chunk(replace(chunk, compression="", data=content), validate_crc=True)
    except ValueError as error:
        raise damaged(source.where, f"a chunk has another checksum than it says: {error}") from error


def _topic(channel: Channel, schema: Schema | None, where: str) -> Topic:
    if schema is None or channel.message_encoding != "ros1":
        given = f"those of {channel.topic[:60]!r} are not (encoding {channel.message_encoding[:20]!r})"
        rule = f"messages are of ROS 1 types that the file defines, but {given}"
        raise BadResults(where, rule, "name a recording that Parcours wrote", slug="recording-encoding")
    definition, known = schema.data.decode(), channel.metadata
    md5 = known.get("md5sum") or md5_of(definition, schema.name)
    return Topic(channel.topic, schema.name, md5, definition, known.get("latching") == "1")


def md5_of(definition: str, name: str) -> str:
    """Return the md5 sum of a definition with the definitions of the types it uses, as ROS 1 computes it.

    Args:
        definition: the whole text; definitions of further types follow lines of = and MSG: their name.
        name: of the type itself, e.g. geometry_msgs/Twist.

    >>> md5_of("string data", "std_msgs/String")
    '992ce8a1687cec8c8bd883ec73ca41d1'
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, name))
    return store.generate_msgdef(normalize_msgtype(name), ros_version=1)[1]

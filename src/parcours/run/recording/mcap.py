"""Writes and reads messages of ROS types in MCAP files, by the library `mcap`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, BinaryIO

from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType
from mcap.writer import Writer as LibraryWriter

from parcours.errors import BadResults
from parcours.run.recording.source import ByteSource, CutOff, damaged
from parcours.run.recording.topic import CHUNK, Encoding, Message, Topic, TopicWriter

_OWN = "parcours_md5sum"
"""What the channel of a message says that Parcours packs as ROS 1, and that was changed to CDR."""

Change = Callable[[bytes], bytes]


class McapWriter(TopicWriter):
    """Writes an MCAP file."""

    latest = 1 << 63

    def __init__(self, file: BinaryIO, where: str, encoding: Encoding) -> None:
        super().__init__(file, where)
        self._encoding = encoding
        self._writer: Any = LibraryWriter(file, chunk_size=CHUNK, compression=CompressionType.NONE)
        self._writer.start("ros1" if encoding == "ros1" else "ros2", "parcours")

    def _declared(self, topic: Topic) -> tuple[int, Change | None]:
        # Readers of ROS 2 take files of one encoding only: what Parcours packs as ROS 1 is changed for them.
        is_changed = topic.encoding == "ros1" and self._encoding == "cdr"
        name, known = topic.type, {"md5sum": topic.md5, "latching": str(int(topic.latched))}
        encoding: Encoding = "cdr" if is_changed else topic.encoding
        if encoding == "cdr":
            known = {_OWN: topic.md5} if is_changed else {}
            known["offered_qos_profiles"] = ""
            name = name.replace("/", "/msg/") if is_changed else name
        change = _change(topic.definition, name, to_cdr=True) if is_changed else None
        definition = topic.definition.encode(errors="backslashreplace")
        schema = self._writer.register_schema(_valid(name), "ros1msg" if encoding == "ros1" else "ros2msg", definition)
        return self._writer.register_channel(topic.name, encoding, schema, known), change

    def _add(self, known: tuple[int, Change | None], time: int, content: bytes) -> None:
        channel, change = known
        self._writer.add_message(channel, time, content if change is None else change(content), time)

    def _end_chunk(self) -> None:
        self._writer.flush()

    def remark(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self._writer.add_metadata(name, {_valid(key): _valid(value) for key, value in entries.items()})

    def close(self) -> None:
        """Write the summary."""
        self._writer.finish()
        self._file.close()


def _change(definition: str, name: str, *, to_cdr: bool) -> Change:
    """Return what changes messages of a definition from the encoding of ROS 1 to CDR, or back."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, name))
    convert = store.ros1_to_cdr if to_cdr else store.cdr_to_ros1
    return lambda content: bytes(convert(content, name))


def _valid(text: str) -> str:
    """Return the text as UTF-8 can hold it."""
    return text.encode(errors="backslashreplace").decode()


def mcap_messages(source: ByteSource) -> Iterator[Message]:
    """Yield the messages of an MCAP file; see `topic.messages`."""
    stream: Any = source
    schemas: dict[int, Schema] = {}
    topics: dict[int, Topic] = {}
    changes: dict[int, Change] = {}
    try:
        for outer in StreamReader(stream, emit_chunks=True, record_size_limit=None).records:
            for record in _inside(outer, source) if isinstance(outer, Chunk) else (outer,):
                if isinstance(record, McapMessage):
                    if record.channel_id not in topics:
                        raise damaged(source.where, f"channel {record.channel_id} has messages but was never declared")
                    topic, change = topics[record.channel_id], changes.get(record.channel_id)
                    yield topic, record.log_time, change(record.data) if change else record.data
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas.get(record.schema_id)
                    topics[record.id] = _topic(record, schema, source.where)
                    if schema is not None and _OWN in record.metadata:
                        changes[record.id] = _change(schema.data.decode(), schema.name, to_cdr=False)
    except (BadResults, CutOff):
        raise
    except Exception as error:  # the library raises many things at a file that lies
        raise damaged(source.where, f"a record cannot be understood: {type(error).__name__}: {error}") from error


def _inside(chunk: Chunk, source: ByteSource) -> list[McapRecord]:
    content = source.expand(chunk.compression, chunk.data, chunk.uncompressed_size)
    try:
        return breakup_chunk(replace(chunk, compression="", data=content), validate_crc=True)
    except ValueError as error:
        raise damaged(source.where, f"a chunk has another checksum than it says: {error}") from error


def _topic(channel: Channel, schema: Schema | None, where: str) -> Topic:
    if schema is None or channel.message_encoding not in ("ros1", "cdr"):
        given = f"those of {channel.topic[:60]!r} are not (encoding {channel.message_encoding[:20]!r})"
        rule = f"messages are of ROS types that the file defines, but {given}"
        raise BadResults(where, rule, "name a recording that Parcours wrote", slug="recording-encoding")
    definition, known = schema.data.decode(), channel.metadata
    if _OWN in known:
        return Topic(channel.topic, schema.name.replace("/msg/", "/"), known[_OWN], definition)
    if channel.message_encoding == "cdr":
        return Topic(channel.topic, schema.name, "", definition, encoding="cdr")
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

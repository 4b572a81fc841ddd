"""Recordings in the hands of tools that know nothing of Parcours: MCAP's own reader, rosbags; and what they write."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import mcap.writer
import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros1.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader as RosbagsReader
from rosbags.rosbag1 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from parcours.run.noise import Noise
from parcours.run.recording import Entry, Raw, convert, read_recording, write_recording
from parcours.run.recording.mcap import md5_of
from parcours.run.trace import Trace, TraceEvent

BEGIN = 1_700_000_000_000_000_000
both = pytest.mark.parametrize("form", ("mcap", "bag"))

FORM = (
    Entry("stamp", "int", "[ns]"),
    Entry("x", "float", "east [m]"),
    Entry("halted", "bool"),
    Entry("way", "floats", "[m]"),
    Entry("kinds", "ints"),
    Entry("name", "text"),
)
POSE = (-7, 0.1, True, np.array([1.5, np.inf]), np.array([2**62]), "où")
EMPTY = (0, -0.0, False, np.zeros(0), np.zeros(0, np.int64), "")


class Poses:
    """Flat payloads of one form on every channel."""

    def form(self, channel: str) -> Sequence[Entry] | None:
        return FORM

    def flatten(self, channel: str, payload: object) -> Sequence[object]:
        assert isinstance(payload, tuple)
        return payload

    def restore(self, channel: str, values: Sequence[object]) -> object:
        return tuple(values)


TWIST = """# a velocity
Vector3 linear
Vector3 angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
VELOCITY = Raw("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a", TWIST, np.arange(6.0).tobytes())

TRACE = Trace(
    "wall",
    (
        TraceEvent(1_000, "send", "Planner", "", "best-trajectory", 1, "", POSE),
        TraceEvent(2_000, "send", "Planner", "", "best-trajectory", 2, "", EMPTY),
        TraceEvent(3_000, "take", "Planner", "p12"),
        TraceEvent(600_000_000, "send", "Control", "", "cmd_vel", 3, "", VELOCITY),
        TraceEvent(600_000_001, "receive", "Robot", "", "cmd_vel", 3, "", VELOCITY),
    ),
    "ros1",
    "case-1",
    Noise((1, 2, 3), "1 round trip"),
)
TOPICS = ["/parcours/run", *["/best_trajectory", "/parcours/events"] * 2, "/parcours/events",
          "/cmd_vel", "/parcours/events", "/parcours/events", "/parcours/end"]  # fmt: skip


def recorded(form: str, folder: Path) -> Path:
    path = folder / f"run.{form}"
    write_recording(path, TRACE, Poses(), begin=BEGIN, about={"seed": "7"})
    return path


def check_messages(messages: list[tuple[str, int, Any]]) -> None:
    assert [topic for topic, _, _ in messages] == TOPICS
    assert [at - BEGIN for _, at, _ in messages][1:-1] == [
        1000,
        1000,
        2000,
        2000,
        3000,
        *[600_000_000] * 2,
        600_000_001,
    ]
    pose, empty, velocity = (message for topic, _, message in messages if not topic.startswith("/parcours"))
    assert (pose.stamp, pose.x, pose.halted, list(pose.way), list(pose.kinds), pose.name) == (
        -7, 0.1, True, [1.5, np.inf], [2**62], "où",
    )  # fmt: skip
    assert list(empty.way) == [] and empty.name == ""
    assert (velocity.linear.y, velocity.angular.z) == (1.0, 5.0)
    events = [message for topic, _, message in messages if topic == "/parcours/events"]
    assert [(e.number, e.time, e.kind, e.component) for e in events] == [
        (number, e.time, e.kind, e.component) for number, e in enumerate(TRACE.events)
    ]
    assert [(e.payload, e.topic, e.raw) for e in events] == [
        (0, "/best_trajectory", False), (1, "/best_trajectory", False), (-1, "", False), (3, "/cmd_vel", True),
        (3, "", True),
    ]  # fmt: skip


def test_the_reader_of_mcap_decodes_every_message_and_finds_all_sums_right(tmp_path: Path) -> None:
    with recorded("mcap", tmp_path).open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = [
            (channel.topic, message.log_time, decoded)
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False)
        ]
        check_messages(found)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == len(TOPICS)
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 3
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (
            BEGIN, BEGIN + 600_000_002,
        )  # fmt: skip
        remarks = {one.name: one.metadata for one in reader.iter_metadata()}
    assert remarks["parcours.run"]["clock"] == "wall" and remarks["parcours.run"]["seed"] == "7"
    assert remarks["parcours.end"] == {"events": "5", "noise": '["1 round trip", 1, 2, 3]'}


def test_the_reader_of_mcap_seeks_by_topic_and_time(tmp_path: Path) -> None:
    with recorded("mcap", tmp_path).open("rb") as file:
        reader = make_reader(file)
        found = reader.iter_messages(topics=["/cmd_vel"], starting_at=BEGIN + 500_000_000)
        assert [message.data for _, _, message in found] == [VELOCITY.content]
        late = reader.iter_messages(starting_at=BEGIN + 500_000_000)
        assert len(list(late)) == 4


def test_the_stream_reader_of_mcap_reads_a_recording_without_its_end(tmp_path: Path) -> None:
    whole = recorded("mcap", tmp_path).read_bytes()
    cut = io.BytesIO(whole[: whole.rindex(b"/parcours/end") - 400])
    kinds = [type(record).__name__ for record in _until_its_end(StreamReader(cut, skip_magic=False))]
    assert kinds.count("Message") >= 6


def _until_its_end(reader: StreamReader) -> list[object]:
    found: list[object] = []
    with contextlib.suppress(EndOfFile):
        for record in reader.records:
            found.append(record)
    return found


def test_rosbags_reads_the_bag_by_its_index_and_finds_the_md5_sums_right(tmp_path: Path) -> None:
    path = recorded("bag", tmp_path)
    with AnyReader([path]) as reader:
        found = [
            (connection.topic, at, reader.deserialize(data, connection.msgtype))
            for connection, at, data in reader.messages()
        ]
        assert sorted(topic for topic, _, _ in found) == sorted(TOPICS)
    with RosbagsReader(path) as raw:
        assert {connection.topic: connection.msgcount for connection in raw.connections} == {
            topic: TOPICS.count(topic) for topic in TOPICS
        }
        for connection in raw.connections:
            store = get_typestore(Stores.EMPTY)
            text = connection.msgdef.data
            store.register(get_types_from_msg(text, connection.msgtype))
            assert store.generate_msgdef(connection.msgtype, ros_version=1)[1] == connection.digest
    check_messages(sorted(found, key=lambda one: (one[1], one[0] == "/parcours/events")))


@both
def test_what_goes_through_the_other_format_is_still_read_by_foreign_tools(form: str, tmp_path: Path) -> None:
    other = tmp_path / f"other.{'bag' if form == 'mcap' else 'mcap'}"
    assert convert(recorded(form, tmp_path), other) == len(TOPICS)
    if form == "mcap":
        with AnyReader([other]) as reader:
            assert len(list(reader.messages())) == len(TOPICS)
    else:
        with other.open("rb") as file:
            found = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
            assert len(list(found.iter_decoded_messages())) == len(TOPICS)
            assert {one.name for one in found.iter_metadata()} == {"parcours.run", "parcours.end"}


@pytest.mark.parametrize("compression", list(mcap.writer.CompressionType))
def test_an_mcap_that_another_writer_compressed_reads_the_same(
    compression: mcap.writer.CompressionType, tmp_path: Path
) -> None:
    target = tmp_path / "again.mcap"
    with recorded("mcap", tmp_path).open("rb") as file, target.open("wb") as out:
        writer: Any = mcap.writer.Writer(out, compression=compression, chunk_size=300)
        writer.start("ros1", "another")
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "ros1", kind, {})
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    again = read_recording(target, Poses())
    assert again.complete and again.trace == TRACE
    assert _plain(again.trace) == _plain(TRACE)


@pytest.mark.parametrize("compression", [RosbagsWriter.CompressionFormat.BZ2, RosbagsWriter.CompressionFormat.LZ4])
def test_a_bag_that_another_writer_compressed_reads_the_same(
    compression: RosbagsWriter.CompressionFormat, tmp_path: Path
) -> None:
    target = tmp_path / "again.bag"
    writer = RosbagsWriter(target)
    writer.set_compression(compression)
    with RosbagsReader(recorded("bag", tmp_path)) as reader, writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        places = {
            one.id: writer.add_connection(
                one.topic, one.msgtype, typestore=store, msgdef=one.msgdef.data, md5sum=one.digest
            )
            for one in reader.connections
        }
        for connection, at, data in reader.messages():
            writer.write(places[connection.id], at, data)
    again = read_recording(target, Poses())
    assert again.complete and again.trace == TRACE
    assert [e.payload is None for e in again.trace.events] == [e.payload is None for e in TRACE.events]


def _plain(trace: Trace) -> list[str]:
    return [repr(event.payload) for event in trace.events]


SCAN = """Header header
uint8 NONE=0   # nothing
string FRAME= base # link
geometry_msgs/Pose[] poses
Local[2] others
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Pose
Point position
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
================================================================================
MSG: my_msgs/Local
bool here
"""


@pytest.mark.parametrize(("name", "text"), [("geometry_msgs/Twist", TWIST), ("my_msgs/Scan", SCAN)])
def test_md5_sums_are_those_of_ros(name: str, text: str) -> None:
    genmsg: Any = import_module("mcap_ros1._vendor.genmsg")
    load = import_module("mcap_ros1._vendor.genmsg.msg_loader").load_msg_from_string
    context = genmsg.MsgContext.create_default()
    first, *others = text.split("=" * 80 + "\nMSG: ")
    for other in reversed(others):
        title, _, rest = other.partition("\n")
        load(context, rest, title)
    assert md5_of(text, name) == genmsg.compute_md5(context, load(context, first, name))

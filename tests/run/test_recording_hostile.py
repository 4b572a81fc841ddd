"""Files that are no recordings, lie about their lengths or were tampered with: refused by name, in little memory."""

from __future__ import annotations

import bz2
import io
import json
import struct
import tracemalloc
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadResults
from parcours.run.recording import Entry, convert, read_recording, write_recording
from parcours.run.recording.content import END, EVENT, EVENTS, RUN, TEXT
from parcours.run.recording.source import ByteSource
from parcours.run.recording.topic import Format, Topic, open_writer
from parcours.run.trace import Trace, TraceEvent

both = pytest.mark.parametrize("form", ("mcap", "bag"))
HEAD: dict[str, object] = {
    "parcours": "recording/1",
    "clock": "wall",
    "host": "h",
    "case": "c",
    "begin": 1,
    "about": {},
}
TAIL: dict[str, object] = {"events": 0, "noise": None, "left_out": [], "about": {}}


class Numbers:
    """One whole number as the payload of every channel; refuses negative ones."""

    def __init__(self, *fields: Entry) -> None:
        self.fields = fields or (Entry("n", "int"),)

    def form(self, channel: str) -> Sequence[Entry] | None:
        return None if channel == "unknown" else self.fields

    def flatten(self, channel: str, payload: object) -> Sequence[object]:
        return (payload,)

    def restore(self, channel: str, values: Sequence[object]) -> object:
        (number,) = values
        if not isinstance(number, int) or number < 0:
            raise ValueError("negative")
        return number


TRACE = Trace("wall", tuple(TraceEvent(k, "send", "A", "", "c", k, "", k) for k in range(12)), "h", "c")


def valid(form: str, folder: Path) -> Path:
    path = folder / f"valid.{form}"
    write_recording(path, TRACE, Numbers())
    return path


Message = tuple[Topic, int, bytes]


def composed(form: Format, folder: Path, *messages: Message) -> Path:
    """Return a file of these messages."""
    path = folder / f"composed.{form}"
    writer = open_writer(form, path.open("wb"), str(path))
    for message in messages:
        writer.write(*message)
    writer.close()
    return path


def said(topic: Topic, what: object) -> Message:
    return topic, 1, TEXT.pack((what if isinstance(what, str) else json.dumps(what),))


def event(number: int, kind: str = "send", payload: int = -1, topic: str = "", channel: str = "c") -> Message:
    return EVENTS, 1, EVENT.pack((number, 0, -1, payload, False, kind, "A", "", channel, topic, ""))


@both
@given(place=st.integers(0, 10**6), content=st.binary(min_size=1, max_size=8))
@settings(max_examples=60)
def test_a_recording_with_other_bytes_is_refused_or_read_but_nothing_else_happens(
    form: str, place: int, content: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = valid(form, tmp_path_factory.mktemp("tampered"))
    whole = bytearray(path.read_bytes())
    place %= len(whole)
    whole[place : place + len(content)] = content
    path.write_bytes(whole)
    try:
        read_recording(path, Numbers())
    except BadResults as error:
        assert str(path) in str(error)


@both
@given(content=st.binary(max_size=200))
def test_anything_after_the_magic_is_refused(
    form: str, content: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("noise") / "noise"
    path.write_bytes((b"\x89MCAP0\r\n" if form == "mcap" else b"#ROSBAG V2.0\n") + content)
    with pytest.raises(BadResults):
        read_recording(path)


@both
@pytest.mark.parametrize("lie", [2**28, 2**31, 2**32 - 1])
def test_lengths_that_lie_cost_no_memory(form: str, lie: int, tmp_path: Path) -> None:
    path = valid(form, tmp_path)
    whole = path.read_bytes()
    tracemalloc.start()
    for place in range(4096 if form == "bag" else 8, len(whole) - 8, 29):
        path.write_bytes(whole[:place] + struct.pack("<I", lie) + whole[place + 4 :])
        try:
            read_recording(path, Numbers())
        except BadResults:
            continue
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20_000_000


@both
def test_a_record_longer_than_is_ever_read_at_once_is_refused(form: str, tmp_path: Path) -> None:
    path = tmp_path / "sparse"
    head = (
        b"\x89MCAP0\r\n\x06" + struct.pack("<Q", 2**29)
        if form == "mcap"
        else b"#ROSBAG V2.0\n" + struct.pack("<I", 2**29)
    )
    path.write_bytes(head)
    with path.open("r+b") as file:
        file.truncate(2**30)
    with pytest.raises(BadResults, match="recording-too-large"):
        read_recording(path)


@both
def test_more_than_was_asked_for_is_not_read(form: str, tmp_path: Path) -> None:
    path = valid(form, tmp_path)
    with pytest.raises(BadResults, match="at most 500 bytes are read"):
        read_recording(path, Numbers(), most=500)


def expand(compression: str, content: bytes, size: int, where: str) -> bytes:
    return ByteSource(io.BytesIO(), where, 1 << 30).expand(compression, content, size)


LZ4 = import_module("lz4.frame")
BOMB = bytes(50_000_000)
BOMBS = {"bz2": bz2.compress(BOMB), "lz4": LZ4.compress(BOMB), "zstd": zstandard.compress(BOMB)}


@pytest.mark.parametrize("compression", tuple(BOMBS))
def test_a_chunk_that_expands_to_more_than_it_says_costs_no_memory(compression: str) -> None:
    tracemalloc.start()
    with pytest.raises(BadResults, match="a chunk of 1000 bytes has another size"):
        expand(compression, BOMBS[compression], 1000, "bomb.mcap")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000


@pytest.mark.parametrize("compression", ["bz2", "lz4", "zstd"])
def test_a_chunk_that_is_not_compressed_as_it_says_is_refused(compression: str) -> None:
    with pytest.raises(BadResults, match="recording-damaged"):
        expand(compression, b"nothing of that kind", 10, "a.mcap")


def test_a_compression_nobody_knows_is_refused() -> None:
    with pytest.raises(BadResults, match="recording-compression"):
        expand("rar", b"", 0, "a.mcap")


@pytest.mark.parametrize("content", [b"", b"\x89MCA", b"#ROSBAG V1.2\n", b"{}", b"PK\x03\x04"])
def test_what_is_no_recording_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(BadResults, match="recording-magic"):
        read_recording(path)


def test_what_is_not_there_or_is_no_file_is_refused(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "none", tmp_path, tmp_path / "pipe"):
        with pytest.raises(BadResults, match="recording-unreadable"):
            read_recording(path)


@both
@pytest.mark.parametrize(
    ("messages", "slug"),
    [
        ((event(0),), "recording-no-run"),
        ((said(RUN, HEAD), event(0), event(0)), "recording-mixed"),
        ((said(RUN, HEAD), said(RUN, HEAD | {"case": "d"})), "recording-mixed"),
        ((said(RUN, HEAD | {"parcours": "recording/9"}),), "recording-version"),
        ((said(RUN, HEAD | {"clock": "sun"}),), "recording-damaged"),
        ((said(RUN, HEAD | {"clock": ["wall"]}),), "recording-damaged"),
        ((said(RUN, HEAD | {"begin": True}),), "recording-damaged"),
        ((said(RUN, "[" * 100_000),), "recording-damaged"),
        ((said(RUN, "[]"),), "recording-damaged"),
        ((said(RUN, HEAD), said(END, TAIL | {"noise": [1]})), "recording-damaged"),
        ((said(RUN, HEAD), said(END, TAIL | {"events": "many"})), "recording-damaged"),
        ((said(RUN, HEAD), said(END, TAIL | {"left_out": 1})), "recording-damaged"),
        ((said(RUN, HEAD), event(0, "explosion")), "recording-damaged"),
        ((said(RUN, HEAD), (EVENTS, 1, b"\x00" * 20)), "recording-damaged"),
        ((said(RUN, HEAD), (EVENTS, 1, event(0)[2] + b"\x00")), "recording-damaged"),
        ((said(RUN, HEAD), (Topic(EVENTS.name, "a/A", "0" * 32, "bool b"), 1, b"\x00")), "recording-schema"),
        ((said(RUN, HEAD), (Topic("/c", "a/A", "0" * 32, "bool b"), 1, b"\x00"), event(0, "send", 0, "/c")),
         "recording-schema"),
        ((said(RUN, HEAD), (Topic("/c", "a/A", "0" * 32, "int64 n"), 1, b"\x00"), event(0, "send", 0, "/c")),
         "recording-damaged"),
        ((said(RUN, HEAD), (Topic("/c", "a/A", "0" * 32, "int64 n"), 1, b"\xff" * 8), event(0, "send", 0, "/c")),
         "recording-damaged"),
        ((said(RUN, HEAD), (Topic("/c", "a/A", "0" * 32, "int64 n"), 1, b"\x00" * 8),
          event(0, "send", 0, "/c", "unknown")), "recording-schema"),
    ],
)  # fmt: skip
def test_a_sound_file_that_says_nonsense_is_refused(
    form: Format, messages: tuple[Message, ...], slug: str, tmp_path: Path
) -> None:
    with pytest.raises(BadResults, match=slug):
        read_recording(composed(form, tmp_path, *messages), Numbers())


@both
def test_a_recording_of_another_form_is_refused_with_both_forms(form: str, tmp_path: Path) -> None:
    path = valid(form, tmp_path)
    with pytest.raises(BadResults, match=r"of the fields 'float64 n; ', but they are of 'int64 n; '"):
        read_recording(path, Numbers(Entry("n", "float")))


@both
def test_payloads_and_events_that_somebody_took_out_are_missed(form: Format, tmp_path: Path) -> None:
    without = composed(form, tmp_path, said(RUN, HEAD), event(0, "send", 0, "/c"), said(END, TAIL | {"events": 1}))
    assert read_recording(without, Numbers()).missing == "the payloads of 1 events are not there"
    fewer = composed(form, tmp_path, said(RUN, HEAD), event(0), said(END, TAIL | {"events": 2}))
    assert read_recording(fewer, Numbers()).missing == "1 of 2 events are there"


def test_a_checksum_that_is_wrong_is_found(tmp_path: Path) -> None:
    path = valid("mcap", tmp_path)
    whole = path.read_bytes()
    place = whole.index(b"send")
    path.write_bytes(whole[:place] + b"tend" + whole[place + 4 :])
    with pytest.raises(BadResults, match="checksum"):
        read_recording(path, Numbers())


def test_messages_that_are_not_of_ros_1_are_refused(tmp_path: Path) -> None:
    path = valid("mcap", tmp_path)
    path.write_bytes(path.read_bytes().replace(b"\x04\x00\x00\x00ros1", b"\x04\x00\x00\x00json"))
    with pytest.raises(BadResults, match="recording-"):
        read_recording(path, Numbers())


@both
def test_a_damaged_recording_is_not_converted(form: Format, tmp_path: Path) -> None:
    target = tmp_path / "target.bag"
    with pytest.raises(BadResults, match="recording-damaged"):
        convert(composed(form, tmp_path, said(RUN, "no json")), target)
    assert not target.exists()

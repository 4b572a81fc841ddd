"""Runs recorded and read back: every event, every payload bit; cut off, late, converted; foreign types as they are."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from parcours.run.noise import Noise
from parcours.run.recording import (
    Entry,
    Raw,
    Recorder,
    convert,
    read_recording,
    write_recording,
)
from parcours.run.trace import Kind, Trace, TraceEvent

FORMATS = ("mcap", "bag")
both = pytest.mark.parametrize("form", FORMATS)

FORMS = {
    "pose": (Entry("stamp", "int", "[ns]"), Entry("x", "float", "[m]"), Entry("halted", "bool")),
    "path": (Entry("xs", "floats", "[m]"), Entry("id", "int"), Entry("kinds", "ints"), Entry("name", "text")),
    "go": (),
}


class Flat:
    """Payloads that are their flat values."""

    def form(self, channel: str) -> Sequence[Entry] | None:
        return FORMS.get(channel)

    def flatten(self, channel: str, payload: object) -> Sequence[object]:
        assert isinstance(payload, tuple)
        return payload

    def restore(self, channel: str, values: Sequence[object]) -> object:
        return tuple(values)


CODEC = Flat()


def bits(payload: object) -> object:
    if isinstance(payload, tuple):
        return tuple(bits(one) for one in payload)
    if isinstance(payload, float):
        return struct.pack("<d", payload)
    if isinstance(payload, np.ndarray):
        return str(payload.dtype), payload.shape, payload.tobytes()
    return payload


def payload_bits(trace: Trace) -> list[object]:
    return [bits(event.payload) for event in trace.events]


texts = st.text(max_size=8)
whole = st.integers(-(2**63), 2**63 - 1)
payloads = {
    "pose": st.tuples(whole, st.floats(), st.booleans()),
    "path": st.tuples(
        arrays(np.float64, st.integers(0, 5)), whole, arrays(np.int64, st.integers(0, 5)), texts
    ),
    "go": st.just(()),
    "": st.none(),
}  # fmt: skip
raws = st.builds(
    Raw, st.sampled_from(["a/A", "b_msgs/B"]), st.just("0" * 32), st.just("uint8[] x\n"), st.binary(max_size=20)
)


@st.composite
def occurrences(draw: st.DrawFn) -> TraceEvent:
    channel = draw(st.sampled_from(tuple(payloads)))
    return TraceEvent(
        draw(st.integers(0, 10**18)), draw(st.sampled_from(get_args(Kind))), draw(texts), draw(texts), channel,
        draw(st.integers(-1, 3)), draw(texts), draw(st.none() | payloads[channel] | raws),
    )  # fmt: skip


traces = st.builds(
    Trace,
    clock=st.sampled_from(["simulated", "wall"]),
    events=st.lists(occurrences(), max_size=12).map(lambda found: tuple(sorted(found, key=lambda e: e.time))),
    host=texts,
    case=texts,
    noise=st.none() | st.builds(Noise, st.lists(st.integers(0, 10**9), min_size=1).map(tuple), st.text()),
)


@both
@settings(max_examples=40)
@given(trace=traces, about=st.dictionaries(texts, texts, max_size=3))
def test_a_trace_reads_back_as_it_was_written_bit_by_bit(
    form: str, trace: Trace, about: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("recording") / f"run.{form}"
    write_recording(path, trace, CODEC, begin=10**9, about=about)
    again = read_recording(path, CODEC)
    assert again.trace == trace
    assert payload_bits(again.trace) == payload_bits(trace)
    assert again.complete and again.left_out == () and about.items() <= again.about.items()


@both
@settings(max_examples=40)
@given(trace=traces)
def test_what_was_converted_into_the_other_format_reads_the_same(
    form: str, trace: Trace, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("recording")
    source, target = folder / f"run.{form}", folder / f"other.{'bag' if form == 'mcap' else 'mcap'}"
    write_recording(source, trace, CODEC)
    convert(source, target)
    again = read_recording(target, CODEC)
    assert again.complete and again.trace == trace
    assert payload_bits(again.trace) == payload_bits(trace)


@both
def test_a_payload_is_written_once_however_many_events_speak_of_it(form: str, tmp_path: Path) -> None:
    way = (np.arange(10_000.0), 1, np.arange(3), "long")
    kinds: tuple[Kind, ...] = ("send", "hold", "release", "receive")
    events = tuple(TraceEvent(k, kind, "A", "", "path", 4, payload=way) for k, kind in enumerate(kinds))
    path = tmp_path / f"run.{form}"
    write_recording(path, Trace("wall", events), CODEC)
    assert path.stat().st_size < 2 * 80_000
    again = read_recording(path, CODEC).trace.events
    assert all(event.payload is again[0].payload for event in again)


@both
def test_another_payload_of_the_same_message_is_kept_apart(form: str, tmp_path: Path) -> None:
    sent, corrupted = (1, 0.5, False), (1, 99.0, False)
    events = (
        TraceEvent(0, "send", "A", "", "pose", 4, payload=sent),
        TraceEvent(1, "receive", "B", "", "pose", 4, payload=corrupted),
    )
    path = tmp_path / f"run.{form}"
    write_recording(path, Trace("wall", events), CODEC)
    assert [event.payload for event in read_recording(path, CODEC).trace.events] == [sent, corrupted]


@both
def test_events_that_became_known_late_are_put_in_order_of_time(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{form}"
    with Recorder(path, CODEC, clock="wall") as recorder:
        for at in (5_000_000_000, 1, 3_000_000_000, 1):
            recorder.write(TraceEvent(at, "send", f"A{at}", channel="pose", payload=(at, 0.0, True)))
    events = read_recording(path, CODEC).trace.events
    assert [(event.time, event.component) for event in events] == [
        (1, "A1"), (1, "A1"), (3_000_000_000, "A3000000000"), (5_000_000_000, "A5000000000"),
    ]  # fmt: skip
    assert all(isinstance(event.payload, tuple) and event.payload[0] == event.time for event in events)


@both
def test_what_is_known_at_the_end_only_is_recorded_too(form: str, tmp_path: Path) -> None:
    path, noise = tmp_path / f"run.{form}", Noise((40, 90, 7000), "reading the clock")
    with Recorder(path, clock="wall", host="ros1", case="c-7", begin=1_700_000_000_000_000_000) as recorder:
        recorder.conclude(noise, {"verdict": "fail", "reason": "too late"})
    again = read_recording(path)
    assert again.trace == Trace("wall", (), "ros1", "c-7", noise)
    assert (again.about["verdict"], again.about["reason"]) == ("fail", "too late")
    assert again.begin == 1_700_000_000_000_000_000


@both
def test_payloads_that_no_codec_knows_are_left_out_and_named(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{form}"
    write_recording(path, Trace("wall", (TraceEvent(0, "send", channel="odd", payload=object()),)), CODEC)
    again = read_recording(path, CODEC)
    assert again.left_out == ("odd",)
    assert again.trace.events[0].payload is None


@both
def test_without_a_codec_events_and_foreign_messages_are_read(form: str, tmp_path: Path) -> None:
    raw = Raw("a/A", "1" * 32, "uint8[] x\n", b"\x01\x00\x00\x00\x07")
    events = (
        TraceEvent(0, "send", channel="pose", payload=(1, 2.0, True)),
        TraceEvent(1, "send", channel="foreign", payload=raw),
    )
    path = tmp_path / f"run.{form}"
    write_recording(path, Trace("wall", events), CODEC)
    again = read_recording(path)
    assert again.trace.events == events
    assert [event.payload for event in again.trace.events] == [None, raw]


WRITER = """
import sys
from pathlib import Path
from parcours.run.recording import Recorder
from parcours.run.trace import TraceEvent
recorder = Recorder(Path(sys.argv[1]), clock="wall", host="processes", case="c-1")
for number in range(10**9):
    recorder.write(TraceEvent(number * 1_000_000, "take", "Planner", f"p{number % 50}", text=str(number)))
    if number == 2000:
        print("under way", flush=True)
"""


@both
def test_a_recording_whose_writer_was_killed_is_read_and_says_that_it_is_incomplete(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{form}"
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    try:
        assert writer.stdout is not None and writer.stdout.readline() == "under way\n"
    finally:
        os.kill(writer.pid, signal.SIGKILL)
        writer.communicate()
    again = read_recording(path)
    assert not again.complete and "stops after" in again.missing
    events = again.trace.events
    assert len(events) >= 2000 - 251, "only the last quarter of a second may be lost"
    assert [int(event.text) for event in events] == list(range(len(events)))
    assert again.trace.case == "c-1"


@both
def test_a_recording_whose_run_raised_stays_incomplete_but_holds_every_event(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{form}"
    with pytest.raises(KeyError), Recorder(path, clock="wall") as recorder:
        recorder.write(TraceEvent(0, "take", "A", "p1"))
        raise KeyError("in the run")
    again = read_recording(path)
    assert not again.complete and len(again.trace.events) == 1


def _cut_off(form: str, events: Sequence[TraceEvent], flush_each: int, folder: Path) -> tuple[bytes, int]:
    path = folder / f"whole.{form}"
    with Recorder(path, CODEC, clock="wall", host="h", case="c") as recorder:
        start = path.stat().st_size
        for number, event in enumerate(events):
            recorder.write(event)
            if number % flush_each == flush_each - 1:
                recorder.flush()
    return path.read_bytes(), start


@both
def test_a_recording_cut_anywhere_gives_what_came_before_the_cut(form: str, tmp_path: Path) -> None:
    events = tuple(TraceEvent(k, "send", "A", "", "pose", k, payload=(k, k / 7, False)) for k in range(40))
    whole, start = _cut_off(form, events, 5, tmp_path)
    path, most = tmp_path / "cut", 0
    for end in range(start, len(whole), 37):
        path.write_bytes(whole[:end])
        again = read_recording(path, CODEC)
        found = again.trace.events
        assert (
            found == events[: len(found)]
            and payload_bits(again.trace) == [bits(e.payload) for e in events][: len(found)]
        )
        assert len(found) >= most and (len(found) == 40 or not again.complete)
        most = len(found)
    assert most == 40


@both
def test_a_chunk_is_on_the_disk_before_the_run_goes_on_a_quarter_of_a_second(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{form}"
    recorder = Recorder(path, clock="wall")
    for at in range(0, 1_000_000_000, 50_000_000):
        recorder.write(TraceEvent(at, "take", "A", "p1"))
    assert read_recording(path).trace.events[-1].time >= 700_000_000
    recorder.flush()
    assert len(read_recording(path).trace.events) == 20
    recorder.close()

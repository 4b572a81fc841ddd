"""Frames and their socket: whatever is said arrives as it was said, and what is no frame is refused."""

from __future__ import annotations

import contextlib
import socket
import time
from dataclasses import dataclass
from typing import get_args

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import HostFailure
from parcours.run.hosts import frames
from parcours.run.hosts.frames import (
    Command,
    Deliver,
    Died,
    Look,
    OfferedTurn,
    Quit,
    Ready,
    Report,
    Scalar,
    TransitionTaken,
    Turned,
    Wire,
)
from parcours.run.hosts.sockets import FrameSocket
from parcours.run.instance import Manner

NUMBERS = st.integers(-(2**63), 2**63 - 1)
WIRES = st.builds(Wire, st.text(), st.binary())
TURNS = st.builds(OfferedTurn, st.text(), NUMBERS, st.text(), st.none() | WIRES, st.tuples(WIRES) | st.just(()))
FIELDS = {
    int: NUMBERS,
    str: st.text(),
    bytes: st.binary(),
    Wire: WIRES,
    Manner: st.sampled_from(get_args(Manner)),
    tuple[int, ...]: st.lists(NUMBERS).map(tuple),
    tuple[OfferedTurn, ...]: st.lists(TURNS, max_size=3).map(tuple),
    tuple[Wire, ...]: st.lists(WIRES, max_size=3).map(tuple),
    tuple[tuple[int, Wire], ...]: st.lists(st.tuples(NUMBERS, WIRES), max_size=3).map(tuple),
    tuple[tuple[int, Wire, tuple[Wire, ...]], ...]: st.lists(
        st.tuples(NUMBERS, WIRES, st.lists(WIRES, max_size=2).map(tuple)), max_size=2
    ).map(tuple),
    Wire | None: st.none() | WIRES,
    tuple[str, ...] | None: st.none() | st.lists(st.text(), max_size=3).map(tuple),
    dict[str, Scalar] | None: st.none()
    | st.dictionaries(st.text(), st.booleans() | NUMBERS | st.floats(allow_nan=False) | st.text(), max_size=3),
}


def any_of(kinds: object) -> st.SearchStrategy[object]:
    """Return any frame of a union of kinds, every field drawn."""
    made: list[st.SearchStrategy[object]] = [
        st.builds(kind, **{field.name: FIELDS[field.type] for field in msgspec.structs.fields(kind)})
        for kind in get_args(kinds)
    ]
    return st.one_of(made)


@given(any_of(Command))
def test_a_command_arrives_as_it_was_given(frame: object) -> None:
    assert frames.command(frames.packed(frame)) == frame  # type: ignore[arg-type]


@given(any_of(Report))
def test_a_report_arrives_as_it_was_given(frame: object) -> None:
    assert frames.report(frames.packed(frame)) == frame  # type: ignore[arg-type]


@given(any_of(Report), any_of(Command))
def test_a_report_is_no_command_and_a_command_no_report(report: object, command: object) -> None:
    with pytest.raises(HostFailure, match=r"must be a command of this version.*\[frame-foreign\]"):
        frames.command(frames.packed(report))  # type: ignore[arg-type]
    with pytest.raises(HostFailure, match=r"must be a report of this version.*\[frame-foreign\]"):
        frames.report(frames.packed(command))  # type: ignore[arg-type]


@given(st.binary(max_size=60))
@settings(max_examples=300)
def test_bytes_of_somebody_else_are_refused_and_nothing_else_is_raised(data: bytes) -> None:
    for read in (frames.command, frames.report):
        with pytest.raises(HostFailure, match="frame-foreign"):
            read(data)


@given(any_of(Command), st.data())
@settings(max_examples=300)
def test_a_damaged_frame_is_refused_or_another_frame_but_nothing_else_is_raised(
    frame: object, data: st.DataObject
) -> None:
    content = bytearray(frames.packed(frame))  # type: ignore[arg-type]
    content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(HostFailure):
        assert isinstance(frames.command(bytes(content)), Command)


@pytest.mark.parametrize("content", [
    b"", b"\xc1", b"\x92\xa4Look", b"\x92\xa4Look\xa1x", b"\x92\xa1\xff\x00",
    b"\x93\xa7Deliver\x00\x92\xa1\xff\xc4\x00", b"\xdd\xff\xff\xff\xff", b"\x91" * 5000,
])  # fmt: skip
def test_frames_cut_short_of_wrong_kinds_or_of_no_text_are_refused(content: bytes) -> None:
    for read in (frames.command, frames.report):
        with pytest.raises(HostFailure, match="frame-foreign"):
            read(content)


@dataclass
class Pair:
    one: FrameSocket
    other: FrameSocket


@pytest.fixture
def pair() -> Pair:
    mine, its = socket.socketpair()
    return Pair(FrameSocket(mine), FrameSocket(its))


def heard(end: FrameSocket, n: int) -> list[bytes]:
    """Return the next n frames."""
    got: list[bytes] = []
    until = time.perf_counter_ns() + 10_000_000_000
    while len(got) < n and time.perf_counter_ns() < until:
        end.wait(until)
        got += end.frames()
    return got


@pytest.mark.parametrize("sizes", [[0], [0, 1, 0, 65_536, 3], [65_531, 65_532, 65_533], [1] * 20_000])
def test_frames_arrive_whole_and_in_order_whatever_their_sizes(pair: Pair, sizes: list[int]) -> None:
    sent = [k.to_bytes(4, "big") * (size // 4) + b"x" * (size % 4) for k, size in enumerate(sizes)]
    got: list[bytes] = []
    for frame in sent:
        pair.one.send(frame)
        if pair.one.waits:
            got += heard(pair.other, 1)
    while len(got) < len(sent):
        pair.one.flush()
        got += heard(pair.other, 1)
    assert got == sent


def test_what_nobody_reads_waits_here_and_keeps_nobody(pair: Pair) -> None:
    sent = [bytes([k]) * 3_000_000 for k in range(8)]
    begun = time.monotonic()
    for frame in sent:
        pair.one.send(frame)
    assert time.monotonic() - begun < 5.0 and pair.one.waits
    got: list[bytes] = []
    until = time.monotonic() + 20.0
    while len(got) < len(sent) and time.monotonic() < until:
        got += pair.other.frames()
        pair.one.flush()
    assert got == sent and not pair.one.waits


def test_an_end_that_is_gone_is_known_and_what_it_had_said_is_heard(pair: Pair) -> None:
    pair.one.send(b"last words")
    pair.one.close()
    assert heard(pair.other, 1) == [b"last words"]
    assert pair.other.frames() == [] and pair.other.closed
    pair.other.send(b"to nobody")
    assert not pair.other.waits


def test_a_length_that_no_frame_has_ends_the_connection(pair: Pair) -> None:
    mine, its = socket.socketpair()
    end = FrameSocket(its)
    mine.sendall(b"\xff\xff\xff\xff" + b"GET / HTTP/1.1\r\n")
    assert end.frames() == [] and end.closed
    mine.close()


def test_a_frame_too_large_to_be_read_is_refused_where_it_is_sent(pair: Pair) -> None:
    with pytest.raises(HostFailure, match=r"at most 64 MiB.*frame-size"):
        pair.one.send(b"\0" * (64 * 1024 * 1024 + 1))


def test_the_smallest_and_the_fullest_frames_are_what_they_say() -> None:
    turned = Turned(3, "taken", 9, "p1", (Wire("c", b"d"),), 8, ((7, Wire("e")),), "t")
    for report in (Ready(), turned, TransitionTaken(1, "", ()), Died(5, -9)):
        assert frames.report(frames.packed(report)) == report
    for command in (Quit(), Look(2), Deliver(1, Wire("c", b"\x00"))):
        assert frames.command(frames.packed(command)) == command

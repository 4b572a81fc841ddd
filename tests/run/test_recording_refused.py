"""What cannot be recorded is refused by name: values, forms, times, places; names and sums are those of ROS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.run.recording import Entry, Recorder, write_recording
from parcours.run.recording.content import Names
from parcours.run.recording.layout import MessageLayout
from parcours.run.trace import Trace, TraceEvent

both = pytest.mark.parametrize("form", ("mcap", "bag"))

FORMS = {
    "pose": (Entry("stamp", "int", "[ns]"), Entry("x", "float", "[m]"), Entry("halted", "bool")),
    "path": (Entry("xs", "floats", "[m]"), Entry("id", "int"), Entry("kinds", "ints"), Entry("name", "text")),
    "go": (),
}


@pytest.mark.parametrize(
    "values",
    [(1, 2.0), (1, 2.0, True, 4), ("1", 2.0, True), (2**63, 2.0, True), (1.5, 2.0, True), (1, "x", True), (1, None, 1)],
)
def test_values_that_are_not_of_their_form_are_refused(values: tuple[object, ...]) -> None:
    with pytest.raises(BadRequest, match="recording-value"):
        MessageLayout(FORMS["pose"], "channel 'pose'").pack(values)


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, np.zeros((2, 2))), (2, [0.5]), (2, np.array([2**63], np.uint64)), (0, "x"), (3, 7), (0, 1.0)],
)
def test_arrays_and_texts_that_are_not_of_their_form_are_refused(place: int, value: object) -> None:
    values: list[object] = [[1.0], 1, [1], "a"]
    values[place] = value
    with pytest.raises(BadRequest, match="recording-value"):
        MessageLayout(FORMS["path"], "channel 'path'").pack(values)


@pytest.mark.parametrize(
    "fields", [(Entry("X", "int"),), (Entry("a", "int"), Entry("a", "int")), (Entry("a b", "int"),)]
)
def test_forms_that_ros_cannot_name_are_refused(fields: tuple[Entry, ...]) -> None:
    with pytest.raises(BadRequest, match="recording-form"):
        MessageLayout(fields, "channel 'c'")


def test_comments_do_not_count_in_the_sum_but_order_does() -> None:
    one, two = Entry("a", "int", "first"), Entry("b", "float")
    plain = MessageLayout((Entry("a", "int"), two), "c")
    assert MessageLayout((one, two), "c").md5 == plain.md5 != MessageLayout((two, one), "c").md5


def test_a_comment_of_several_lines_stays_a_comment() -> None:
    assert (
        MessageLayout((Entry("a", "int", "first\nfloat64 trick"),), "c").definition
        == "int64 a  # first float64 trick\n"
    )


@pytest.mark.parametrize(
    "channel", ["", "/", "a b", "ünï", "7up", "a//b", "parcours/events", "/parcours/run", "x" * 50]
)
def test_every_channel_gets_a_topic_that_ros_can_name(channel: str) -> None:
    topic = Names().flat(channel, "")
    parts = topic.name.split("/")[1:]
    assert all(part and part.isascii() and part[0].isalpha() for part in parts)
    assert topic.name not in ("/parcours/events", "/parcours/run")
    assert topic.type.removeprefix("parcours/").isalnum()


@both
def test_a_disk_without_room_is_named(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{form}"
    path.symlink_to("/dev/full")
    with pytest.raises(BadRequest, match=f"run.{form}: must be writable, but: No space left"):
        Recorder(path, clock="wall")


def test_a_folder_that_is_not_there_and_a_name_of_no_format_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="folder-unwritable"):
        Recorder(tmp_path / "none" / "run.mcap", clock="wall")
    with pytest.raises(BadRequest, match="recording-suffix"):
        Recorder(tmp_path / "run.json", clock="wall")


@both
@pytest.mark.parametrize("at", [-2_000_000_000, 2**63, 2**64])
def test_a_time_that_no_recording_can_hold_is_refused(form: str, at: int, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="recording-time"):
        write_recording(tmp_path / f"run.{form}", Trace("wall", (TraceEvent(at, "note"),)))

"""`parcours recording` tells what is there, and converts."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from parcours.cli.recording import command
from parcours.errors import BadRequest
from parcours.run.recording import Recorder, read_recording, write_recording
from parcours.run.trace import Trace, TraceEvent, read_trace

EVENTS = (TraceEvent(0, "take", "A", "p1"), TraceEvent(1_500_000_000, "take", "A", "p2"), TraceEvent(10**10, "note"))


def test_a_recording_is_told_and_written_in_the_other_formats(tmp_path: Path) -> None:
    bag, target, lines = tmp_path / "run.bag", tmp_path / "run.mcap", tmp_path / "run.jsonl"
    trace = Trace("wall", EVENTS, "ros1", "case-1")
    write_recording(bag, trace, about={"verdict": "pass"})
    result = CliRunner().invoke(command, [str(bag), "--out", str(target), "--trace", str(lines)])
    assert result.exit_code == 0, result.output
    said = result.output.splitlines()
    assert said[0] == "case case-1 on ros1, wall clock"
    assert [line.split() for line in said[1:3]] == [["2", "take"], ["1", "note"]]
    assert "10.000 s from the first event to the last" in said and "verdict: pass" in said and "complete" in said
    assert read_recording(target).trace == read_trace(lines) == trace


def test_an_incomplete_recording_is_said_to_be_so(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = Recorder(path, clock="wall")
    recorder.write(EVENTS[0])
    recorder.flush()
    result = CliRunner().invoke(command, [str(path)])
    assert "incomplete: the recording stops after 1 events" in result.output
    recorder.close()


def test_a_target_of_no_known_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.bag"
    write_recording(path, Trace("wall", EVENTS))
    result = CliRunner().invoke(command, [str(path), "--out", str(tmp_path / "run.txt")])
    assert isinstance(result.exception, BadRequest) and "recording-suffix" in str(result.exception)

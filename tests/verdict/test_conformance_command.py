"""`parcours conform`: what it prints, and its exit code."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli.conform import command
from parcours.errors import BadRequest, BadResults
from parcours.run.trace import Trace, TraceEvent, write_trace

Run = Callable[..., Result]

MODEL = """
parcours: model/1
name: lamp
messages:
  Light: {fields: {level: {type: int}}}
channels:
  light: {from: Lamp, to: environment, message: Light}
components:
  Lamp:
    machines:
      m:
        initial: off
        transitions:
          switch_on: {from: off, to: on, message: light(3)}
          switch_off: {from: on, to: off}
"""

TAKEN = (
    TraceEvent(0, "take", "Lamp", "switch_on"),
    TraceEvent(0, "send", "Lamp", "", "light", 0),
    TraceEvent(5_000_000, "take", "Lamp", "switch_off"),
)


@pytest.fixture
def conform(tmp_path: Path) -> Run:
    (tmp_path / "model.yaml").write_text(MODEL)

    def run(events: tuple[TraceEvent, ...], *options: str) -> Result:
        write_trace(tmp_path / "trace.jsonl", Trace("wall", events))
        words = [str(tmp_path / "trace.jsonl"), "--model", str(tmp_path / "model.yaml"), *options]
        return CliRunner().invoke(command, words)

    return run


def test_a_conforming_trace_exits_with_0(conform: Run) -> None:
    result = conform(TAKEN)
    assert (result.exit_code, result.output) == (0, "pass: 3 events of Lamp are as the model allows\n")


def test_a_deviation_exits_with_1_and_says_where_what_and_how(conform: Run) -> None:
    result = conform((*TAKEN, TAKEN[2]))
    assert result.exit_code == 1
    assert result.output.splitlines() == [
        "fail: event 3 at 5.000 ms, Lamp: switch_off cannot be taken here",
        "expected: take switch_on",
        "path:     switch_on switch_off",
    ]


def test_json_says_the_same(conform: Run) -> None:
    result = conform((TAKEN[0], TAKEN[2]), "--json")
    record = json.loads(result.output)
    assert (result.exit_code, record["verdict"]) == (1, "fail")
    assert record["deviation"] == {
        "position": 1,
        "time": 5_000_000,
        "component": "Lamp",
        "kind": "take",
        "name": "switch_off",
        "rule": "switch_off came before what the last transition must send",
        "expected": [{"what": "send", "name": "light", "values": {"level": 3}}],
        "path": ["switch_on"],
        "doubt": "",
    }


def test_silence_is_a_deviation_where_a_timeout_is_given(conform: Run) -> None:
    assert conform(TAKEN, "--duration", "30").exit_code == 0
    result = conform(TAKEN, "--quiescence", "light=20", "--duration", "30")
    assert result.exit_code == 1
    assert "nothing came on light within 20 ms" in result.output


def test_from_messages_alone_hidden_steps_are_filled_in(conform: Run) -> None:
    sends = (TAKEN[1], TraceEvent(9, "send", "Lamp", "", "light", 1))
    assert conform(sends, "--observes", "messages").exit_code == 0
    assert conform(sends).exit_code == 1


def test_what_cannot_be_decided_exits_with_3(conform: Run) -> None:
    result = conform((TraceEvent(0, "note", text="begun"),))
    assert result.exit_code == 3
    assert result.output.startswith("inconclusive: the trace shows no transitions")


@pytest.mark.parametrize(
    "option", ["--quiescence light", "--quiescence light=soon", "--duration nan", "--duration inf"]
)
def test_times_that_are_none_are_refused(conform: Run, option: str) -> None:
    assert isinstance(conform(TAKEN, *option.split()).exception, BadRequest)


def test_unknown_names_and_files_that_are_no_traces_are_refused(conform: Run, tmp_path: Path) -> None:
    for option in (("--component", "Lump"), ("--quiescence", "lihgt=1"), ("--unmodelled", "lihgt")):
        assert isinstance(conform(TAKEN, *option).exception, BadRequest)
    (tmp_path / "other.jsonl").write_text("{}\n")
    result = CliRunner().invoke(command, [str(tmp_path / "other.jsonl"), "--model", str(tmp_path / "model.yaml")])
    assert isinstance(result.exception, BadResults)

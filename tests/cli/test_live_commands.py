"""`parcours run` on real processes: interrupted, killed and resumed; `parcours judge` afterwards."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from command_line import parcours_here
from parcours.run.recording import read_recording
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.components.study import component_study
from parcours_ramp.system.live_results import rejudge

_PATIENCE = 240.0
"""[s]; a loaded machine that compiles first is slow."""


class Command:
    """`parcours` in a session of its own, with all its descendants."""

    def __init__(self, *arguments: str, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "parcours", *arguments], cwd=folder, text=True, start_new_session=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.pid = self._process.pid

    def wait_for(self, what: Callable[[], bool]) -> None:
        until = time.monotonic() + _PATIENCE
        while not what():
            assert self._process.poll() is None, f"ended with {self._process.returncode}: {self.ended()}"
            assert time.monotonic() < until, "nothing came of it"
            time.sleep(0.02)

    def signal(self, number: int, *, group: bool = False) -> None:
        (os.killpg if group else os.kill)(self.pid, number)

    def ended(self) -> tuple[int, str, str]:
        """Return exit code, output and complaints once it has ended; all that holds its pipes must have, too."""
        out, complaint = self._process.communicate(timeout=_PATIENCE)
        return self._process.returncode, out, complaint

    def clear(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self._process.communicate(timeout=10)


@pytest.fixture
def parcours(tmp_path: Path) -> Iterator[Callable[..., Command]]:
    begun: list[Command] = []

    def begin(*arguments: str) -> Command:
        begun.append(Command(*arguments, folder=tmp_path))
        return begun[-1]

    yield begin
    for one in begun:
        one.clear()


def session_of(pid: int) -> list[int]:
    """Return the processes of a session that are alive."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            fields = entry.read_text().rpartition(")")[2].split()
            if fields[3] == str(pid) and fields[0] != "Z":
                found.append(int(entry.parent.name))
    return found


def nobody_is_left(pid: int, within: float = 5.0) -> bool:
    until = time.monotonic() + within
    while session_of(pid) and time.monotonic() < until:
        time.sleep(0.02)
    return not session_of(pid)


COMPONENTS = ("run", "ramp_components", "--host", "processes", "--record", "mcap", "--out", "out")


def test_ctrl_c_in_the_middle_of_component_cases_leaves_nobody_and_no_traceback(
    parcours: Callable[..., Command], tmp_path: Path
) -> None:
    command = parcours(*COMPONENTS)
    command.wait_for(lambda: len(list((tmp_path / "out" / "recordings").glob("*.mcap"))) >= 5)
    command.signal(signal.SIGINT, group=True)
    code, said, complaint = command.ended()
    assert (code, "Traceback" in complaint) == (130, False), complaint
    kept = len((tmp_path / "out" / "cases.jsonl").read_text().splitlines())
    assert kept >= 4 and f"interrupted: {kept} of 261 cases are finished and kept in out" in said
    assert nobody_is_left(command.pid)
    for path in sorted((tmp_path / "out" / "recordings").glob("functional-*.mcap")):
        assert component_study().rejudge(path).agrees


def test_ctrl_c_while_the_nodes_are_being_started_leaves_nobody_and_no_traceback(
    parcours: Callable[..., Command],
) -> None:
    command = parcours(*COMPONENTS)
    command.wait_for(lambda: len(session_of(command.pid)) >= 2)
    time.sleep(0.3)
    command.signal(signal.SIGINT, group=True)
    code, _, complaint = command.ended()
    assert (code, "Traceback" in complaint) == (130, False), complaint
    assert nobody_is_left(command.pid)


SYSTEM = ("run", "ramp_system", "--host", "processes", "--schedule", "guarded", "--cases", "3", "--time-limit", "0.5",
          "--record", "mcap", "--out", "out", "--fail-if", "deaths > 0")  # fmt: skip


def test_a_killed_run_keeps_what_was_finished_and_goes_on_from_there(
    parcours: Callable[..., Command], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, recordings = tmp_path / "out" / "live.jsonl", tmp_path / "out" / "recordings"
    second = recordings / "system-000001.mcap"
    command = parcours(*SYSTEM)
    command.wait_for(lambda: second.exists() and second.stat().st_size > 100_000)
    command.signal(signal.SIGKILL)
    command.ended()
    assert nobody_is_left(command.pid, 3.0)

    head, first = log.read_text().splitlines()
    assert json.loads(head)["parcours"].startswith("live/") and json.loads(first)["number"] == 0
    cut = read_recording(second, RampCodec())
    assert not cut.complete and len(cut.trace.events) > 100
    judged = rejudge(second)
    assert judged.judgement.verdict is Verdict.INCONCLUSIVE and "incomplete" in judged.judgement.why

    with log.open("a") as file:
        file.write('{"number": 1, "id": "ram')  # as if killed while it wrote
    again = parcours(*SYSTEM)
    code, out, complaint = again.ended()
    assert code == 0, complaint
    lines = log.read_text().splitlines()
    assert lines[:2] == [head, first] and [json.loads(line)["number"] for line in lines[1:]] == [0, 1, 2]
    assert "all 3 cases are finished in out" in out and nobody_is_left(again.pid)

    monkeypatch.chdir(tmp_path)
    code, out, complaint = parcours_here("judge", "out/recordings")
    assert code == 0 and "3 of 3 recordings earn the verdict that was recorded" in out, complaint
    code, _, complaint = parcours_here(*SYSTEM, "--seed", "9")
    assert code == 2 and "results-other" in complaint and "seed" in complaint


@pytest.mark.parametrize(("arguments", "slug"), [
    (("run", "ramp_components", "--host", "nowhere", "--out", "out"), "parameter-choice"),
    (("run", "ramp_system", "--host", "nowhere", "--out", "out"), "parameter-choice"),
    (("judge", "."), "recording-case"),
    (("judge", "absent.mcap"), "recording-"),
    (("run", "ramp_system", "--host", "processes", "--faults", "Planer: crash at 3 s", "--out", "out"), "fault-"),
])  # fmt: skip
def test_what_cannot_be_done_is_refused_in_one_paragraph(
    arguments: tuple[str, ...], slug: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, complaint = parcours_here(*arguments)
    assert code == 2 and slug in complaint and complaint.count("parcours:") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_study_whose_cases_are_not_in_real_time_has_no_host() -> None:
    code, _, complaint = parcours_here("run", "navigation", "--planner", "orca", "--host", "processes", "--out", "out")
    assert code == 2 and "No such option" in complaint and "--host" in complaint

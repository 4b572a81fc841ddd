"""Tasks in processes of their own: what hangs, dies or raises there is an answer, and costs no other item."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import pytest

from parcours.run.heartbeat import write_place
from parcours.run.keeper import MOST_PROCESSES
from parcours.run.serving import tell
from parcours.run.workers import Crew, Done, Lost, failure_of


def _odd(item: int) -> int:
    """Answer, hang, die or raise."""
    write_place(f"item {item}")
    if item == 1:
        time.sleep(60.0)
    if item == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 3:
        os._exit(7)
    if item == 4:
        raise ValueError("item 4")
    return item * item


@pytest.mark.parametrize("size", [1, 3])
def test_an_item_that_hangs_or_dies_is_an_answer_and_costs_no_other(size: int) -> None:
    with contextlib.closing(Crew(_odd, size, forks=True, patience=2.0)) as crew:
        crew.pending.extend((number, (number,)) for number in range(7))
        answers = dict(crew.answers())
    assert [answers[k] for k in (0, 5, 6)] == [Done(0), Done(25), Done(36)]
    assert answers[1] == Lost("hung", -signal.SIGKILL, "item 1", None)
    assert answers[2] == Lost("died", -signal.SIGKILL, "item 2", None)
    assert answers[3] == Lost("died", 7, "item 3", None)
    assert isinstance(answers[4], Exception)
    assert "case 4: must be computed without an error, but raised ValueError: item 4 (in _odd" in str(
        failure_of("case 4", answers[4])
    )


def _forks_a_child(item: int) -> int:
    if os.fork() == 0:
        os.setsid()
        time.sleep(3.0)
        os._exit(0)
    os._exit(5)


def test_a_child_that_survives_its_worker_does_not_hide_its_death() -> None:
    with contextlib.closing(Crew(_forks_a_child, 1, forks=True, patience=60.0)) as crew:
        crew.pending.append((0, (0,)))
        begun = time.monotonic()
        assert dict(crew.answers()) == {0: Lost("died", 5, "", None)}
        assert time.monotonic() - begun < 2.5


def _comes_back(item: int) -> int:
    return os.fork() and item


def test_a_child_that_comes_back_into_our_code_answers_for_nobody() -> None:
    with contextlib.closing(Crew(_comes_back, 1, forks=True)) as crew:
        crew.pending.extend((number, (number,)) for number in (1, 2))
        assert list(crew.answers()) == [(1, Done(1)), (2, Done(2))]


def _starts_a_program(file: str) -> None:
    import subprocess

    program = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    Path(file).write_text(str(program.pid))
    time.sleep(60)


def test_what_a_task_has_started_ends_with_its_process_group(tmp_path: Path) -> None:
    file = tmp_path / "pid"
    with contextlib.closing(Crew(_starts_a_program, 1, forks=True, own_group=True, patience=1.0)) as crew:
        crew.pending.append((0, (str(file),)))
        [(_, answer)] = crew.answers()
    assert isinstance(answer, Lost) and answer.how == "hung"
    deadline = time.monotonic() + 10
    while _runs(int(file.read_text())) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not _runs(int(file.read_text()))


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _slow_but_telling(n: int) -> int:
    for k in range(n):
        time.sleep(0.3)
        tell(k)
    return n


def test_what_a_task_tells_is_heard_and_is_a_sign_of_life(capfd: pytest.CaptureFixture[str]) -> None:
    heard: list[int] = []
    with contextlib.closing(Crew(_slow_but_telling, 1, forks=True, patience=1.0, heard=heard.append)) as crew:
        crew.pending.append((0, (6,)))
        assert list(crew.answers()) == [(0, Done(6))]
    assert heard == list(range(6))


def _forks_on_and_on(item: int) -> int:
    for _ in range(MOST_PROCESSES + 20):
        if os.fork() == 0:
            time.sleep(60.0)
            os._exit(0)
    time.sleep(60.0)
    return item


def test_strangers_with_too_many_processes_are_ended() -> None:
    with contextlib.closing(Crew(_forks_on_and_on, 1, forks=True, strangers=True)) as crew:
        crew.pending.append((0, (1,)))
        [(_, lost)] = crew.answers()
    assert isinstance(lost, Lost) and lost.how == "tampered"
    assert lost.place == f"changed its process: it had more than {MOST_PROCESSES} processes at once"


def _is_python_s_own(item: int) -> list[object]:
    import types

    return [hasattr(types, "FunctionType"), os.environ.get("PYTHONSAFEPATH")]


def test_files_named_like_python_s_own_do_not_end_a_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("types", "random", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not the library')\n")
    monkeypatch.chdir(tmp_path)
    with contextlib.closing(Crew(_is_python_s_own, 1, strangers=True)) as crew:
        crew.pending.append((0, (1,)))
        assert list(crew.answers()) == [(0, Done([True, None]))]
    assert "PYTHONSAFEPATH" not in os.environ


def _prints_much(megabytes: int) -> int:
    for _ in range(megabytes):
        sys.stdout.write("x" * 1_000_000)
    return megabytes


@pytest.mark.parametrize(("megabytes", "ends"), [(60, False), (80, True)])
def test_what_strangers_print_is_cut_and_counted(megabytes: int, ends: bool, capfd: pytest.CaptureFixture[str]) -> None:
    with contextlib.closing(Crew(_prints_much, 1, forks=True, strangers=True)) as crew:
        crew.pending.append((0, (megabytes,)))
        [(_, answer)] = crew.answers()
    place = "changed its process: it printed more than 64 MB in one case"
    assert (isinstance(answer, Lost) and answer.place == place) if ends else answer == Done(megabytes)
    printed = capfd.readouterr().err
    assert 1 << 18 <= len(printed) < (1 << 18) + 100
    assert printed.endswith("(whatever else this process prints is left out)\n")


def _prints(item: int) -> int:
    sys.stdout.write("printed by a task\n")
    os.system("echo printed by its program")
    return item


def test_what_a_task_prints_goes_to_standard_error(capfd: pytest.CaptureFixture[str]) -> None:
    with contextlib.closing(Crew(_prints, 1, forks=True)) as crew:
        crew.pending.append((0, (1,)))
        assert list(crew.answers()) == [(0, Done(1))]
    assert "printed" not in capfd.readouterr().out

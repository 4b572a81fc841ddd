"""How long programs live: from case to case while they are sound, never longer than what started them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from parcours.errors import HostFailure
from parcours.study.components.process import end_programs
from parcours.study.components.program import ProgramComponent

if TYPE_CHECKING:
    from tests.study.conftest import Workshop

SOUND = """
greet()
while True:
    said = json.loads(sys.stdin.readline() or sys.exit(0))
    if "reset" in said:
        say(reset=True)
    if "permit" in said:
        say(sent={"channel": "done", "message": os.getpid()})
        say(took="b1")
"""
"""Its transitions never end, so that every case ends amid its work."""

ONCE = """
greet()
hear("permit")
say(sent={"channel": "done", "message": os.getpid()})
say(took="b1")
hear("reset")
"""

TIDY = "import atexit; atexit.register(lambda: (time.sleep(0.2), open('tidy', 'w').close()))\n" + SOUND

DEAF = """
greet()
hear("permit")
say(sent={"channel": "done", "message": os.getpid()})
say(took="b1")
time.sleep(1000)
"""


def pid_of(component: ProgramComponent) -> int:
    [(_, pid)] = next(component.handle("push", "", 0)).sends
    assert isinstance(pid, int)
    return pid


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def ends(pid: int) -> bool:
    until = time.monotonic() + 60.0
    while is_running(pid) and time.monotonic() < until:
        time.sleep(0.01)
    return not is_running(pid)


def test_a_sound_program_serves_the_next_case_and_a_failed_one_does_not(workshop: Workshop) -> None:
    first, beside = workshop.bolt(SOUND), workshop.bolt(SOUND)
    pids = pid_of(first), pid_of(beside)
    assert pids[0] != pids[1]
    first.close()
    with pytest.raises(HostFailure, match="must not be used after it was closed"):
        next(first.handle("push", "", 0))
    again = workshop.bolt(SOUND)
    assert pid_of(again) == pids[0]
    os.kill(pids[0], signal.SIGKILL)
    assert "killed by SIGKILL" in workshop.reason(again)
    again.close()
    assert pid_of(workshop.bolt(SOUND)) not in pids


def test_an_idle_program_that_has_died_is_started_again(workshop: Workshop) -> None:
    first = workshop.bolt(SOUND)
    pid = pid_of(first)
    first.close()
    os.kill(pid, signal.SIGKILL)
    assert ends(pid)
    assert pid_of(workshop.bolt(SOUND)) != pid


def test_a_program_that_ends_instead_of_a_second_reset_is_started_again(workshop: Workshop) -> None:
    first = workshop.bolt(ONCE)
    pids = {pid_of(first)}
    first.reset()
    pids.add(pid_of(first))
    first.close()
    assert pid_of(workshop.bolt(ONCE)) not in pids
    assert len(pids) == 2


def test_a_program_that_dies_of_a_second_reset_has_failed(workshop: Workshop) -> None:
    component = workshop.bolt(ONCE + "sys.exit('cannot')")
    pid_of(component)
    component.reset()
    expected = "must answer `reset`, but ended (exit status 1); its last words: 'cannot'"
    assert expected in workshop.reason(component)


def test_words_of_an_earlier_case_are_not_last_words_of_a_later_one(workshop: Workshop) -> None:
    component = workshop.bolt(
        """
        greet()
        hear("permit")
        print("the first case", file=sys.stderr, flush=True)
        say(took="b1")
        reset()
        hear("permit")
        os._exit(9)
        """
    )
    next(component.handle("push", "", 0))
    component.reset()
    assert workshop.reason(component).endswith("but ended (exit status 9) [program-ended]")


def test_programs_see_the_end_of_their_input_and_may_end_in_good_order(workshop: Workshop) -> None:
    component = workshop.bolt(TIDY)
    pid_of(component)
    component.close()
    end_programs()
    assert (workshop.folder / "tidy").exists()


def test_a_forked_process_does_not_keep_the_input_of_programs_open(workshop: Workshop) -> None:
    pid_of(workshop.bolt(TIDY))
    process = multiprocessing.get_context("fork").Process(target=time.sleep, args=(1000,))
    process.start()
    end_programs()
    assert (workshop.folder / "tidy").exists()
    process.kill()
    process.join()


def test_programs_that_do_not_heed_the_end_of_their_input_are_ended(workshop: Workshop) -> None:
    pid = pid_of(workshop.bolt(DEAF))
    end_programs()
    assert not is_running(pid)


def test_a_program_that_hangs_is_ended(workshop: Workshop) -> None:
    component = workshop.bolt("open('pid', 'w').write(str(os.getpid())); time.sleep(1000)", patience=3.0)
    assert "within 3 s, but did not" in workshop.reason(component)
    assert not is_running(int((workshop.folder / "pid").read_text()))


def test_helpers_end_with_their_program(workshop: Workshop) -> None:
    component = workshop.bolt(
        """
        greet()
        hear("permit")
        say(sent={"channel": "done", "message": subprocess.Popen(["sleep", "1000"]).pid})
        say(took="b1")
        hear("permit")
        os._exit(1)
        """
    )
    work = component.handle("push", "", 0)
    [(_, helper)] = next(work).sends
    assert isinstance(helper, int)
    assert is_running(helper)
    with pytest.raises(HostFailure, match="exit status 1"):
        next(work)
    assert ends(helper)


def in_another_process(line: Connection, component: ProgramComponent, workshop: Workshop) -> None:
    own = workshop.bolt(SOUND)
    line.send((workshop.reason(component), pid_of(own)))
    own.close()


def test_a_forked_process_has_programs_of_its_own(workshop: Workshop) -> None:
    idle, used = workshop.bolt(SOUND), workshop.bolt(SOUND)
    pids = pid_of(idle), pid_of(used)
    idle.close()
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=in_another_process, args=(theirs, used, workshop))
    process.start()
    why, pid = ours.recv()
    process.join()
    assert "must be used by the process that started it" in why
    assert pid not in pids
    assert ends(pid)
    assert pid_of(used) == pids[1]
    assert pid_of(workshop.bolt(SOUND)) == pids[0]


TESTER = """
import sys, time
from pathlib import Path
from parcours.model.model_file import parse_model
from parcours.study.components.program import ProgramComponent
from parcours.study.components.systems import ProgramPart

lock = parse_model(Path("lock.yaml").read_text(), "lock.yaml")
component = ProgramComponent(lock.component("Bolt"), ProgramPart((sys.executable, "bolt.py")), {}, "", 0, 60.0)
print(next(component.handle("push", "", 0)).sends[0][1], flush=True)
sys.stdin.readline()
"""


@pytest.mark.parametrize(("source", "kills"), [(DEAF, True), (DEAF, False), (TIDY, False)])
def test_programs_end_with_their_tester_however_it_ends(workshop: Workshop, source: str, kills: bool) -> None:
    from parcours.model.writing import write_model

    (workshop.folder / "lock.yaml").write_text(write_model(workshop.lock))
    workshop.part(source)
    with subprocess.Popen(
        [sys.executable, "-c", TESTER], cwd=workshop.folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as tester:
        assert tester.stdout is not None
        pid = int(tester.stdout.readline())
        assert is_running(pid)
        if kills:
            tester.kill()
        tester.communicate("\n")
    assert ends(pid)
    assert (workshop.folder / "tidy").exists() == (source == TIDY)

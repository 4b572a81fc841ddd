"""Programs in other languages as components: what they hear, what they say, whole cases, and the page about them."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from parcours.abtc import abstract_cases, serialise
from parcours.errors import HostFailure
from parcours.run.enforcement import Execution
from parcours.run.in_process import execute
from parcours.run.port import Component
from parcours.study.components.executing import in_process
from parcours.study.components.process import end_programs
from parcours.study.components.program import ProgramComponent
from parcours.study.components.study import ComponentStudy
from parcours.study.components.tester import prompted
from parcours.study.study_file import read_study

if TYPE_CHECKING:
    from tests.study.conftest import Workshop

ROOT = Path(__file__).parents[2]
WAIT = 60.0
"""Longest wait for what comes for certain [s]."""


def test_a_program_takes_transitions_one_permit_at_a_time(workshop: Workshop) -> None:
    component = workshop.bolt(
        """
        greet()
        given = hear("deliver")
        for transition in ("b1", "b2"):
            hear("permit")
            open(transition, "w").close()
            say(sent={"channel": "done", "message": given})
            say(took=transition, wake=9)
        hear("permit")
        say(took=None, wake=11)
        """
    )
    message = {"deep": [1, "é\n\u2028", None]}
    work = component.handle("push", message, 5)
    assert not (workshop.folder / "b1").exists()
    step = next(work)
    assert (step.transition, component.next_wake()) == ("b1", 9)
    assert step.sends == (("done", {"channel": "push", "message": message, "time": 5}),)
    assert not (workshop.folder / "b2").exists()
    assert [one.transition for one in work] == ["b2"]
    assert component.next_wake() == 11


def test_a_program_hears_of_its_case_inputs_requests_and_time(workshop: Workshop) -> None:
    component = workshop.bolt(
        """
        heard = [greet()]
        while True:
            said = json.loads(sys.stdin.readline() or sys.exit(0))
            if "permit" not in said:
                heard.append(said)
            elif heard:
                say(sent={"channel": "done", "message": heard})
                say(took="b1")
                heard = []
            else:
                say(took=None)
        """,
        values={"speed": 0.5, "floor": 3},
    )
    component.set_inputs({"stuck": True})
    [step] = component.prompt("b2", 1)
    case = {"case": "a case", "seed": 7, "values": {"speed": 0.5, "floor": 3}}
    assert step.sends == (("done", [case, {"inputs": {"stuck": True}}, {"ask": {"transition": "b2", "time": 1}}]),)
    [polled] = component.handle(None, None, 2)
    assert polled.sends == (("done", [{"ask": {"transition": None, "time": 2}}]),)
    [woken] = component.wake(3)
    assert woken.sends == (("done", [{"time": 3}]),)


def test_a_program_may_want_to_be_woken_from_the_start(workshop: Workshop) -> None:
    source = "hear('hello'); say(hello={'component': 'Bolt'}); hear('reset'); say(reset=True, wake=2e9); hear('x')"
    component = workshop.bolt(source)
    assert component.next_wake() == 2_000_000_000


def test_large_messages_pass_both_ways(workshop: Workshop) -> None:
    component = workshop.bolt(
        """
        greet()
        message = hear("deliver")["message"]
        hear("permit")
        say(sent={"channel": "done", "message": message})
        say(took="b1")
        """
    )
    message = ["é" * 300, list(range(50_000)), "x" * 300_000]
    assert next(component.handle("push", message, 0)).sends == (("done", message),)


def test_what_json_cannot_hold_is_refused_and_the_program_goes_on(workshop: Workshop) -> None:
    component = workshop.bolt("greet(); hear('deliver'); hear('permit'); say(took='b1')")
    with pytest.raises(HostFailure, match=r"`deliver` must hold what JSON can hold, but: .*\[program-message\]"):
        list(component.handle("push", float("nan"), 0))
    assert next(component.handle("push", "", 0)).transition == "b1"


def test_a_program_that_closes_its_input_may_still_answer(workshop: Workshop) -> None:
    component = workshop.bolt("greet(); hear('permit'); os.close(0); say(took='b1'); time.sleep(1000)")
    assert next(component.handle("push", "", 0)).transition == "b1"


def test_a_program_may_speak_on_a_socket_and_print_what_it_likes(workshop: Workshop) -> None:
    component = workshop.bolt(
        """
        print("what is this?", flush=True)
        line = socket.socket(socket.AF_UNIX)
        line.connect(os.environ["PARCOURS_SOCKET"])
        os.dup2(line.fileno(), 0)
        print("still talking", os.environ["MINE"], flush=True)
        say = lambda **words: line.sendall(json.dumps(words).encode() + b"\\n")
        greet()
        hear("permit")
        say(took="b1")
        hear("permit")
        os._exit(6)
        """,
        socket=True,
        environment={"MINE": "too"},
    )
    work = component.handle("push", "", 0)
    assert next(work).transition == "b1"
    with pytest.raises(HostFailure, match=r"ended \(exit status 6\); its last words: 'still talking too'"):
        next(work)


# Whole cases

KEY = """
greet()
while True:
    given = json.loads(sys.stdin.readline() or sys.exit(0))
    if "deliver" in given:
        hear("permit")
        if given["deliver"]["channel"] == "turn":
            say(sent={"channel": "push", "message": {"word": 2}})
            say(took="k1")
        else:
            say(took="k2")
        hear("permit")
        say(took=None)
"""

BOLT = """
greet()
message = hear("deliver")["message"]
hear("permit")
say(sent={"channel": "done", "message": message})
say(took="b1")
hear("permit")
say(took=None)
hear("ask")
hear("permit")
say(took="b2")
"""


def executed(workshop: Workshop, source: str) -> Execution:
    """Execute a case in which a key pushes the bolt that the program of this source is."""
    parts = {"Key": workshop.part(KEY, "key.py"), "Bolt": workshop.part(source)}
    cases = [case for case in abstract_cases(workshop.lock) if case.interaction.components[0] == "Key"]

    def made(name: str) -> Component:
        return ProgramComponent(workshop.lock.component(name), parts[name], {}, "lock", 1, WAIT)

    return execute(
        serialise(cases[0]), made, lambda event: {"word": 1},
        prompt=lambda event, component, now: prompted(event.transition, component, now),
    )  # fmt: skip


def test_programs_go_through_a_whole_case_and_a_dead_one_is_its_deviation(workshop: Workshop) -> None:
    sound = executed(workshop, BOLT)
    assert sound.completed, sound.deviation
    end_programs()
    broken = executed(workshop, "greet(); hear('permit'); os.kill(os.getpid(), signal.SIGABRT)")
    expected = (
        "expected b1, got HostFailure: component Bolt: its program must answer `permit`, but ended (killed by SIGABRT)"
    )
    assert expected in str(broken.deviation)


@pytest.fixture(scope="module")
def lifts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the examples, the one in C++ built."""
    folder = tmp_path_factory.mktemp("examples")
    for name in ("lift", "lift_cpp", "lift_perl", "lift_threads"):
        shutil.copytree(ROOT / "examples" / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "out"))
    subprocess.run(["make", "--silent", "--always-make"], cwd=folder / "lift_cpp", check=True)
    return folder


@pytest.mark.parametrize("name", ["lift_cpp", "lift_perl", "lift_threads"])
def test_a_lift_in_another_form_gives_the_traces_of_the_one_in_python(lifts: Path, name: str) -> None:
    def executions(folder: Path) -> list[Execution]:
        study = read_study(folder / "study.yaml")
        assert isinstance(study, ComponentStudy)
        same = replace(study, name="lift")  # the same cases, with the same values
        run = in_process(same.exercise({}))
        return [run(case) for case in same.suite({}, seed=3, n_cases=24)]

    python = executions(lifts / "lift")
    assert executions(lifts / name) == python
    assert all(one.completed for one in python)
    end_programs()


def page_block(language: str, start: str) -> str:
    page = (ROOT / "docs" / "programs.md").read_text()
    blocks = [block.partition("```")[0] for block in page.split(f"```{language}\n")[1:]]
    return next(block for block in blocks if block.startswith(start))


def test_the_program_on_the_page_says_what_the_page_says(tmp_path: Path) -> None:
    (tmp_path / "door.py").write_text(page_block("python", "import json"))
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    with subprocess.Popen(
        ["python3", "door.py"], cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as program:
        assert program.stdin is not None
        assert program.stdout is not None
        for line in page_block("text", "> ").strip().splitlines():
            mark, _, said = line.partition(" ")
            if mark == ">":
                print(said, file=program.stdin, flush=True)
            else:
                assert program.stdout.readline().strip() == said
        program.stdin.close()
        assert program.wait(WAIT) == 0

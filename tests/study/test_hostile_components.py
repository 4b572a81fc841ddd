"""Components that die, hang or answer nonsense fail their own cases with the reason, here and on nodes; others pass."""

from __future__ import annotations

import functools
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from parcours.report.junit import CaseResult
from parcours.study import Request
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.verdict.judgement import Verdict

LIFT = Path(__file__).parents[2] / "examples" / "lift"
SLEEP = f"7{os.getpid()}.25"
"""How long a stray child of a component sleeps [s]: nobody else's does."""

MODES: dict[str, tuple[str, str]] = {
    "exits": ("os._exit(7)", r"its process ended: exit status 7"),
    "exits well": ("sys.exit(0)", r"its process ended: exit status 0"),
    "is killed": ("os.kill(os.getpid(), signal.SIGSEGV)", r"its process ended: killed by SIGSEGV"),
    "raises": ("raise ValueError('jammed')", r"got ValueError: jammed"),
    "raises what ctrl-c raises": ("raise KeyboardInterrupt", r"its process ended|KeyboardInterrupt"),
    "raises what cannot be said": ("raise Unspeakable", r"got (ValueError: no|Unspeakable)"),
    "recurses": ("return self.close(message)", r"got RecursionError"),
    "loops": ("while True: pass", r"(no answer|nothing|must answer) within"),
    "returns a number": ("return 7", r"TypeError: a method returns took\(\.\.\.\), several of them, or None, .* int"),
    "returns a text": ("return 'd2'", r"TypeError: a method returns .* but returned str"),
    "yields a text": ("return iter(['d2'])", r"TypeError: a step is made by took\(\.\.\.\), but str was given"),
    "yields for ever": ("return itertools.repeat(took('d3'))", r"expected d[12], got d3"),
    "takes nothing": ("return None", r"expected d[12], got no transition"),
    "takes what is not there": ("return took('d9')", r"took 'd9', which is no transition of Door; Known: d1, d2, d3"),
    "takes another's": ("return took('c1')", r"took 'c1', which is no transition of Door"),
    "takes no text": ("return took(['d1'])", r"expected d[12], got "),
    "floods": ("return took('d2', *[('door', SHUT)] * 10001)", r"sent 10001 messages in one .* at most 10000 are"),
    "sends no message": ("return took('d2', door=None)", r"message on 'door': must be a mapping .* of DoorState"),
    "sends too little": ("return took('d2', door={})", r"message on 'door': must have the fields .* lacks shut"),
    "sends too much": ("return took('d2', door={**SHUT, 'x': 1})", r"must have the fields .*, but has x"),
    "sends wrong types": ("return took('d2', door={'shut': 'yes'})", r"field 'shut': must be bool, but is 'yes'"),
    "sends objects": ("return took('d2', door=object())", r"a message holds plain values"),
}  # fmt: skip
HARMLESS = {
    "prints": "print('{' * 100_000)",
    "starts a thread": "threading.Thread(target=time.sleep, args=(1000,), daemon=False).start()",
    "starts a program": f"subprocess.Popen(['sleep', '{SLEEP}'])",
    "turns the random numbers back": "random.seed(1)",
}
DEAF = ("sum(itertools.repeat(0))", "signal.setitimer(signal.ITIMER_REAL, 0)\n        while True: pass")

HEAD = """
import itertools, os, random, signal, subprocess, sys, threading, time
import lift
from parcours.study import took

SHUT = {"shut": True}

class Unspeakable(Exception):
    def __str__(self):
        raise ValueError("no")

class Door(lift.Door):
    def __init__(self, case):
        self.mode = getattr(self, f"mode_{case.number}", None)

    def close(self, message):
        answer = self.mode(message) if self.mode else lift
        return super().close(message) if answer is lift else answer
"""
SYSTEM = "system: {Panel: lift.py:Panel, Cabin: lift.py:Cabin, Door: bad.py:Door}"


def executed(folder: Path, lines: Sequence[str], host: str = "simulated", head: str = HEAD) -> Sequence[CaseResult]:
    """Run four cases for each hostile line: the door does it in the third of them, `hostile` gives its place."""
    shutil.copytree(LIFT, folder, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "study.yaml").write_text(f"parcours: study/1\nname: lift\n{SYSTEM}\npatience: 300 ms\n")
    modes = [
        f"    def mode_{hostile(k)}(self, message):\n        {line}\n        return lift\n"
        for k, line in enumerate(lines)
    ]
    (folder / "bad.py").write_text(head + "\n".join(modes))
    study = find(str(folder))
    settings = settings_of(study.parameters, {"host": host})
    run = study.run(Request(settings, 1, folder / "out", max(4 * len(lines), 8)), lambda what, done, total: None)
    assert not run.interrupted
    return study.read(folder / "out").cases()


def hostile(k: int) -> int:
    """Return the number of the case in which the k-th hostile line is executed: one that visits the door."""
    return 4 * k + 2


def others_pass(results: Sequence[CaseResult], n_hostile: int) -> None:
    numbers = set(map(hostile, range(n_hostile)))
    others = [one for number, one in enumerate(results) if number not in numbers]
    assert [one for one in others if one.verdict is not Verdict.PASS] == []


def lines_of(mode: str) -> str:
    return {**{name: line for name, (line, _) in MODES.items()}, **HARMLESS}[mode]


@functools.cache
def everything(host: str, folder: Path) -> Sequence[CaseResult]:
    return executed(folder, [lines_of(mode) for mode in (*MODES, *HARMLESS)], host)


@pytest.fixture(scope="module", params=["simulated", "processes"])
def results(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Sequence[CaseResult]:
    return everything(request.param, tmp_path_factory.getbasetemp() / f"hostile-{request.param}")


@pytest.mark.parametrize("mode", MODES)
def test_a_door_that_does_wrong_fails_its_own_case_with_the_reason(mode: str, results: Sequence[CaseResult]) -> None:
    result = results[hostile(list(MODES).index(mode))]
    assert result.verdict is Verdict.FAIL and re.search(MODES[mode][1], result.why), result.why
    assert "Door#" in result.why and "\n" not in result.why and len(result.why) < 1000


def test_all_other_cases_pass(results: Sequence[CaseResult]) -> None:
    others_pass(results, len(MODES))


def test_what_a_component_started_ends_with_its_process(results: Sequence[CaseResult]) -> None:
    left = subprocess.run(["pgrep", "-f", f"sleep {SLEEP}"], capture_output=True, text=True, check=False).stdout
    for pid in map(int, left.split()):
        os.kill(pid, signal.SIGKILL)
    assert left == ""


@pytest.mark.parametrize("line", DEAF)
def test_a_component_that_no_alarm_reaches_is_ended_from_outside(line: str, tmp_path: Path) -> None:
    results = executed(tmp_path / "deaf", [line])
    assert results[2].verdict is Verdict.FAIL
    assert "no answer within 0.95 s, and deaf to being ended, in event " in results[2].why and "Door#" in results[2].why
    others_pass(results, 1)


def test_a_nodes_turn_may_last_as_long_as_the_study_says(tmp_path: Path) -> None:
    results = executed(tmp_path / "slow", ["while True: pass"], "processes")
    assert "nothing within" in results[2].why and "within 5 s" not in results[2].why


@pytest.mark.parametrize("host", ["simulated", "processes"])
@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("1 / 0", r"ZeroDivisionError: division by zero"),
        ("os._exit(3)", r"its process ended: exit status 3"),
        ("while True: pass", r"(no answer|nothing|must answer) within"),
    ],
)
def test_a_constructor_that_does_wrong_fails_its_own_case(line: str, why: str, host: str, tmp_path: Path) -> None:
    guarded = f"        if case.number == 2:\n            {line}\n"
    head = HEAD.replace("    def __init__(self, case):\n", f"    def __init__(self, case):\n{guarded}")
    results = executed(tmp_path / "made", ["pass"], host, head)
    assert results[2].verdict is Verdict.FAIL and re.search(why, results[2].why), results[2].why
    others_pass(results, 1)


@pytest.mark.parametrize("host", ["simulated", "processes"])
def test_a_child_that_a_component_forks_answers_for_nobody(host: str, tmp_path: Path) -> None:
    results = executed(tmp_path / "forks", ["os.fork()"], host)
    assert len(results) == 8
    others_pass(results, 1)


def test_a_reason_that_no_file_can_hold_is_kept_all_the_same(tmp_path: Path) -> None:
    results = executed(tmp_path / "odd", [r"raise ValueError('a\ud800b')", "raise ValueError('x' * 10_000_000)"])
    assert "ValueError: a" in results[2].why
    assert "ValueError: xxx" in results[6].why and len(results[6].why) < 10_000
    others_pass(results, 2)


ORACLE = """
import os
from parcours.verdict.judgement import Judgement, Verdict

def judge(case, trace):
    number = case.number
    if number == 0: raise ValueError("no")
    if number == 1: return 7
    if number == 2: return False
    if number == 3: return "the door is too slow"
    if number == 4: return Judgement(Verdict.INCONCLUSIVE, "who knows")
    if number == 5: os._exit(9)
    while number == 6: pass
"""


def test_an_oracle_that_does_wrong_costs_the_cases_that_it_judges(tmp_path: Path) -> None:
    folder = tmp_path / "lift"
    shutil.copytree(LIFT, folder)
    (folder / "judges.py").write_text(ORACLE)
    with (folder / "study.yaml").open("a") as file:
        file.write("oracles: [judges.py:judge]\npatience: 300 ms\n")
    study = find(str(folder))
    study.run(Request(settings_of(study.parameters, {}), 1, folder / "out"), lambda what, done, total: None)
    found = [(str(one.verdict), one.why) for one in study.read(folder / "out").cases()]
    assert found[:5] == [
        ("error", "oracle judges.py:judge raised ValueError: no"),
        ("error", "oracle judges.py:judge must return True, False, None, a text or a Judgement, but returned int"),
        ("fail", "judges.py:judge does not hold"),
        ("fail", "the door is too slow"),
        ("inconclusive", "who knows"),
    ]
    assert found[5][0] == "fail" and "its process ended: exit status 9" in found[5][1]
    assert found[6][0] == "fail" and "no answer within 0.95 s" in found[6][1]
    assert found[7] == ("pass", "judges.py:judge holds")

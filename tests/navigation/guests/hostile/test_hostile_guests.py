"""A hostile planner costs its own case: the others keep their bytes, nothing is left, and no line of it ran here."""

from __future__ import annotations

import ctypes
import os
import re
import sys
import textwrap
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from hostile_deeds import ANY, CONSTRUCTORS, DEEDS, SAME
from parcours.errors import ParcoursError
from parcours.run import workers as workers
from parcours.run.campaign import run_campaign
from parcours.run.store import open_results
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests import planner_process as planner_process
from parcours_navigation.guests.planner_facts import PlannerFault
from parcours_navigation.guests.planner_tasks import planner_seed
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.study import study as study_module
from parcours_navigation.study.study import NavigationStudy

CASES = SystemCases(1)
SHORT = Scenario(time_limit=0.6, call_timeout=0.5)
N_TOGETHER = 8  # deeds in one campaign
N_CASES = 3 * N_TOGETHER  # the second of every three is guilty
PATIENCE, SHORTER = 60.0, 2.0  # for what is loaded, and for what is known not to come to an end [s]
LONGEST = 120.0  # a campaign of eight hostile cases takes some seconds; generous on a busy machine

PLANNER = """
import os
RESULTS = {results!r}
with open({log!r}, "a") as file:
    file.write(f"{{os.getpid()}}\\n")
{top}

class Planner:
    {init}
    def reset(self, task):
        self.deed = {deeds}.get(task.seed)

    def observe(self, o):
        if self.deed and o.time > 0.28:
            deed, self.deed = self.deed, None
            answer = getattr(self, deed)(o)
            if answer is not None:
                return answer
        return 0.2, 0.1
{methods}
"""


@pytest.fixture(scope="module", autouse=True)
def adopting() -> Iterator[None]:
    """Adopt whatever orphans the tests leave, so that they can be counted."""
    libc = ctypes.CDLL(None)
    libc.prctl(36, 1, 0, 0, 0)
    yield
    libc.prctl(36, 0, 0, 0, 0)


@pytest.fixture(scope="module", autouse=True)
def little_memory() -> Iterator[None]:
    """Let guests fill less memory, sooner."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "memory_for_each", lambda size: 1 << 30)
        yield


@pytest.fixture(scope="module")
def tame(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    folder = tmp_path_factory.mktemp("tame")
    return campaign(planner(folder), folder)


def planner(folder: Path, deeds: Sequence[str] = (), top: str = "", init: str = "") -> str:
    """Write a planner that does the deeds, given by their source, and return its name."""
    file = folder / "hostile_planner.py"
    file.write_text(
        PLANNER.format(
            results=str(folder / "results"), log=str(folder / "pids"), top=top, init=init,
            deeds={planner_seed(1, guilty(k)): f"do_{k}" for k in range(len(deeds))},
            methods="".join(method(k, deed) for k, deed in enumerate(deeds)),
        )
    )  # fmt: skip
    return f"{file}:Planner"


def method(k: int, deed: str) -> str:
    return f"\n    def do_{k}(self, o):\n{textwrap.indent(deed.strip(chr(10)), ' ' * 8)}"


def guilty(k: int) -> int:
    """Return the number of the case in which a deed is done."""
    return 3 * k + 1


def campaign(name: str, folder: Path) -> np.ndarray:
    """Run a planner's campaign and return its facts."""
    begun, loaded, before = time.monotonic(), set(sys.modules), children()
    try:
        study = NavigationStudy(name, CASES, SHORT)
        assert run_campaign(study, study.campaign(N_CASES, 3), folder / "results", workers=2).finished == N_CASES
        return open_results(folder / "results").load()
    finally:
        assert time.monotonic() - begun < LONGEST
        assert str(os.getpid()) not in (folder / "pids").read_text().split(), "it was imported here"
        assert not [name for name in sys.modules if name.startswith("parcours_planner_") and name not in loaded]
        require_no_children(before)


def children() -> set[str]:
    """Return who this process has started and has not ended, such as the fork server of an earlier test's nodes."""
    me = os.getpid()
    return set(Path(f"/proc/{me}/task/{me}/children").read_text().split())


def require_no_children(before: set[str]) -> None:
    """Fail if any process is left that the test has started."""
    until = time.monotonic() + 10
    while time.monotonic() < until:
        left = [pid for pid in children() - before if is_alive(pid)]
        if not left:
            return
        time.sleep(0.01)
    raise AssertionError(f"left behind: {[Path(f'/proc/{pid}/cmdline').read_bytes() for pid in left]}")


def is_alive(pid: str) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        tracker = b"resource_tracker" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
    return state != "Z" and not tracker


@pytest.mark.parametrize("first", range(0, len(DEEDS), N_TOGETHER), ids=lambda first: list(DEEDS)[first])
def test_hostile_deeds_cost_their_own_cases_only(first: int, tmp_path: Path, tame: np.ndarray) -> None:
    done = list(DEEDS)[first : first + N_TOGETHER]
    facts = campaign(planner(tmp_path, [DEEDS[deed][0] for deed in done]), tmp_path)
    innocent = ~np.isin(facts["number"], [guilty(k) for k in range(len(done))])
    assert facts[innocent].tobytes() == tame[innocent].tobytes()
    rows = {deed: (DEEDS[deed][1], facts[guilty(k)], tame[guilty(k)]) for k, deed in enumerate(done)}
    wrong = {deed: row["reason"].decode() for deed, (due, row, same) in rows.items() if not ended_as(due, row, same)}
    assert not wrong


def ended_as(due: str, row: np.void, tame: np.void) -> bool:
    """Return whether a case ended as it must."""
    reason = row["reason"].decode()
    if due == SAME:
        return reason == "" and row.tobytes() == tame.tobytes()
    return due == ANY or (row["error"] != PlannerFault.NONE and re.search(due, reason) is not None)


def test_nothing_that_is_open_here_can_be_written_to(tmp_path: Path) -> None:
    ours, theirs = os.pipe()
    deed = "import os\nfor n in range(3, 200):\n    try: os.write(n, b'forged')\n    except OSError: pass"
    try:
        campaign(planner(tmp_path, [deed]), tmp_path)
    finally:
        os.close(theirs)
    with os.fdopen(ours, "rb") as pipe:
        assert pipe.read() == b""


@pytest.mark.parametrize("deed", CONSTRUCTORS)
def test_a_hostile_import_or_constructor_is_refused_with_its_cause(
    deed: str, tmp_path: Path, tame: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, due = CONSTRUCTORS[deed]
    patience = SHORTER if re.search("did not within|must come", due) else PATIENCE
    monkeypatch.setattr(planner_process, "LOADING", patience)
    monkeypatch.setattr(study_module, "LOADING", patience)
    init = "".join(f"{theirs} = {ours}\n    " for theirs, ours in (("__init__", "init"), ("needs", "needs"))
                   if f"def {ours}" in source or f"{ours} = " in source)  # fmt: skip
    name = planner(tmp_path, top=source, init=init)
    try:
        facts = campaign(name, tmp_path)
    except ParcoursError as refused:
        assert due != SAME and (due == ANY or re.search(due, str(refused))), str(refused)
        return
    assert due in (SAME, ANY), "it was not refused"
    assert facts.tobytes() == tame.tobytes()

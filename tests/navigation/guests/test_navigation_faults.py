"""What a planner does wrong costs the case it does it in, and nothing else."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults
from parcours.run.campaign import run_campaign
from parcours.run.exception_text import REASON_LENGTH, reason_bytes
from parcours.run.heartbeat import LostCase
from parcours.run.store import Campaign, open_results
from parcours.verdict.judgement import Verdict
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.planner_facts import PlannerFault
from parcours_navigation.guests.planner_tasks import planner_seed
from parcours_navigation.guests.planners import load_planner, source_of
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes
from parcours_navigation.protocol import Answer, Observation, Trajectory
from parcours_navigation.study.analysis import analyse
from parcours_navigation.study.campaigns import load_results
from parcours_navigation.study.outcome_tables import error_table
from parcours_navigation.study.study import NavigationStudy

CASES = SystemCases(1)

PLANNER = '''
import itertools, os

def ticking(observation):
    print("asked")
    return 0.1, 0.0

class Moody:
    """Fails in another way in every case."""

    def reset(self, task):
        self.mood = MOODS[task.seed]

    def observe(self, observation):
        if observation.time < 0.5:
            return 0.1, 0.0
        if self.mood == 0:
            raise ValueError("out of " + repr(object()))
        if self.mood == 1:
            return 0.1, float("nan")
        if self.mood == 2:
            while True:
                pass
        if self.mood == 3:
            sum(itertools.repeat(0))  # never returns to the interpreter
        if self.mood == 4:
            os._exit(3)
        return None

class Refuses:
    def __init__(self):
        raise RuntimeError("no licence")

class Needs:
    def __init__(self, model):
        pass

class Idle:
    pass

class Curious:
    def observe(self, observation, goal):
        return None

nothing = 3
'''


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "moody_planner.py"
    path.write_text(PLANNER)
    return path


def bad(answer: object) -> Callable[[Observation], Answer]:
    def planner(observation: Observation) -> Answer:
        return (0.1, 0.0) if observation.time < 1.0 else answer  # type: ignore[return-value]

    return planner


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        ((0.1, float("nan")), "returned (0.1, nan), but speeds are finite"),
        ((float("-inf"), 0.0), "returned (-inf, 0.0)"),
        ((np.float64("nan"), 0.0), "returned (nan, 0.0)"),
        ((10**400, 0.0), "speeds are finite"),
        ("left", "returned 'left' of type str"),
        (0.5, "returned 0.5 of type float"),
        ((0.1,), "of length 1"),
        ((0.1, 0.0, 0.0), "of length 3"),
        ((0.1, "0"), "returned (0.1, '0'), but speeds are numbers"),
        ((True, 0.0), "returned (True, 0.0), but speeds are numbers"),
        ((1j, 0.0), "speeds are numbers"),
        (np.zeros(3), "an array of shape (3,) of float64"),
        (np.zeros((2, 1)), "an array of shape (2, 1)"),
        (Trajectory(np.zeros((0, 4))), "points of shape (0, 4)"),
        (Trajectory(np.zeros((3, 3))), "points of shape (3, 3)"),
        (Trajectory(np.zeros((2, 4))), "times do not increase"),
        (Trajectory([(0.0, 0.0, 0.0, 0.0), (1.0, 1e154, 0.0, 0.0)]), "no number may exceed 1e+06"),  # type: ignore[arg-type]
        (Trajectory([(0.0, 0.0, 0.0, 0.0), (1e-9, 1.0, 0.0, 0.0)]), "times do not increase by at least 1e-06 s"),  # type: ignore[arg-type]
        (Trajectory(np.array([[0.0, 0.0, np.nan, 0.0]])), "point 0 is (0.0, 0.0, nan, 0.0)"),
        (Trajectory(np.array([["a"] * 4])), "points of shape (1, 4)"),
        (Trajectory([[1.0], [1.0, 2.0]]), "make no array"),  # type: ignore[arg-type]
        (Trajectory(None), "points are None"),  # type: ignore[arg-type]
        (object(), "of type object"),
    ],
)
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_an_answer_that_is_none_is_an_error_that_names_it(answer: object, says: str, delay: float) -> None:
    facts = NavigationStudy(bad(answer), CASES, Scenario(command_delay=delay))(3, 1)
    assert outcomes(facts)[0] == Outcome.ERROR and VERDICT_OF[Outcome.ERROR] is Verdict.ERROR
    assert facts["error"][0] == PlannerFault.BAD_ANSWER
    assert says in facts["reason"][0].decode()
    assert facts["n_planning_cycles"][0] == 21
    assert facts["t_end"][0] == 1_000_000_000
    assert "failed at 1.00 s: bad answer: returned" in explain(facts[0])


def test_what_a_planner_raises_is_named_with_its_line_and_the_next_case_goes_on() -> None:
    class Third:
        def __init__(self) -> None:
            self.cases = -1

        def reset(self, task: object) -> None:
            self.cases += 1
            if self.cases == 1:
                raise KeyError("reset")

        def observe(self, observation: Observation) -> Answer:
            if self.cases == 2:
                raise SystemExit(4)
            if self.cases == 3:
                return self.observe(observation)
            return 0.1, 0.0

    facts = NavigationStudy(Third(), CASES, Scenario(time_limit=1.0))(0, 5)
    assert facts["error"].tolist() == [0, 1, 1, 1, 0]
    reasons = [reason.decode() for reason in facts["reason"].tolist()]
    assert reasons[1].startswith("raised: KeyError: 'reset' (test_navigation_faults.py:")
    assert reasons[2].startswith("raised: SystemExit: 4 (test_navigation_faults.py:")
    assert reasons[3].startswith("raised: RecursionError")
    assert facts["n_planning_cycles"].tolist() == [40, 0, 1, 1, 40]


def test_an_error_goes_before_a_collision_and_a_goal() -> None:
    facts = NavigationStudy("stand-still", CASES)(0, 1)
    facts["n_robot_contacts"], facts["t_goal"], facts["error"] = 1, 9, PlannerFault.RAISED
    assert outcomes(facts)[0] == Outcome.ERROR


def test_a_call_that_never_ends_is_cut_where_the_interpreter_can_be_interrupted(file: Path) -> None:
    def loops(observation: Observation) -> Answer:
        while observation.time >= 0.5:
            pass
        return 0.1, 0.0

    before = signal.getsignal(signal.SIGALRM)
    facts = NavigationStudy(loops, CASES, Scenario(call_timeout=0.1))(0, 2)
    assert facts["error"].tolist() == [PlannerFault.HUNG] * 2
    assert facts["reason"][0] == b"hung: no answer within 0.1 s to the observation at 0.50 s"
    assert facts["t_end"].tolist() == [500_000_000] * 2
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


def test_hangs_and_crashes_cost_only_their_cases(file: Path, tmp_path: Path) -> None:
    moods = {planner_seed(1, case): mood for case, mood in enumerate((9, 3, 4, 0, 2, 9))}
    source = f"MOODS = {moods}\n" + PLANNER
    file.write_text(source)
    name = f"{file}:Moody"
    study = NavigationStudy(name, CASES, Scenario(time_limit=1.0, call_timeout=0.25))
    assert run_campaign(study, study.campaign(6, 3), tmp_path / "1", workers=2).finished == 6
    facts = open_results(tmp_path / "1").load()
    line = source[: source.index("raise ValueError")].count("\n") + 1
    assert [reason.decode() for reason in facts["reason"].tolist()] == [
        "",
        "hung: no answer within 0.25 s to the observation at 0.50 s",
        "died: its process ended with exit code 3 after the observation at 0.50 s",
        f"raised: ValueError: out of <object object at 0x...> (moody_planner.py:{line})",
        "hung: no answer within 0.25 s to the observation at 0.50 s",
        "",
    ]
    told = LostCase(1, 500_000_000, "hung", ""), LostCase(2, 500_000_000, "died", "ended with exit code 3")
    here = study.without(told)(0, 6)
    for field in here.dtype.names or ():
        assert here[field].tobytes() == facts[field].tobytes(), field
    results = load_results(tmp_path / "1")
    ended = {"one": analyse(results)}
    errors = int((facts["error"] != 0).sum())
    assert errors == sum(ended["one"].document()["errors"].values())  # type: ignore[attr-defined]
    table = error_table(ended)
    assert table is not None and sum(int(str(row[2])) for row in table.rows) == errors
    lost = int(facts["number"][facts["error"] == PlannerFault.DIED][0])
    with pytest.raises(BadResults, match=r"nothing to see of it: .*died.*\[replay-lost\]"):
        results.replay(lost)
    raised = int(facts["number"][facts["error"] == PlannerFault.RAISED][0])
    assert "raised: ValueError" in results.replay(raised).subtitle
    file.write_text(source + "# changed\n")
    with pytest.raises(BadResults, match=r"\[planner-changed\]"):
        results.replay(raised)
    again = NavigationStudy(name, CASES, Scenario(time_limit=1.0, call_timeout=0.25))
    with pytest.raises(BadResults, match=r"planner_source.*\[results-other\]"):
        run_campaign(again, again.campaign(6, 3), tmp_path / "1")


def test_what_a_planner_prints_does_not_reach_the_json(file: Path, tmp_path: Path) -> None:
    command = ["run", "navigation", "--planner", f"{file}:ticking", "--cases", "3", "--json", "--workers", "1"]
    ran = CliRunner().invoke(parcours, [*command, "--time-limit", "1", "--out", str(tmp_path / "o")])
    assert ran.exit_code == 1, ran.output  # no case reaches its goal
    told = json.loads(ran.stdout)[str(tmp_path / "o")]
    assert told["planner"] == f"{file}:ticking" and told["cases"] == 3 and told["errors"] == {}
    page = tmp_path / "page.html"
    drawn = CliRunner().invoke(parcours, ["replay", str(tmp_path / "o"), "2", "--html", str(page)])
    assert drawn.exit_code == 0 and page.read_text().startswith("<!")
    told = CliRunner().invoke(parcours, ["report", str(tmp_path / "o"), "--junit", str(tmp_path / "j.xml")])
    assert told.exit_code == 1 and 'failures="3"' in (tmp_path / "j.xml").read_text()


@pytest.mark.parametrize(
    ("name", "says", "slug"),
    [
        ("no_such_module:Planner", "there is no 'no_such_module'", "planner-missing"),
        ("no/such/file.py:Planner", "its file must exist", "planner-missing"),
        ("{file}:Moodi", "did you mean 'Moody'", "planner-missing"),
        ("{file}:Refuses", "raised RuntimeError: no licence", "planner-raised"),
        ("{file}:Needs", "raised TypeError: .*missing 1 required positional argument", "planner-raised"),
        ("{file}:Idle", r"have observe\(observation\), but is a Idle without", "planner-form"),
        ("{file}:nothing", "but is a int without", "planner-form"),
        ("{file}:Curious", "must take exactly one argument", "planner-form"),
        ("orka", "did you mean 'orca'", "planner-unknown"),
        ("", "must be a known name", "planner-unknown"),
        (":x", "must be a known name", "planner-unknown"),
    ],
)
def test_a_planner_that_cannot_be_loaded_is_refused_by_name(file: Path, name: str, says: str, slug: str) -> None:
    with pytest.raises(BadRequest, match=rf"planner '.*{says}.*\[{slug}\]"):
        NavigationStudy(name.format(file=file), CASES)


def test_a_file_that_does_not_compile_is_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text("def observe(:\n")
    with pytest.raises(BadRequest, match=r"raised SyntaxError.*\[planner-raised\]"):
        load_planner(f"{tmp_path / 'broken.py'}:observe")


def test_the_current_folder_is_importable_and_the_digest_is_of_the_file(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    assert load_planner("moody_planner:ticking").observe.__name__ == "ticking"
    source = source_of("moody_planner:ticking")
    assert source is not None and source == source_of(f"{file}:Moody")
    file.write_text(PLANNER.replace("0.1, 0.0", "0.2, 0.0"))
    changed = source_of("moody_planner:ticking")
    assert changed is not None and changed.digest != source.digest
    assert source_of("orca") is None


def test_only_a_named_planner_can_be_a_campaign() -> None:
    with pytest.raises(BadRequest, match=r"\[planner-name\]"):
        NavigationStudy(bad(None), CASES).campaign(3)


@pytest.mark.parametrize("text", ["", "ä" * 200, "a\0b\nc", "x" * 159 + "€€", "\ud800"])
def test_a_reason_fits_its_field_and_stays_text(text: str) -> None:
    kept = np.array([reason_bytes(text)], f"S{REASON_LENGTH}")[0]
    assert kept == reason_bytes(text) and len(kept) <= REASON_LENGTH
    assert "\n" not in kept.decode("utf-8")


@pytest.mark.parametrize("said", ["x" * 400, "ä" * 400, "€" * 130, "short"])
def test_however_long_an_exception_is_the_place_that_raised_it_is_kept_whole(said: str) -> None:
    def talkative(observation: object) -> None:
        raise ValueError(said)

    [facts] = NavigationStudy(talkative, CASES)(0, 1)
    reason = facts["reason"].decode()
    assert reason.startswith("raised: ValueError: " + said[:20])
    assert re.search(r" \(test_navigation_faults\.py:\d+\)$", reason)
    assert ("..." in reason) == (said != "short") and len(reason.encode()) <= REASON_LENGTH


def test_sigterm_ends_a_campaign_as_ctrl_c_does(tmp_path: Path) -> None:
    def rows(first: int, count: int) -> np.ndarray:
        return np.zeros(count, dtype)

    def stop(done: int, total: int) -> None:
        if done == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    dtype = np.dtype([("n", "i8")])
    before = signal.getsignal(signal.SIGTERM)
    outcome = run_campaign(rows, Campaign("toy", "x", 0, 9, dtype, shard_size=1), tmp_path / "o", progress=stop)
    assert outcome.interrupted and outcome.finished == 2
    assert signal.getsignal(signal.SIGTERM) == before
    assert run_campaign(rows, Campaign("toy", "x", 0, 9, dtype, shard_size=1), tmp_path / "o").finished == 9

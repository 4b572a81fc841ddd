"""A planner that changes the folder, forks or raises what Ctrl-C raises changes nothing but its own cases."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadRequest
from parcours.report.terminal import to_text
from parcours.run.campaign import run_campaign
from parcours.run.store import open_results
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.planner_facts import PlannerFault
from parcours_navigation.guests.planners import load_planner
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.protocol import Answer, Observation
from parcours_navigation.study.analysis import analyse
from parcours_navigation.study.campaigns import FinishedCampaign, load_results
from parcours_navigation.study.outcome_tables import outcome_figure, outcome_table
from parcours_navigation.study.study import NavigationStudy
from parcours_ramp.system.campaigns import load_campaign
from parcours_ramp.system.study import system_study

CASES = SystemCases(1)
SHORT = Scenario(time_limit=1.0)
NO_ERRORS = ("--fail-if", "errors > 0")

PLANNERS = """
import os

class Plain:
    def observe(self, observation):
        return 0.1, 0.2

class Wanderer(Plain):
    def __init__(self):
        os.chdir(os.path.join(os.path.dirname(__file__), "elsewhere"))

    def observe(self, observation):
        os.chdir("/")
        return 0.1, 0.2

class Interrupts:
    def observe(self, observation):
        if observation.time > 0.4:
            raise KeyboardInterrupt
        return 0.1, 0.2
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "stray_planner.py").write_text(PLANNERS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def listening_to_ctrl_c() -> Iterator[None]:
    """Listen to Ctrl-C as a program does that a terminal starts, whatever a background shell left behind."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def ignoring_ctrl_c() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_planner_that_changes_the_folder_loses_no_results(here: Path) -> None:
    command = ["run", "navigation", "--planner", "stray_planner.py:Wanderer", "--cases", "9", "--time-limit", "1"]
    ran = CliRunner().invoke(parcours, [*command, *("--workers", "2", "--json", "--out", "results"), *NO_ERRORS])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)["results"]
    assert told["cases"] == 9 and told["errors"] == {} and told["planner"] == "stray_planner.py:Wanderer"
    assert len(open_results(here / "results").load()) == 9
    assert sorted(path.name for path in here.iterdir() if path.name != "__pycache__") == [
        "elsewhere", "results", "stray_planner.py",
    ]  # fmt: skip
    assert list((here / "elsewhere").iterdir()) == []


def test_a_planner_is_found_by_its_relative_path_after_it_changed_the_folder(here: Path) -> None:
    study = NavigationStudy("stray_planner.py:Wanderer", CASES, SHORT)
    assert Path.cwd() == here
    assert study.label == "stray_planner.py:Wanderer" and study.digest
    plain = NavigationStudy(f"{here}/stray_planner.py:Plain", CASES, SHORT)(0, 2)
    assert study(0, 2).tobytes() == plain.tobytes()


class Forks:
    """Forks at some point; the children answer otherwise or raise, and their ids are kept."""

    def __init__(self, when: str) -> None:
        self.when = when
        self.children: list[int] = []

    def forked(self, when: str) -> bool:
        if self.when != when:
            return False
        self.children.append(os.fork())
        return self.children[-1] == 0

    def reset(self, task: object) -> None:
        self.forked("reset")

    def observe(self, observation: Observation) -> Answer:
        if observation.time < 1.4:
            return 0.1, 0.2
        if self.forked("raise"):
            raise ValueError("the child's")
        return (0.25, 1.0) if self.forked("observe") else (0.1, 0.2)


@pytest.mark.parametrize("delay", [0.0, 0.1])
@pytest.mark.parametrize("when", ["reset", "observe", "raise"])
def test_a_child_that_a_planner_forks_ends_silently_and_its_parent_goes_on(when: str, delay: float) -> None:
    planner, mine, scenario = Forks(when), os.getpid(), Scenario(time_limit=0.5, command_delay=delay)
    facts = NavigationStudy(planner, CASES, scenario)(0, 2)
    assert os.getpid() == mine
    assert len(planner.children) >= 2
    assert [os.waitpid(child, 0)[1] for child in planner.children] == [0] * len(planner.children)
    assert facts.tobytes() == NavigationStudy(Forks("never"), CASES, scenario)(0, 2).tobytes()


def test_a_child_that_a_constructor_forks_ends_silently() -> None:
    children = []

    class Constructed:
        def __init__(self) -> None:
            children.append(os.fork())

        def observe(self, observation: Observation) -> Answer:
            return 0.1, 0.2

    mine = os.getpid()
    load_planner(Constructed)
    assert os.getpid() == mine
    assert os.waitpid(children[0], 0)[1] == 0


def test_a_keyboard_interrupt_of_its_own_costs_a_planner_the_case_in_a_worker(here: Path) -> None:
    study = NavigationStudy(f"{here}/stray_planner.py:Interrupts", CASES, SHORT)
    outcome = run_campaign(study, study.campaign(4, 2), here / "results", workers=2)
    assert not outcome.interrupted and outcome.finished == 4
    facts = open_results(here / "results").load()
    assert facts["error"].tolist() == [PlannerFault.RAISED] * 4
    assert facts["reason"][0].startswith(b"raised: KeyboardInterrupt (stray_planner.py:")


def test_ctrl_c_in_the_process_that_listens_to_it_ends_the_run(listening_to_ctrl_c: None) -> None:
    def interrupts(observation: Observation) -> Answer:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        NavigationStudy(interrupts, CASES, SHORT)(0, 1)


def test_what_a_named_planner_raises_is_no_ctrl_c_of_ours(here: Path, listening_to_ctrl_c: None) -> None:
    study = NavigationStudy(f"{here}/stray_planner.py:Interrupts", CASES, SHORT)
    assert study(0, 1)["error"].tolist() == [PlannerFault.RAISED]


def test_a_constructor_that_raises_keyboard_interrupt_is_refused_where_ctrl_c_is_ignored(ignoring_ctrl_c: None) -> None:
    class Interrupts:
        def __init__(self) -> None:
            raise KeyboardInterrupt

    with pytest.raises(BadRequest, match=r"raised KeyboardInterrupt.*\[planner-raised\]"):
        load_planner(Interrupts)


@pytest.mark.parametrize(("n_cases", "size"), [(1, 4), (40, 4), (256, 16), (905, 56), (100_000, 64)])
def test_a_campaign_comes_in_shards_small_enough_for_slow_planners(n_cases: int, size: int) -> None:
    assert NavigationStudy("stand-still", CASES).campaign(n_cases).shard_size == size


def test_what_is_told_of_a_planner_is_the_sound_outcomes_and_no_signal_it_cannot_give(here: Path) -> None:
    study = NavigationStudy("straight-ahead", CASES)
    run_campaign(study, study.campaign(30), here / "straight")
    ramp = system_study("guarded", seed=1)
    run_campaign(ramp, ramp.campaign(4), here / "ramp")
    straight: FinishedCampaign = load_results(here / "straight")
    ended = {"s": analyse(straight), "g": analyse(load_campaign(here / "ramp"))}
    one, other = {"s": ended["s"]}, {"g": ended["g"]}
    rows = {str(row[0]): row[1:] for row in outcome_table(one).rows}
    assert next(iter(rows)) == "cases" and list(rows)[1] == "passed"
    assert not {"reached goal", "feasible at the end", "imminent collision", "stuck in imminent collision"} & set(rows)
    collided = int(np.sum((straight.facts["n_robot_contacts"] > 0) | (straight.facts["n_shared_contacts"] > 0)))
    assert collided > 0 and str(rows["failed"][0]).startswith(f"{collided / 30:.1%} [")
    assert not {"feasible", "imminent_collision", "stuck"} & set(ended["s"].document())
    assert outcome_figure(one).title == "The verdicts"
    both = {str(row[0]): row[1:] for row in outcome_table(ended).rows}
    assert both["reached goal"][0] == "–" and str(both["reached goal"][1]).endswith("%]")
    assert list(both).index("passed") < list(both).index("reached goal")
    assert list({str(row[0]): 0 for row in outcome_table(other).rows})[1] == "reached goal"
    assert "the paper" not in to_text(outcome_table(one))


def test_a_replay_of_a_campaign_without_finished_cases_says_so(here: Path) -> None:
    study = NavigationStudy("stand-still", CASES, SHORT)
    run_campaign(study, study.campaign(8, 4), here / "results")
    told = []
    for which in ("shard-000000*", "shard-*"):
        for path in sorted((here / "results").glob(which)):
            path.unlink()
        result = CliRunner().invoke(parcours, ["replay", "results", "2", "--html", "x.html"])
        assert result.exit_code != 0
        told.append(str(result.exception) + result.output)
    assert "4 of 8 cases are finished, and case 2 is not yet" in told[0]
    assert "no case is finished yet" in told[1] and "-1" not in told[1]

"""A planner that ends or blocks its process costs its own cases and times, and never the comparison."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from parcours.report.terminal import to_text
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.comparison.analysis import analyse
from parcours_navigation.comparison.decision_times import decision_times
from parcours_navigation.comparison.document import comparison_document
from parcours_navigation.comparison.page import compare_page
from parcours_navigation.comparison.running import Reproducing, run_comparison
from parcours_navigation.comparison.tables import decision_table
from parcours_navigation.guests.planner_facts import PlannerFault
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.study.study import NavigationStudy

CASES = SystemCases(1)

FAULTY = """
import itertools, os

LOG = {log!r}

class F:
    cases = 0

    def reset(self, task):
        with open(LOG, "a") as file:
            file.write("%d %d\\n" % (os.getpid(), task.seed))
        F.cases += 1

    def observe(self, observation):
        {fault}
        return 0.1, 0.0
"""
DIES = "if observation.time > 0.2: os._exit(7)"
DIES_LATER = "if F.cases > 1: os._exit(7)"
HANGS_LATER = "if F.cases > 1: sum(itertools.repeat(0))"
EXITS_LATER = "if F.cases > 1: raise SystemExit(0)"


@pytest.fixture
def faulty(tmp_path: Path) -> Callable[[str], str]:
    """Return a function that writes a planner with that fault, which logs process and case, and names it."""

    def written(fault: str) -> str:
        path = tmp_path / "faulty.py"
        path.write_text(FAULTY.format(log=str(tmp_path / "log"), fault=fault))
        return f"{path}:F"

    return written


def test_a_planner_that_takes_its_process_down_costs_its_cases_only(
    faulty: Callable[[str], str], tmp_path: Path
) -> None:
    name = faulty(DIES)
    results = run_comparison(["stand-still", name], tmp_path / "o", n_cases=1, measured=1, timed=1)
    stands, dies = results.contenders
    assert dies.facts["error"].tolist() == [PlannerFault.DIED] and not stands.facts["error"].any()
    assert stands.decisions is not None and dies.decisions is None and dies.untimed == ""
    assert dies.published is not None
    assert all(np.isnan(dies.published[field]).all() for field in dies.published.dtype.names or ())
    begun = [line.split() for line in (tmp_path / "log").read_text().splitlines()]
    assert len({case for _, case in begun}) == len(begun) == 1  # neither measured nor timed once it is known to fail
    assert str(os.getpid()) not in {process for process, _ in begun}


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (
            DIES_LATER,
            "in 1 of 1 cases its decisions could not be timed: there it died: its process ended with exit code 7",
        ),
        (HANGS_LATER, "in 1 of 1 cases its decisions could not be timed: there it did not answer"),
        (EXITS_LATER, "in 1 of 1 cases its decisions could not be timed: there it raised SystemExit"),
    ],
)
def test_what_fails_only_while_it_is_timed_is_told_in_the_table(
    faulty: Callable[[str], str], tmp_path: Path, fault: str, said: str
) -> None:
    study = NavigationStudy(faulty(fault), CASES, Scenario(time_limit=1.0, call_timeout=0.5))
    taken, untimed = decision_times(study, [0])
    assert taken is None and untimed == said
    begun = [line.split() for line in (tmp_path / "log").read_text().splitlines()]
    assert len(begun) == 3  # to see what it sees, a first decision, and the times
    assert str(os.getpid()) not in {process for process, _ in begun}


def test_a_comparison_goes_on_without_the_times_of_a_planner_that_dies_there(
    faulty: Callable[[str], str], tmp_path: Path
) -> None:
    results = run_comparison([faulty(DIES_LATER), "stand-still"], tmp_path / "o", n_cases=1, measured=0, timed=3)
    dies, stands = results.contenders
    assert not dies.facts["error"].any() and dies.decisions is None
    assert stands.decisions is not None and stands.decisions.n > 100
    assert "could not be timed: there it died: its process ended with exit code 7" in " ".join(
        to_text(decision_table(analyse(results))).split()
    )


def test_the_sound_cases_of_a_planner_that_fails_in_others_are_timed(
    faulty: Callable[[str], str], tmp_path: Path
) -> None:
    study = NavigationStudy(faulty("pass"), CASES, Scenario(time_limit=1.0))
    taken, untimed = decision_times(study, [1, 3])
    assert untimed == "" and taken is not None
    assert taken.n == 2 * 41 and 0.0 < taken.median <= taken.p99 <= taken.largest


def test_cases_that_failed_are_not_run_again_for_published_code() -> None:
    asked = []

    def planner(observation: object) -> tuple[float, float]:
        asked.append(observation)
        return 0.1, 0.0

    study = NavigationStudy(planner, CASES, Scenario(time_limit=1.0))
    rows = Reproducing(study, frozenset({0}))(0, 1)
    assert not asked and rows["number"].tolist() == [0]
    assert rows["facts"].tolist() == [0]
    assert all(np.isnan(rows[name]).all() for name in rows.dtype.names or () if name not in ("number", "facts"))


def test_a_planner_that_draws_by_itself_is_not_reproducible(tmp_path: Path) -> None:
    (tmp_path / "dice.py").write_text(
        "import random\n\n\ndef dice(observation):\n    return random.SystemRandom().uniform(0.0, 0.1), 0.0\n"
    )
    found = run_comparison([f"{tmp_path}/dice.py:dice", "stand-still"], tmp_path / "out", n_cases=3, timed=0)
    assert [one.repeated for one in found.contenders] == [(0, 3), (3, 3)]
    page = compare_page(analyse(found))
    assert "dice.py:dice 0 of 3, stand-still 3 of 3 first cases" in dict(page.facts)["run again"]
    assert page.summary is not None and "is not reproducible: 3 of 3 cases" in page.summary.facts[1]
    assert comparison_document(analyse(found))["planners"]["stand-still"]["run_again"] == {"equal": 3, "n": 3}  # type: ignore[index]

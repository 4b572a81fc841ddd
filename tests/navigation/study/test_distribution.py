"""Measures beside the verdict: what is known of cases, and how it is shown."""

from __future__ import annotations

import numpy as np
import pytest

from parcours_navigation.cases.family import SystemCases
from parcours_navigation.facts import FACTS, NEVER
from parcours_navigation.measures import MEASURES, measures_of
from parcours_navigation.protocol import Observation, Velocity
from parcours_navigation.study.case_parameters import world_cases
from parcours_navigation.study.distribution import (
    SHOWN,
    MeasureSummary,
    distribution_table,
    measured,
    oracle,
    straight_ways,
    summarised,
    survived,
)
from parcours_navigation.study.study import study_of
from parcours_navigation.worlds.family import WorldCases
from parcours_ramp.system.study import system_study

CASES = SystemCases(1)


def planted(n: int) -> tuple[np.ndarray, np.ndarray]:
    facts, measures = np.zeros(n, FACTS), np.zeros(n, MEASURES)
    facts["t_goal"], facts["t_goal_after"] = NEVER, NEVER
    facts["t_goal"][0], facts["travelled"], facts["min_clearance"] = 12_000_000_000, 5.0, np.linspace(0.0, 1.0, n)
    facts["n_planning_cycles"], facts["n_late_cycles"] = 200, 50
    measures["least_time_to_collision"] = np.inf
    return facts, measures


def failing(seen: Observation) -> Velocity:
    raise ZeroDivisionError


def test_a_case_of_a_world_in_which_the_planner_failed_at_once_is_a_failure_and_no_fault_of_the_table() -> None:
    cases, facts = world_cases({"world": "doorway"}, 1), study_of(failing, CASES)(0, 2)
    assert isinstance(cases, WorldCases)
    straight = straight_ways(cases, facts["number"], facts["measures"])
    assert measured(facts, facts["measures"], straight=straight)["spl"].tolist() == [0.0, 0.0]


def test_what_a_case_does_not_have_is_left_out_of_its_row() -> None:
    facts, measures = planted(21)
    known = measured(facts, measures, earliest=np.full(21, 6.0), survival=np.full(21, 0.8))
    assert list(known) == list(SHOWN)
    found = summarised(known)
    assert found["time_to_goal"] == MeasureSummary("s", 1, mean=12.0, median=12.0, p05=12.0, p95=12.0)
    assert found["least_time_to_collision"].n == 0 and found["least_time_to_collision"].median is None
    assert found["sct"].mean == pytest.approx(0.5 / 21)
    assert found["late_cycles"].median == 25.0
    assert found["min_clearance"].p05 == pytest.approx(0.05)


def test_without_measures_or_oracle_only_the_facts_are_shown() -> None:
    known = measured(planted(3)[0])
    assert "sct" not in known and "mean_clearance" not in known and "survivability" not in known
    assert {"time_to_goal", "path_length", "spl", "min_clearance", "switches"} <= set(known)


def test_a_table_shows_the_median_with_both_points_and_a_dash_for_nothing() -> None:
    facts, measures = planted(21)
    table = distribution_table("", {"a": summarised(measured(facts, measures)), "b": summarised(measured(facts))})
    rows = {row[0]: row for row in table.rows}
    assert str(rows["least clearance"][2]).replace("\xa0", " ") == "0.5 [0.05, 0.95]"
    assert rows["least time to collision"][2] is None and rows["mean clearance"][3] is None


def test_the_oracle_and_survivability_do_not_depend_on_how_cases_are_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = np.arange(12)
    whole, alive = oracle(CASES, numbers), survived(CASES, numbers)
    told: list[tuple[int, int]] = []
    monkeypatch.setattr("parcours_navigation.study.distribution._AT_ONCE", 5)
    assert oracle(CASES, numbers, lambda done, total: told.append((done, total))).tobytes() == whole.tobytes()
    assert survived(CASES, numbers).tobytes() == alive.tobytes()
    assert told == [(5, 12), (10, 12), (12, 12)]
    assert len(oracle(CASES, np.arange(0))) == 0


@pytest.mark.parametrize("planner", ["ramp-guarded", "ramp-original", "straight-ahead"])
def test_measures_kept_with_the_facts_are_those_of_the_track_up_to_the_end(planner: str) -> None:
    study = study_of(planner, CASES)
    kept = study(0, 3)["measures"]
    for number in range(3):
        facts, track, places = study.track(number)
        again = measures_of(
            track, places, [CASES.obstacle_radius] * 3, robot_radius=CASES.robot_radius, goal=(2.0, 2.0),
            t_goal=int(facts[0]["t_goal"]), until=int(facts[0]["t_end"]),
        )  # fmt: skip
        assert np.array_equal(np.array(kept[number].tolist()), np.array(again.tolist()), equal_nan=True)


def test_watching_on_changes_no_measure() -> None:
    study = system_study("original", seed=1)
    assert study.watched_on > 0.0
    short = study_of("ramp-original", CASES)
    for name in MEASURES.names or ():
        assert np.array_equal(study(0, 6)["measures"][name], short(0, 6)["measures"][name], equal_nan=True)

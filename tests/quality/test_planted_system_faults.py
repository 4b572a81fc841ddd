"""Faults planted in the whole system: the campaign's facts must show each of them."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours_navigation.outcomes import Outcome, outcomes
from parcours_ramp.planner.latency import Duration, Latencies
from parcours_ramp.planner.parameters import Parameters, guarded
from parcours_ramp.system.study import system_study

CASES = 180

FAULTS: dict[str, Parameters] = {
    "none": guarded(),
    "guard that looks at this instant only": guarded(guard_horizon=0.0),
    "guard that looks 50 ms ahead": guarded(guard_horizon=0.05),
    "guard without margin or horizon": guarded(guard_horizon=0.0, guard_margin=0.0),
    "planner without any margin": guarded(guard_horizon=0.0, guard_margin=0.0, plan_margin=0.0),
    "brakes that hardly hold": guarded(a_max=0.06),
    "planner that thinks once in two seconds": guarded(planning_rate=0.5),
}


@functools.cache
def facts(fault: str) -> NDArray[np.void]:
    return dataclasses.replace(system_study("guarded"), parameters=FAULTS[fault])(0, CASES)


def share(rows: NDArray[np.void], outcome: Outcome) -> float:
    return float((outcomes(rows) == outcome).mean())


def test_the_sound_system_s_robot_closes_no_gap() -> None:
    assert share(facts("none"), Outcome.COLLIDED) == 0.0


@pytest.mark.parametrize("fault", [name for name in FAULTS if name.startswith("guard")])
def test_a_disabled_guard_shows_as_contacts_the_robot_is_to_blame_for(fault: str) -> None:
    rows = facts(fault)
    assert share(rows, Outcome.COLLIDED) > 0.05
    to_blame = [(run["n_robot_contacts"] + run["n_shared_contacts"] > 0).sum() for run in (facts("none"), rows)]
    assert to_blame[0] == 0
    assert to_blame[1] > 0.05 * CASES
    assert (rows["t_contact"] != -1).sum() > (facts("none")["t_contact"] != -1).sum()
    assert rows["halted_time"].sum() < facts("none")["halted_time"].sum()


def test_a_planner_that_keeps_no_margin_shows_as_contacts() -> None:
    assert share(facts("planner without any margin"), Outcome.COLLIDED) > 0.05


def test_a_robot_that_can_hardly_brake_shows_as_contacts() -> None:
    assert share(facts("brakes that hardly hold"), Outcome.COLLIDED) > 0.02


def test_a_planner_that_hardly_thinks_shows_as_goals_missed() -> None:
    lazy, sound = facts("planner that thinks once in two seconds"), facts("none")
    assert lazy["n_planning_cycles"].sum() < 0.2 * sound["n_planning_cycles"].sum()
    assert (lazy["t_goal"] != -1).sum() < 0.9 * (sound["t_goal"] != -1).sum()


def test_a_guard_whose_word_comes_half_a_second_late_shows_as_contacts() -> None:
    late = dataclasses.replace(Latencies(), guard=Duration(0.5, 0.6), added_stop=0.3)
    rows = dataclasses.replace(system_study("guarded"), latencies=late)(0, CASES)
    assert share(rows, Outcome.COLLIDED) > 0.03


def test_planning_on_a_machine_too_slow_for_its_rate_shows_as_late_cycles() -> None:
    slow = dataclasses.replace(Latencies(), planning=Duration(0.2, 0.3))
    rows = dataclasses.replace(system_study("guarded"), latencies=slow)(0, 30)
    assert (rows["n_late_cycles"] > 0.9 * rows["n_planning_cycles"]).all()
    assert facts("none")["n_late_cycles"].sum() < 0.5 * facts("none")["n_planning_cycles"].sum()

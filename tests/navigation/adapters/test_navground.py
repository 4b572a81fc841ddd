"""Behaviours of the real navground as planners."""

from __future__ import annotations

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.adapters.navground import Navground
from parcours_navigation.adapters.optional_imports import imported
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.planners import load_planner
from parcours_navigation.protocol import Limits, Observation, Robot, Task, Velocity
from parcours_navigation.study.study import NavigationStudy

LIMITS = Limits(speed=0.25, yaw_rate=1.57, acceleration=1.0, yaw_acceleration=2.0)


@pytest.mark.parametrize("name", ["ORCA", "HL", "HRVO"])
def test_a_behaviour_runs_as_a_planner_the_same_each_time(name: str) -> None:
    study = NavigationStudy(f"parcours_navigation.adapters.navground:{name}", SystemCases(seed=1))
    facts = study(0, 8)
    assert (facts["error"] == 0).all() and (facts["t_goal"] > 0).any()
    assert study(3, 1).tobytes() == facts[3:4].tobytes()


def test_a_holonomic_robot_is_given_a_velocity() -> None:
    planner = Navground("HL")
    task = Task((0.0, 2.0), 0.2, 0.125, LIMITS, 0.05, 2.0, 1, Robot("holonomic"))
    planner.reset(task)
    answer = planner.observe(Observation(0.0, np.zeros(5), np.zeros((0, 6)), task))
    assert isinstance(answer, Velocity) and answer.vy > 0.0


def test_an_unknown_behaviour_is_refused_by_name() -> None:
    with pytest.raises(BadRequest, match=r"navground behaviour 'HLL'.*\[no-adapter\]"):
        Navground("HLL")


def test_a_package_that_is_not_there_is_named_with_the_remedy() -> None:
    with pytest.raises(BadRequest, match=r"pip install 'parcours\[adapters\]' \[no-adapter\]"):
        imported("no_such_module", "no-such")


def test_a_behaviour_is_found_by_the_name_of_its_class() -> None:
    assert load_planner("parcours_navigation.adapters.navground:SocialForce").reset is not None

"""Gymnasium both ways: our world passes its checker, and a policy drives as a planner."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from parcours_navigation.adapters.environment import CaseEnv, Reward
from parcours_navigation.adapters.features import features, size
from parcours_navigation.adapters.policy import PolicyPlanner
from parcours_navigation.adapters.stepping import Stepped
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.planners.orca import Orca
from parcours_navigation.study.study import NavigationStudy


def towards_goal(seen: Any) -> tuple[float, float]:
    """Drive at the goal, as a policy would: from the vector alone."""
    return 1.0 if seen[0] > 0.0 else 0.0, float(np.clip(2.0 * seen[1] / max(seen[2], 0.1), -1.0, 1.0))


class Learnt:
    """A policy as Stable-Baselines3 has them."""

    def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
        assert deterministic
        return np.array(towards_goal(observation), np.float32), None


def test_gymnasiums_own_checker_finds_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(CaseEnv(), skip_render_check=True)


def test_a_seed_is_a_case_and_an_option_too() -> None:
    env = CaseEnv()
    first, info = env.reset(seed=17)
    again, _ = env.reset(options={"case": 17})
    assert info["case"] == 17 and np.array_equal(first, again)
    assert not np.array_equal(first, env.reset(seed=18)[0])
    assert first.shape == (size(3),) and first.dtype == np.float32


def test_an_episode_pays_for_progress_and_arrival() -> None:
    env = CaseEnv(reward=Reward(progress=1.0, arrival=5.0, contact=-7.0, time=0.0))
    ends = set()
    for case in range(12):
        seen, info = env.reset(seed=case)
        start, total, over = float(seen[2]), 0.0, False
        while not over:
            seen, reward, terminated, truncated, info = env.step(np.array(towards_goal(seen), np.float32))
            total, over = total + reward, terminated or truncated
        extra = 5.0 * info["reached"] - 7.0 * info["contacts"]
        assert total == pytest.approx(start - float(seen[2]) + extra, abs=1e-4)
        ends.add((info["reached"], info["contacts"] > 0))
    assert (True, False) in ends and (False, True) in ends


def test_the_same_planner_fares_the_same_in_steps_as_in_a_study() -> None:
    cases = SystemCases(seed=1)
    stepped, planner, expected = Stepped(cases), Orca(), NavigationStudy(Orca, cases)(0, 4)
    for case in range(4):
        seen = stepped.begin(case)
        planner.reset(seen.task)
        arrived = False
        while not (arrived or stepped.is_over):
            arrived = stepped.hold(*planner.observe(seen))
        facts = stepped.facts()
        for name in ("t_goal", "x", "y", "travelled", "min_clearance", "n_robot_contacts"):
            assert facts[name] == expected[case][name]


def test_a_policy_drives_the_same_as_function_and_as_object() -> None:
    cases = SystemCases(seed=1)
    facts = [NavigationStudy(PolicyPlanner(policy), cases)(0, 3) for policy in (towards_goal, Learnt())]
    assert facts[0]["x"].tobytes() == facts[1]["x"].tobytes()
    assert (facts[0]["error"] == 0).all() and (facts[0]["travelled"] > 0.5).all()


def test_a_vector_shows_the_nearest_obstacles_in_the_robots_frame() -> None:
    seen = Stepped(SystemCases(seed=1)).begin(0)
    vector = features(seen, 5)
    assert vector[0] == pytest.approx(2.0 * 2.0**0.5, abs=1e-6) and abs(vector[1]) < 1e-6
    assert vector[6::6][:3].tolist() == [1.0, 1.0, 1.0] and not vector[6 + 18 :].any()
    assert list(vector[11::6][:3]) == sorted(vector[11::6][:3])

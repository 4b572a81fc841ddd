"""RVO2 by the real pyrvo as a planner."""

from __future__ import annotations

import numpy as np

from parcours_navigation.adapters.pyrvo import Pyrvo
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.protocol import Limits, Map, Observation, Robot, Task, Velocity
from parcours_navigation.study.study import NavigationStudy

LIMITS = Limits(speed=0.25, yaw_rate=1.57, acceleration=1.0, yaw_acceleration=2.0)


def test_it_reaches_most_goals_and_is_the_same_each_time() -> None:
    study = NavigationStudy(Pyrvo, SystemCases(seed=1))
    facts = study(0, 12)
    assert (facts["error"] == 0).all() and (facts["t_goal"] > 0).sum() >= 8
    assert study(5, 1).tobytes() == facts[5:6].tobytes()


def test_it_does_not_choose_a_velocity_into_a_wall() -> None:
    task = Task((2.0, 0.0), 0.2, 0.125, LIMITS, 0.05, 2.0, 1, Robot("holonomic"))
    cells = np.zeros((40, 60), np.uint8)
    cells[:, 26:28] = 100  # from x = 0.3 on: no way on
    planner = Pyrvo()
    for ground, low, high in ((None, 0.24, 0.26), (Map(cells, 0.05, (-1.0, -1.0)), -0.3, 0.15)):
        planner.reset(task)
        answer = planner.observe(Observation(0.0, np.zeros(5), np.zeros((0, 6)), task, map=ground))
        assert isinstance(answer, Velocity)
        assert low < answer.vx < high

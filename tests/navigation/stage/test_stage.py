"""The two ways to move a world, the quick one for plain worlds and the one for any, give the same bits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.host import GuestHost
from parcours_navigation.guests.planners import load_planner
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.protocol import Answer, Observation, Trajectory
from parcours_navigation.robots.kinds import Body
from parcours_navigation.study.study import NavigationStudy


def along(observation: Observation) -> Answer:
    """Follow a trajectory half of the time, and hold a command else."""
    if observation.time % 4.0 < 2.0:
        return 0.2, 0.3
    x, y, heading = observation.robot[:3]
    times = observation.time + np.arange(5) * 0.5
    return Trajectory(np.column_stack([times, x + 0.1 * np.arange(5), np.full(5, y), np.full(5, heading)]))


@pytest.mark.parametrize("protocol", ["table-vii", "published"])
def test_a_plain_world_is_the_same_when_it_is_moved_as_any_other(protocol: str) -> None:
    study = NavigationStudy(along, SystemCases(3, protocol), Scenario(watched_on=2.0))  # type: ignore[arg-type]
    plain = study.run(np.arange(20))
    host, general = GuestHost(load_planner(along), study.setting(), 3), []
    for one in study.staged(np.arange(20)):
        robot = one.scene.robot[0]
        body = Body(
            radius=float(robot["radius"]), speed=float(robot["v_max"]), yaw_rate=float(robot["w_max"]),
            acceleration=float(robot["a_max"]), yaw_acceleration=float(robot["alpha_max"]),
        ).record(*(float(robot[name]) for name in ("x", "y", "heading", "v")))  # fmt: skip
        scene = dataclasses.replace(one.scene, plain=False, body=np.array([body]))
        general.append(dataclasses.replace(one, scene=scene))
    assert host.run(general, 3).tobytes() == plain.tobytes()

"""Cases of any family at their beginning: the paper's arena with the scenario's robot and task, or a world's own."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.robot import ROBOT
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.protocol import Task
from parcours_navigation.robots.kinds import Body
from parcours_navigation.stage.memory import Scene, Staged
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.plan import TaskPlan as PlannedTask
from parcours_navigation.worlds.plan import WorldPlan

Cases = SystemCases | WorldCases
"""A family of cases that planners are run on."""

_N_OBSTACLES = 3


def staged(cases: Cases, scenario: Scenario, numbers: NDArray[np.int64]) -> Sequence[Staged]:
    """Return cases at their beginning. Raises BadRequest if one cannot be, naming it."""
    if isinstance(cases, WorldCases):
        return cases.staged(numbers.tolist(), scenario.period)
    plain, end = plain_scene(scenario, cases.robot_radius), cases.end(scenario.time_limit)
    task = Task(
        scenario.goal, scenario.goal_tolerance, cases.robot_radius, scenario.limits, scenario.period, scenario.arena, 0
    )
    return [
        Staged(number, dataclasses.replace(plain, obstacles=one), task, end, scenario.start_speed)
        for number, one in zip(numbers.tolist(), clear_obstacles(cases, scenario, numbers), strict=True)
    ]


def clear_obstacles(cases: SystemCases, scenario: Scenario, numbers: NDArray[np.int64]) -> NDArray[np.void]:
    """Return the obstacles of the paper's cases, once they are found clear of the robot's start, shape (n, 3)."""
    obstacles = np.ascontiguousarray(cases.obstacles(numbers))
    x, y, _ = scenario.start
    gap = np.hypot(obstacles["x0"] - x, obstacles["y0"] - y) - (cases.robot_radius + obstacles["radius"])
    if len(numbers) and gap.min() < 0.0:
        k = int(np.argmin(gap.min(axis=1)))
        inside = f"at ({x:g}, {y:g}) m it is {-gap[k].min():.3f} m inside"
        rule, id = f"the robot must start clear of obstacles, but {inside}", cases.id(int(numbers[k]))
        raise BadRequest(id, rule, "give another start, or smaller radii", slug="start-occupied")
    return obstacles


@functools.lru_cache(maxsize=16)
def plain_scene(scenario: Scenario, robot_radius: float) -> Scene:
    """Return the paper's world, but for the obstacles."""
    limits, (x, y, heading), speed = scenario.limits, scenario.start, scenario.start_speed
    robot = np.zeros(1, ROBOT)
    robot[0] = (x, y, heading, speed, 0.0, speed, 0.0, limits.speed, limits.yaw_rate, limits.acceleration,
                limits.yaw_acceleration, robot_radius)  # fmt: skip
    goals = np.array([[*scenario.goal, np.nan]])
    return Scene(np.zeros(_N_OBSTACLES, OBSTACLE), robot, goals, scenario.goal_tolerance)


def plan_of(cases: Cases, scenario: Scenario, number: int) -> WorldPlan:
    """Return what the world of a case is made of; in the paper's arena without its obstacles, which are drawn."""
    if isinstance(cases, WorldCases):
        return cases.plan(number)
    limits = scenario.limits
    body = Body("unicycle", cases.robot_radius, (), limits.speed, limits.yaw_rate, limits.acceleration,
                limits.yaw_acceleration)  # fmt: skip
    return WorldPlan(PlannedTask(scenario.start, scenario.start_speed, scenario.goal, tolerance=scenario.goal_tolerance,
                            time_limit=cases.end(scenario.time_limit)), robot=body)  # fmt: skip

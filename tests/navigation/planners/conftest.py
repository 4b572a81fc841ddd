"""A small world for planners' tests: one robot that keeps its limits, and discs that keep their speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from parcours_navigation.protocol import Command, Floats, Limits, Observation, Planner, Task

LIMITS = Limits(speed=0.25, yaw_rate=math.pi / 2, acceleration=1.0, yaw_acceleration=2.094)
PERIOD = 0.05


@dataclass
class Drive:
    """How a planner drove: when it reached the goal (inf: never), the least gap, every command and every place."""

    reached: float = math.inf
    gap: float = math.inf
    commands: list[tuple[float, float]] = field(default_factory=list)
    places: list[tuple[float, float]] = field(default_factory=list)


class Course:
    """What planners are driven with."""

    @staticmethod
    def task_to(x: float, y: float, seed: int = 1, period: float = PERIOD) -> Task:
        """Return the task of going to (x, y) within 0.2 m."""
        return Task((x, y), 0.2, 0.125, LIMITS, period, 2.0, seed)

    @staticmethod
    def discs(*rows: tuple[float, float, float, float, float]) -> Floats:
        """Return obstacles of radius 0.1 m from rows (x, y, heading, v, w), shape (n, 6)."""
        return np.array([(*row, 0.1) for row in rows]).reshape(len(rows), 6)

    @staticmethod
    def observe(planner: Planner, robot: Floats, obstacles: Floats, task: Task, time: float = 0.0) -> Command:
        """Return the planner's command, which must be a pair of finite numbers."""
        answer = planner.observe(Observation(time, robot, obstacles, task))
        assert isinstance(answer, tuple) and len(answer) == 2
        v, w = answer
        assert math.isfinite(v) and math.isfinite(w)
        return Command(float(v), float(w))

    @staticmethod
    def step(robot: Floats, command: tuple[float, float], dt: float) -> None:
        """Move a unicycle by dt [s] within LIMITS."""
        v = min(max(command[0], -LIMITS.speed), LIMITS.speed)
        w = min(max(command[1], -LIMITS.yaw_rate), LIMITS.yaw_rate)
        robot[3] += min(max(v - robot[3], -LIMITS.acceleration * dt), LIMITS.acceleration * dt)
        robot[4] += min(max(w - robot[4], -LIMITS.yaw_acceleration * dt), LIMITS.yaw_acceleration * dt)
        robot[2] += 0.5 * robot[4] * dt
        robot[0] += robot[3] * math.cos(robot[2]) * dt
        robot[1] += robot[3] * math.sin(robot[2]) * dt
        robot[2] += 0.5 * robot[4] * dt

    @staticmethod
    def drive(planner: Planner, task: Task, obstacles: Floats, limit: float = 20.0, heading: float = 0.0) -> Drive:
        """Return how the planner drives from rest in (0, 0) until it reaches the goal or the limit [s] has passed."""
        robot = np.array([0.0, 0.0, heading, 0.0, 0.0])
        moving = obstacles.copy()
        result = Drive()
        planner.reset(task)
        for k in range(round(limit / PERIOD)):
            if math.dist(robot[:2], task.goal) < task.goal_tolerance:
                result.reached = k * PERIOD
                break
            command = Course.observe(planner, robot, moving, task, k * PERIOD)
            result.commands.append((command.v, command.w))
            for _ in range(5):
                Course.step(robot, command, PERIOD / 5)
                moving[:, 0] += moving[:, 3] * np.cos(moving[:, 2]) * PERIOD / 5
                moving[:, 1] += moving[:, 3] * np.sin(moving[:, 2]) * PERIOD / 5
                moving[:, 2] += moving[:, 4] * PERIOD / 5
                gaps = np.hypot(moving[:, 0] - robot[0], moving[:, 1] - robot[1]) - 0.225
                result.gap = min(result.gap, float(gaps.min(initial=math.inf)))
            result.places.append((float(robot[0]), float(robot[1])))
        return result


@pytest.fixture(scope="session")
def course() -> Course:
    """Return the small world."""
    return Course()

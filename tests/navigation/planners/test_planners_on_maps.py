"""Planners among walls: through a gap, out of a dead end, by map or scan, also as a car, whatever they are shown."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours_navigation.planners.a_star import AStar
from parcours_navigation.planners.distance import Walls, look, walls_of
from parcours_navigation.planners.dwa import Dwa
from parcours_navigation.planners.mpc import Mpc
from parcours_navigation.planners.mppi import Mppi
from parcours_navigation.planners.orca import Orca
from parcours_navigation.planners.teb import Teb
from parcours_navigation.protocol import Map, Observation, Planner, Robot, Scan, Task

if TYPE_CHECKING:
    from tests.navigation.planners.conftest import Course

    from parcours_navigation.protocol import Floats

Maker = Callable[[], Planner]
every = pytest.mark.parametrize("maker", [AStar, Orca, Dwa, Mppi, Mpc, Teb])
CAR = Robot("car", wheelbase=0.2, steering=0.6, steering_rate=2.0)


def room(*boxes: tuple[int, int, int, int]) -> Map:
    """Return a room of 4 m x 3 m in cells of 5 cm, with walls (first row, last row, first column, last column)."""
    cells = np.zeros((60, 80), np.uint8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    for a, b, c, d in boxes:
        cells[a:b, c:d] = 100
    return Map(cells, 0.05, (0.0, 0.0))


GAP = room((0, 34, 40, 42), (46, 60, 40, 42))
DEAD_END = room((16, 44, 48, 50), (16, 18, 30, 50), (42, 44, 30, 50))


def beams(robot: Floats, walls: Walls) -> Scan:
    """Return what 180 beams of 3 m meet, by small steps."""
    ranges = np.full(180, math.inf)
    for k in range(180):
        angle, far = robot[2] - math.pi + k * math.radians(2.0), 0.0
        while far < 3.0:
            d = look(walls.distances, walls.frame, robot[0] + far * math.cos(angle), robot[1] + far * math.sin(angle))[
                0
            ]
            if d < 0.01:
                ranges[k] = far
                break
            far += max(0.7 * d, 0.01)
    return Scan(ranges, -math.pi, math.radians(2.0), 3.0)


def drive(
    course: Course, planner: Planner, task: Task, ground: Map, *, scans: bool = False, limit: float = 40.0
) -> tuple[float, float, list[tuple[float, float]]]:
    """Return when the goal was reached [s], the least gap to walls [m], and the commands, from rest at (0.6, 1.5)."""
    walls, robot = walls_of(ground), np.array([0.6, 1.5, 0.0, 0.0, 0.0])
    least = math.inf
    commands: list[tuple[float, float]] = []
    planner.reset(task)
    scan = None
    for k in range(round(limit / 0.05)):
        if math.dist(robot[:2].tolist(), task.goal) < task.goal_tolerance:
            return k * 0.05, least, commands
        if scans and k % 4 == 0:
            scan = beams(robot, walls)
        seen = Observation(k * 0.05, robot.copy(), course.discs(), task, scan, None if scans else ground)
        command = planner.observe(seen)
        assert isinstance(command, tuple)
        v, w = float(command[0]), float(command[1])
        assert abs(v) <= task.limits.speed + 1e-12 and abs(w) <= task.limits.yaw_rate + 1e-12
        commands.append((v, w))
        if task.robot.kind == "car":
            bend = abs(v) * math.tan(task.robot.steering) / task.robot.wheelbase
            w = min(max(w, -bend), bend)
        for _ in range(5):
            course.step(robot, (v, w), 0.01)
        least = min(least, look(walls.distances, walls.frame, robot[0], robot[1])[0] - task.robot_radius)
    return math.inf, least, commands


@every
@pytest.mark.parametrize("ground", [room(), GAP, DEAD_END], ids=["empty", "gap", "dead end"])
def test_the_goal_is_reached_without_touching_a_wall(course: Course, maker: Maker, ground: Map) -> None:
    reached, least, _ = drive(course, maker(), course.task_to(3.4, 1.5), ground)
    assert reached < 30.0
    assert least > 0.0


@pytest.mark.parametrize("maker", [Orca, Dwa, Mppi, Mpc, Teb])
def test_walls_that_only_a_scan_shows_are_not_touched(course: Course, maker: Maker) -> None:
    _, least, _ = drive(course, maker(), course.task_to(3.4, 1.5), GAP, scans=True, limit=14.0)
    assert least > 0.0


@pytest.mark.parametrize("maker", [AStar, Mpc, Teb])
def test_a_car_reaches_its_goal(course: Course, maker: Maker) -> None:
    plain = course.task_to(3.4, 1.5)
    task = Task(plain.goal, 0.2, 0.125, plain.limits, 0.05, 2.0, 1, CAR)
    reached, least, _ = drive(course, maker(), task, GAP)
    assert reached < 35.0 and least > 0.0


@every
def test_the_same_case_has_the_same_commands_whatever_was_driven_before(course: Course, maker: Maker) -> None:
    task, planner = course.task_to(3.4, 1.5), maker()
    first = drive(course, planner, task, GAP, limit=5.0)[2]
    drive(course, planner, course.task_to(3.4, 0.5), DEAD_END, limit=2.0)
    assert drive(course, planner, task, GAP, limit=5.0)[2] == first
    assert drive(course, maker(), task, GAP, limit=5.0)[2] == first


@every
def test_hostile_observations_get_finite_answers_within_the_limits(course: Course, maker: Maker) -> None:
    planner = maker()
    full = Map(np.full((20, 20), 100, np.uint8), 0.1, (-1.0, -1.0))
    unknown = Map(np.full((20, 20), 255, np.uint8), 0.1, (-1.0, -1.0))
    one = Map(np.full((1, 1), 100, np.uint8), 0.1, (0.0, 0.0))
    none = Map(np.zeros((0, 0), np.uint8), 0.1, (0.0, 0.0))
    closed = room((0, 60, 40, 42))
    nothing = Scan(np.full(8, math.inf), 0.0, 0.7, 3.0)
    odd = Scan(np.array([math.nan, 0.0, -1.0, math.inf, 0.01, 1e9]), 0.0, 1.0, 3.0)
    for goal in ((0.0, 0.0), (3.4, 1.5), (-900.0, 4.0)):
        task = course.task_to(*goal)
        for ground in (full, unknown, one, none, closed, None):
            for scan in (None, nothing, odd):
                for path in (None, np.zeros((1, 2)), np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]])):
                    planner.reset(task)
                    for k in range(2):
                        robot = np.array([0.0, 0.0, 9.0, 0.1, 0.2])
                        rows = course.discs((0.0, 0.0, 0.0, 0.2, 0.1), (0.3, 0.1, 2.0, 0.0, 0.0))
                        seen = Observation(0.05 * k, robot, rows, task, scan, ground, path)
                        command = planner.observe(seen)
                        assert isinstance(command, tuple)
                        assert abs(command[0]) <= 0.25 + 1e-12 and abs(command[1]) <= math.pi / 2 + 1e-12

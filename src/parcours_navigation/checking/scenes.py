"""Situations to show a planner: a standard task, observations along a winding way, the same moved or mirrored."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.protocol import HEADING, RADIUS, YAW_RATE, Map, Observation, Scan, Task, X, Y
from parcours_navigation.robots.kinds import Body
from parcours_navigation.sensing.scan import Beams, scan

_SCENARIO = Scenario()

PERIOD = _SCENARIO.period
"""Time between two observations there [s]."""

_BODY = Body()

Row = tuple[float, ...]


def standard_task(
    goal: tuple[float, float] = (2.0, 2.0), *, seed: int = 7, period: float = PERIOD, body: Body = _BODY
) -> Task:
    """Return the paper's task: a disc of 0.125 m to a goal it must come within 0.2 m of, in an arena of 2 m.

    Of another body it has the kind and the limits, but not the size.
    """
    return Task(goal, 0.2, 0.125, body.limits, period, 2.0, seed, dataclasses.replace(body.robot, footprint=None))


def observation(task: Task, robot: Sequence[float], obstacles: Sequence[Row] = (), time: float = 0.0) -> Observation:
    """Return an observation at a time [s] in arrays of its own; what a row leaves out is 0, the radius 0.1 m."""
    state = np.zeros(5)
    state[: len(robot)] = robot
    rows = np.zeros((len(obstacles), 6))
    rows[:, 5] = 0.1
    for row, obstacle in zip(rows, obstacles, strict=True):
        row[: len(obstacle)] = obstacle
    return Observation(time, state, rows, task)


def sensed(seen: Observation, needs: Sequence[str]) -> Observation:
    """Return the observation with what a planner needs beside it: a scan, an empty map, a straight way.

    >>> there = sensed(observation(standard_task(), (0.0, 0.0), [(1.0, 0.0)]), ["scan"])
    >>> round(float(there.scan.ranges[180]), 6), there.map
    (0.9, None)
    """
    x, y, heading = (float(seen.robot[k]) for k in (X, Y, HEADING))
    if "scan" in needs and seen.scan is None:
        beams = Beams(360)
        ranges = np.empty(beams.n)
        discs = np.ascontiguousarray(seen.obstacles[:, [X, Y, RADIUS]])
        scan(np.zeros(0), discs, x, y, heading, beams.first, beams.step, beams.reach, ranges)
        seen.scan = Scan(ranges, beams.first, beams.step, beams.reach)
    if "map" in needs and seen.map is None:
        low = np.floor(np.minimum((x, y), seen.task.goal)) - 3.0
        rows = int(np.ceil(np.abs(np.subtract(seen.task.goal, (x, y))).max()) + 7.0) * 20
        seen.map = Map(np.zeros((rows, rows), np.uint8), 0.05, (float(low[0]), float(low[1])))
    if "path" in needs and seen.path is None:
        seen.path = np.array([(x, y), seen.task.goal])
    return seen


def script(task: Task, n: int = 30) -> list[Observation]:
    """Return what a robot sees on a winding way past three obstacles, two of them moving; n observations."""
    seen = []
    for k in range(n):
        t = k * task.period
        along = 0.2 * t
        heading = 0.6 + 0.25 * math.sin(0.8 * t)
        robot = (0.2 + 0.8 * along, 0.15 + 0.6 * along, heading, 0.2, 0.2 * math.cos(0.8 * t))
        obstacles = (
            (1.5 - 0.15 * t, 0.75 - 0.03 * t, 3.34, 0.153, 0.0, 0.1),
            (0.55, 1.15, 0.0, 0.0, 0.0, 0.12),
            (1.35, 1.9 - 0.2 * t, -1.5707963, 0.2, 0.0, 0.1),
        )
        seen.append(observation(task, robot, obstacles, t))
    return seen


def copied(seen: Observation) -> Observation:
    """Return the same observation in arrays of its own."""
    return Observation(seen.time, seen.robot.copy(), seen.obstacles.copy(), seen.task)


def moved(seen: Observation, angle: float, shift: tuple[float, float], about: tuple[float, float]) -> Observation:
    """Return the observation of a world turned by an angle about a point and then shifted.

    >>> turned = moved(observation(standard_task(), (2.0, 1.0, 0.0)), math.pi / 2, (0.0, 0.0), (1.0, 1.0))
    >>> turned.robot.round(6).tolist(), [round(x, 6) for x in turned.task.goal]
    ([1.0, 2.0, 1.570796, 0.0, 0.0], [0.0, 2.0])
    """
    c, s = math.cos(angle), math.sin(angle)

    def place(x: float, y: float) -> tuple[float, float]:
        dx, dy = x - about[0], y - about[1]
        return about[0] + shift[0] + c * dx - s * dy, about[1] + shift[1] + s * dx + c * dy

    turned = copied(seen)
    for row in (turned.robot, *turned.obstacles):
        row[X], row[Y] = place(float(row[X]), float(row[Y]))
        row[HEADING] = math.remainder(float(row[HEADING]) + angle, 2.0 * math.pi)
    turned.task = dataclasses.replace(seen.task, goal=place(*seen.task.goal))
    return turned


def mirrored(seen: Observation) -> Observation:
    """Return the observation of the world mirrored at the diagonal of the arena: left becomes right.

    >>> other = mirrored(observation(standard_task((2.0, 1.0)), (0.5, 0.0, 0.2, 0.1, 0.3)))
    >>> other.robot.round(3).tolist(), other.task.goal
    ([0.0, 0.5, 1.371, 0.1, -0.3], (1.0, 2.0))
    """
    other = copied(seen)
    for row in (other.robot, *other.obstacles):
        row[X], row[Y] = float(row[Y]), float(row[X])
        row[HEADING] = math.remainder(math.pi / 2.0 - float(row[HEADING]), 2.0 * math.pi)
        row[YAW_RATE] = -row[YAW_RATE]
    other.task = dataclasses.replace(seen.task, goal=(seen.task.goal[1], seen.task.goal[0]))
    return other


def crowd(n: int) -> tuple[Row, ...]:
    """Return n >= 0 obstacles on rings round the middle of the arena, every second one moving, none on the origin."""
    rows = []
    for k in range(n):
        angle, ring = 2.399963 * k, 0.35 + 0.02 * k  # the golden angle: no two in one direction
        speed = 0.15 if k % 2 else 0.0
        rows.append((1.2 + ring * math.cos(angle), 1.2 + ring * math.sin(angle), angle, speed, 0.0, 0.1))
    return tuple(rows)

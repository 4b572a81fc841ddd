"""The way that a planner steers along: the one it is given, else the shortest one over the map, else straight ahead."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from parcours_navigation.planners.distance import NO_WALLS, Walls
from parcours_navigation.planners.motion import to_goal
from parcours_navigation.planners.search import along, search, stand_in
from parcours_navigation.protocol import SPEED, Floats, Map, Observation, Task, X, Y

SOFT, WEIGHT = 0.3, 2.0
"""Within so much room [m] beyond the radius a way costs up to 1 + WEIGHT times its length."""

_STANDING = 0.02
_SPACING = 0.1
_AGAIN = 0.5
_STRAYED = 1.0
_SLACK = 1e-6


class Aim(NamedTuple):
    """Where to head for, for now."""

    x: float  # [m]
    y: float
    left: float  # length of the way from there to the goal [m]
    is_goal: bool  # it is the goal itself


class Route:
    """A way to the goal, searched when it is first asked for, and again when the robot strays from it.

    It keeps `margin` [m] more than the robot's radius off walls, and if there is no such way, the radius.
    """

    def __init__(self, margin: float) -> None:
        self._margin = margin
        self.begin()

    def begin(self) -> None:
        """Forget the way: a case begins."""
        self._points = np.empty((0, 2))
        self._given: Floats | None = None
        self._walls: Walls = NO_WALLS
        self._at = 0
        self._searched = -math.inf
        self.is_whole = True  # the way leads to the goal itself
        self._radius = 0.0

    @property
    def points(self) -> Floats:
        """The way from where the robot is on it, shape (n, 2) [m]; empty if there is none."""
        return self._points[self._at :]

    def aim(self, observation: Observation, walls: Walls, lookahead: float) -> Aim:
        """Return the place to head for: on the way, in sight, and at most `lookahead` [m] along it.

        With neither a path nor a map, or if `lookahead` is 0, that is the goal itself.
        """
        task = observation.task
        goal = Aim(task.goal[0], task.goal[1], 0.0, True)
        has_path = observation.path is not None and len(observation.path) > 0
        if lookahead <= 0.0 or (walls.distances.size == 0 and not has_path):
            return goal
        self._update(observation, walls)
        if len(self._points) == 0:
            return goal
        x, y = float(observation.robot[X]), float(observation.robot[Y])
        nearest, off, ahead, left = self._seen(x, y, walls, lookahead)
        strayed = off > _STRAYED + lookahead
        if self._given is None and strayed and observation.time >= self._searched + _AGAIN:
            self.search(observation, walls)
            nearest, off, ahead, left = self._seen(x, y, walls, lookahead)
        self._at = nearest
        to_x, to_y = float(self._points[ahead, 0]), float(self._points[ahead, 1])
        return Aim(to_x, to_y, left, self.is_whole and ahead == len(self._points) - 1)

    def _seen(self, x: float, y: float, walls: Walls, lookahead: float) -> tuple[int, float, int, float]:
        radius = self._radius - _SLACK
        return along(self._points, self._at, x, y, lookahead, walls.distances, walls.frame, radius)

    def _update(self, observation: Observation, walls: Walls) -> None:
        """Take the path that is given, or search for one if the map is another, or none was looked for."""
        path, task = observation.path, observation.task
        if path is not None and len(path) > 0:
            if self._given is None or not np.array_equal(self._given, path):
                self._given = np.array(path, np.float64)
                self._points, self._at, self._radius = _spaced(self._given), 0, task.robot_radius
                last = self._points[-1]
                self.is_whole = math.dist(last.tolist(), task.goal) <= task.goal_tolerance
                if self.is_whole:
                    self._points[-1] = task.goal
        elif self._given is not None or self._walls is not walls:
            self._given = None
            self.search(observation, walls)

    def search(self, observation: Observation, walls: Walls, moving: bool = False) -> None:
        """Search the map for the way from where the robot is; obstacles that stand, or all, are in the way, too."""
        task, side = observation.task, float(walls.frame[2])
        self._searched, self._walls, self._at = observation.time, walls, 0
        start = _cell(walls, float(observation.robot[X]), float(observation.robot[Y]))
        goal = _cell(walls, *task.goal)
        room = walls.distances.copy()
        for row in observation.obstacles:
            if moving or abs(row[SPEED]) < _STANDING:
                stand_in(room, walls.frame, row[0], row[1], row[5], task.robot_radius + self._margin + SOFT)
        way = np.empty(room.size, np.int64)
        for radius in (task.robot_radius + self._margin, task.robot_radius):
            n, self.is_whole, _ = search(room, side, radius, SOFT, WEIGHT, start, goal, way)
            self._radius = radius
            if self.is_whole:
                break
        rows, columns = np.divmod(way[:n], room.shape[1])
        self._points = np.column_stack([walls.frame[0] + columns * side, walls.frame[1] + rows * side])
        if self.is_whole:
            self._points[-1] = task.goal


def blank(task: Task, x: float, y: float, side: float = 0.05, beyond: float = 2.0) -> Map:
    """Return an empty map around (x, y) and the goal, `beyond` [m] on all sides, of at most 400 cells a side.

    >>> from parcours_navigation.protocol import Limits
    >>> task = Task((1.0, 0.0), 0.2, 0.125, Limits(0.25, 1.5, 1.0, 2.0), 0.05, 2.0, 1)
    >>> blank(task, 0.0, 0.0).cells.shape
    (80, 100)
    """
    low = min(x, task.goal[0]) - beyond, min(y, task.goal[1]) - beyond
    high = max(x, task.goal[0]) + beyond, max(y, task.goal[1]) + beyond
    side = max(side, max(high[0] - low[0], high[1] - low[1]) / 400.0)
    rows, columns = (math.ceil((high[k] - low[k]) / side - 1e-9) for k in (1, 0))
    return Map(np.zeros((rows, columns), np.uint8), side, low)


def _cell(walls: Walls, x: float, y: float) -> int:
    """Return the flat index of the cell at (x, y) [m], or of the nearest one."""
    rows, columns = walls.distances.shape
    j = min(max(round((x - walls.frame[0]) / walls.frame[2]), 0), columns - 1)
    i = min(max(round((y - walls.frame[1]) / walls.frame[2]), 0), rows - 1)
    return int(int(i) * columns + int(j))


def _spaced(path: Floats) -> Floats:
    """Return the path with points at most _SPACING apart."""
    points = [path[:1]]
    for a, b in itertools.pairwise(path):
        n = min(max(math.ceil(math.dist(a.tolist(), b.tolist()) / _SPACING), 1), 10_000)
        points.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(points)


def towards(observation: Observation, aim: Aim) -> tuple[float, float, float, float]:
    """Return (x, y, distance, speed) as `motion.to_goal` does, but of the aim; the speed is 0 where the way ends."""
    x, y, distance, speed = to_goal(observation)
    if aim.is_goal or speed == 0.0:
        return x, y, distance, speed
    task, robot = observation.task, observation.robot
    x, y = aim.x - float(robot[X]), aim.y - float(robot[Y])
    distance = math.sqrt(x * x + y * y)
    rest = distance + aim.left
    if rest <= 0.5 * task.goal_tolerance or distance <= _SLACK:
        return x, y, max(distance, _SLACK), 0.0
    return x, y, distance, min(task.limits.speed, math.sqrt(2.0 * task.limits.acceleration * rest))

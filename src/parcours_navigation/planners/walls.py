"""Walls near the robot, from a map or a laser scan, as small standing discs: what planners of moving discs can read.

Of all that is near only the nearest place in each direction is kept, as a scanner would: so their number is bounded,
and they lie closest together where the robot is closest to them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import PI, TAU, atan2, sin_cos
from parcours.kernels import heap_kernel, kernel
from parcours_navigation.planners.distance import NO_WALLS, look, walls_of
from parcours_navigation.planners.motion import runs_into, travel
from parcours_navigation.protocol import Floats, Observation, Scan

SECTORS = 72
"""Directions in which the nearest place of a wall is kept."""

_STEP = 0.1
_KNOWN = 0.06
"""A beam that ends this near to an obstacle's edge is taken to have met it [m]."""


@kernel
def _keep(nearest: Floats, sides: Floats, x: float, y: float, side: float) -> None:
    """Note a place seen from the robot if it is the nearest in its direction; `side` is half that of a square."""
    square = x * x + y * y
    k = min(int((atan2(y, x) + PI) / TAU * SECTORS), SECTORS - 1)
    if square < nearest[k, 0] * nearest[k, 0] + nearest[k, 1] * nearest[k, 1]:
        nearest[k, 0], nearest[k, 1] = x, y
        sides[k] = side


@kernel
def _discs(robot: Floats, nearest: Floats, sides: Floats, reach: float, discs: Floats) -> int:
    """Fill in rows (x, y, 0, 0, 0, radius) of the places that were kept, and return how many there are."""
    n = 0
    for k in range(SECTORS):
        if nearest[k, 0] * nearest[k, 0] + nearest[k, 1] * nearest[k, 1] < reach * reach:
            discs[n, 0], discs[n, 1] = robot[0] + nearest[k, 0], robot[1] + nearest[k, 1]
            discs[n, 2] = discs[n, 3] = discs[n, 4] = 0.0
            discs[n, 5] = sides[k]
            n += 1
    return n


@heap_kernel
def from_faces(robot: Floats, faces: Floats, reach: float, discs: Floats) -> int:
    """Return how many discs stand for the wall's faces (x, y, half a side) within `reach` [m], and fill them in.

    The disc of a square is the one within it that touches all four sides. `discs` has the shape (SECTORS, 6).
    """
    nearest, sides = np.full((SECTORS, 2), 1e9), np.zeros(SECTORS)
    for i in range(len(faces)):
        x, y = faces[i, 0] - robot[0], faces[i, 1] - robot[1]
        if x * x + y * y < reach * reach:
            _keep(nearest, sides, x, y, faces[i, 2])
    return _discs(robot, nearest, sides, reach, discs)


@heap_kernel
def from_beams(
    robot: Floats, ranges: Floats, first: float, step: float, obstacles: Floats, reach: float, discs: Floats
) -> int:
    """Return how many discs of no size stand for what beams met within `reach` [m] but no known obstacle; see Scan."""
    nearest, sides = np.full((SECTORS, 2), 1e9), np.zeros(SECTORS)
    for i in range(len(ranges)):
        far = ranges[i]
        if not 0.0 < far < reach:
            continue
        s, c = sin_cos(robot[2] + first + i * step)
        x, y = far * c, far * s
        is_known = False
        for k in range(len(obstacles)):
            dx, dy = robot[0] + x - obstacles[k, 0], robot[1] + y - obstacles[k, 1]
            edge = obstacles[k, 5] + _KNOWN
            if dx * dx + dy * dy < edge * edge:
                is_known = True
                break
        if not is_known:
            _keep(nearest, sides, x, y, 0.0)
    return _discs(robot, nearest, sides, reach, discs)


@kernel
def least_room(robot: Floats, v: float, w: float, time: float, distances: Floats, frame: Floats) -> float:
    """Return how much nearer than now a robot at (v, w) comes to walls in `time` [s]: the room where it is least [m].

    Infinite if it comes no nearer. For `distances` and `frame` see `distance.look`.
    """
    here = look(distances, frame, robot[0], robot[1])[0]
    least = np.inf
    n = int(np.ceil(time / _STEP))
    for k in range(1, n + 1):
        x, y = travel(robot[0], robot[1], robot[2], v, w, time * k / n)
        room = look(distances, frame, x, y)[0]
        if room < here:
            least = min(least, room)
    return float(least)


class Surroundings:
    """The walls that a planner knows: the map's if there is one, else what a scan shows.

    >>> Surroundings().walls is NO_WALLS
    True
    """

    def __init__(self) -> None:
        self.walls = NO_WALLS
        self._discs = np.zeros((SECTORS, 6))
        self._rows = np.zeros((0, 6))

    def look(self, observation: Observation) -> None:
        """Read the map, if there is one that was not read before."""
        if observation.map is not None:
            self.walls = walls_of(observation.map, self.walls)
        elif self.walls is not NO_WALLS:
            self.walls = NO_WALLS

    def discs(self, observation: Observation, reach: float) -> Floats:
        """Return walls within `reach` [m] as rows of `Observation.obstacles` that stand, shape (n, 6), n <= SECTORS.

        The array is used again by the next call.
        """
        robot, scan = observation.robot, observation.scan
        n = 0
        if len(self.walls.faces):
            n = from_faces(robot, self.walls.faces, reach, self._discs)
        elif observation.map is None and scan is not None:
            ranges = _ranges(scan)
            n = from_beams(robot, ranges, scan.first, scan.step, observation.obstacles, reach, self._discs)
        return self._discs[:n]

    def with_walls(self, observation: Observation, reach: float) -> Floats:
        """Return the obstacles, followed by walls within `reach` [m]: the observed array itself if there are none."""
        discs = self.discs(observation, reach)
        n, m = len(observation.obstacles), len(discs)
        if m == 0:
            return observation.obstacles
        if len(self._rows) < n + m:
            self._rows = np.zeros((n + m, 6))
        self._rows[:n] = observation.obstacles
        self._rows[n : n + m] = discs
        return self._rows[: n + m]

    def with_scan(self, observation: Observation, reach: float) -> Floats:
        """Return the obstacles, followed by walls within `reach` [m] that a scan shows, if there is no map."""
        return observation.obstacles if self.walls.distances.size else self.with_walls(observation, reach)

    def must_halt(self, observation: Observation, v: float, w: float, time: float, margin: float) -> bool:
        """Return whether a robot at (v, w) [m/s, rad/s] would run into an obstacle or wall within `time` [s].

        It may come within `margin` [m] of no obstacle, but touch walls of a map all but.
        """
        robot, radius = observation.robot, observation.task.robot_radius
        if time <= 0.0:
            return False
        walls = self.walls
        if walls.distances.size and least_room(robot, v, w, time, walls.distances, walls.frame) < radius:
            return True
        near = self.with_scan(observation, radius + margin + abs(v) * time)
        return runs_into(robot, v, w, near, radius + margin, time, _STEP)[1] >= 0


def _ranges(scan: Scan) -> NDArray[np.float64]:
    return np.ascontiguousarray(scan.ranges, np.float64)

"""What a learnt policy sees and says: an observation as a vector of bounded numbers, and a pair of them as speeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import sin_cos
from parcours_navigation.protocol import HEADING, RADIUS, SPEED, YAW_RATE, Command, Limits, Observation, X, Y

BOUND = 10.0
"""No number in a vector is above it."""

OF_ROBOT, OF_OBSTACLE = 6, 6
"""Numbers that speak of the robot, and of each obstacle."""

Vector = NDArray[np.float32]


def size(n_obstacles: int) -> int:
    """Return the length of a vector that shows this many obstacles."""
    return OF_ROBOT + OF_OBSTACLE * n_obstacles


def features(observation: Observation, n_obstacles: int) -> Vector:
    """Return an observation in the robot's own frame, shape (size(n_obstacles) + n_beams,), all within BOUND.

    First the goal ahead and to the left and its distance [m], speed and yaw rate as shares of their limits, and the
    time [10 s]; then for each obstacle, nearest edge first: 1 (0 where there is none), its place ahead and to the left
    [m], its velocity ahead and to the left [m/s], the gap to it [m]. Where there is a scan, its ranges follow, as
    shares of its reach.
    """
    robot, task = observation.robot, observation.task
    s, c = sin_cos(float(robot[HEADING]))
    x, y = float(robot[X]), float(robot[Y])

    def own(dx: float, dy: float) -> tuple[float, float]:
        return c * dx + s * dy, c * dy - s * dx

    out = np.zeros(size(n_obstacles))
    out[:2] = own(task.goal[0] - x, task.goal[1] - y)
    out[2] = np.sqrt(out[0] * out[0] + out[1] * out[1])
    out[3], out[4] = float(robot[SPEED]) / task.limits.speed, float(robot[YAW_RATE]) / task.limits.yaw_rate
    out[5] = 0.1 * observation.time
    rows = observation.obstacles
    dx, dy = rows[:, X] - x, rows[:, Y] - y
    gaps = np.sqrt(dx * dx + dy * dy) - rows[:, RADIUS] - task.robot_radius
    for k, i in enumerate(np.argsort(gaps, kind="stable")[:n_obstacles].tolist()):
        row = rows[i]
        row_s, row_c = sin_cos(float(row[HEADING]))
        first = OF_ROBOT + OF_OBSTACLE * k
        out[first] = 1.0
        out[first + 1 : first + 3] = own(float(row[X]) - x, float(row[Y]) - y)
        out[first + 3 : first + 5] = own(float(row[SPEED]) * row_c, float(row[SPEED]) * row_s)
        out[first + 5] = gaps[i]
    if observation.scan is not None:
        scan = observation.scan
        out = np.concatenate([out, np.minimum(scan.ranges, scan.reach) / scan.reach])
    return np.clip(np.nan_to_num(out, nan=0.0, posinf=BOUND, neginf=-BOUND), -BOUND, BOUND).astype(np.float32)


def speeds(action: object, limits: Limits) -> Command:
    """Return the speeds that an action means: shares in -1 .. 1 of top speed and yaw rate, cut to that.

    >>> speeds([0.5, -3.0], Limits(0.25, 1.5, 1.0, 2.0))
    Command(v=0.125, w=-1.5)
    """
    pair = np.asarray(action, np.float64).reshape(2)
    v, w = np.clip(pair, -1.0, 1.0).tolist()
    return Command(v * limits.speed, w * limits.yaw_rate)

"""The speeds that bring a robot onto a trajectory of poses in time.

The feedback law is that of Kanayama, Kimura, Miyazaki and Noguchi, "A stable tracking control method for an autonomous
mobile robot" (ICRA 1990, eq. 7), with the gains of its section 6, on poses interpolated linearly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import sin_cos, wrap
from parcours.kernels import kernel

ALONG, ACROSS, TURN = 10.0, 64.0, 16.0
"""Gains: on the way ahead [1/s], on the way aside [1/m2], on the heading [1/m]."""

TURN_AT_REST = 4.0
"""Gain on the heading where the trajectory stands or turns on the spot [1/s]."""

AT_REST = 0.01
"""A trajectory slower than this counts as standing [m/s]."""

Floats = NDArray[np.float64]


FARTHEST = 1e6
"""No time, place or heading of a trajectory is above it [s, m, rad]: farther, speeds are no finite numbers any more."""

SHORTEST_STEP = 1e-6
"""Times of a trajectory are at least so far apart [s]."""


@kernel
def is_trajectory(points: Floats) -> bool:
    """Return whether no number of the rows (time, x, y, heading) is above FARTHEST and times increase; shape (n, 4)."""
    for i in range(len(points)):
        for k in range(4):
            if not abs(points[i, k]) <= FARTHEST:
                return False
        if i > 0 and points[i, 0] < points[i - 1, 0] + SHORTEST_STEP:
            return False
    return len(points) > 0


@kernel
def reference(points: Floats, time: float) -> tuple[float, float, float, float, float]:
    """Return where a trajectory is at a time [s]: x, y, heading, speed, yaw rate [m, m, rad, m/s, rad/s].

    Its points are those of `protocol.Trajectory`; before the first time it stands on the first pose, after the last on
    the last.

    >>> x, y, heading, v, w = reference(np.array([[0.0, 1.0, 0.0, 0.0], [2.0, 2.0, 0.0, 1.0]]), 1.0)
    >>> x, y, heading, w
    (1.5, 0.0, 0.5, 0.5)
    """
    n = len(points)
    if time < points[0, 0] or n == 1:
        return points[0, 1], points[0, 2], points[0, 3], 0.0, 0.0
    if time >= points[n - 1, 0]:
        return points[n - 1, 1], points[n - 1, 2], points[n - 1, 3], 0.0, 0.0
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if points[middle, 0] <= time:
            low = middle
        else:
            high = middle
    lasts = points[high, 0] - points[low, 0]
    share = (time - points[low, 0]) / lasts
    dx, dy = points[high, 1] - points[low, 1], points[high, 2] - points[low, 2]
    turn = wrap(points[high, 3] - points[low, 3])
    heading = points[low, 3] + share * turn
    s, c = sin_cos(wrap(heading))
    speed = np.sqrt(dx * dx + dy * dy) / lasts
    if dx * c + dy * s < 0.0:
        speed = -speed
    return points[low, 1] + share * dx, points[low, 2] + share * dy, heading, speed, turn / lasts


@kernel
def speeds(points: Floats, time: float, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return the forward speed [m/s] and yaw rate [rad/s] to command a robot at a pose [m, m, rad] at a time [s].

    >>> v, w = speeds(np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 0.2, 0.0, 0.0]]), 0.5, 0.1, 0.0, 0.0)
    >>> round(v, 9), w
    (0.2, 0.0)
    """
    at_x, at_y, at_heading, v, w = reference(points, time)
    s, c = sin_cos(heading)
    dx, dy = at_x - x, at_y - y
    ahead, aside = c * dx + s * dy, c * dy - s * dx
    error = wrap(at_heading - heading)
    error_s, error_c = sin_cos(error)
    if abs(v) < AT_REST:
        near = dx * dx + dy * dy < 1e-4
        return 0.0 if near else ALONG * ahead * 0.2, w + TURN_AT_REST * error
    return v * error_c + ALONG * ahead, w + v * ACROSS * aside + abs(v) * TURN * error_s

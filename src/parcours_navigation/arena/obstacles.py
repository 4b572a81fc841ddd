"""Obstacles of unforeseen motion: a disc stands, moves at constant (v, w) for a while, and stands again (Fig. 4).

The motion is a closed form of time, so where an obstacle is never depends on how often anybody looked.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import Record, kernel

OBSTACLE = np.dtype(
    [
        ("x0", "f8"),  # where it stands at first [m]
        ("y0", "f8"),  # [m]
        ("heading0", "f8"),  # [rad]
        ("speed", "f8"),  # linear speed while it moves [m/s]
        ("turn", "f8"),  # yaw rate while it moves [rad/s]
        ("start", "i8"),  # when it begins to move [ns]
        ("stop", "i8"),  # when it stands again [ns]
        ("announced", "i8"),  # so long before it begins to move it is already reported to [ns]
        ("radius", "f8"),  # [m]
        ("x", "f8"),  # where it is now [m]
        ("y", "f8"),  # [m]
        ("heading", "f8"),  # [rad]
        ("v", "f8"),  # how it moves now [m/s]
        ("w", "f8"),  # [rad/s]
        ("now", "i8"),  # the time to which the world has brought it [ns]
        ("touching", "i8"),  # 1 while it is in contact with the robot
        ("apart", "i8"),  # up to this time it cannot come nearer than any obstacle has come before [ns]
    ]
)
"""What one obstacle will do, where it is, and how near it came."""

_STRAIGHT = 1e-9


@kernel
def place_at(obstacle: Record, now: int) -> tuple[float, float]:
    """Return where the obstacle's centre is at `now` [ns], as (x, y) [m]."""
    elapsed = max(min(now, obstacle.stop) - obstacle.start, 0) * 1e-9
    if elapsed == 0.0:
        return obstacle.x0, obstacle.y0
    s0, c0 = sin_cos(obstacle.heading0)
    if abs(obstacle.turn) < _STRAIGHT:
        way = obstacle.speed * elapsed
        return obstacle.x0 + way * c0, obstacle.y0 + way * s0
    s1, c1 = sin_cos(obstacle.heading0 + obstacle.turn * elapsed)
    arc_radius = obstacle.speed / obstacle.turn
    return obstacle.x0 + arc_radius * (s1 - s0), obstacle.y0 - arc_radius * (c1 - c0)


@kernel
def motion_at(obstacle: Record, now: int) -> tuple[float, float, float]:
    """Return how the obstacle moves at `now` [ns], as (heading [rad], speed [m/s], yaw rate [rad/s])."""
    elapsed = max(min(now, obstacle.stop) - obstacle.start, 0) * 1e-9
    heading = obstacle.heading0 + obstacle.turn * elapsed
    if obstacle.start <= now < obstacle.stop:
        return heading, obstacle.speed, obstacle.turn
    return heading, 0.0, 0.0


@kernel
def reported_at(obstacle: Record, now: int) -> tuple[float, float]:
    """Return how the obstacle is reported to move at `now` [ns], as (speed [m/s], yaw rate [rad/s])."""
    if obstacle.start - obstacle.announced <= now < obstacle.stop:
        return obstacle.speed, obstacle.turn
    return 0.0, 0.0


@kernel
def move(obstacle: Record, now: int) -> None:
    """Put the obstacle where it is at `now` [ns]."""
    obstacle.heading, obstacle.v, obstacle.w = motion_at(obstacle, now)
    obstacle.x, obstacle.y = place_at(obstacle, now)

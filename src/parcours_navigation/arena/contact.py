"""Two discs that move for one tick: their least distance, the moment of contact, and who caused it.

Between two ticks both centres are taken to move on straight lines, so contact cannot slip between samples. At 0.01 s
the true arcs stray from their chords by at most v*w*dt^2/8 = 1e-5 m; in the one tick in which an obstacle sets out or
stops, its clearance is blurred by at most v*dt/4 = 1.25 mm.

    p0 ●──────share──────○─────────────● p1     the obstacle's place relative to the robot, at two ticks; contact is
                       .   .   reach            where the chord first enters the disc of both radii (`contact_share`),
                     .   ●   .                  clearance what the foot of the perpendicular leaves (`least_distance`):
                       . o .                    neither p0 nor p1 need touch
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import kernel

ROBOT_CLOSED, OBSTACLE_CLOSED, BOTH_CLOSED = 1, 2, 3
"""Who caused a contact."""

AT_REST = 0.01
"""Below this speed [m/s] the robot counts as standing."""


@kernel
def gap_square(x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the square of the least distance [m2] from the origin to the segment from (x0, y0) to (x1, y1) [m].

    With the points as relative positions at two instants, no contact between the instants is missed.

    >>> gap_square(-1.0, 0.5, 1.0, 0.5)
    0.25
    """
    dx, dy = x1 - x0, y1 - y0
    square = dx * dx + dy * dy
    share = 0.0
    if square > 0.0:
        share = min(max(-(x0 * dx + y0 * dy) / square, 0.0), 1.0)
    x, y = x0 + share * dx, y0 + share * dy
    return float(x * x + y * y)


@kernel
def least_distance(x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the least distance [m] between two bodies whose relative position moves from (x0, y0) to (x1, y1) [m].

    >>> least_distance(-1.0, 0.5, 1.0, 0.5)
    0.5
    """
    return float(np.sqrt(gap_square(x0, y0, x1, y1)))


@kernel
def contact_share(x0: float, y0: float, x1: float, y1: float, reach: float) -> float:
    """Return the share of the step, in [0, 1], at which two bodies first come within `reach` [m]; 2 if they do not.

    >>> contact_share(2.0, 0.0, 0.0, 0.0, 0.5)
    0.75
    """
    # |p0 + share * (p1 - p0)| = reach, a quadratic a s^2 + 2 b s + c = 0; the smaller root is where the gap closes.
    c = x0 * x0 + y0 * y0 - reach * reach
    if c <= 0.0:
        return 0.0
    dx, dy = x1 - x0, y1 - y0
    a = dx * dx + dy * dy
    b = x0 * dx + y0 * dy
    discriminant = b * b - a * c
    if b >= 0.0 or discriminant < 0.0 or a == 0.0:
        return 2.0
    share = float((-b - np.sqrt(discriminant)) / a)
    return share if share <= 1.0 else 2.0


@kernel
def who_closed(
    gap_x: float, gap_y: float, robot_vx: float, robot_vy: float, obstacle_vx: float, obstacle_vy: float
) -> int:
    """Return who caused a contact: whose velocity [m/s] points along the gap (x, y) [m] from robot to obstacle.

    A robot slower than AT_REST causes no contact.

    >>> who_closed(1.0, 0.0, 0.2, 0.0, -0.3, 0.0) == BOTH_CLOSED
    True
    >>> who_closed(1.0, 0.0, -0.2, 0.0, -0.3, 0.0) == OBSTACLE_CLOSED
    True
    """
    robot_moves = robot_vx * robot_vx + robot_vy * robot_vy >= AT_REST * AT_REST
    by_robot = robot_moves and robot_vx * gap_x + robot_vy * gap_y > 0.0
    by_obstacle = obstacle_vx * gap_x + obstacle_vy * gap_y < 0.0
    if by_robot and by_obstacle:
        return BOTH_CLOSED
    if by_robot:
        return ROBOT_CLOSED
    return OBSTACLE_CLOSED

"""The walls that others keep off: the nearest one, and those within reach. The only file here that reads the ground.

`walls` is the ground packed into one array (`ground.packing`), of length 0 where there is none; or plain segments
(ax, ay, bx, by) [m], shape (n, 4), each of which is looked at: for a few walls, and as a twin.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import kernel
from parcours_navigation.ground import nearest_shapes
from parcours_navigation.ground.nearest_shapes import nearest_point
from parcours_navigation.protocol import Floats

FOUND = 6
"""Columns of what `walls_within` fills in: ax, ay, bx, by, thickness (a radius), distance [m]."""


@kernel
def foot(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> tuple[float, float]:
    """Return the point of the segment from (ax, ay) to (bx, by) that is nearest to (x, y) [m].

    >>> foot(0.0, 0.0, 2.0, 0.0, 0.5, 3.0)
    (0.5, 0.0)
    """
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    share = 0.0
    if square > 0.0:
        share = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0)
    return ax + share * dx, ay + share * dy


@kernel
def nearest(walls: Floats, x: float, y: float) -> tuple[float, float, float]:
    """Return (distance, wx, wy) of the nearest point of any wall [m]; an infinite distance without walls.

    >>> nearest(np.array([[0.0, 1.0, 2.0, 1.0], [3.0, -1.0, 3.0, 1.0]]), 1.0, 0.0)
    (1.0, 1.0, 1.0)
    """
    if walls.ndim == 1:
        return nearest_point(walls, x, y)
    segments = walls.reshape(-1, 4)
    best, best_x, best_y = np.inf, x, y
    distance = np.inf
    for i in range(len(segments)):
        ax, ay, bx, by = segments[i, 0], segments[i, 1], segments[i, 2], segments[i, 3]
        if min(ax, bx) > x + distance or max(ax, bx) < x - distance:
            continue
        if min(ay, by) > y + distance or max(ay, by) < y - distance:
            continue
        wx, wy = foot(ax, ay, bx, by, x, y)
        square = (x - wx) * (x - wx) + (y - wy) * (y - wy)
        if square < best:
            best, best_x, best_y = square, wx, wy
            distance = np.sqrt(best)
    return float(np.sqrt(best)), best_x, best_y


@kernel
def walls_within(walls: Floats, x: float, y: float, reach: float, into: Floats) -> int:
    """Return how many walls are nearer to (x, y) than `reach` [m], and fill them in, nearest first.

    `into` has rows of FOUND numbers; where there are more walls than rows, the farthest are left out. Walls that are
    equally near keep their order.
    """
    if walls.ndim == 1:
        return nearest_shapes.walls_within(walls, x, y, reach, into)
    segments = walls.reshape(-1, 4)
    n = 0
    for i in range(len(segments)):
        ax, ay, bx, by = segments[i, 0], segments[i, 1], segments[i, 2], segments[i, 3]
        if min(ax, bx) > x + reach or max(ax, bx) < x - reach or min(ay, by) > y + reach or max(ay, by) < y - reach:
            continue
        wx, wy = foot(ax, ay, bx, by, x, y)
        distance = float(np.sqrt((x - wx) * (x - wx) + (y - wy) * (y - wy)))
        if distance >= reach:
            continue
        if n == len(into):
            if distance >= into[n - 1, 5]:
                continue
            n -= 1
        k = n
        while k > 0 and into[k - 1, 5] > distance:
            for column in range(into.shape[1]):
                into[k, column] = into[k - 1, column]
            k -= 1
        into[k, 0], into[k, 1], into[k, 2], into[k, 3] = ax, ay, bx, by
        into[k, 4], into[k, 5] = 0.0, distance
        n += 1
    return n

"""Which shapes of the ground are near a place, and where: for those who keep off walls.

┏━━━━━━━━━━     foot ● is the point of a shape that is nearest to the place ×; of a disc it lies on the rim,
┃    ●          on the line from its middle. Buckets are visited in rings (see `clearance`) for the one nearest
┃  reach  )     shape, and by rows of a square for all within reach.
┃●   ×   )
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.ground.clearance import at_least, first_ring, last_ring, ring_columns, ring_gap, ring_rows
from parcours_navigation.ground.packing import (
    BOTTOM,
    CELL,
    COLUMNS,
    HEAD,
    LEFT,
    ROWS,
    SEGMENTS,
    STRIDE,
    bucket,
    column_of,
    row_of,
)

FOUND = 6
"""Columns of what `walls_within` fills in: ax, ay, bx, by, radius, distance [m]; a disc has both ends in its middle."""


@kernel
def foot(ax: float, ay: float, bx: float, by: float, radius: float, x: float, y: float) -> tuple[float, float, float]:
    """Return the distance of the segment ab, so thick as its radius, from (x, y), and its nearest point (px, py) [m].

    The distance is less than 0 in a disc; from its very middle, the nearest point is the one to the right.

    >>> foot(0.0, 0.0, 2.0, 0.0, 0.0, 0.5, 3.0)
    (3.0, 0.5, 0.0)
    >>> foot(0.0, 0.0, 0.0, 0.0, 1.0, 3.0, 0.0)
    (2.0, 1.0, 0.0)
    """
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    share = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    px, py = ax + share * dx, ay + share * dy
    ux, uy = x - px, y - py
    far = np.sqrt(ux * ux + uy * uy)
    if radius == 0.0:
        return far, px, py
    if far == 0.0:
        return -radius, px + radius, py
    return far - radius, px + radius / far * ux, py + radius / far * uy


@kernel
def nearest_point(packed: Record, x: float, y: float) -> tuple[float, float, float]:
    """Return (distance, px, py): how far the nearest wall, edge or disc is, and its nearest point [m].

    The distance is less than 0 in discs only; without a ground it is inf. Of equally near shapes it is one, always the
    same. Arguments as of `clearance`.
    """
    best, best_x, best_y = np.inf, x, y
    if len(packed) == 0:
        return best, best_x, best_y
    right, top = packed[LEFT] + packed[COLUMNS] * packed[CELL], packed[BOTTOM] + packed[ROWS] * packed[CELL]
    qx, qy = min(max(x, packed[LEFT]), right), min(max(y, packed[BOTTOM]), top)
    column, row = column_of(packed, qx), row_of(packed, qy)
    n_segments, columns = int(packed[SEGMENTS]), int(packed[COLUMNS])
    away = np.sqrt((x - qx) * (x - qx) + (y - qy) * (y - qy))
    for k in range(first_ring(packed, at_least(packed, x, y) - away), last_ring(packed, column, row) + 1):
        if ring_gap(packed, qx, qy, column, row, k) > best:
            break
        low, high = ring_rows(packed, row, k)
        for r in range(low, high):
            c, final, step = ring_columns(packed, column, row, k, r)
            while c <= final:
                begin, end = bucket(packed, r * columns + c)
                c += step
                for j in range(begin, end):
                    i = int(packed[j])
                    at = HEAD + STRIDE * i
                    ax, ay, bx, by, radius = packed[at], packed[at + 1], packed[at + 2], packed[at + 3], 0.0
                    if i >= n_segments:
                        bx, by, radius = ax, ay, bx
                    distance, px, py = foot(ax, ay, bx, by, radius, x, y)
                    if distance < best:
                        best, best_x, best_y = distance, px, py
    return best, best_x, best_y


@kernel
def walls_within(packed: Record, x: float, y: float, reach: float, into: Record) -> int:
    """Return how many walls, edges and discs are nearer than `reach` [m], and fill them in, nearest first.

    Args:
        packed: what `Ground.pack` returns.
        x: [m].
        y: [m].
        reach: [m].
        into: filled, shape (m, FOUND); where there are more than m, the farthest are left out.
    """
    n = 0
    if len(packed) == 0 or len(into) == 0:
        return n
    n_segments, columns = int(packed[SEGMENTS]), int(packed[COLUMNS])
    for row in range(row_of(packed, y - reach), row_of(packed, y + reach) + 1):
        for column in range(column_of(packed, x - reach), column_of(packed, x + reach) + 1):
            begin, end = bucket(packed, row * columns + column)
            for j in range(begin, end):
                i = int(packed[j])
                at = HEAD + STRIDE * i
                ax, ay, bx, by, radius = packed[at], packed[at + 1], packed[at + 2], packed[at + 3], 0.0
                if i >= n_segments:
                    bx, by, radius = ax, ay, bx
                distance, _, _ = foot(ax, ay, bx, by, radius, x, y)
                if distance < reach:
                    n = _insert(into, n, ax, ay, bx, by, radius, distance)
    return n


@kernel
def _insert(into: Record, n: int, ax: float, ay: float, bx: float, by: float, radius: float, distance: float) -> int:
    """Put a shape in its place among the n that are there, unless it is one of them; return how many there are then."""
    k = n
    while k > 0 and into[k - 1, 5] >= distance:
        k -= 1
        if (
            into[k, 5] == distance and into[k, 0] == ax and into[k, 1] == ay and into[k, 2] == bx and into[k, 3] == by
            and into[k, 4] == radius
        ):  # fmt: skip
            return n  # it lies in several buckets
    while k < n and into[k, 5] == distance:  # those that are equally near keep their order
        k += 1
    if k == len(into):
        return n
    n = min(n + 1, len(into))
    for m in range(n - 1, k, -1):
        for column in range(into.shape[1]):
            into[m, column] = into[m - 1, column]
    into[k, 0], into[k, 1], into[k, 2], into[k, 3], into[k, 4], into[k, 5] = ax, ay, bx, by, radius, distance
    return n

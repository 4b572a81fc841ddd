"""How near a point or a moving disc comes to the ground, when it first touches it, and what it can see.

Exact but for rounding. A search looks at the buckets in rings round the place asked for and ends when no shape in the
next ring can be nearer than the nearest so far:

    3 3 3 3 3 3 3      The block of rings 0 .. k - 1 reaches at least `gap` beyond the place on all sides, so a
    3 2 2 2 2 2 3      shape that is in none of its buckets is at least that far away. The field says how many
    3 2 1 1 1 2 3      of the inner rings must be empty.
    3 2 1 ● 1 2 3
    3 2 1 1 1 2 3      In a solid body clearance is negative: minus the distance to the nearest edge of a solid.
    3 2 2 2 2 2 3      So it is continuous, and changes by no more than the place does (`at_least` lives on that).
    3 3 3 3 3 3 3
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.ground.packing import (
    BOTTOM,
    CELL,
    COLUMNS,
    DEPTH,
    FIELD,
    HEAD,
    LEFT,
    OUTSIDE,
    ROWS,
    SEGMENTS,
    SHAPES,
    SLACK,
    SOLID,
    STRIDE,
    UNEVEN,
    bucket,
    column_of,
    row_of,
)
from parcours_navigation.ground.shapes import (
    MISSES,
    enters_capsule,
    enters_disc,
    point_to_segment,
    segment_to_segment,
)

PIECE = 4.0
"""A longer way is looked at in pieces of this many cells."""


@kernel
def depth_at(packed: Record, x: float, y: float) -> float:
    """Return how many solid bodies cover the point [m]: 0 in the open; what lies out of bounds counts as one.

    Edges that a ray to the right crosses are counted up to the first cell that no edge passes through.
    """
    left, bottom, cell = packed[LEFT], packed[BOTTOM], packed[CELL]
    columns, rows, n_solid = int(packed[COLUMNS]), int(packed[ROWS]), int(packed[SOLID])
    if not (left <= x < left + columns * cell and bottom <= y < bottom + rows * cell):
        return float(packed[OUTSIDE])
    row, depth, covered = row_of(packed, y), int(packed[DEPTH]), 0.0
    for column in range(column_of(packed, x), columns):
        c = row * columns + column
        if packed[depth + c] != UNEVEN:
            return float(covered + packed[depth + c])
        begin, end = bucket(packed, c)
        for k in range(begin, end):
            i = int(packed[k])
            if i >= n_solid:
                continue
            at = HEAD + STRIDE * i
            y0, y1 = packed[at + 1], packed[at + 3]
            if (y0 <= y) != (y1 <= y):
                hit = packed[at] + (y - y0) / (y1 - y0) * (packed[at + 2] - packed[at])
                if hit > x and column_of(packed, hit) == column:  # it may lie in other buckets of the row, too
                    covered += 1.0 if y1 > y0 else -1.0
    return float(covered + packed[OUTSIDE])


@kernel
def ring_gap(packed: Record, x: float, y: float, column: int, row: int, k: int) -> float:
    """Return a distance [m] from a point in the cell (column, row) that no shape first met in ring k undercuts."""
    if k == 0:
        return 0.0
    fx = x - (packed[LEFT] + column * packed[CELL])
    fy = y - (packed[BOTTOM] + row * packed[CELL])
    side = packed[CELL]
    beyond = min(min(fx, side - fx), min(fy, side - fy))
    return float((k - 1) * side + min(max(beyond, 0.0), side) - packed[SLACK])


@kernel
def ring_rows(packed: Record, row: int, k: int) -> tuple[int, int]:
    """Return the first row of the grid that ring k round a row has cells in, and the one after the last."""
    return max(row - k, 0), min(row + k + 1, int(packed[ROWS]))


@kernel
def ring_columns(packed: Record, column: int, row: int, k: int, at: int) -> tuple[int, int, int]:
    """Return the first and last column of ring k round a cell in the row `at`, and the step between columns.

    The last is before the first if the row has none of the grid.
    """
    left, right, end = column - k, column + k, int(packed[COLUMNS]) - 1
    if at == row - k or at == row + k:
        return max(left, 0), min(right, end), 1
    return left if left >= 0 else right, right if right <= end else left, 2 * k


@kernel
def first_ring(packed: Record, lower: float) -> int:
    """Return a ring before which all are empty, where nothing is nearer than `lower` [m]."""
    return int(max(lower, 0.0) * 0.7071067811865475 / packed[CELL] * (1.0 - 1e-12))


@kernel
def last_ring(packed: Record, column: int, row: int) -> int:
    """Return the last ring round a cell that has a cell of the grid."""
    columns, rows = int(packed[COLUMNS]), int(packed[ROWS])
    return max(max(column, columns - 1 - column), max(row, rows - 1 - row))


@kernel
def _nearest(
    packed: Record, x0: float, y0: float, x1: float, y1: float, mx: float, my: float, half: float, lower: float,
    bound: float, first: int, last: int,
) -> float:  # fmt: skip
    """Return the least distance [m] from the way to the shapes `first` .. `last` - 1, `bound` if none is nearer.

    To a disc it is negative inside. Shapes are looked for near the part of the way within `half` of (mx, my); the
    distance counts to all of the way. Nothing is nearer to (mx, my) than `lower`.
    """
    right, top = packed[LEFT] + packed[COLUMNS] * packed[CELL], packed[BOTTOM] + packed[ROWS] * packed[CELL]
    qx, qy = min(max(mx, packed[LEFT]), right), min(max(my, packed[BOTTOM]), top)
    away = np.sqrt((mx - qx) * (mx - qx) + (my - qy) * (my - qy))
    column, row = column_of(packed, qx), row_of(packed, qy)
    n_segments, columns, stands, best = int(packed[SEGMENTS]), int(packed[COLUMNS]), x0 == x1 and y0 == y1, bound
    for k in range(first_ring(packed, lower - away), last_ring(packed, column, row) + 1):
        gap = ring_gap(packed, qx, qy, column, row, k)
        if k > 0 and max(gap, away) - half > best:  # a disc of ring 0 may cover the place: it is nearer than the gap
            break
        low, high = ring_rows(packed, row, k)
        for r in range(low, high):
            c, final, step = ring_columns(packed, column, row, k, r)
            while c <= final:
                begin, end = bucket(packed, r * columns + c)
                c += step
                for j in range(begin, end):
                    i = int(packed[j])
                    if i < first or i >= last:
                        continue
                    at = HEAD + STRIDE * i
                    ax, ay, bx, by = packed[at], packed[at + 1], packed[at + 2], packed[at + 3]
                    if i >= n_segments:
                        best = min(best, np.sqrt(point_to_segment(ax, ay, x0, y0, x1, y1)) - bx)
                    elif best > 0.0:
                        if stands:
                            square = point_to_segment(x0, y0, ax, ay, bx, by)
                        else:
                            square = segment_to_segment(x0, y0, x1, y1, ax, ay, bx, by)
                        if square < best * best:
                            best = np.sqrt(square)
    return float(best)


@kernel
def _clearance(packed: Record, x: float, y: float, lower: float) -> float:
    """Return `clearance`, nothing being nearer to the point than `lower` [m]."""
    n_solid, n_segments, n = int(packed[SOLID]), int(packed[SEGMENTS]), int(packed[SHAPES])
    if depth_at(packed, x, y) > 0.0:
        inside = -_nearest(packed, x, y, x, y, x, y, 0.0, 0.0, np.inf, 0, n_solid)
        return min(inside, _nearest(packed, x, y, x, y, x, y, 0.0, 0.0, 0.0, n_segments, n))
    return _nearest(packed, x, y, x, y, x, y, 0.0, lower, np.inf, 0, n)


@kernel
def clearance(packed: Record, x: float, y: float) -> float:
    """Return the distance [m] from a point to the nearest wall, solid body or disc; inf on an empty ground.

    In a solid body it is minus the distance to the nearest edge of any; in a disc, minus the way out.

    Args:
        packed: what `Ground.pack` returns.
        x: [m].
        y: [m].
    """
    if len(packed) == 0:
        return np.inf
    return _clearance(packed, x, y, at_least(packed, x, y))


@kernel
def at_least(packed: Record, x: float, y: float) -> float:
    """Return a lower bound of `clearance` [m], fast: it reads one cell of the field.

    It is within a cell's diagonal of the clearance on the grid; arguments as of `clearance`.
    """
    if len(packed) == 0:
        return np.inf
    cell = packed[CELL]
    right, top = packed[LEFT] + packed[COLUMNS] * cell, packed[BOTTOM] + packed[ROWS] * cell
    qx, qy = min(max(x, packed[LEFT]), right), min(max(y, packed[BOTTOM]), top)
    if packed[OUTSIDE] == 0.0 and (qx != x or qy != y):
        return float(np.sqrt((x - qx) * (x - qx) + (y - qy) * (y - qy)))  # all shapes lie on the grid
    column, row = column_of(packed, qx), row_of(packed, qy)
    dx, dy = x - (packed[LEFT] + (column + 0.5) * cell), y - (packed[BOTTOM] + (row + 0.5) * cell)
    middle = packed[int(packed[FIELD]) + row * int(packed[COLUMNS]) + column]
    return float(middle - np.sqrt(dx * dx + dy * dy) - packed[SLACK])


@kernel
def fill_field(packed: Record, field: Record) -> None:
    """Write the clearance of the middle of each cell; depths and buckets must be there already."""
    columns, cell = int(packed[COLUMNS]), packed[CELL]
    for row in range(int(packed[ROWS])):
        lower = 0.0
        for column in range(columns):
            x, y = packed[LEFT] + (column + 0.5) * cell, packed[BOTTOM] + (row + 0.5) * cell
            found = _clearance(packed, x, y, lower)
            field[row * columns + column] = found
            lower = found - cell * (1.0 + 1e-9)


@kernel
def least_on_way(packed: Record, x0: float, y0: float, x1: float, y1: float, radius: float, enough: float) -> float:
    """Return the least clearance [m] of a disc that moves on a chord; any value above `enough` where it is more.

    Exact while the disc's middle stays out of solid bodies. Where it enters one: at most -radius, and at most the
    clearance at both ends.

    Args:
        packed: what `Ground.pack` returns.
        x0: where the disc's middle is at first [m].
        y0: [m].
        x1: ... and at last [m].
        y1: [m].
        radius: of the disc [m], 0 or more.
        enough: clearance that is not looked at more closely [m]; inf if all is.
    """
    if len(packed) == 0:
        return np.inf
    dx, dy = x1 - x0, y1 - y0
    long = np.sqrt(dx * dx + dy * dy)
    n = int(long / (PIECE * packed[CELL])) + 1
    half = 0.5 * long / n
    best = bound = enough + radius + packed[SLACK]
    for i in range(n):
        share = (i + 0.5) / n
        mx, my = x0 + share * dx, y0 + share * dy
        lower = at_least(packed, mx, my)
        if lower - half <= best:
            best = _nearest(packed, x0, y0, x1, y1, mx, my, half, lower, best, 0, int(packed[SHAPES]))
    if packed[SOLID] > 0.0:
        if at_least(packed, x0, y0) <= 0.0 and depth_at(packed, x0, y0) > 0.0:
            best = min(best, _clearance(packed, x0, y0, 0.0))
        if at_least(packed, x1, y1) <= 0.0 and depth_at(packed, x1, y1) > 0.0:
            best = min(best, _clearance(packed, x1, y1, 0.0))
    return best - radius if best < bound else np.inf


@kernel
def first_touch(packed: Record, x0: float, y0: float, x1: float, y1: float, radius: float) -> float:
    """Return the share of the chord at which a disc first touches the ground; MISSES (2) if it does not.

    0 if it touches from the first. Arguments as of `least_on_way`.
    """
    if len(packed) == 0:
        return MISSES
    if at_least(packed, x0, y0) <= 0.0 and depth_at(packed, x0, y0) > 0.0:
        return 0.0
    dx, dy = x1 - x0, y1 - y0
    long = np.sqrt(dx * dx + dy * dy)
    n = int(long / (PIECE * packed[CELL])) + 1
    half = 0.5 * long / n
    first = MISSES
    columns, n_segments = int(packed[COLUMNS]), int(packed[SEGMENTS])
    for p in range(n):
        share = (p + 0.5) / n
        mx, my = x0 + share * dx, y0 + share * dy
        if at_least(packed, mx, my) - half > radius:
            continue
        wide, high = 0.5 * abs(dx) / n + radius + packed[SLACK], 0.5 * abs(dy) / n + radius + packed[SLACK]
        for row in range(row_of(packed, my - high), row_of(packed, my + high) + 1):
            for column in range(column_of(packed, mx - wide), column_of(packed, mx + wide) + 1):
                begin, end = bucket(packed, row * columns + column)
                for k in range(begin, end):
                    i = int(packed[k])
                    at = HEAD + STRIDE * i
                    ax, ay, bx, by = packed[at], packed[at + 1], packed[at + 2], packed[at + 3]
                    if i < n_segments:
                        first = min(first, enters_capsule(x0, y0, x1, y1, ax, ay, bx, by, radius))
                    else:
                        first = min(first, enters_disc(x0 - ax, y0 - ay, x1 - ax, y1 - ay, radius + bx))
        if first <= (p + 1.0) / n:
            break
    return first


@kernel
def sees(packed: Record, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Return whether nothing of the ground meets the line between two points [m]; arguments as of `least_on_way`."""
    return first_touch(packed, x0, y0, x1, y1, 0.0) > 1.0

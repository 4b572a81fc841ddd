"""A convex polygon that moves and turns: how near it comes to the ground or to a disc, and when they first touch.

    world                              body
       ╱╲      ╱╲                        ┌────────┐     A corner of the polygon follows a curve in the world, an end of
      ╱  ╲ ─► ╱  ╲     ┃ wall            │   ·►   │     a wall one in the polygon's frame. Both are replaced by their
      ╲  ╱    ╲  ╱     ┃                 └────────┘     chords over n equal pieces of the way, from which they stray by
       ╲╱      ╲╱                            ● ┄┄► ●    at most (turn^2 D + 2 turn way) / (8 n^2)

with D the distance of what moves from the centre of rotation, as the curve's acceleration is at most turn^2 D +
2 turn way per unit of share. The number of pieces keeps this below TOLERANCE; a way without a turn is one piece, and
exact. Between chords distances are exact: no contact deeper than TOLERANCE is missed, none is reported beyond it.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos, wrap
from parcours.kernels import Record, heap_kernel, kernel
from parcours_navigation.ground.clearance import (
    at_least,
    clearance,
    depth_at,
    last_ring,
    ring_columns,
    ring_gap,
    ring_rows,
)
from parcours_navigation.ground.packing import COLUMNS, HEAD, SEGMENTS, SLACK, SOLID, STRIDE, bucket, column_of, row_of
from parcours_navigation.ground.shapes import (
    MISSES,
    cross,
    point_to_polygon,
    point_to_segment,
    segment_to_segment,
    way_to_polygon,
)

TOLERANCE = 1e-5
"""How far results may be off [m] where the polygon turns."""

MOST_PIECES = 4096
"""Pieces of one way at most: enough for a turn of pi and D of 100 m at 0.4 mm, and for any tick."""

_HALVINGS = 40
"""Halvings of a way on which the first touch is looked for."""


@kernel
def reach_of(corners: Record) -> float:
    """Return the distance [m] of the farthest corner from the polygon's origin; corners [m], shape (n, 2)."""
    square = 0.0
    for i in range(len(corners)):
        square = max(square, corners[i, 0] * corners[i, 0] + corners[i, 1] * corners[i, 1])
    return float(np.sqrt(square))


@kernel
def _pieces(turn: float, way: float, far: float) -> int:
    """Return how many pieces keep curves within TOLERANCE of their chords: turn [rad], way and distance [m]."""
    bulge = abs(turn) * (abs(turn) * far + 2.0 * way) / 8.0
    return int(min(np.ceil(np.sqrt(bulge / TOLERANCE)), MOST_PIECES - 1.0)) + 1 if bulge > 0.0 else 1


@kernel
def _place(corners: Record, x: float, y: float, s: float, c: float, out: Record) -> None:
    """Write where the corners are with the origin in (x, y) [m] at a heading of this sine and cosine."""
    for i in range(len(corners)):
        out[i, 0] = x + c * corners[i, 0] - s * corners[i, 1]
        out[i, 1] = y + s * corners[i, 0] + c * corners[i, 1]


@kernel
def _segment_meets(corners: Record, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the segment ab crosses an edge of the polygon."""
    n = len(corners)
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        if cross(ax, ay, bx, by, corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]):
            return True
    return False


@kernel
def _to_body(x: float, y: float, px: float, py: float, s: float, c: float) -> tuple[float, float]:
    """Return a point in the frame of a body at (px, py) [m] and a heading of this sine and cosine."""
    return c * (x - px) + s * (y - py), c * (y - py) - s * (x - px)


@kernel
def _to_wall(
    corners: Record, before: Record, after: Record, ax: float, ay: float, bx: float, by: float, pose: Record
) -> float:
    """Return the least distance [m] of the polygon on one piece of its way to the segment ab.

    `before` and `after` are its corners at both ends; `pose` holds x, y, sine and cosine there, shape (2, 4).
    """
    if _segment_meets(before, ax, ay, bx, by) or _segment_meets(after, ax, ay, bx, by):
        return 0.0
    square = np.inf
    for i in range(len(corners)):
        square = min(square, segment_to_segment(before[i, 0], before[i, 1], after[i, 0], after[i, 1], ax, ay, bx, by))
    least = np.sqrt(square)
    for end in range(2):
        x, y = (ax, ay) if end == 0 else (bx, by)
        x0, y0 = _to_body(x, y, pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3])
        x1, y1 = _to_body(x, y, pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3])
        least = min(least, max(way_to_polygon(x0, y0, x1, y1, corners), 0.0))
    return float(least)


@kernel
def _beside(
    corners: Record, before: Record, after: Record, pose: Record, ax: float, ay: float, bx: float, by: float, far: float
) -> bool:
    """Return whether the segment ab certainly stays more than `far` [m] from the polygon on this piece of its way.

    It lies beyond a side of the box round the polygon as it is at first, which no corner leaves by more than its chord.
    """
    x0, y0 = _to_body(ax, ay, pose[0], pose[1], pose[2], pose[3])
    x1, y1 = _to_body(bx, by, pose[0], pose[1], pose[2], pose[3])
    left, right, low, high, square = np.inf, -np.inf, np.inf, -np.inf, 0.0
    for i in range(len(corners)):
        left, right = min(left, corners[i, 0]), max(right, corners[i, 0])
        low, high = min(low, corners[i, 1]), max(high, corners[i, 1])
        dx, dy = after[i, 0] - before[i, 0], after[i, 1] - before[i, 1]
        square = max(square, dx * dx + dy * dy)
    far += np.sqrt(square) + TOLERANCE
    return bool(
        max(x0, x1) < left - far or min(x0, x1) > right + far or max(y0, y1) < low - far or min(y0, y1) > high + far
    )


@kernel
def _piece_least(
    packed: Record, corners: Record, before: Record, after: Record, pose: Record, reach: float, bound: float
) -> float:
    """Return the least distance [m] of the polygon on one piece of its way to the ground, `bound` if none is less."""
    dx, dy = pose[1, 0] - pose[0, 0], pose[1, 1] - pose[0, 1]
    spread = 0.5 * np.sqrt(dx * dx + dy * dy) + reach  # the polygon stays within this of the middle
    mx, my = pose[0, 0] + 0.5 * dx, pose[0, 1] + 0.5 * dy
    lower = at_least(packed, mx, my)
    if lower - spread > bound:
        return bound
    column, row, best = column_of(packed, mx), row_of(packed, my), bound
    n_segments, columns = int(packed[SEGMENTS]), int(packed[COLUMNS])
    for k in range(last_ring(packed, column, row) + 1):
        if k > 0 and ring_gap(packed, mx, my, column, row, k) - spread > best:  # a disc of ring 0 may cover the middle
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
                    ax, ay, bx, by = packed[at], packed[at + 1], packed[at + 2], packed[at + 3]
                    if i >= n_segments:
                        near = spread + best + bx
                        if (ax - mx) * (ax - mx) + (ay - my) * (ay - my) <= near * near:
                            x0, y0 = _to_body(ax, ay, pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3])
                            x1, y1 = _to_body(ax, ay, pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3])
                            best = min(best, way_to_polygon(x0, y0, x1, y1, corners) - bx)
                    elif best > 0.0 and not _beside(corners, before, after, pose[0], ax, ay, bx, by, best):
                        best = min(best, _to_wall(corners, before, after, ax, ay, bx, by, pose))
    return best


@heap_kernel
def footprint_least(
    packed: Record, corners: Record, x0: float, y0: float, heading0: float, x1: float, y1: float, heading1: float,
    enough: float,
) -> float:  # fmt: skip
    """Return the least clearance [m] of a convex polygon that moves and turns; any value above `enough` if it is more.

    0 or less where it touches a wall, lies across one, or starts in a solid body; overlap with discs is negative. Its
    origin moves on a straight line while it turns evenly, the shorter way. Within TOLERANCE; exact without a turn.

    Args:
        packed: what `Ground.pack` returns.
        corners: in the polygon's own frame, counter-clockwise [m], shape (n, 2).
        x0: where its origin is at first [m].
        y0: [m].
        heading0: [rad].
        x1: ... and at last [m].
        y1: [m].
        heading1: [rad].
        enough: clearance that is not looked at more closely [m]; inf if all is.
    """
    if len(packed) == 0:
        return np.inf
    turn, dx, dy = wrap(heading1 - heading0), x1 - x0, y1 - y0
    way, reach = np.sqrt(dx * dx + dy * dy), reach_of(corners)
    lower = at_least(packed, x0 + 0.5 * dx, y0 + 0.5 * dy)
    if lower - 0.5 * way - reach > enough:
        return float(lower - 0.5 * way - reach)
    bound = min(enough, max(clearance(packed, x0, y0), 0.0) + reach) + packed[SLACK]
    n = _pieces(turn, way, bound + 2.0 * reach + way)
    before, after, pose = np.empty_like(corners), np.empty_like(corners), np.empty((2, 4))
    s, c = sin_cos(heading0)
    pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3] = x0, y0, s, c
    _place(corners, x0, y0, s, c, after)
    best = bound
    if packed[SOLID] > 0.0 and depth_at(packed, after[0, 0], after[0, 1]) > 0.0:
        best = min(best, 0.0)
    for i in range(1, n + 1):
        share = i / n
        before[:] = after
        pose[0] = pose[1]
        if turn != 0.0:
            s, c = sin_cos(heading0 + share * turn)
        pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3] = x0 + share * dx, y0 + share * dy, s, c
        _place(corners, pose[1, 0], pose[1, 1], s, c, after)
        best = _piece_least(packed, corners, before, after, pose, reach, best)
    return float(best) if best < bound or bound < enough else np.inf


@kernel
def footprint_touch(
    packed: Record, corners: Record, x0: float, y0: float, heading0: float, x1: float, y1: float, heading1: float
) -> float:  # fmt: skip
    """Return the share of the way at which the polygon first touches the ground; MISSES (2) if it does not.

    Within TOLERANCE of the place; arguments as of `footprint_least`.
    """
    if footprint_least(packed, corners, x0, y0, heading0, x1, y1, heading1, 0.0) > 0.0:
        return MISSES
    if footprint_least(packed, corners, x0, y0, heading0, x0, y0, heading0, 0.0) <= 0.0:
        return 0.0
    turn, free, touched = wrap(heading1 - heading0), 0.0, 1.0
    for _ in range(_HALVINGS):  # it has touched by some share of its way if it has by a smaller one
        share = 0.5 * (free + touched)
        x, y, heading = x0 + share * (x1 - x0), y0 + share * (y1 - y0), heading0 + share * turn
        if footprint_least(packed, corners, x0, y0, heading0, x, y, heading, 0.0) > 0.0:
            free = share
        else:
            touched = share
    return touched


@kernel
def footprint_to_disc(
    corners: Record, x: float, y: float, heading: float, disc_x: float, disc_y: float, radius: float
) -> float:
    """Return the clearance [m] between a convex polygon that stands and a disc; negative is overlap.

    Args:
        corners: as of `footprint_least`.
        x: of the polygon's origin [m].
        y: [m].
        heading: [rad].
        disc_x: middle of the disc [m].
        disc_y: [m].
        radius: [m].

    >>> square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    >>> footprint_to_disc(square, 0.0, 0.0, 0.0, 3.0, 0.0, 0.5)
    1.5
    """
    s, c = sin_cos(heading)
    bx, by = _to_body(disc_x, disc_y, x, y, s, c)
    return point_to_polygon(bx, by, corners) - radius


@kernel
def footprint_disc_least(
    corners: Record, x0: float, y0: float, heading0: float, x1: float, y1: float, heading1: float, disc_x0: float,
    disc_y0: float, disc_x1: float, disc_y1: float, radius: float, enough: float,
) -> float:  # fmt: skip
    """Return the least clearance [m] between a moving polygon and a disc that moves on a chord meanwhile.

    Any value above `enough` where it is more; where the disc's middle passes through the polygon, at most -radius.
    Within TOLERANCE; the polygon as of `footprint_least`, the disc from (disc_x0, disc_y0) to (disc_x1, disc_y1) [m].
    """
    turn, reach = wrap(heading1 - heading0), reach_of(corners)
    gx0, gy0, gx1, gy1 = disc_x0 - x0, disc_y0 - y0, disc_x1 - x1, disc_y1 - y1  # the disc, seen from the origin
    lower = np.sqrt(point_to_segment(0.0, 0.0, gx0, gy0, gx1, gy1)) - reach - radius
    if lower > enough:
        return float(lower)
    dx, dy = gx1 - gx0, gy1 - gy0
    far = np.sqrt(max(gx0 * gx0 + gy0 * gy0, gx1 * gx1 + gy1 * gy1))
    n = _pieces(turn, np.sqrt(dx * dx + dy * dy), far)
    s, c = sin_cos(heading0)
    bx1, by1 = c * gx0 + s * gy0, c * gy0 - s * gx0
    least = np.inf
    for i in range(1, n + 1):
        share = i / n
        if turn != 0.0:
            s, c = sin_cos(heading0 + share * turn)
        gx, gy = gx0 + share * dx, gy0 + share * dy
        bx0, by0 = bx1, by1
        bx1, by1 = c * gx + s * gy, c * gy - s * gx
        least = min(least, way_to_polygon(bx0, by0, bx1, by1, corners))
    return float(least - radius)


@kernel
def footprint_disc_touch(
    corners: Record, x0: float, y0: float, heading0: float, x1: float, y1: float, heading1: float, disc_x0: float,
    disc_y0: float, disc_x1: float, disc_y1: float, radius: float,
) -> float:  # fmt: skip
    """Return the share of the way at which a moving polygon and a moving disc first touch; MISSES (2) if they do not.

    Arguments as of `footprint_disc_least`.
    """
    turn, free, touched = wrap(heading1 - heading0), 0.0, 1.0
    if (
        footprint_disc_least(
            corners, x0, y0, heading0, x1, y1, heading1, disc_x0, disc_y0, disc_x1, disc_y1, radius, 0.0
        ) > 0.0
    ):  # fmt: skip
        return MISSES
    if footprint_to_disc(corners, x0, y0, heading0, disc_x0, disc_y0, radius) <= 0.0:
        return 0.0
    for _ in range(_HALVINGS):
        share = 0.5 * (free + touched)
        x, y, heading = x0 + share * (x1 - x0), y0 + share * (y1 - y0), heading0 + share * turn
        ox, oy = disc_x0 + share * (disc_x1 - disc_x0), disc_y0 + share * (disc_y1 - disc_y0)
        if footprint_disc_least(corners, x0, y0, heading0, x, y, heading, disc_x0, disc_y0, ox, oy, radius, 0.0) > 0.0:
            free = share
        else:
            touched = share
    return touched

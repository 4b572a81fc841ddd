"""Distances between single shapes, and the moment at which a moving point enters one: exact but for rounding.

a ●━━━━━━━━━━━━━━━● b        a wall; a disc of radius r touches it while its centre lies in the capsule round it
 (┈┈┈┈┈┈┈┈┈┈┈┈┈┈┈┈┈)         ┈ flat side: the signed distance from the line falls to r between a and b
    p0 ●                     ( ) caps: discs of radius r round a and b
         ╲ share             the least share of all three is the first touch
           ● p1
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel

MISSES = 2.0
"""The share of a way at which something happens that does not happen on it."""

_POINT = 1e-280
"""A segment whose length has a smaller square [m2] is a point: below, numbers lose digits."""


@kernel
def point_to_segment(x: float, y: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the square of the distance [m2] from a point to the segment from (x0, y0) to (x1, y1) [m].

    >>> point_to_segment(0.0, 2.0, -1.0, 0.0, 1.0, 0.0)
    4.0
    """
    dx, dy = x1 - x0, y1 - y0
    px, py = x - x0, y - y0
    along = px * dx + py * dy
    square = dx * dx + dy * dy
    if along >= square or square < _POINT:
        px, py = x - x1, y - y1
    elif along > 0.0:
        across = px * dy - py * dx
        return across * across / square
    return px * px + py * py


@kernel
def cross(ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float) -> bool:
    """Return whether the segments ab and cd [m] cross: each has ends strictly on both sides of the other.

    >>> cross(-1.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0), cross(-1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    (True, False)
    """
    ux, uy = bx - ax, by - ay
    c = ux * (cy - ay) - uy * (cx - ax)
    d = ux * (dy - ay) - uy * (dx - ax)
    if not ((c > 0.0 and d < 0.0) or (c < 0.0 and d > 0.0)):
        return False
    vx, vy = dx - cx, dy - cy
    a = vx * (ay - cy) - vy * (ax - cx)
    b = vx * (by - cy) - vy * (bx - cx)
    return (a > 0.0 and b < 0.0) or (a < 0.0 and b > 0.0)


@kernel
def segment_to_segment(ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float) -> float:
    """Return the square of the distance [m2] between the segments ab and cd [m]; 0 where they meet.

    >>> segment_to_segment(0.0, 0.0, 1.0, 0.0, 3.0, -1.0, 3.0, 1.0)
    4.0
    """
    if cross(ax, ay, bx, by, cx, cy, dx, dy):
        return 0.0
    # Of two segments that do not cross, one end is nearest.
    return min(
        min(point_to_segment(ax, ay, cx, cy, dx, dy), point_to_segment(bx, by, cx, cy, dx, dy)),
        min(point_to_segment(cx, cy, ax, ay, bx, by), point_to_segment(dx, dy, ax, ay, bx, by)),
    )


@kernel
def enters_disc(x0: float, y0: float, x1: float, y1: float, radius: float) -> float:
    """Return the share of the way at which a point comes within `radius` [m] of the origin; MISSES if it does not.

    A point that is there at first enters at 0.

    >>> enters_disc(2.0, 0.0, 0.0, 0.0, 0.5)
    0.75
    """
    c = x0 * x0 + y0 * y0 - radius * radius
    if c <= 0.0:
        return 0.0
    dx, dy = x1 - x0, y1 - y0
    a = dx * dx + dy * dy
    b = x0 * dx + y0 * dy
    discriminant = b * b - a * c
    if b >= 0.0 or discriminant < 0.0 or a == 0.0:
        return MISSES
    share = c / (np.sqrt(discriminant) - b)  # the smaller root, without the difference of near numbers
    return float(share) if share <= 1.0 else MISSES


@kernel
def enters_capsule(
    x0: float, y0: float, x1: float, y1: float, ax: float, ay: float, bx: float, by: float, radius: float
) -> float:
    """Return the share of the way at which a point comes within `radius` [m] of the segment ab; MISSES if it does not.

    >>> enters_capsule(0.0, 2.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.5)
    0.75
    """
    if point_to_segment(x0, y0, ax, ay, bx, by) <= radius * radius:
        return 0.0
    first = min(
        enters_disc(x0 - ax, y0 - ay, x1 - ax, y1 - ay, radius), enters_disc(x0 - bx, y0 - by, x1 - bx, y1 - by, radius)
    )
    ux, uy = bx - ax, by - ay
    square = ux * ux + uy * uy
    long = np.sqrt(square)
    before = (ux * (y0 - ay) - uy * (x0 - ax)) / long if long > 0.0 else 0.0
    after = (ux * (y1 - ay) - uy * (x1 - ax)) / long if long > 0.0 else 0.0
    if before < 0.0:
        before, after = -before, -after
    if before > radius and after <= radius:  # it comes down to the flat side that it is on
        share = (before - radius) / (before - after)
        px, py = x0 + share * (x1 - x0) - ax, y0 + share * (y1 - y0) - ay
        if 0.0 <= px * ux + py * uy <= square:
            first = min(first, share)
    return first


@kernel
def point_to_polygon(x: float, y: float, corners: Record) -> float:
    """Return the distance [m] from a point to a convex polygon; inside, less than 0: how deep.

    Args:
        x: [m].
        y: [m].
        corners: counter-clockwise [m], shape (n, 2).
    """
    n = len(corners)
    nearest, deepest = np.inf, -np.inf
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        ax, ay, bx, by = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
        nearest = min(nearest, point_to_segment(x, y, ax, ay, bx, by))
        deepest = max(deepest, (by - ay) * (x - ax) - (bx - ax) * (y - ay))
    return float(np.sqrt(nearest) if deepest > 0.0 else -np.sqrt(nearest))


@kernel
def way_to_polygon(x0: float, y0: float, x1: float, y1: float, corners: Record) -> float:
    """Return the least distance [m] of a point on its way to a convex polygon; 0 if it enters, less if it ends inside.

    `corners` as of `point_to_polygon`.
    """
    ends = min(point_to_polygon(x0, y0, corners), point_to_polygon(x1, y1, corners))
    if ends <= 0.0:
        return ends
    nearest = np.inf
    n = len(corners)
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        nearest = min(
            nearest, segment_to_segment(x0, y0, x1, y1, corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1])
        )
    return float(np.sqrt(nearest))

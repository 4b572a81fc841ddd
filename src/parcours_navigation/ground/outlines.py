"""Checks what a ground is made of: outlines of solid bodies, walls, discs, bounds; one finding for each fault."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import ParcoursError
from parcours.kernels import Record, kernel
from parcours_navigation.ground.shapes import cross, point_to_segment

Floats = NDArray[np.float64]

FARTHEST = 1e5
"""Largest coordinate or length [m]: beyond it a micrometre would be lost in rounding."""

MOST_CORNERS = 10_000
"""Corners of one outline at most."""


class BadGround(ParcoursError):
    """Walls, bodies, a map or a wish for a generated ground do not make a ground."""


def table(given: ArrayLike, columns: int, where: str) -> Floats:
    """Return what was given as numbers, shape (n, columns), read-only.

    Raises:
        BadGround: it is not a table with this many columns, or a number is not finite or beyond FARTHEST.

    >>> table([[0, 0, 1, 0]], 4, "walls").shape
    (1, 4)
    """
    try:
        numbers = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        rule = f"it must be rows of {columns} numbers, but {str(given)[:60]!r} was given"
        raise BadGround(where, rule, slug="ground-shape") from None
    if numbers.size == 0:
        numbers = numbers.reshape(0, columns)
    if numbers.ndim != 2 or numbers.shape[1] != columns:
        rule = f"it must be rows of {columns} numbers, but has the shape {numbers.shape}"
        raise BadGround(where, rule, slug="ground-shape")
    bad = np.argwhere(~(np.abs(numbers) <= FARTHEST))
    if len(bad):
        row, column = bad[0]
        rule = f"numbers must be finite and within {FARTHEST:g} m, but row {row + 1} has {numbers[row, column]}"
        raise BadGround(where, rule, "give metres", slug="ground-number")
    numbers.flags.writeable = False
    return numbers


@kernel
def first_meeting(corners: Record) -> tuple[int, int]:
    """Return the first two edges of a closed outline that meet where they should not, (-1, -1) if none do.

    Edges meet as they should where one ends and the next begins, and do not fold back there.
    """
    n = len(corners)
    for i in range(n):
        ax, ay = corners[i, 0], corners[i, 1]
        i1 = (i + 1) % n
        bx, by = corners[i1, 0], corners[i1, 1]
        for j in range(i + 1, n):
            j1 = (j + 1) % n
            cx, cy, dx, dy = corners[j, 0], corners[j, 1], corners[j1, 0], corners[j1, 1]
            if cross(ax, ay, bx, by, cx, cy, dx, dy):
                return i, j
            # an end of one on the other; neighbours share one end, and are asked about the other
            if j != i1 and point_to_segment(cx, cy, ax, ay, bx, by) == 0.0:
                return i, j
            if j1 != i and point_to_segment(dx, dy, ax, ay, bx, by) == 0.0:
                return i, j
            if j1 != i and point_to_segment(ax, ay, cx, cy, dx, dy) == 0.0:
                return i, j
            if j != i1 and point_to_segment(bx, by, cx, cy, dx, dy) == 0.0:
                return i, j
    return -1, -1


def area(corners: Floats) -> float:
    """Return the area [m2] within a closed outline, negative if it runs clockwise; corners [m], shape (n, 2).

    >>> area(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]))
    1.0
    """
    x, y = corners[:, 0] - corners[0, 0], corners[:, 1] - corners[0, 1]
    return 0.5 * math.fsum(x * np.roll(y, -1) - y * np.roll(x, -1))


def outline(given: ArrayLike, where: str = "polygon") -> Floats:
    """Return the corners of a solid body counter-clockwise [m], shape (n, 2), read-only.

    The last corner is joined to the first; it may also repeat it.

    Args:
        given: corners in order, either way round [m], shape (n, 2).
        where: what the body is called in messages.

    Raises:
        BadGround: there are fewer than three corners or too many, two follow each other in one place, the outline
            crosses or touches itself, or numbers are no good.

    >>> outline([[0, 0], [0, 1], [1, 0]]).tolist()
    [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]
    """
    corners = table(given, 2, where)
    if len(corners) > 1 and (corners[0] == corners[-1]).all():
        corners = corners[:-1]
    if not 3 <= len(corners) <= MOST_CORNERS:
        rule = f"a polygon has from 3 to {MOST_CORNERS} corners, but {len(corners)} were given"
        raise BadGround(where, rule, "for a single wall give a segment", slug="polygon-corners")
    doubled = np.flatnonzero((corners == np.roll(corners, -1, axis=0)).all(axis=1))
    if len(doubled):
        rule = f"corners that follow each other must differ, but {_names(doubled[0], len(corners))} are both at "
        raise BadGround(where, rule + _place(corners[doubled[0]]), "delete one", slug="polygon-corners")
    i, j = first_meeting(corners)
    if i >= 0:
        rule = f"an outline must not cross or touch itself, but the edges after corner {i + 1} and corner {j + 1} do"
        raise BadGround(where, rule, "put the corners in order, or give several polygons", slug="polygon-crosses")
    corners = np.ascontiguousarray(corners if area(corners) > 0.0 else corners[::-1])
    corners.flags.writeable = False
    return corners


def convex(given: ArrayLike, where: str = "footprint") -> Floats:
    """Return the corners of a convex polygon counter-clockwise [m], shape (n, 2), as kernels of footprints take it.

    Raises:
        BadGround: as `outline`, or it is not convex.

    >>> convex([[0, 0], [4, 0], [1, 1], [0, 4]])
    Traceback (most recent call last):
    parcours_navigation.ground.outlines.BadGround: footprint: it must be convex, but turns right at corner 3, (1, 1); \
take the corner out [footprint-convex]
    """
    corners = outline(given, where)
    edge = np.roll(corners, -1, axis=0) - corners
    before = np.roll(edge, 1, axis=0)
    right = np.flatnonzero(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0] < 0.0)
    if len(right):
        at = int(right[0])
        rule = f"it must be convex, but turns right at corner {at + 1}, {_place(corners[at])}"
        raise BadGround(where, rule, "take the corner out", slug="footprint-convex")
    return corners


def bounds_of(given: ArrayLike, where: str = "bounds") -> Floats:
    """Return bounds x0, y0, x1, y1 [m], shape (4,), read-only.

    Raises:
        BadGround: there is no room between them, or numbers are no good.
    """
    bounds: Floats = table(np.atleast_2d(np.asarray(given, dtype=object)), 4, where)[0]
    if not (bounds[0] < bounds[2] and bounds[1] < bounds[3]):
        rule = "they are x0, y0, x1, y1 with x0 < x1 and y0 < y1, but are "
        given_as = ", ".join(f"{value:g}" for value in bounds)
        raise BadGround(where, rule + given_as, "give the lower left corner first", slug="ground-bounds")
    return bounds


def faults(segments: Floats, discs: Floats) -> Iterator[BadGround]:
    """Yield what is wrong with walls, shape (n, 4), and discs, shape (m, 3), both [m]."""
    for i in np.flatnonzero((segments[:, :2] == segments[:, 2:]).all(axis=1)):
        rule = f"a wall needs two different ends, but both are at {_place(segments[i, :2])}"
        yield BadGround(f"wall {i + 1}", rule, "delete it, or give a disc", slug="wall-length")
    for i in np.flatnonzero(discs[:, 2] <= 0.0):
        rule = f"a radius must be above 0 m, but is {discs[i, 2]:g} m"
        yield BadGround(f"disc {i + 1}", rule, "give metres above 0, or delete it", slug="disc-radius")


def _place(point: Floats) -> str:
    return f"({point[0]:g}, {point[1]:g})"


def _names(i: int, n: int) -> str:
    return f"corners {i + 1} and {(i + 1) % n + 1}"

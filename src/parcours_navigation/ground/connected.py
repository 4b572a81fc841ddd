"""Whether a disc gets from one place to another on a ground, or certainly does not: proofs by lattices.

· · · · ·     Yes: a point is open if its clearance is at least the radius and half a spacing. From one open point
· ●━● · ·     to the next along a row or column the disc moves freely: no place in between is farther than half a
· · ┃ · ·     spacing from one of the two, and clearance changes by no more than the place.
· · ●━●━●
              No: a point is open if its clearance is at least the radius less 0.71 spacings. Any free way is
· ●╲· · ·     shadowed by the points nearest to it, each within 0.71 spacings, and one next to the other, diagonals
· · ●━●╲·     included. So if the points from the start do not lead to the goal, no way does.
· · · · ●
              Where neither is proven, the ways are hardly wider than the disc.
"""

from __future__ import annotations

import math

import numpy as np

from parcours.kernels import Record, heap_kernel, kernel
from parcours_navigation.ground.clearance import at_least, clearance, least_on_way
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.ground.packing import Floats

MOST_POINTS = 4_000_000
"""Points of the lattice at most."""

_SHADOW = 0.70710679
"""A place is within this many spacings of the nearest point of a lattice: half a diagonal, rounded up."""

Place = tuple[float, float]


def is_connected(
    packed: Floats,
    area: Floats,
    start: Place,
    goal: Place,
    radius: float,
    tolerance: float = 0.0,
    spacing: float | None = None,
) -> bool:
    """Return whether a disc certainly gets from start to goal without touching the ground or leaving the area.

    Args:
        packed: what `Ground.pack` returns.
        area: x0, y0, x1, y1 [m], shape (4,): the disc's middle stays in there.
        start: [m].
        goal: [m].
        radius: of the disc [m].
        tolerance: so near to the goal is there [m].
        spacing: between neighbours on the lattice [m]; None: a quarter of the radius.

    Raises:
        BadGround: the lattice would have too many points.

    >>> is_connected(np.empty(0), np.array([0.0, 0.0, 2.0, 2.0]), (0.1, 0.1), (1.9, 1.9), 0.1)
    True
    """
    return _ask(packed, area, start, goal, radius, tolerance, spacing, True)


def is_apart(
    packed: Floats,
    area: Floats,
    start: Place,
    goal: Place,
    radius: float,
    tolerance: float = 0.0,
    spacing: float | None = None,
) -> bool:
    """Return whether a disc certainly does not get from start to goal within the area; arguments as of `is_connected`.

    A disc that touches the ground at the start gets nowhere.

    >>> from parcours_navigation.ground.ground import lay_ground
    >>> packed = lay_ground([[1.0, 0.0, 1.0, 2.0]]).pack()
    >>> area = np.array([0.0, 0.0, 2.0, 2.0])
    >>> is_apart(packed, area, (0.5, 1.0), (1.5, 1.0), 0.1), is_apart(packed, area, (0.5, 1.0), (0.5, 1.5), 0.1)
    (True, False)
    """
    return not _ask(packed, area, start, goal, radius, tolerance, spacing, False)


def _ask(
    packed: Floats,
    area: Floats,
    start: Place,
    goal: Place,
    radius: float,
    tolerance: float,
    spacing: float | None,
    certain: bool,
) -> bool:
    """Return whether the goal is reached from the start on one of the two lattices."""
    x0, y0, x1, y1 = (float(side) for side in area)
    if not (x0 <= start[0] <= x1 and y0 <= start[1] <= y1):
        return False
    if not (x0 - tolerance <= goal[0] <= x1 + tolerance and y0 - tolerance <= goal[1] <= y1 + tolerance):
        return False
    step = 0.25 * radius if spacing is None else spacing
    if not step > 0.0 or (x1 - x0) / step * ((y1 - y0) / step) > MOST_POINTS:
        rule = f"a lattice needs a spacing above 0 and at most {MOST_POINTS} points, but {step} m is given"
        raise BadGround("spacing", rule, "take a wider spacing or a smaller area", slug="map-size")
    rim = 0 if certain else 1  # a shadow may lie beside the area
    before, after = math.floor((start[0] - x0) / step) + rim, math.floor((x1 - start[0]) / step) + rim
    below, above = math.floor((start[1] - y0) / step) + rim, math.floor((y1 - start[1]) / step) + rim
    left, bottom = start[0] - before * step, start[1] - below * step  # the start is a point of the lattice
    return bool(
        _reaches(
            packed, left, bottom, before + after + 1, below + above + 1, before, below, step, goal[0], goal[1], radius,
            tolerance, certain,
        )
    )  # fmt: skip


@kernel
def _is_there(
    packed: Record, x: float, y: float, goal_x: float, goal_y: float, step: float, radius: float, tolerance: float,
    certain: bool,
) -> bool:  # fmt: skip
    """Return whether the goal is reached at an open point, or by a free step from it."""
    far = np.sqrt((x - goal_x) * (x - goal_x) + (y - goal_y) * (y - goal_y))
    if not certain:
        return bool(far <= tolerance + _SHADOW * step)
    if far <= tolerance:
        return True
    return far <= 1.5 * step and least_on_way(packed, x, y, goal_x, goal_y, radius, 0.0) > 0.0


@heap_kernel
def _reaches(
    packed: Record, x0: float, y0: float, columns: int, rows: int, column: int, row: int, step: float, goal_x: float,
    goal_y: float, radius: float, tolerance: float, certain: bool,
) -> bool:  # fmt: skip
    """Return whether a flood from one point of a lattice comes to one that is at the goal."""
    wanted = radius + 0.5 * step if certain else radius - _SHADOW * step
    if clearance(packed, x0 + column * step, y0 + row * step) <= radius:
        return False
    known = np.zeros(columns * rows, np.uint8)
    queue = np.empty(columns * rows, np.int64)
    queue[0] = row * columns + column
    known[queue[0]] = 1
    done, waiting = 0, 1
    while done < waiting:
        point = queue[done]
        done += 1
        px, py = point % columns, point // columns
        if _is_there(packed, x0 + px * step, y0 + py * step, goal_x, goal_y, step, radius, tolerance, certain):
            return True
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                nx, ny = px + dx, py + dy
                if (certain and dx * dy != 0) or nx < 0 or nx >= columns or ny < 0 or ny >= rows:
                    continue
                if known[ny * columns + nx]:
                    continue
                known[ny * columns + nx] = 1
                x, y = x0 + nx * step, y0 + ny * step
                if at_least(packed, x, y) >= wanted or clearance(packed, x, y) >= wanted:
                    queue[waiting] = ny * columns + nx
                    waiting += 1
    return False

"""Permitted half-planes of velocities -> the permitted velocity nearest to a wanted one, or the least bad of all.

The two linear programs of van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance (Springer 2011),
sections 5.3 and 5.4, by the incremental method of de Berg et al., Computational Geometry (2008), chapter 4.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import kernel
from parcours_navigation.protocol import Floats

_PARALLEL = 1e-9


@kernel
def _optimum_on_line(
    planes: Floats, i: int, top: float, want_x: float, want_y: float, far: bool
) -> tuple[bool, float, float]:
    """Return (exists, x, y): the best velocity on the border of half-plane i within all earlier ones and the disc."""
    nx, ny, b = planes[i, 0], planes[i, 1], planes[i, 2]
    square = top * top - b * b
    if square < 0.0:
        return False, 0.0, 0.0
    high = np.sqrt(square)
    low = -high
    px, py, dx, dy = nx * b, ny * b, ny, -nx
    for j in range(i):
        slope = planes[j, 0] * dx + planes[j, 1] * dy
        room = planes[j, 2] - (planes[j, 0] * px + planes[j, 1] * py)
        if abs(slope) < _PARALLEL:
            if room > 0.0:
                return False, 0.0, 0.0
        elif slope > 0.0:
            low = max(low, room / slope)
        else:
            high = min(high, room / slope)
    if low > high:
        return False, 0.0, 0.0
    along = want_x * dx + want_y * dy
    if far:
        t = high if along > 0.0 else low
    else:
        t = min(max(along, low), high)
    return True, px + t * dx, py + t * dy


@kernel
def nearest_permitted(
    planes: Floats, n: int, top: float, want_x: float, want_y: float, far: bool
) -> tuple[int, float, float]:
    """Return (first half-plane that cannot be kept or n, x, y): the best velocity within a disc and half-planes.

    The two-dimensional linear program of section 5.3: half-planes are added one by one, and the optimum moves to the
    border of a new one that it does not satisfy.

    Args:
        planes: rows (nx, ny, b): nx*x + ny*y >= b is permitted [m/s], (nx, ny) a unit vector; shape (>= n, 3).
        n: how many rows count.
        top: radius of the disc of velocities [m/s].
        want_x: the velocity to be near to [m/s], or the direction to go far in.
        want_y: its other part.
        far: whether (want_x, want_y) is a direction, a unit vector.
    """
    x, y = want_x, want_y
    if far:
        x, y = want_x * top, want_y * top
    else:
        length = np.sqrt(x * x + y * y)
        if length > top:
            x, y = x * top / length, y * top / length
    for i in range(n):
        if planes[i, 0] * x + planes[i, 1] * y < planes[i, 2]:
            exists, new_x, new_y = _optimum_on_line(planes, i, top, want_x, want_y, far)
            if not exists:
                return i, x, y
            x, y = new_x, new_y
    return n, x, y


@kernel
def least_violating(
    planes: Floats, n: int, first: int, top: float, x: float, y: float, scratch: Floats
) -> tuple[float, float]:
    """Return the velocity (x, y) in the disc whose greatest violation of a half-plane is least [m/s].

    The three-dimensional linear program of section 5.3, solved as one of two dimensions for each half-plane that is
    violated most: within it, where it is violated as much as another one is a line.

    Args:
        planes: as in `nearest_permitted`.
        n: how many rows count.
        first: the half-plane at which `nearest_permitted` failed.
        top: radius of the disc of velocities [m/s].
        x: the velocity that it had then [m/s].
        y: its other part.
        scratch: working memory, shape (>= n, 3).
    """
    worst = 0.0
    for i in range(first, n):
        if planes[i, 2] - (planes[i, 0] * x + planes[i, 1] * y) <= worst:
            continue
        m = 0
        for j in range(i):
            nx, ny = planes[j, 0] - planes[i, 0], planes[j, 1] - planes[i, 1]
            length = np.sqrt(nx * nx + ny * ny)
            if length > _PARALLEL:
                scratch[m, 0], scratch[m, 1] = nx / length, ny / length
                scratch[m, 2] = (planes[j, 2] - planes[i, 2]) / length
                m += 1
        kept, new_x, new_y = nearest_permitted(scratch, m, top, planes[i, 0], planes[i, 1], True)
        if kept == m:
            x, y = new_x, new_y
        worst = planes[i, 2] - (planes[i, 0] * x + planes[i, 1] * y)
    return x, y

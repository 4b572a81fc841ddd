"""Measures of closeness to obstacles: gaps, time within them, time to collision.

The gap to the closest obstacle is taken to change linearly from one entry to the next.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.measures.table import INTIMATE, PERSONAL, SOCIAL


@kernel
def closest_gap(track: Record, places: Record, radii: Record, robot_radius: float, i: int) -> float:
    """Return the gap from the robot to the closest obstacle at entry i [m]; negative in overlap, inf without any."""
    closest = np.inf
    for k in range(len(radii)):
        dx, dy = places[i, k, 0] - track[i].x, places[i, k, 1] - track[i].y
        closest = min(closest, np.sqrt(dx * dx + dy * dy) - radii[k] - robot_radius)
    return closest


@kernel
def _share_below(limit: float, g0: float, g1: float) -> float:
    """Return the share of an interval in which a gap that goes linearly from g0 to g1 is below `limit`."""
    if g0 < limit:
        return 1.0 if g1 < limit else float((limit - g0) / (g1 - g0))
    return float((limit - g1) / (g0 - g1)) if g1 < limit else 0.0


@kernel
def measure_clearances(
    track: Record, places: Record, radii: Record, robot_radius: float, safe_distance: float, ground: Record,
    out: Record,
) -> None:  # fmt: skip
    """Fill what follows from the gap to the closest obstacle, or to the ground: `ground`, a gap [m] an entry."""
    n = len(track)
    total = unsafe = intimate = personal = social = 0.0
    least = np.inf
    g0 = np.inf
    for i in range(n):
        g1 = closest_gap(track, places, radii, robot_radius, i)
        if len(ground):
            g1 = min(g1, ground[i])
        least = min(least, g1)
        if i > 0 and g1 < np.inf:
            dt = (track[i].time - track[i - 1].time) * 1e-9
            total += 0.5 * (g0 + g1) * dt
            low = min(g0, g1)
            if low < safe_distance:
                unsafe += dt * _share_below(safe_distance, g0, g1)
            if low < SOCIAL:
                social += dt * _share_below(SOCIAL, g0, g1)
                if low < PERSONAL:
                    personal += dt * _share_below(PERSONAL, g0, g1)
                    if low < INTIMATE:
                        intimate += dt * _share_below(INTIMATE, g0, g1)
        g0 = g1
    if n > 0 and least == np.inf:
        total = np.inf
    out.mean_clearance = total / out.duration if out.duration > 0.0 else np.nan
    out.least_clearance = least if n > 0 else np.nan
    out.time_unsafe = unsafe
    out.time_intimate = intimate
    out.time_personal = personal - intimate
    out.time_social = social - personal


@kernel
def least_time_to_collision(track: Record, places: Record, radii: Record, robot_radius: float) -> float:
    """Return the least time to contact [s] with the velocities of the interval that follows each entry."""
    n = len(track)
    least = np.inf
    for k in range(len(radii)):
        reach = radii[k] + robot_radius
        square = reach * reach
        x0 = y0 = 0.0
        for i in range(n):
            x1, y1 = places[i, k, 0] - track[i].x, places[i, k, 1] - track[i].y
            if x1 * x1 + y1 * y1 < square:
                return 0.0
            if i > 0:
                dx, dy = x1 - x0, y1 - y0
                b = -(x0 * dx + y0 * dy)
                c = x0 * x0 + y0 * y0 - square
                root = b * b - (dx * dx + dy * dy) * c
                if b > 0.0 and root >= 0.0:
                    dt = (track[i].time - track[i - 1].time) * 1e-9
                    if dt > 0.0:
                        # c / (b + root): the smaller root, without loss where it is small
                        least = min(least, dt * max(c, 0.0) / (b + np.sqrt(root)))
            x0, y0 = x1, y1
    return float(least)

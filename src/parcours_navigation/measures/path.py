"""Measures of the robot's way: path length, times of setting out and arriving, turning, curvature.

Between two entries the robot moves on the chord.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import PI, atan2, wrap
from parcours.kernels import Record, kernel
from parcours_navigation.facts import NEVER
from parcours_navigation.ground.shapes import enters_disc
from parcours_navigation.measures.table import SET_OUT, SPACING


@kernel
def _between(track: Record, i: int, share: float) -> float:
    """Return the time since the start, `share` of the way from entry i - 1 to entry i [s]."""
    t0, t1 = track[i - 1].time, track[i].time
    return float((t0 - track[0].time) * 1e-9 + share * (t1 - t0) * 1e-9)


@kernel
def measure_way(track: Record, goal_x: float, goal_y: float, goal_tolerance: float, t_goal: int, out: Record) -> None:
    """Fill what follows from the robot's positions and the goal."""
    out.time_to_goal = out.time_to_set_out = np.nan
    out.goal_distance = out.least_goal_distance = out.displacement = out.needed_turn = np.nan
    out.path_length = 0.0
    n = len(track)
    if n == 0:
        return
    start_x, start_y = track[0].x, track[0].y
    gx, gy = goal_x - start_x, goal_y - start_y
    out.displacement = np.sqrt(gx * gx + gy * gy)
    out.needed_turn = abs(wrap(atan2(gy, gx) - track[0].heading)) if out.displacement > 0.0 else 0.0
    least = gx * gx + gy * gy
    x0, y0 = start_x, start_y
    way = 0.0
    reached, set_out = False, False
    if t_goal != NEVER:
        reached = True
        out.time_to_goal = (t_goal - track[0].time) * 1e-9
    elif least <= goal_tolerance * goal_tolerance:
        reached = True
        out.time_to_goal = 0.0
    for i in range(1, n):
        x1, y1 = track[i].x, track[i].y
        dx, dy = x1 - x0, y1 - y0
        square = dx * dx + dy * dy
        if square > 0.0:
            way += np.sqrt(square)
            rx, ry = x0 - goal_x, y0 - goal_y
            foot = min(max(-(rx * dx + ry * dy) / square, 0.0), 1.0)
            fx, fy = rx + foot * dx, ry + foot * dy
            near = fx * fx + fy * fy
            if near < least:
                least = near
            if not reached and near <= goal_tolerance * goal_tolerance:
                reached = True
                share = min(enters_disc(rx, ry, x1 - goal_x, y1 - goal_y, goal_tolerance), 1.0)
                out.time_to_goal = _between(track, i, share)
            if not set_out:
                sx, sy = x1 - start_x, y1 - start_y
                if sx * sx + sy * sy >= SET_OUT * SET_OUT:
                    set_out = True
                    # walked backwards, the step enters the circle it leaves
                    share = 1.0 - enters_disc(sx, sy, x0 - start_x, y0 - start_y, SET_OUT)
                    out.time_to_set_out = _between(track, i, max(share, 0.0))
        x0, y0 = x1, y1
    out.path_length = way
    out.least_goal_distance = np.sqrt(least)
    ex, ey = goal_x - x0, goal_y - y0
    out.goal_distance = np.sqrt(ex * ex + ey * ey)


@kernel
def measure_shape(track: Record, out: Record) -> None:
    """Fill the heading change, and the curvature and roughness over points at least SPACING apart."""
    change = 0.0
    weighted = weights = greatest = rough = 0.0
    triples = 0
    xa = ya = xb = yb = 0.0
    back = 0.0
    points = 0
    n = len(track)
    for i in range(n):
        if i > 0:
            turn = track[i].heading - track[i - 1].heading
            if turn != 0.0:
                change += abs(turn) if -PI <= turn < PI else abs(wrap(turn))
        x, y = track[i].x, track[i].y
        if points == 0:
            xb, yb, points = x, y, 1
            continue
        dx, dy = x - xb, y - yb
        square = dx * dx + dy * dy
        if square < SPACING * SPACING:
            continue
        ahead = np.sqrt(square)
        if points >= 2:
            cx, cy = x - xa, y - ya
            c = np.sqrt(cx * cx + cy * cy)
            doubled = abs((xb - xa) * dy - (yb - ya) * dx)
            curvature = 2.0 * doubled / (back * ahead * c) if c > 0.0 else 0.0
            weight = 0.5 * (back + ahead)
            weighted += curvature * weight
            weights += weight
            greatest = max(greatest, curvature)
            rough += doubled / (c * c) if c > 0.0 else 0.0
            triples += 1
        xa, ya, xb, yb = xb, yb, x, y
        back = ahead
        points += 1
    out.heading_change = change
    out.mean_curvature = weighted / weights if triples > 0 else np.nan
    out.max_curvature = greatest if triples > 0 else np.nan
    out.roughness = rough / triples if triples > 0 else np.nan

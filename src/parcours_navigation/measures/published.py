"""What published benchmark code computes of one run, defects included.

Written from what the code of MRPB, Arena, HuNavSim and SocNavBench does, read in their repositories; none of it is
theirs. All of it depends on how often the track is sampled.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import PI, atan2, wrap
from parcours.kernels import Record, kernel
from parcours_navigation.measures.closeness import closest_gap
from parcours_navigation.measures.table import INTIMATE, PERSONAL, REST_SPEED, REST_TURN, SOCIAL, TOUCH


@kernel
def measure_as_published(
    track: Record,
    places: Record,
    radii: Record,
    robot_radius: float,
    goal_x: float,
    goal_y: float,
    safe_distance: float,
    out: Record,
) -> None:
    """Fill `out`, a record of PUBLISHED, as `one_case.measures_as_published` says; means over no samples are NaN."""
    _mrpb(track, places, radii, robot_radius, safe_distance, out)
    _arena(track, places, radii, robot_radius, out)
    _hunavsim_people(track, places, radii, robot_radius, out)
    _hunavsim_drive(track, out)
    _socnavbench(track, goal_x, goal_y, out)


@kernel
def _mrpb(track: Record, places: Record, radii: Record, robot_radius: float, safe_distance: float, out: Record) -> None:
    """Fill the unsafe time: stretches of samples count from their first to their last, if they ended before the log."""
    total = 0.0
    first = -1
    for i in range(len(track)):
        if closest_gap(track, places, radii, robot_radius, i) < safe_distance:
            if first < 0:
                first = i
        elif first >= 0:
            total += (track[i - 1].time - track[first].time) * 1e-9
            first = -1
    out.time_unsafe = total


@kernel
def _arena(track: Record, places: Record, radii: Record, robot_radius: float, out: Record) -> None:
    """Fill Arena's numbers: means of its lists, one entry a sample."""
    n = len(track)
    change = acceleration = jerk = curvature = normalised = rough = 0.0
    contacts = 0
    touching = False
    for i in range(n):
        touches = closest_gap(track, places, radii, robot_radius, i) <= 0.0
        if i > 0 and touches and not touching:
            contacts += 1
        touching = touches
        if i == 0:
            continue
        change += abs(wrap(track[i].heading) - wrap(track[i - 1].heading))
        a1 = abs(track[i].v) - abs(track[i - 1].v)
        acceleration += abs(a1)
        if i == 1:
            continue
        jerk += abs(a1 - (abs(track[i - 1].v) - abs(track[i - 2].v)))
        ax, ay = track[i - 1].x - track[i - 2].x, track[i - 1].y - track[i - 2].y
        bx, by = track[i].x - track[i - 1].x, track[i].y - track[i - 1].y
        cx, cy = track[i].x - track[i - 2].x, track[i].y - track[i - 2].y
        a, b, c = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by), np.sqrt(cx * cx + cy * cy)
        doubled = abs(ax * by - ay * bx)
        if a * b * c != 0.0:
            curvature += 2.0 * doubled / (a * b * c)
            normalised += 2.0 * doubled / (a * b * c) * (a + b)
        rough += doubled / (c * c)
    out.heading_change = change
    out.acceleration = acceleration / (n - 1) if n > 1 else np.nan
    out.jerk = jerk / (n - 2) if n > 2 else np.nan
    out.curvature = curvature / (n - 2) if n > 2 else np.nan
    out.normalised_curvature = normalised / (n - 2) if n > 2 else np.nan
    out.roughness = rough / (n - 2) if n > 2 else np.nan
    out.n_contacts = contacts


@kernel
def _hunavsim_people(track: Record, places: Record, radii: Record, robot_radius: float, out: Record) -> None:
    """Fill what HuNavSim's evaluator counts of gaps, sample by sample."""
    n = len(track)
    total = 0.0
    least = np.inf
    intimate = personal = social = touches = 0
    for i in range(n):
        for k in range(len(radii)):
            dx, dy = places[i, k, 0] - track[i].x, places[i, k, 1] - track[i].y
            if np.sqrt(dx * dx + dy * dy) - radii[k] - robot_radius < TOUCH:
                touches += 1
        gap = max(closest_gap(track, places, radii, robot_radius, i), 0.0)
        if gap < np.inf:
            total += gap
        least = min(least, gap)
        if gap < INTIMATE:
            intimate += 1
        elif gap < PERSONAL:
            personal += 1
        elif gap < SOCIAL:
            social += 1
    out.mean_gap = total / n if n > 0 else np.nan
    out.least_gap = least
    out.intimate = 100.0 * intimate / n if n > 0 else np.nan
    out.personal = 100.0 * personal / n if n > 0 else np.nan
    out.social = 100.0 * social / n if n > 0 else np.nan
    out.n_touches = touches


@kernel
def _hunavsim_drive(track: Record, out: Record) -> None:
    """Fill what HuNavSim's evaluator makes of the speeds."""
    n = len(track)
    acceleration = overacceleration = 0.0
    rests = 0
    for i in range(n):
        if track[i].v < REST_SPEED and track[i].w < REST_TURN:
            rests += 1
        if i > 0:
            dt = (track[i].time - track[i - 1].time) * 1e-9
            if dt > 0.0:
                a = abs(track[i].v - track[i - 1].v) / dt
                acceleration += a
                overacceleration += a / dt
    out.time_at_rest = (track[n - 1].time - track[0].time) * 1e-9 / n * rests if n > 0 else np.nan
    out.mean_acceleration = acceleration / n if n > 0 else np.nan
    out.overacceleration = overacceleration / n if n > 0 else np.nan


@kernel
def _socnavbench(track: Record, goal_x: float, goal_y: float, out: Record) -> None:
    """Fill the irregularity, an angle at the origin of the map, and the ratio of lengths."""
    n = len(track)
    angles = way = 0.0
    for i in range(n):
        x, y = track[i].x, track[i].y
        gx, gy = goal_x - x, goal_y - y
        lengths = np.sqrt(gx * gx + gy * gy) * np.sqrt(x * x + y * y) + 1e-10
        cosine = min(max((gx * x + gy * y) / lengths, -1.0), 1.0)
        angles += atan2(np.sqrt(1.0 - cosine * cosine), cosine) if cosine != 0.0 else 0.5 * PI
        if i > 0:
            dx, dy = x - track[i - 1].x, y - track[i - 1].y
            way += np.sqrt(dx * dx + dy * dy)
    out.irregularity = angles / n if n > 0 else np.nan
    out.length_ratio = np.nan
    if n > 0:
        gx, gy = goal_x - track[0].x, goal_y - track[0].y
        out.length_ratio = (way + 1e-5) / np.sqrt(gx * gx + gy * gy)

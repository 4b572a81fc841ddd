"""Measures of the robot's drive: rest, accelerations, jerks, halts.

Speeds change linearly from one entry to the next, flags are held.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.measures.table import REST_SPEED, REST_TURN


@kernel
def measure_halts(track: Record, out: Record) -> None:
    """Fill what follows from the imminent-collision flag."""
    total = longest = stretch = 0.0
    farthest = way = 0.0
    for i in range(len(track) - 1):
        if track[i].halted != 0:
            dt = (track[i + 1].time - track[i].time) * 1e-9
            dx, dy = track[i + 1].x - track[i].x, track[i + 1].y - track[i].y
            total += dt
            stretch += dt
            way += np.sqrt(dx * dx + dy * dy)
            longest = max(longest, stretch)
            farthest = max(farthest, way)
        else:
            stretch = way = 0.0
    out.time_halted = total
    out.longest_halt = longest
    out.stop_distance = farthest


@kernel
def measure_drive(track: Record, out: Record) -> None:
    """Fill what follows from the speeds: rest, accelerations, jerks."""
    rest = speed = smooth = squared = squared_yaw = 0.0
    squared_jerk = squared_yaw_jerk = jerk = jerk_time = 0.0
    a0 = yaw0 = dt0 = 0.0
    intervals = 0
    for i in range(len(track) - 1):
        dt = (track[i + 1].time - track[i].time) * 1e-9
        if dt <= 0.0:
            continue
        v0, v1, w0 = track[i].v, track[i + 1].v, track[i].w
        if abs(v0) < REST_SPEED and abs(w0) < REST_TURN:
            rest += dt
        if (v0 < 0.0) == (v1 < 0.0):
            speed += 0.5 * abs(v0 + v1) * dt
        else:
            speed += 0.5 * (v0 * v0 + v1 * v1) / abs(v1 - v0) * dt
        a, yaw = (v1 - v0) / dt, (track[i + 1].w - w0) / dt
        smooth += abs(a)
        squared += a * a * dt
        squared_yaw += yaw * yaw * dt
        if intervals > 0:
            between = 0.5 * (dt0 + dt)
            squared_jerk += (a - a0) * (a - a0) / between
            squared_yaw_jerk += (yaw - yaw0) * (yaw - yaw0) / between
            jerk += abs(a - a0)
            jerk_time += between
        a0, yaw0, dt0 = a, yaw, dt
        intervals += 1
    out.time_at_rest = rest
    out.mean_speed = speed / out.duration if out.duration > 0.0 else np.nan
    out.smoothness = smooth / intervals if intervals > 0 else np.nan
    out.squared_acceleration = squared
    out.squared_yaw_acceleration = squared_yaw
    out.squared_jerk = squared_jerk
    out.squared_yaw_jerk = squared_yaw_jerk
    out.mean_jerk = jerk / jerk_time if jerk_time > 0.0 else np.nan

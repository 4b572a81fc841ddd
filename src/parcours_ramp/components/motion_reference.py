"""Where a robot is planned to be and an obstacle is expected to be, once more: slowly, from what a message says alone.

For the references that judge Control and Planner. Nothing here calls what it is to judge.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SAMPLE = 0.1  # between two samples of a trajectory or prediction [s]
STANDS = 0.01  # what is slower stands [m/s]
_LONGEST = 50.0  # a trajectory is cut off there [s]
_LINE, _CURVE = 0, 1
_STEPS = 2000  # of the table of a corner


class Pose(NamedTuple):
    """Position [m], heading [rad], speed [m/s] and yaw rate [rad/s]."""

    x: float
    y: float
    heading: float
    v: float = 0.0
    w: float = 0.0


def pose_of(record: Any) -> Pose:
    """Return a POSE in plain numbers."""
    return Pose(*(float(record[name]) for name in Pose._fields))


def wrapped(angle: float) -> float:
    """Return an angle in -pi..pi [rad]."""
    return math.remainder(angle, 2.0 * math.pi)


def planned(trajectory: Any, seconds: float) -> Pose:
    """Return where a TRAJECTORY is after so long [s]: at its ends beyond them, there at rest."""
    duration, skipped = float(trajectory["duration"]), float(trajectory["skipped"])
    time, begun = min(max(seconds, 0.0), duration) + skipped, 0.0
    pieces = trajectory["pieces"]
    last = int(trajectory["n_pieces"]) - 1
    k = next((i for i in range(last) if time < pieces[i]["end"]), last)
    begun = float(pieces[k - 1]["end"]) if k else 0.0
    pose = _on(pieces[k], time - begun)
    ends = seconds >= duration and duration + skipped < _LONGEST
    return pose._replace(v=0.0, w=0.0) if ends else pose


def _on(piece: Any, time: float) -> Pose:
    x, y, heading, angle = (float(piece[name]) for name in ("x", "y", "heading", "angle"))
    way, speed = _driven(time, *(float(piece[name]) for name in ("v0", "peak", "rate", "up", "hold", "down")))
    if piece["kind"] == _LINE:
        return Pose(x + way * math.cos(heading), y + way * math.sin(heading), heading, speed)
    if piece["kind"] != _CURVE:
        sign = 1.0 if angle >= 0.0 else -1.0
        return Pose(x, y, wrapped(heading + sign * way), 0.0, sign * speed)
    ahead, aside, turned, bend = _corner(float(piece["leg"]), angle, way)
    c, s = math.cos(heading), math.sin(heading)
    return Pose(x + c * ahead - s * aside, y + s * ahead + c * aside, wrapped(heading + turned), speed, speed * bend)


def _driven(
    time: float, v0: float, peak: float, rate: float, up: float, hold: float, down: float
) -> tuple[float, float]:
    """Return way and speed: it speeds up, holds, slows down."""
    faster, steady = min(time, up), min(max(time - up, 0.0), hold)
    slower = min(max(time - up - hold, 0.0), down)
    way = v0 * faster + 0.5 * rate * faster**2 + peak * steady + peak * slower - 0.5 * rate * slower**2
    return way, v0 + rate * time if time < up else peak - rate * slower


@lru_cache(maxsize=4096)
def _table(leg: float, angle: float) -> NDArray[np.float64]:
    """Return way, x, y, heading and curvature along a quadratic Bezier curve from (0, 0), heading 0."""
    u = np.linspace(0.0, 1.0, _STEPS + 1)
    c, s = math.cos(angle), math.sin(angle)
    x, y = leg * (2.0 * u * (1.0 - u) + u * u * (1.0 + c)), leg * u * u * s
    dx, dy = 2.0 * leg * (1.0 - u + u * c), 2.0 * leg * u * s
    rate = np.hypot(dx, dy)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) / _STEPS)])
    bend = (dx * 2.0 * leg * s - dy * 2.0 * leg * (c - 1.0)) / rate**3
    return np.array([way, x, y, np.arctan2(dy, dx), bend])


def _corner(leg: float, angle: float, way: float) -> tuple[float, float, float, float]:
    table = _table(leg, angle)
    x, y, turned, bend = (float(np.interp(way, table[0], column)) for column in table[1:])
    return x, y, turned, bend


def expected_place(obstacle: Any, seconds: float) -> tuple[float, float]:
    """Return where an OBSTACLE_STATE is expected to be so long after it was sensed [s]: (x, y) [m].

    It stands, goes on for 12 s on a line, or for half a turn or 5 s on an arc; between samples it goes straight.
    """
    pose = pose_of(obstacle["pose"])
    if abs(pose.v) < STANDS:
        return pose.x, pose.y
    bends = abs(pose.w) >= 0.01
    last = int(min(math.pi / abs(pose.w), 5.0) / SAMPLE) if bends else 120
    place = min(max(seconds / SAMPLE, 0.0), float(last))
    k = min(int(place), last - 1)
    one, two = (_after(pose, i * SAMPLE, bends) for i in (k, k + 1))
    return one[0] + (place - k) * (two[0] - one[0]), one[1] + (place - k) * (two[1] - one[1])


def _after(pose: Pose, seconds: float, bends: bool) -> tuple[float, float]:
    if not bends:
        way = pose.v * seconds
        return pose.x + way * math.cos(pose.heading), pose.y + way * math.sin(pose.heading)
    radius, turned = pose.v / pose.w, pose.heading + pose.w * seconds
    x = pose.x + radius * (math.sin(turned) - math.sin(pose.heading))
    return x, pose.y - radius * (math.cos(turned) - math.cos(pose.heading))

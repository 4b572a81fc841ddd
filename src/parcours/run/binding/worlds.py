"""The names by which formulas speak of the simulated world: what is true at the moment at which a message is made.

Lengths are in metres, angles in radians counter-clockwise from x, times in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

ROBOT_NAMES = tuple(f"robot.{name}" for name in ("x", "y", "heading", "v", "w", "vx", "vy", "radius"))
"""The robot in the world: position, heading, speed along it, yaw rate, velocity along x and y."""

ODOM_NAMES = ("odom.x", "odom.y", "odom.heading")
"""The robot in the frame of its start: (0, 0, 0) when the case begins."""

GOAL_NAMES = ("goal.x", "goal.y", "goal.heading", "start.x", "start.y", "start.heading")

EACH_NAMES = tuple(f"obstacle.{name}" for name in ("x", "y", "heading", "v", "w", "vx", "vy", "radius", "index"))
"""One obstacle, in places with `[*]`, and on the channels of `each`."""

ASKED = ("request", "item")
"""What names of a response's `inject` start with that speak of its request, and of one item of its list `for each`."""

WORLD_NAMES = ("time", "wall_time", "obstacles", *ROBOT_NAMES, *ODOM_NAMES, *GOAL_NAMES)
"""Every name but those of one obstacle. `time` is since the case began, `wall_time` since 1970, `obstacles` how many
there are."""

SCAN_NAMES = ("scan.ranges", "scan.first", "scan.last", "scan.step", "scan.reach")
MAP_NAMES = ("map.cells", "map.rows", "map.columns", "map.resolution", "map.x", "map.y")
WAY_NAMES = ("waypoint.x", "waypoint.y")
STACK_NAMES = ("stamp", "tolerance", *SCAN_NAMES, *MAP_NAMES)
"""What only a navigation stack is told. `stamp` is what its nodes' clock shows [s], `tolerance` how near the goal
counts [m]. Angles of a scan count from the robot's heading, `map.x` and `map.y` are the map's lower left corner, a
waypoint is one of a path."""

LISTS = {"scan.ranges": "real", "map.cells": "int"}
"""Those that are lists, and of what."""


def body(prefix: str, x: float, y: float, heading: float, v: float, w: float, radius: float) -> dict[str, float]:
    """Return the names of a body with their values.

    >>> body("robot", 1.0, 2.0, 0.0, 0.5, 0.1, 0.2)["robot.vx"]
    0.5
    """
    values = {"x": x, "y": y, "heading": heading, "v": v, "w": w, "radius": radius}
    values |= {"vx": v * math.cos(heading), "vy": v * math.sin(heading)}
    return {f"{prefix}.{name}": value for name, value in values.items()}


def odometry(start: Mapping[str, float], x: float, y: float, heading: float) -> dict[str, float]:
    """Return where the robot is in the frame of its start.

    Args:
        start: `start.x`, `start.y` [m] and `start.heading` [rad].
        x: where it is in the world [m].
        y: as x.
        heading: its heading in the world [rad].

    >>> start = {"start.x": 1.0, "start.y": 0.0, "start.heading": math.pi / 2}
    >>> [round(value, 9) for value in odometry(start, 1.0, 2.0, math.pi / 2).values()]
    [2.0, 0.0, 0.0]
    """
    dx, dy, turn = x - start["start.x"], y - start["start.y"], start["start.heading"]
    along, across = math.cos(turn), math.sin(turn)
    return {
        "odom.x": along * dx + across * dy,
        "odom.y": along * dy - across * dx,
        "odom.heading": math.remainder(heading - turn, 2.0 * math.pi),
    }

"""The guard once more, slowly: how fast the robot may drive beside obstacles, and whether it is about to meet one."""

from __future__ import annotations

import math
from typing import Any

from parcours_ramp.components.motion_reference import SAMPLE, STANDS, Pose, expected_place, planned, pose_of
from parcours_ramp.planner.parameters import Parameters

CREEP, VEERS, REACH_OF_LIMITS, TURNS, OBEYED = 0.02, 0.04, 0.4, 0.15, 0.1
_UNSURE = 0.004  # what is looked at every 10 ms may come nearer in between [m]
_FINE = 10  # looks a sample


def speed_limit(robot: Pose, states: Any, parameters: Parameters) -> float:
    """Return the limit [m/s] for obstacles, an array of OBSTACLE_STATE: from it the robot can still stop.

    One that stands may set out towards the robot if the robot is ahead of it; one that moves may stop before the robot.
    """
    limit = math.inf
    for state in states:
        obstacle, reach = pose_of(state["pose"]), parameters.robot_radius + float(state["radius"])
        distance = math.hypot(obstacle.x - robot.x, obstacle.y - robot.y)
        gap = distance - reach - OBEYED * max(robot.v, 0.0)
        bearing = math.atan2(obstacle.y - robot.y, obstacle.x - robot.x)
        if gap > REACH_OF_LIMITS or math.cos(bearing - robot.heading) < -TURNS:
            continue
        if abs(obstacle.v) >= STANDS:
            if distance * abs(math.sin(bearing - robot.heading)) < reach:
                limit = min(limit, _stops_within(gap, 0.0, parameters))
            continue
        behind = bearing - obstacle.heading
        if math.cos(behind) < 0.0 and distance * abs(math.sin(behind)) < reach + VEERS:
            limit = min(limit, max(_stops_within(gap, parameters.obstacle_speed, parameters), CREEP))
    return limit


def _stops_within(gap: float, obstacle_speed: float, parameters: Parameters) -> float:
    """Return the speed v with (v + u) t + v^2 / 2a + u v / a = gap, by bisection; 0 if there is none."""
    u, t, a = obstacle_speed, parameters.reaction, parameters.a_max

    def closed(v: float) -> float:
        return (v + u) * t + v * v / (2.0 * a) + u * v / a

    low, high = 0.0, 10.0
    if closed(low) >= gap:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if closed(middle) < gap else (low, middle)
    return low


def meets(
    trajectory: Any, begins: int, first: int, last: int, margin: float, drift: tuple[float, float], obstacles: Any,
    parameters: Parameters,
) -> bool | None:  # fmt: skip
    """Return whether the robot, on its way from sample `first` to before `last`, meets an obstacle; None if nearly so.

    Args:
        begins: when the trajectory begins [ns].
        margin: what must be left between the two [m].
        drift: what to add to planned places [m].
        obstacles: as sensed, with their stamp [ns].
    """
    unsure = False
    for state in obstacles.states:
        reach = parameters.robot_radius + float(state["radius"]) + margin
        gaps = [_gap(trajectory, k * SAMPLE / _FINE, (begins - obstacles.stamp) * 1e-9, drift, state)
                for k in range(first * _FINE, (last - 1) * _FINE + 1)]  # fmt: skip
        if math.hypot(*gaps[0]) < reach:  # it may leave an obstacle that it is too near to
            if abs(math.hypot(*gaps[0]) - reach) < _UNSURE or not parameters.may_leave:
                unsure = unsure or parameters.may_leave
                if not parameters.may_leave:
                    return True
            k = 0
            while k + _FINE < len(gaps) and math.hypot(*gaps[k]) < reach:
                here, there = gaps[k], gaps[k + _FINE]
                moved = math.dist(here, there)
                if math.hypot(*there) < math.hypot(*here) + 0.15 * moved - 1e-5:
                    return True
                unsure = unsure or math.hypot(*there) < math.hypot(*here) + 0.15 * moved + 1e-5
                k += _FINE
            gaps = gaps[k:]
            if math.hypot(*gaps[0]) < reach:
                continue  # leaves until the end
        nearest = min(math.hypot(*gap) for gap in gaps)
        if nearest < reach - _UNSURE:
            return True
        unsure = unsure or nearest < reach + _UNSURE
    return None if unsure else False


def _gap(trajectory: Any, seconds: float, later: float, drift: tuple[float, float], state: Any) -> tuple[float, float]:
    robot = planned(trajectory, seconds)
    x, y = expected_place(state, seconds + later)
    return x - robot.x - drift[0], y - robot.y - drift[1]

"""Where discs that move at constant (v, w) will be, and their least gap in continuous time; options of planners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from parcours.elementary import HALF_PI_HIGH, HALF_PI_LOW, exp_near_zero, sin_cos, sin_cos_near_zero
from parcours.errors import BadRequest, require_known
from parcours.kernels import kernel
from parcours_navigation.arena.contact import gap_square
from parcours_navigation.protocol import Floats, Observation, X, Y

_STRAIGHT = 1e-9


@kernel
def sin_cos_each(angles: Floats, sines: Floats, cosines: Floats) -> None:
    """Fill in sin and cos of each angle [rad], shape (n,): the bits of `sin_cos`, but several angles at a time.

    >>> s, c = np.empty(2), np.empty(2)
    >>> sin_cos_each(np.array([0.5, -4.0]), s, c)
    >>> (s[1], c[1]) == sin_cos(-4.0)
    True
    """
    for k in range(len(angles)):
        turns = np.floor(angles[k] * 0.6366197723675814 + 0.5)
        s, c = sin_cos_near_zero((angles[k] - turns * HALF_PI_HIGH) - turns * HALF_PI_LOW)
        # In numbers rather than words, and without a jump: processors do both of these one at a time.
        quadrant = turns - 4.0 * np.floor(0.25 * turns)
        is_odd = (quadrant == 1.0) | (quadrant == 3.0)
        sine, cosine = c if is_odd else s, s if is_odd else c
        sines[k] = -sine if quadrant >= 2.0 else sine
        cosines[k] = -cosine if (quadrant == 1.0) | (quadrant == 2.0) else cosine


@kernel
def exp_each(values: Floats) -> None:
    """Replace each x, |x| < 700, by e**x, shape (n,): the bits of `exp`, but several numbers at a time.

    >>> powers = np.array([0.0, -690.0])
    >>> exp_each(powers)
    >>> [f"{one:.13g}" for one in powers]
    ['1', '2.17173828139e-300']
    """
    for k in range(len(values)):
        y, twos = exp_near_zero(values[k])
        values[k] = y * np.int64((int(twos) + 1023) << 52).view(np.float64)  # 2**twos, as IEEE 754 writes it


@kernel
def chord_velocity(heading: float, v: float, w: float, t: float) -> tuple[float, float]:
    """Return the mean velocity (x, y) [m/s] over t [s] of a body at constant v [m/s] and w [rad/s].

    >>> chord_velocity(0.0, 0.5, 1.0, 0.0)
    (0.5, 0.0)
    """
    half = 0.5 * w * t
    s, c = sin_cos(heading + half)
    if abs(half) > _STRAIGHT:
        v *= sin_cos(half)[0] / half
    return v * c, v * s


@kernel
def travel(x: float, y: float, heading: float, v: float, w: float, t: float) -> tuple[float, float]:
    """Return (x, y) [m] of a body after t [s] at constant speed v [m/s] and yaw rate w [rad/s].

    >>> x, y = travel(0.0, 0.0, 0.0, 1.0, 3.141592653589793, 1.0)
    >>> abs(x) < 1e-15, round(y, 12)
    (True, 0.636619772368)
    """
    vx, vy = chord_velocity(heading, v, w, t)
    return x + vx * t, y + vy * t


@kernel
def extrapolate(
    robot: Floats,
    obstacles: Floats,
    top: float,
    radius: float,
    comfort: float,
    step: float,
    places: Floats,
    reaches: Floats,
) -> int:
    """Return how many obstacles matter, and fill in where they will be if they keep their speed and yaw rate.

    An obstacle does not matter if no motion of the robot brings it within `comfort` of it in the time looked at.

    `top` is the robot's greatest speed [m/s], `radius` its own with its margin [m]; instants are `step` [s] apart, the
    first is now. `places` receives x, y [m] of each obstacle that matters at each instant, shape (n_instants, >= n, 2),
    `reaches` the sum of its radius and the robot's [m], shape (>= n,).
    """
    n_instants = places.shape[0]
    span = (n_instants - 1) * step
    n = 0
    for i in range(obstacles.shape[0]):
        x, y, heading = obstacles[i, 0], obstacles[i, 1], obstacles[i, 2]
        v, w = obstacles[i, 3], obstacles[i, 4]
        reach = radius + obstacles[i, 5]
        away = reach + comfort + (max(top, abs(robot[3])) + abs(v)) * span
        if (x - robot[0]) * (x - robot[0]) + (y - robot[1]) * (y - robot[1]) > away * away:
            continue
        for k in range(n_instants):
            places[k, n, 0], places[k, n, 1] = travel(x, y, heading, v, w, k * step)
        reaches[n] = reach
        n += 1
    return n


@kernel
def runs_into(
    robot: Floats, v: float, w: float, obstacles: Floats, radius: float, horizon: float, step: float
) -> tuple[float, int]:
    """Return (time, which): when the robot first comes within `radius` of an obstacle while moving towards it.

    The robot moves at constant (v, w), obstacles keep their speeds. Obstacles that run into a robot which moves away
    from them, or stands, are left out: braking would not help. Without any the time is infinite and `which` is -1.
    It looks `horizon` [s] ahead; both are taken to move straight for a `step` [s].
    """
    n_steps = int(np.ceil(horizon / step))
    first, which = np.inf, -1
    for i in range(obstacles.shape[0]):
        reach = radius + obstacles[i, 5]
        ox, oy, rx, ry = obstacles[i, 0], obstacles[i, 1], robot[0], robot[1]
        speeds = (abs(v) + abs(obstacles[i, 3])) * horizon + reach
        if (ox - rx) * (ox - rx) + (oy - ry) * (oy - ry) > speeds * speeds:
            continue
        for k in range(1, n_steps + 1):
            t = k * step
            next_rx, next_ry = travel(robot[0], robot[1], robot[2], v, w, t)
            next_ox, next_oy = travel(
                obstacles[i, 0], obstacles[i, 1], obstacles[i, 2], obstacles[i, 3], obstacles[i, 4], t
            )
            if gap_square(ox - rx, oy - ry, next_ox - next_rx, next_oy - next_ry) < reach * reach:
                mx, my = 0.5 * (ox + next_ox - rx - next_rx), 0.5 * (oy + next_oy - ry - next_ry)
                if (next_rx - rx) * mx + (next_ry - ry) * my > 0.0:
                    if t < first:
                        first, which = t, i
                    break
            rx, ry, ox, oy = next_rx, next_ry, next_ox, next_oy
    return first, which


def to_goal(observation: Observation) -> tuple[float, float, float, float]:
    """Return (x, y, distance, speed): where the goal is seen from the robot [m], and how fast to go there [m/s].

    The speed is the robot's top speed, less where it must brake to stop on the goal, and 0 within half the tolerance.
    """
    task, robot = observation.task, observation.robot
    x, y = task.goal[0] - float(robot[X]), task.goal[1] - float(robot[Y])
    distance = math.sqrt(x * x + y * y)
    if distance <= 0.5 * task.goal_tolerance:
        return x, y, distance, 0.0
    return x, y, distance, min(task.limits.speed, math.sqrt(2.0 * task.limits.acceleration * distance))


Options = dict[str, tuple[float, float, float, str]]
"""Name of an option -> default, least, greatest, unit; one whose default is an int takes whole numbers only."""


class Settled:
    """Values of options as plain attributes: a SimpleNamespace is slower to read, and planners read them each time."""

    def __init__(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            setattr(self, name, value)


def settled(planner: str, options: Options, given: Mapping[str, float]) -> Any:
    """Return an object with a value for each option: the one given, or its default.

    Raises BadRequest if an option is unknown, no number, out of its range, or not whole where it must be.
    """
    for name in given:
        require_known(name, list(options), f"option of {planner}", slug="planner-parameter")
    return Settled({name: _settled(planner, name, *one, given.get(name, one[0])) for name, one in options.items()})


def _settled(planner: str, name: str, default: float, low: float, high: float, unit: str, value: object) -> float:
    where, whole = f"planner {planner}, {name}", isinstance(default, int)
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        rule, remedy = f"must be a number, but {value!r} was given", f"give a number from {low:g} to {high:g}"
        raise BadRequest(where, rule, remedy, slug="planner-parameter")
    if not low <= value <= high:
        span = f"{low:g} to {high:g} {unit}".rstrip()
        raise BadRequest(where, f"must lie in {span}, but is {value:g}", slug="planner-parameter")
    if whole and int(value) != value:
        raise BadRequest(where, f"must be a whole number, but is {value:g}", slug="planner-parameter")
    return int(value) if whole else float(value)

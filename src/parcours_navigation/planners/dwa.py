"""DWA: the best of the speeds that can be reached soon and from which the robot can still brake.

Candidates (v, w) on a grid over the dynamic window are driven as arcs; those that leave no room for braking are
dropped, the others weighed by heading, clearance and velocity (Fox, Burgard, Thrun, The dynamic window approach to
collision avoidance, IEEE Robotics & Automation Magazine 4(1), 1997). Obstacles are extrapolated at constant (v, w), and
contact is found in continuous time.
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import PI, atan2, sin_cos, wrap
from parcours.kernels import kernel
from parcours_navigation.arena.contact import gap_square
from parcours_navigation.planners.motion import Options, extrapolate, settled
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import Command, Floats, Observation, Task

_STRAIGHT = 1e-9
_KEEN = 16  # candidates that are searched for; more would cost more than they save


@kernel
def drive_arc(
    robot: Floats, v: float, w: float, places: Floats, reaches: Floats, n: int, step: float, comfort: float
) -> tuple[float, float, float]:
    """Return (contact, closing, gap) of an arc: when it touches, when the robot runs into something, the least gap.

    The times [s] are those of the starts of the steps in which it happens, infinite if it does not. The robot runs into
    an obstacle that it touches while it moves towards it. With that the arc ends.

    `places`, `reaches`, `n` and `step` are those of `extrapolate`; gaps above `comfort` [m] are as good as any.
    """
    x, y = robot[0], robot[1]
    half = 0.5 * w * step
    s_half, c_half = sin_cos(half)
    chord = v * step
    if abs(half) > _STRAIGHT:
        chord *= s_half / half
    s, c = sin_cos(robot[2] + half)
    s_turn, c_turn = 2.0 * s_half * c_half, c_half * c_half - s_half * s_half
    contact, least = np.inf, comfort
    for k in range(1, places.shape[0]):
        dx, dy = chord * c, chord * s
        for i in range(n):
            x0, y0 = places[k - 1, i, 0] - x, places[k - 1, i, 1] - y
            x1, y1 = places[k, i, 0] - x - dx, places[k, i, 1] - y - dy
            square = gap_square(x0, y0, x1, y1)
            if square < (reaches[i] + least) * (reaches[i] + least):
                least = min(least, np.sqrt(square) - reaches[i])
                if square < reaches[i] * reaches[i]:
                    contact = min(contact, (k - 1) * step)
                    if dx * (x0 + x1) + dy * (y0 + y1) > 0.0:
                        return contact, (k - 1) * step, least
        x += dx
        y += dy
        s, c = s * c_turn + c * s_turn, c * c_turn - s * s_turn
    return contact, np.inf, least


@kernel
def is_admissible(v: float, closing: float, deceleration: float, reaction: float) -> bool:
    """Return whether a robot at v [m/s] stands before it would run into something in `closing` [s].

    It brakes at `deceleration` [m/s2] after `reaction` [s]; a robot that stands is always admissible.
    """
    return v <= 0.0 or closing > reaction + v / deceleration


World = tuple[Floats, Floats, int, float]
"""Where the obstacles will be: places, reaches, n and step, as in `extrapolate`."""


@kernel
def _speed(i: int, n_v: int, v_low: float, v_high: float) -> float:
    """Return the speed of row i of the window [m/s]; the last is that of braking."""
    return v_high - (v_high - v_low) * i / (n_v - 1) if i < n_v else 0.0


@kernel
def _look(
    robot: Floats, goal: tuple[float, float], v_low: float, v_high: float, w_low: float, w_high: float, alpha: float,
    interval: float, weight: float, looks: Floats,
) -> None:  # fmt: skip
    """Fill in what each candidate gets for its heading at the goal, shape (n_v + 1, n_w)."""
    n_v, n_w = looks.shape[0] - 1, looks.shape[1]
    for j in range(n_w):
        w = w_low + (w_high - w_low) * j / (n_w - 1)
        half = 0.5 * w * interval  # as `travel` does, where all speeds share what it asks of the yaw rate
        s, c = sin_cos(robot[2] + half)
        share = sin_cos(half)[0] / half if abs(half) > _STRAIGHT else 1.0
        heading = robot[2] + w * interval + 0.5 * w * abs(w) / alpha
        for i in range(n_v + 1):
            mean = _speed(i, n_v, v_low, v_high) * share
            x, y = robot[0] + mean * c * interval, robot[1] + mean * s * interval
            off = abs(wrap(atan2(goal[1] - y, goal[0] - x) - heading))
            looks[i, j] = weight * (1.0 - off / PI)


@kernel
def best_speeds(
    robot: Floats,
    goal: tuple[float, float],
    speed: float,
    limits: Floats,
    world: World,
    window: tuple[float, float],
    weights: Floats,
    comfort: float,
    memory: Floats,
) -> tuple[float, float]:
    """Return the admissible (v, w) [m/s, rad/s] of the highest objective; v is 0 if nothing else is admissible.

    `limits` are speed, yaw rate, acceleration, yaw acceleration; `window` interval and reaction of OPTIONS; `weights`
    those of heading, clearance, velocity and gap; `memory` has two words a candidate, shape (2, n_v + 1, n_w).
    """
    #      w          the dynamic window: what the accelerations let the robot have after `interval`,
    #  +max ┌───────────────────┐             cut by its limits; (v, w) is now
    #       │    ┌─────┐        │
    #       │    │· · ·│ n_w    │   a column of w = now - alpha t .. now + alpha t for each of n_v speeds
    #     0 ├────│·(v,w)────────┤   v, and one for v = 0, so that braking is always a candidate
    #       │    └─────┘        │
    #  -max └───────────────────┘
    #       0     n_v          top  v
    places, reaches, n, step = world
    interval, reaction = window
    looks, promises = memory[0], memory[1]
    n_v, n_w = looks.shape[0] - 1, looks.shape[1]
    top, a, alpha = limits[0], limits[2], limits[3]
    v_high = max(min(robot[3] + a * interval, speed), 0.0)
    v_low = min(max(robot[3] - a * interval, 0.0), v_high)
    w_low, w_high = max(robot[4] - alpha * interval, -limits[1]), min(robot[4] + alpha * interval, limits[1])
    horizon = (places.shape[0] - 1) * step
    _look(robot, goal, v_low, v_high, w_low, w_high, alpha, interval, weights[0], looks)
    for i in range(n_v + 1):
        free = weights[2] * _speed(i, n_v, v_low, v_high) / top + weights[3] * comfort / comfort
        for j in range(n_w):
            promises[i, j] = looks[i, j] + weights[1] + free
    # Obstacles only take from what a candidate promises, also when rounded: rounding keeps order. So those that promise
    # most are driven first, then the others in turn that can still be better; of equal ones the first is the best.
    best, best_v, best_w, best_at = -np.inf, 0.0, 0.0, looks.size
    still, contact_still, gap_still = False, np.inf, comfort
    for turn in range(_KEEN + looks.size):
        most, at = -np.inf, turn - _KEEN
        if turn < _KEEN:
            for i in range(n_v + 1):
                for j in range(n_w):
                    if promises[i, j] > most:
                        most, at = promises[i, j], i * n_w + j
        else:
            most = promises[at // n_w, at % n_w]
        if most == -np.inf or most < best or (most == best and at > best_at):
            if turn < _KEEN:
                break
            continue
        at_i, at_j = at // n_w, at % n_w
        promises[at_i, at_j] = -np.inf
        v, w = _speed(at_i, n_v, v_low, v_high), w_low + (w_high - w_low) * at_j / (n_w - 1)
        contact, closing, gap = contact_still, np.inf, gap_still
        if v > 0.0 or not still:
            contact, closing, gap = drive_arc(robot, v, w, places, reaches, n, step, comfort)
        if v == 0.0:  # where the robot stands, its yaw rate changes nothing
            still, contact_still, gap_still = True, contact, gap
        if not is_admissible(v, closing, a, reaction):
            continue
        value = looks[at_i, at_j] + weights[1] * min(contact / horizon, 1.0)
        value += weights[2] * v / top + weights[3] * max(gap, 0.0) / comfort
        if value > best or (value == best and at < best_at):
            best, best_v, best_w, best_at = value, v, w, at
    return best_v, best_w


OPTIONS: Options = {
    "step": (0.2, 0.01, 1.0, "s"),  # robot and obstacles are taken to move straight for this long
    "horizon": (2.0, 0.0, 60.0, "s"),  # how far to look ahead; at least a step
    "interval": (0.25, 0.01, 10.0, "s"),  # the window holds what can be reached within this time
    "reaction": (0.1, 0.0, 10.0, "s"),  # time until the robot brakes, for what is admissible
    "n_v": (5, 2, 1000, ""),  # speeds in the window
    "n_w": (15, 2, 1000, ""),  # yaw rates in the window; odd, so that the present one is among them
    "heading": (1.0, 0.0, 1e6, ""),  # weight of heading at the goal
    "clearance": (1.0, 0.0, 1e6, ""),  # weight of the time until contact
    "velocity": (0.8, 0.0, 1e6, ""),  # weight of the speed
    "gap": (0.4, 0.0, 1e6, ""),  # weight of the least gap on the way
    "comfort": (0.15, 0.001, 10.0, "m"),  # gaps above this are as good as any
    "lookahead": (1.0, 0.0, 100.0, "m"),  # with a map or a path: heads for what is so far along the way; 0: the goal
    "margin": (0.02, 0.0, 10.0, "m"),  # the robot's radius is enlarged by it
}


class Dwa:
    """The dynamic window approach, among obstacles that are taken to keep their speed and yaw rate.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    def __init__(self, **options: float) -> None:
        o = self._options = settled("dwa", OPTIONS, options)
        settled("dwa", {"horizon": (o.horizon, o.step, 60.0, "s")}, {})
        self._n_steps = math.ceil(o.horizon / o.step - 1e-9)
        self._window = (o.interval, o.reaction)
        self._memory = np.empty((2, o.n_v + 1, o.n_w))
        self._weights = np.array([o.heading, o.clearance, o.velocity, o.gap])
        self._places, self._reaches = np.empty((self._n_steps + 1, 0, 2)), np.empty(0)
        self._limits = np.zeros(4)
        self._surroundings, self._route = Surroundings(), Route(o.margin)

    def reset(self, task: Task) -> None:
        """Begin a case; nothing is remembered from one observation to the next but limits, and the way over a map."""
        limits = task.limits
        self._route.begin()
        self._limits = np.array([limits.speed, limits.yaw_rate, limits.acceleration, limits.yaw_acceleration])

    def observe(self, observation: Observation) -> Command:
        """Return the best admissible speeds; at the goal it stops."""
        task, robot, o = observation.task, observation.robot, self._options
        self._surroundings.look(observation)
        aim = self._route.aim(observation, self._surroundings.walls, o.lookahead)
        _, _, _, speed = towards(observation, aim)
        if speed == 0.0:
            return Command(0.0, 0.0)
        radius, top = task.robot_radius + o.margin, task.limits.speed
        obstacles = self._surroundings.with_walls(observation, radius + o.comfort + top * o.horizon)
        if len(obstacles) > len(self._reaches):
            self._places = np.empty((self._n_steps + 1, len(obstacles), 2))
            self._reaches = np.empty(len(obstacles))
        n = extrapolate(robot, obstacles, top, radius, o.comfort, o.step, self._places, self._reaches)
        world = self._places, self._reaches, n, o.step
        v, w = best_speeds(
            robot, aim[:2], speed, self._limits, world, self._window, self._weights, o.comfort, self._memory
        )
        return Command(v, w)

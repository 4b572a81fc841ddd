"""MPC: the accelerations of the next seconds that cost least, by a few steps of Gauss and Newton along the horizon.

A unicycle's accelerations are improved by `ilqr`. It starts from the last plan, and from the best of a few that turn to
either side, since a smooth descent alone does not change sides. Obstacles are extrapolated at constant (v, w).
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import atan2, wrap
from parcours.kernels import heap_kernel, kernel
from parcours_navigation.planners.ilqr import World, drive, improve, move
from parcours_navigation.planners.motion import Options, extrapolate, settled
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import Command, Floats, Observation, Task

_WORST = 1e12
_OFFSETS = (0.0, 0.7, -0.7, 1.4, -1.4)
"""Plans to start from head so far aside of the aim at first [rad]."""


@heap_kernel
def head_for(
    start: Floats, h: float, aim: tuple[float, float], offset: float, limits: Floats, controls: Floats
) -> None:
    """Fill in accelerations that turn to the aim and drive there, for the first half `offset` [rad] aside of it."""
    n = len(controls)
    z, after = start.copy(), start.copy()
    for k in range(n):
        dx, dy = aim[0] - z[0], aim[1] - z[1]
        far = np.sqrt(dx * dx + dy * dy)
        aside = offset * max(1.0 - 2.0 * k / n, 0.0)
        error = wrap(atan2(dy, dx) + aside - z[2])
        top = min(limits[0], np.sqrt(2.0 * limits[2] * far))
        v, w = top * max(1.0 - abs(error), 0.0), min(max(2.0 * error, -limits[1]), limits[1])
        if limits[4] < np.inf:
            v = max(v, 0.5 * top)
            w = min(max(w, -limits[4] * v), limits[4] * v)
        controls[k, 0] = min(max((v - z[3]) / h, -limits[2]), limits[2])
        controls[k, 1] = min(max((w - z[4]) / h, -limits[3]), limits[3])
        move(z, controls[k, 0], controls[k, 1], h, after)
        z[:] = after


@heap_kernel
def plan(
    controls: Floats,
    start: Floats,
    h: float,
    aim: tuple[float, float],
    limits: Floats,
    world: World,
    weights: Floats,
    iterations: int,
) -> float:
    """Replace accelerations by the best that were found from them or from other starts, and return their cost."""
    n = len(controls)
    states, gradients, hessians = np.empty((n + 1, 5)), np.zeros((n + 1, 5)), np.zeros((n + 1, 5, 5))
    fresh, other = np.empty((n, 2)), np.empty((n, 2))
    states[0] = start
    least = _WORST
    for m in range(len(_OFFSETS) + 1):
        if m < len(_OFFSETS):
            head_for(start, h, aim, _OFFSETS[m], limits, other)
        else:
            brake(start, h, limits, other)
        cost = drive(other, h, aim, limits, world, weights, states, gradients, hessians)
        if cost < least:
            least = cost
            fresh[:] = other
    kept = improve(controls, start, h, aim, limits, world, weights, iterations)
    least = improve(fresh, start, h, aim, limits, world, weights, iterations)
    if least < kept:
        controls[:] = fresh
    return min(least, kept)


@kernel
def brake(start: Floats, h: float, limits: Floats, controls: Floats) -> None:
    """Fill in the accelerations that stop the robot."""
    v, w = start[3], start[4]
    for k in range(len(controls)):
        controls[k, 0] = min(max(-v / h, -limits[2]), limits[2])
        controls[k, 1] = min(max(-w / h, -limits[3]), limits[3])
        v += controls[k, 0] * h
        w += controls[k, 1] * h


@kernel
def shift(controls: Floats, steps: float) -> None:
    """Move accelerations on by this many of their steps; after their end they are zero."""
    n = len(controls)
    for k in range(n):
        at = k + min(steps, 1e6)
        first = int(at)
        share = at - first
        for i in range(2):
            now = controls[first, i] if first < n else 0.0
            after = controls[first + 1, i] if first + 1 < n else 0.0
            controls[k, i] = (1.0 - share) * now + share * after


OPTIONS: Options = {
    "n_steps": (20, 2, 500, ""),  # length of the horizon in steps
    "step": (0.2, 0.01, 1.0, "s"),  # length of a step; accelerations are constant in it
    "iterations": (10, 1, 200, ""),  # quadratic programs solved for each of two plans
    "progress": (2.0, 0.0, 1e6, ""),  # cost of a metre to the aim, averaged over the way
    "arrival": (1.0, 0.0, 1e6, ""),  # ... at the end
    "nearness": (40.0, 0.0, 1e9, ""),  # cost of the square metre that a gap lacks to `comfort`, each step
    "effort": (3e-4, 1e-6, 1e6, ""),  # cost of accelerations at their limits, each step
    "bounds": (50.0, 0.0, 1e9, ""),  # cost of the square by which speeds exceed their limits, each step
    "comfort": (0.08, 0.001, 10.0, "m"),  # gaps above this cost nothing
    "margin": (0.02, 0.0, 10.0, "m"),  # the robot's radius is enlarged by it
    "lookahead": (1.5, 0.0, 100.0, "m"),  # with a map or a path: heads for what is so far along the way; 0: the goal
    "halt_time": (0.5, 0.0, 10.0, "s"),  # brake if it would run into an obstacle or wall within this time; 0: never
    "halt_margin": (0.01, 0.0, 10.0, "m"),  # ... or come this near to it
}


class Mpc:
    """Predictive control of a unicycle, or car, among obstacles that are taken to keep their speed and yaw rate.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    def __init__(self, **options: float) -> None:
        o = self._options = settled("mpc", OPTIONS, options)
        self._weights = np.array([o.progress, o.arrival, o.nearness, o.effort, o.bounds])
        self._controls = np.zeros((o.n_steps, 2))
        self._places, self._reaches = np.empty((o.n_steps + 1, 0, 2)), np.empty(0)
        self._limits = np.zeros(5)
        self._surroundings, self._route = Surroundings(), Route(o.margin)
        self._last = math.nan

    def reset(self, task: Task) -> None:
        """Begin a case: plan to keep the speeds."""
        limits, robot = task.limits, task.robot
        bend = math.inf
        if robot.kind == "car":
            bend = math.tan(max(min(robot.steering, 1.4), 0.05)) / max(robot.wheelbase, 1e-3)
        self._limits = np.array([limits.speed, limits.yaw_rate, limits.acceleration, limits.yaw_acceleration, bend])
        self._controls[:] = 0.0
        self._route.begin()
        self._last = math.nan

    def observe(self, observation: Observation) -> Command:
        """Return the speeds after the first step of the improved plan; at the goal it stops."""
        task, robot, o = observation.task, observation.robot, self._options
        elapsed = observation.time - self._last
        self._last = observation.time
        self._surroundings.look(observation)
        walls = self._surroundings.walls
        aim = self._route.aim(observation, walls, o.lookahead)
        _, _, _, speed = towards(observation, aim)
        if speed == 0.0:
            return Command(0.0, 0.0)
        if elapsed > 0.0:
            shift(self._controls, elapsed / o.step)
        radius, top = task.robot_radius + o.margin, task.limits.speed
        # Walls of a map are read from its distances, those of a scan as discs
        reach = radius + o.comfort + top * len(self._controls) * o.step
        obstacles = self._surroundings.with_scan(observation, reach)
        if len(obstacles) > len(self._reaches):
            self._places = np.empty((len(self._controls) + 1, len(obstacles), 2))
            self._reaches = np.empty(len(obstacles))
        n = extrapolate(robot, obstacles, top, radius, o.comfort, o.step, self._places, self._reaches)
        world = self._places, self._reaches, n, walls.distances, walls.frame, radius, o.comfort
        start = np.array(robot, np.float64)
        plan(self._controls, start, o.step, aim[:2], self._limits, world, self._weights, o.iterations)
        v = min(max(float(robot[3]) + float(self._controls[0, 0]) * o.step, 0.0), speed)
        w = float(robot[4]) + float(self._controls[0, 1]) * o.step
        w = min(max(w, -task.limits.yaw_rate), task.limits.yaw_rate)
        if self._surroundings.must_halt(observation, v, w, o.halt_time, o.halt_margin):
            v = 0.0
        return Command(v, w)

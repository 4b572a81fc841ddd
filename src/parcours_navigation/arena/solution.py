"""Proves that a case can be solved: commands with which a unicycle does solve it in the simulated world.

A way is traced back through the inner set, pulled straight where nothing is in the way, and followed by a simple
controller that sees where the way goes on. Only what the world then measured counts: the goal reached within the
limit, no contact before. None found is no proof of anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours_navigation.arena.lattice import EDGE, ROWS, WORDS, grow_inner, has, lay_points, near_goal
from parcours_navigation.arena.reachable import arrival, begin_set, leg_is_free, nanoseconds, take_obstacles_inner
from parcours_navigation.arena.world import NEVER, TICK, WORLD, advance, begin

PERIOD = 50_000_000
"""A command holds for this long [ns]."""

ATTEMPTS = (
    (1.0, 0.03, 0.5),
    (0.9, 0.05, 0.5),
    (0.9, 0.02, 0.5),
    (0.8, 0.1, 0.5),
    (0.75, 0.03, 0.5),
    (1.0, 0.0, 0.5),
    (0.6, 0.02, 0.5),
    (0.6, 0.08, 0.5),
    (0.85, 0.01, 0.25),
    (0.7, 0.005, 0.25),
    (0.7, 0.0, 0.2),
    (0.5, 0.0, 0.2),
)
"""What is tried in turn: (share of top speed planned with, clearance kept by the plan [m], look-ahead [s]).

The controller heads for where the way will be a look-ahead later."""

CLOSE = 0.06
"""Nearer to that place than CLOSE * look-ahead [m] the controller waits, and turns towards where the way goes on."""


@dataclass(frozen=True, slots=True)
class Body:
    """The unicycle that is to find a way.

    Attributes:
        heading: at time 0 [rad].
        speed: at time 0 [m/s].
        w_max: top yaw rate [rad/s].
        a_max: acceleration limit [m/s2].
        alpha_max: yaw acceleration limit [rad/s2].
    """

    heading: float = 0.7853981633974483
    speed: float = 0.249
    w_max: float = 1.5707963267948966
    a_max: float = 1.0
    alpha_max: float = 2.0943951023931953


@dataclass(frozen=True, slots=True)
class Witness:
    """A drive that solves a case.

    Attributes:
        commands: (v, w) [m/s, rad/s], one for every PERIOD from time 0, shape (n, 2).
        arrival: when the world found the goal reached [s].
        clearance: least gap to any obstacle up to then [m].
    """

    commands: NDArray[np.float64]
    arrival: float
    clearance: float


def witness(
    obstacles: Record,
    body: Body | None = None,
    *,
    start: tuple[float, float] = (0.0, 0.0),
    goal: tuple[float, float] = (2.0, 2.0),
    tolerance: float = 0.2,
    limit: float = 21.0,
    v_max: float = 0.25,
    robot_radius: float = 0.125,
) -> list[Witness | None]:
    """Return for each case a drive that solves it, or None where none was found.

    Args:
        obstacles: array of OBSTACLE, shape (n, n_obstacles).
        body: the unicycle; by default that of the system study.
        start: the robot's centre at time 0 [m].
        goal: [m].
        tolerance: nearer to the goal than this counts as reached [m].
        limit: time allowed from time 0 [s].
        v_max: the robot's top speed [m/s].
        robot_radius: [m].

    >>> from parcours_navigation.arena.obstacles import OBSTACLE
    >>> drive = witness(np.zeros((1, 0), OBSTACLE))[0]
    >>> drive is not None and 10.5 < drive.arrival < 10.7
    True
    """
    body = body or Body()
    plans = [lay_points(start, goal, tolerance, limit, v_max * share, robot_radius) for share, _, _ in ATTEMPTS]
    nears = [near_goal(plan) for plan in plans]
    longest = max(int(plan.n_steps) for plan in plans)
    history = np.zeros((longest + 1, WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    wide = np.zeros((4, WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    way = np.zeros((longest + 2, 3))
    commands = np.zeros((int(limit * 1e9) // PERIOD + 1, 2))
    worlds = _worlds(body, start, goal, tolerance, v_max, robot_radius)
    found: list[Witness | None] = []
    for case in obstacles:
        drive: Witness | None = None
        for plan, near, (_, margin, ahead) in zip(plans, nears, ATTEMPTS, strict=True):
            n = _plan_way(case, plan, near, margin, history, wide, way)
            if n:
                n = _pull_straight(case, way[:n], robot_radius + margin, nanoseconds(0.5 * plan.step))
                world = worlds.copy()[0]
                used = _follow(case.copy(), world, way[:n], nanoseconds(limit), ahead, commands)
                if used:
                    drive = Witness(commands[:used].copy(), float(world.t_goal) * 1e-9, float(world.min_clearance))
                    break
        found.append(drive)
    return found


def _worlds(
    body: Body,
    start: tuple[float, float],
    goal: tuple[float, float],
    tolerance: float,
    v_max: float,
    robot_radius: float,
) -> Record:
    """Return the world at time 0, array of WORLD, shape (1,)."""
    world = np.zeros(1, WORLD)
    robot = world["robot"]
    robot["x"], robot["y"] = start
    robot["heading"], robot["v"], robot["command_v"] = body.heading, body.speed, body.speed
    robot["v_max"], robot["w_max"], robot["a_max"] = v_max, body.w_max, body.a_max
    robot["alpha_max"], robot["radius"] = body.alpha_max, robot_radius
    world["goal_x"], world["goal_y"] = goal
    world["goal_tolerance"] = tolerance
    return world.view(np.recarray)


@kernel
def _plan_way(
    obstacles: Record, plan: Record, near: Record, margin: float, history: Record, wide: Record, way: Record
) -> int:
    """Write a way through the inner set as rows (x, y, time) [m, m, s]; return how many, 0 if there is none."""
    for k in range(plan.n_steps + 1):
        bits = history[k]
        if k == 0:
            begin_set(bits, plan)
        else:
            bits[:] = history[k - 1]
            grow_inner(bits, wide)
        take_obstacles_inner(bits, plan, obstacles, k, margin)
        when, x, y = arrival(bits, near, plan, obstacles, k, plan.robot_radius + margin)
        if when < np.inf:
            return _trace_back(plan, history, k, when, x, y, way)
    return 0


@kernel
def _trace_back(plan: Record, history: Record, k: int, when: float, x: float, y: float, way: Record) -> int:
    """Write the way that ends with a leg from (x, y) [m] at step k; each step turns as little as it can."""
    dx, dy = plan.goal_x - x, plan.goal_y - y
    far = np.sqrt(dx * dx + dy * dy)
    share = max(far - plan.tolerance + 1e-6, 0.0) / far if far > 0.0 else 0.0
    way[k + 1, 0], way[k + 1, 1], way[k + 1, 2] = x + share * dx, y + share * dy, when
    column = int(np.rint((x - plan.x0) / plan.spacing))
    row = int(np.rint((y - plan.y0) / plan.spacing))
    forward = plan.v_max * plan.step / plan.spacing / far if far > 0.0 else 0.0
    last_i, last_j = forward * dx, forward * dy
    while True:
        way[k, 0], way[k, 1] = plan.x0 + column * plan.spacing, plan.y0 + row * plan.spacing
        way[k, 2] = k * plan.step
        if k == 0:
            break
        k -= 1
        least, best_i, best_j = np.inf, 0, 0
        for j in range(-4, 5):
            for i in range(-4, 5):
                c, r = column - i, row - j
                if i * i + j * j > 18 or not (0 <= c < 64 * WORDS and 0 <= r < ROWS) or not has(history[k], c, r):
                    continue
                turn = (i - last_i) * (i - last_i) + (j - last_j) * (j - last_j)
                if turn < least:
                    least, best_i, best_j = turn, i, j
        column, row = column - best_i, row - best_j
        last_i, last_j = float(best_i), float(best_j)
    n = 1
    while way[n, 2] < when:
        n += 1
    return n + 1


@kernel
def _pull_straight(obstacles: Record, way: Record, robot_radius: float, piece: int) -> int:
    """Leave out points past which a straight leg at constant speed is free; return how many points stay."""
    n, kept, a = len(way), 1, 0
    while a < n - 1:
        b = n - 1
        while b > a + 1:
            t0, t1 = nanoseconds(way[a, 2]), nanoseconds(way[b, 2])
            rate = 1.0 / (way[b, 2] - way[a, 2])
            vx, vy = (way[b, 0] - way[a, 0]) * rate, (way[b, 1] - way[a, 1]) * rate
            if leg_is_free(obstacles, robot_radius, way[a, 0], way[a, 1], vx, vy, t0, t1, piece):
                break
            b -= 1
        way[kept] = way[b]
        kept, a = kept + 1, b
    return kept


@kernel
def _place_on(way: Record, time: float, beyond: float) -> tuple[float, float]:
    """Return where the way is at a time [s]; past its end it goes on for `beyond` [s], so that the goal is entered."""
    n = len(way)
    time = min(time, way[n - 1, 2] + beyond)
    k = 1
    while k < n - 1 and way[k, 2] < time:
        k += 1
    lasts = way[k, 2] - way[k - 1, 2]
    share = (time - way[k - 1, 2]) / lasts if lasts > 0.0 else 1.0
    return way[k - 1, 0] + share * (way[k, 0] - way[k - 1, 0]), way[k - 1, 1] + share * (way[k, 1] - way[k - 1, 1])


@kernel
def _command(way: Record, robot: Record, time: float, ahead: float) -> tuple[float, float]:
    """Return (v, w) [m/s, rad/s] towards where the way will be."""
    x, y = _place_on(way, time + ahead, ahead)
    ex, ey = x - robot.x, y - robot.y
    far = np.sqrt(ex * ex + ey * ey)
    close = CLOSE * ahead
    waits = far < close
    later = ahead
    while ex * ex + ey * ey < close * close and later < 3.0:
        later += 0.25
        x, y = _place_on(way, time + later, 3.0)
        ex, ey = x - robot.x, y - robot.y
    angle = wrap(atan2(ey, ex) - robot.heading)
    _, c = sin_cos(angle)
    v = 0.0 if waits else min(far / ahead * max(c, 0.0), robot.v_max)
    w = min(4.0 * abs(angle), np.sqrt(1.6 * robot.alpha_max * abs(angle)), robot.w_max)
    return v, w if angle > 0.0 else -w


@kernel
def _follow(obstacles: Record, world: Record, way: Record, limit: int, ahead: float, commands: Record) -> int:
    """Follow the way in the world, keep the commands; return how many bring it to the goal untouched, or 0."""
    begin(world, obstacles)
    k = 0
    while world.now < limit:
        v, w = _command(way, world.robot, world.now * 1e-9, ahead)
        world.robot.command_v = commands[k, 0] = v
        world.robot.command_w = commands[k, 1] = w
        k += 1
        until = min(world.now + PERIOD, limit)
        while world.now + TICK <= until:
            advance(world, obstacles, world.now + TICK)
            if world.t_contact != NEVER:
                return 0
            if world.t_goal != NEVER:
                return k
        if world.now + TICK > limit:
            return 0
    return 0

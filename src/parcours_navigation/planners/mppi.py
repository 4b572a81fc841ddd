"""MPPI: the first speeds of a plan that random futures keep improving.

Sequences of speeds are drawn around the last plan and driven within the limits; the new plan is their average with
weights exp(-cost / temperature): Williams, Wagener, Goldfain, Drews, Rehg, Boots, Theodorou, Information theoretic MPC
for model-based reinforcement learning, ICRA 2017, algorithm 2. Obstacles are extrapolated at constant (v, w), and
contact is found in continuous time.
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import TAU, exp, log, sin_cos
from parcours.kernels import kernel
from parcours.streams import Stream, below, start, uniform
from parcours_navigation.arena.contact import gap_square
from parcours_navigation.planners.motion import Options, extrapolate, runs_into, settled, sin_cos_each
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import Command, Floats, Observation, Task

_PURPOSE = np.uint64(7)
_POOL = 8192
_WORD = (1 << 64) - 1
_HALT_STEP = 0.1

_CRUISE = 0.6
"""Fresh sequences are drawn around this share of top speed, straight ahead."""
_ROUNDED = 1.0 + 1e-6  # more than rounding takes from a distance
_MOVING = 1e-3
"""A robot that moves less than this in a step closes no gap [m]."""
COLLISION, PROGRESS, HEADING, GAP, CONTROL = range(5)
"""Columns of the weights of a future's cost."""
X, Y, HEADING_NOW, V, W, DX, DY, NEAR = range(8)
"""What is known of all futures at each step: place, heading and speeds before it, its move, whether that is near."""
LANES = 8


@kernel
def draw_pool(stream: Stream, pool: Floats) -> None:
    """Fill the array with standard normal numbers (Box and Muller 1958); shape (n,), n even."""
    for k in range(0, len(pool) - 1, 2):
        radius = np.sqrt(-2.0 * log(1.0 - uniform(stream)))
        s, c = sin_cos(TAU * uniform(stream))
        pool[k], pool[k + 1] = radius * c, radius * s


@kernel
def shift_plan(plan: Floats, steps: float) -> None:
    """Move the plan on by this many of its steps, not whole in general; its end is held."""
    last = plan.shape[0] - 1
    for t in range(last + 1):
        at = min(t + steps, float(last))
        k = min(int(at), last)
        share = at - k
        after = min(k + 1, last)
        plan[t, 0] = (1.0 - share) * plan[k, 0] + share * plan[after, 0]
        plan[t, 1] = (1.0 - share) * plan[k, 1] + share * plan[after, 1]


@kernel
def sample(
    plan: Floats, top: float, spread: Floats, fresh: float, stream: Stream, pool: Floats, samples: Floats, bends: Floats
) -> None:
    """Fill in sequences of speeds: the plan itself, the plan braking, some fresh ones, and the plan disturbed.

    `spread` is the standard deviation of v and w, and the correlation of one step with the next. Where a sequence
    starts in the pool of standard normal numbers is drawn from the stream. `samples` receives the sequences, shape
    (n_samples, n_steps, 2), `bends` the sum of plan times disturbance over variance, the cost of control.
    """
    n_samples, n_steps = samples.shape[0], samples.shape[1]
    rest = np.sqrt(1.0 - spread[2] * spread[2])
    n_kept = n_samples - int(fresh * n_samples)
    for k in range(n_samples):
        bends[k] = 0.0
        at = below(stream, len(pool) - 2 * n_steps)
        e_v, e_w = pool[at], pool[at + 1]
        for t in range(n_steps):
            if t > 0:
                e_v = spread[2] * e_v + rest * pool[at + 2 * t]
                e_w = spread[2] * e_w + rest * pool[at + 2 * t + 1]
            if k == 0:
                samples[k, t, 0], samples[k, t, 1] = plan[t, 0], plan[t, 1]
            elif k == 1:
                samples[k, t, 0], samples[k, t, 1] = 0.0, plan[t, 1]
            elif k < n_kept:
                samples[k, t, 0], samples[k, t, 1] = plan[t, 0] + spread[0] * e_v, plan[t, 1] + spread[1] * e_w
                bends[k] += plan[t, 0] * e_v / spread[0] + plan[t, 1] * e_w / spread[1]
            else:
                samples[k, t, 0], samples[k, t, 1] = _CRUISE * top + spread[0] * e_v, spread[1] * e_w


@kernel
def average(samples: Floats, costs: Floats, temperature: float, plan: Floats) -> None:
    """Set the plan to the average of the samples with weights exp(-cost / temperature); costs become weights."""
    least, total = np.inf, 0.0
    for k in range(len(costs)):
        least = min(least, costs[k])
    for k in range(len(costs)):
        costs[k] = exp(-min((costs[k] - least) / temperature, 60.0))
        total += costs[k]
    for t in range(plan.shape[0]):
        v, w = 0.0, 0.0
        for k in range(len(costs)):
            v += costs[k] * samples[k, t, 0]
            w += costs[k] * samples[k, t, 1]
        plan[t, 0], plan[t, 1] = v / total, w / total


@kernel
def _limit(wanted: Floats, before: Floats, reach: float, low: float, high: float, after: Floats) -> None:
    """Fill in the speeds that the limits let each future have after a step: `reach` from those before, low to high."""
    for k in range(len(after)):
        after[k] = min(max(min(max(wanted[k], before[k] - reach), before[k] + reach), low), high)


@kernel
def _turn(w: Floats, new_w: Floats, heading: Floats, step: float, middle: Floats, new_heading: Floats) -> None:
    """Fill in each future's heading after a step and in its middle [rad]."""
    for k in range(len(w)):
        turn = 0.5 * (w[k] + new_w[k]) * step
        middle[k] = heading[k] + 0.5 * turn
        new_heading[k] = heading[k] + turn


@kernel
def _move(v: Floats, new_v: Floats, step: float, dx: Floats, dy: Floats) -> None:
    """Turn (cos, sin) of each future's direction in a step into how it moves [m]."""
    for k in range(len(v)):
        way = 0.5 * (v[k] + new_v[k]) * step
        dx[k] = way * dx[k]
        dy[k] = way * dy[k]


@kernel
def _note_near(
    x: Floats, y: Floats, dx: Floats, dy: Floats, px: float, py: float, qx: float, qy: float, reach: float, near: Floats
) -> None:
    """Set `near` to 1 where a future comes within `reach` of an obstacle that moves from p to q meanwhile [m]."""
    for k in range(len(near)):
        square = gap_square(px - x[k], py - y[k], qx - x[k] - dx[k], qy - y[k] - dy[k])
        near[k] = 1.0 if square < reach * reach else near[k]


@kernel
def _drive(
    robot: Floats, samples: Floats, limits: Floats, world: tuple[Floats, Floats, int, float], comfort: float,
    lanes: Floats,
) -> None:  # fmt: skip
    """Drive all futures side by side, each in a lane, within the limits, and note where they come near to obstacles.

    Fills in the rows of `lanes`: see V and those below it.
    """
    #            lane  0 │ 1 │ 2 │ ... n_samples     one instruction of the processor moves several futures on:
    #   step 0   ────────┼───┼───┼───                nothing that it does for one depends on another, or on where
    #   step 1   ────────┼───┼───┼───                that one is
    places, reaches, n, step = world
    n_samples, n_steps = samples.shape[0], samples.shape[1]
    for k in range(n_samples):
        lanes[X, 0, k], lanes[Y, 0, k], lanes[HEADING_NOW, 0, k] = robot[0], robot[1], robot[2]
        lanes[V, 0, k], lanes[W, 0, k] = robot[3], robot[4]
    for t in range(n_steps):
        x, y, dx, dy, near = lanes[X, t], lanes[Y, t], lanes[DX, t], lanes[DY, t], lanes[NEAR, t]
        for k in range(n_samples):
            dx[k], dy[k] = samples[k, t, 0], samples[k, t, 1]
        _limit(dx, lanes[V, t], limits[2] * step, 0.0, limits[0], lanes[V, t + 1])
        _limit(dy, lanes[W, t], limits[3] * step, -limits[1], limits[1], lanes[W, t + 1])
        _turn(lanes[W, t], lanes[W, t + 1], lanes[HEADING_NOW, t], step, near, lanes[HEADING_NOW, t + 1])
        sin_cos_each(near, dy, dx)
        _move(lanes[V, t], lanes[V, t + 1], step, dx, dy)
        near[:] = 0.0
        far = (t + 1) * step * max(limits[0], abs(robot[3]))  # no future has come farther than this
        for i in range(n):
            px, py, qx, qy = places[t, i, 0], places[t, i, 1], places[t + 1, i, 0], places[t + 1, i, 1]
            square, reach = gap_square(px - robot[0], py - robot[1], qx - robot[0], qy - robot[1]), reaches[i] + comfort
            if not square > (far + reach) * (far + reach) * _ROUNDED + _ROUNDED - 1.0:
                _note_near(x, y, dx, dy, px, py, qx, qy, reach, near)
        for k in range(n_samples):
            lanes[X, t + 1, k] = x[k] + dx[k]
        for k in range(n_samples):
            lanes[Y, t + 1, k] = y[k] + dy[k]


@kernel
def _cost(
    k: int, goal_x: float, goal_y: float, world: tuple[Floats, Floats, int, float], weights: Floats, comfort: float,
    lanes: Floats, controls: Floats,
) -> float:  # fmt: skip
    """Return the cost of one future that was driven, and fill in the speeds it had, up to where it runs into something.

    `controls` are v, w [m/s, rad/s] at the end of each step, shape (n_steps, 2).
    """
    places, reaches, n, step = world
    n_steps = controls.shape[0]
    least, cost = comfort, 0.0
    touched = False
    for t in range(n_steps):
        controls[t, 0], controls[t, 1] = lanes[V, t + 1, k], lanes[W, t + 1, k]
        if lanes[NEAR, t, k] == 0.0:
            continue
        x, y, dx, dy = lanes[X, t, k], lanes[Y, t, k], lanes[DX, t, k], lanes[DY, t, k]
        way = 0.5 * (lanes[V, t, k] + lanes[V, t + 1, k]) * step
        for i in range(n):
            x0, y0 = places[t, i, 0] - x, places[t, i, 1] - y
            x1, y1 = places[t + 1, i, 0] - x - dx, places[t + 1, i, 1] - y - dy
            square = gap_square(x0, y0, x1, y1)
            if square < (reaches[i] + least) * (reaches[i] + least):
                least = min(least, np.sqrt(square) - reaches[i])
                if square < reaches[i] * reaches[i]:
                    urgency = 1.0 - t / n_steps
                    if way > _MOVING and dx * (x0 + x1) + dy * (y0 + y1) > 0.0:
                        return float(cost + weights[COLLISION] * (1.0 + urgency) + weights[PROGRESS])
                    if not touched:
                        touched = True
                        cost += weights[COLLISION] * 0.5 * urgency
    to_x, to_y = goal_x - lanes[X, n_steps, k], goal_y - lanes[Y, n_steps, k]
    far = float(np.sqrt(to_x * to_x + to_y * to_y))
    s, c = sin_cos(lanes[HEADING_NOW, n_steps, k])
    off = 1.0 - (c * to_x + s * to_y) / max(far, 1e-9)
    cost += weights[PROGRESS] * far + weights[HEADING] * off * min(far, 1.0)
    return float(cost + weights[GAP] * (1.0 - max(least, 0.0) / comfort))


@kernel
def score(
    robot: Floats,
    goal: tuple[float, float],
    limits: Floats,
    world: tuple[Floats, Floats, int, float],
    weights: Floats,
    comfort: float,
    samples: Floats,
    costs: Floats,
    lanes: Floats,
) -> None:
    """Add the cost of each future to that of its control, and replace its speeds by those that the limits allow.

    `samples` are v, w [m/s, rad/s] to have at the end of each step, shape (n_samples, n_steps, 2); `limits` speed, yaw
    rate, acceleration, yaw acceleration; `world` is places, reaches, n and step of `extrapolate`, an instant after each
    step; `lanes` is memory, shape (LANES, n_steps + 1, n_samples).
    """
    _drive(robot, samples, limits, world, comfort, lanes)
    for k in range(samples.shape[0]):
        cost = _cost(k, goal[0], goal[1], world, weights, comfort, lanes, samples[k])
        costs[k] = cost + weights[CONTROL] * costs[k]


@kernel
def improve(
    robot: Floats, goal: tuple[float, float], limits: Floats, world: tuple[Floats, Floats, int, float],
    weights: Floats, comfort: float, noise: tuple[Floats, float, float], stream: Stream, pool: Floats, plan: Floats,
    samples: Floats, costs: Floats, lanes: Floats,
) -> None:  # fmt: skip
    """Replace the plan by the average of futures around it: `sample`, `score` and `average` in one call.

    `noise` is spread and fresh of `sample`, and the temperature of `average`.
    """
    spread, fresh, temperature = noise
    sample(plan, limits[0], spread, fresh, stream, pool, samples, costs)
    score(robot, goal, limits, world, weights, comfort, samples, costs, lanes)
    average(samples, costs, temperature, plan)


OPTIONS: Options = {
    "n_samples": (64, 4, 100_000, ""),  # futures drawn for each command
    "n_steps": (15, 1, 1000, ""),  # length of a future in steps
    "step": (0.2, 0.01, 1.0, "s"),  # length of a step; robot and obstacles are taken to move straight in it
    "temperature": (0.01, 1e-9, 1e6, ""),  # futures dearer than the cheapest by this count 1/e [cost]
    "speed_spread": (0.2, 1e-6, 100.0, "m/s"),  # standard deviation of the speed's disturbance
    "yaw_rate_spread": (0.6, 1e-6, 100.0, "rad/s"),  # ... of the yaw rate's
    "smooth": (0.8, 0.0, 1.0, ""),  # correlation of a disturbance with the one a step before
    "fresh": (0.2, 0.0, 0.9, ""),  # share of the futures that do not start from the last plan
    # cost of running into an obstacle at the end of a future, twice that if at once; an obstacle that runs into the
    # robot costs up to half of it
    "collision": (3.0, 0.0, 1e6, ""),
    "progress": (1.0, 0.0, 1e6, ""),  # cost of each metre left to the goal at the end of a future
    "heading": (0.2, 0.0, 1e6, ""),  # cost of looking a right angle away from the goal then
    "gap": (0.25, 0.0, 1e6, ""),  # cost of touching; less linearly down to none at `comfort`
    "control": (1e-4, 0.0, 1e6, ""),  # weight of the plan times its disturbance over the variance, summed
    "comfort": (0.1, 0.001, 10.0, "m"),  # gaps above this cost nothing
    "lookahead": (1.0, 0.0, 100.0, "m"),  # with a map or a path: heads for what is so far along the way; 0: the goal
    "margin": (0.02, 0.0, 10.0, "m"),  # the robot's radius is enlarged by it
    "halt_time": (0.5, 0.0, 10.0, "s"),  # brake if it would run into an obstacle within this time; 0: never
    "halt_margin": (0.01, 0.0, 10.0, "m"),  # ... or come this near to it
}


class Mppi:
    """Model predictive path integral control, among obstacles that are taken to keep their speed and yaw rate.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    def __init__(self, **options: float) -> None:
        o = self._options = settled("mppi", OPTIONS, options)
        self._noise = np.array([o.speed_spread, o.yaw_rate_spread, o.smooth]), o.fresh, o.temperature
        self._weights = np.array([o.collision, o.progress, o.heading, o.gap, o.control])
        self._stream, self._pool = np.zeros(1, np.uint64), np.empty(_POOL)
        self._plan, self._samples = np.zeros((o.n_steps, 2)), np.empty((o.n_samples, o.n_steps, 2))
        self._costs, self._lanes = np.empty(o.n_samples), np.empty((LANES, o.n_steps + 1, o.n_samples))
        self._places, self._reaches = np.empty((o.n_steps + 1, 0, 2)), np.empty(0)
        self._limits = np.zeros(4)
        self._surroundings, self._route = Surroundings(), Route(o.margin)
        self._last = math.nan

    def reset(self, task: Task) -> None:
        """Begin a case: draw its random numbers from its seed, and plan to stand."""
        limits = task.limits
        self._limits = np.array([limits.speed, limits.yaw_rate, limits.acceleration, limits.yaw_acceleration])
        start(self._stream, np.uint64(task.seed & _WORD), np.uint64(0), _PURPOSE)
        draw_pool(self._stream, self._pool)
        self._plan[:] = 0.0
        self._last = math.nan
        self._route.begin()

    def observe(self, observation: Observation) -> Command:
        """Return the first speeds of the improved plan; at the goal it stops."""
        task, robot, o = observation.task, observation.robot, self._options
        elapsed = observation.time - self._last
        self._last = observation.time
        self._surroundings.look(observation)
        aim = self._route.aim(observation, self._surroundings.walls, o.lookahead)
        _, _, _, speed = towards(observation, aim)
        if speed == 0.0:
            return Command(0.0, 0.0)
        if elapsed > 0.0:
            shift_plan(self._plan, elapsed / o.step)
        radius, top = task.robot_radius + o.margin, task.limits.speed
        obstacles = self._surroundings.with_walls(observation, radius + o.comfort + top * len(self._plan) * o.step)
        if len(obstacles) > len(self._reaches):
            self._places = np.empty((len(self._plan) + 1, len(obstacles), 2))
            self._reaches = np.empty(len(obstacles))
        n = extrapolate(robot, obstacles, top, radius, o.comfort, o.step, self._places, self._reaches)
        world = self._places, self._reaches, n, o.step
        improve(
            robot, aim[:2], self._limits, world, self._weights, o.comfort, self._noise, self._stream, self._pool,
            self._plan, self._samples, self._costs, self._lanes,
        )  # fmt: skip
        v, w = min(float(self._plan[0, 0]), speed), float(self._plan[0, 1])
        radius = task.robot_radius + o.halt_margin
        if o.halt_time > 0.0 and runs_into(robot, v, w, obstacles, radius, o.halt_time, _HALT_STEP)[1] >= 0:
            v = 0.0
        return Command(v, w)

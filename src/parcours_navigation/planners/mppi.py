"""MPPI: the first speeds of a plan that random futures keep improving.

Sequences of speeds are drawn around the last plan and driven within the limits; the new plan is their average with
weights exp(-cost / temperature): Williams, Wagener, Goldfain, Drews, Rehg, Boots, Theodorou, Information theoretic MPC
for model-based reinforcement learning, ICRA 2017, algorithm 2. Obstacles are extrapolated at constant (v, w), and
contact is found in continuous time.
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import TAU, log, sin_cos
from parcours.kernels import kernel
from parcours.streams import Stream, below, start, uniform
from parcours_navigation.arena.contact import gap_square
from parcours_navigation.planners.motion import Options, exp_each, extrapolate, runs_into, settled, sin_cos_each
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
X, Y, HEADING_NOW, V, W, DX, DY, SCRATCH, MET, LEAST, PAID, STATE = range(12)
"""What is known of all futures in a step: place, heading and speeds before and after it, the move between, room for
intermediate results, and whether anything is met; of the way so far the least gap [m], the cost of contact, a state."""
LANES = 12
Memory = tuple[Floats, Floats, Stream, Floats, Floats, Floats, Floats, Floats]
"""Places and reaches of `extrapolate`, a stream and its pool, the plan, samples, their costs, lanes."""
FREE, TOUCHED, ENDED = 0.0, 1.0, 2.0
"""No contact yet; contact that the robot did not drive into; the future runs into something and is not driven on."""


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
    least, total, width = np.inf, 0.0, plan.size
    for k in range(len(costs)):
        least = min(least, costs[k])
    for k in range(len(costs)):
        costs[k] = -min((costs[k] - least) / temperature, 60.0)
    exp_each(costs)
    speeds, rows = plan.reshape(width), samples.reshape((len(costs), width))  # v and w of all steps are averaged alike
    speeds[:] = 0.0
    for k in range(len(costs)):
        weight, row = costs[k], rows[k]
        total += weight
        for j in range(width):
            speeds[j] += weight * row[j]
    for j in range(width):
        speeds[j] /= total


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
def _look(
    now: tuple[Floats, Floats], move: tuple[Floats, Floats], px: float, py: float, qx: float, qy: float,
    squares: Floats, within: float,
) -> int:  # fmt: skip
    """Fill in the futures' least squared distances [m2] to what moves from p to q; return how many are < `within`."""
    (x, y), (dx, dy), n = now, move, 0
    for k in range(len(squares)):
        squares[k] = gap_square(px - x[k], py - y[k], qx - x[k] - dx[k], qy - y[k] - dy[k])
        n += 1 if squares[k] < within else 0
    return n


@kernel
def _note_gaps(squares: Floats, reach: float, least: Floats, met: Floats) -> None:
    """Lower the futures' least gaps [m] where these squared distances are less; set `met` to 1 on contact."""
    for k in range(len(squares)):
        is_less = squares[k] < (reach + least[k]) * (reach + least[k])
        least[k] = min(least[k], np.sqrt(squares[k]) - reach) if is_less else least[k]
        met[k] = 1.0 if squares[k] < reach * reach else met[k]


@kernel
def _step(
    t: int, robot: Floats, samples: Floats, limits: Floats, world: tuple[Floats, Floats, int, float], comfort: float,
    lanes: Floats,
) -> None:  # fmt: skip
    """Drive all futures side by side through a step, each in a lane, and note their gaps to obstacles and contact."""
    #            lane  0 │ 1 │ 2 │ ... n_samples     one instruction of the processor moves several futures on:
    #   step 0   ────────┼───┼───┼───                nothing that it does for one depends on another, or on where
    #   step 1   ────────┼───┼───┼───                that one is
    places, reaches, n, step = world
    now, after = t & 1, (t + 1) & 1
    x, y, dx, dy = lanes[X, now], lanes[Y, now], lanes[DX, 0], lanes[DY, 0]
    middle, squares, met = lanes[SCRATCH, 0], lanes[SCRATCH, 0], lanes[MET, 0]
    for k in range(len(dx)):
        dx[k], dy[k] = samples[k, t, 0], samples[k, t, 1]
    _limit(dx, lanes[V, now], limits[2] * step, 0.0, limits[0], lanes[V, after])
    _limit(dy, lanes[W, now], limits[3] * step, -limits[1], limits[1], lanes[W, after])
    _turn(lanes[W, now], lanes[W, after], lanes[HEADING_NOW, now], step, middle, lanes[HEADING_NOW, after])
    sin_cos_each(middle, dy, dx)
    _move(lanes[V, now], lanes[V, after], step, dx, dy)
    met[:] = 0.0
    far = (t + 1) * step * max(limits[0], abs(robot[3]))  # no future has come farther than this
    for i in range(n):
        px, py, qx, qy = places[t, i, 0], places[t, i, 1], places[t + 1, i, 0], places[t + 1, i, 1]
        square, reach = gap_square(px - robot[0], py - robot[1], qx - robot[0], qy - robot[1]), reaches[i] + comfort
        is_away = square > (far + reach) * (far + reach) * _ROUNDED + _ROUNDED - 1.0
        if not is_away and _look((x, y), (dx, dy), px, py, qx, qy, squares, reach * reach) > 0:
            _note_gaps(squares, reaches[i], lanes[LEAST, 0], met)
    for k in range(len(dx)):
        lanes[X, after, k] = x[k] + dx[k]
    for k in range(len(dy)):
        lanes[Y, after, k] = y[k] + dy[k]


@kernel
def _meet(
    t: int, k: int, n_steps: int, world: tuple[Floats, Floats, int, float], weights: Floats, lanes: Floats
) -> None:
    """Let a future pay for the contact that it has in a step."""
    places, reaches, n, step = world
    now, after = t & 1, (t + 1) & 1
    x, y, dx, dy = lanes[X, now, k], lanes[Y, now, k], lanes[DX, 0, k], lanes[DY, 0, k]
    way = 0.5 * (lanes[V, now, k] + lanes[V, after, k]) * step
    urgency = 1.0 - t / n_steps
    for i in range(n):
        x0, y0 = places[t, i, 0] - x, places[t, i, 1] - y
        x1, y1 = places[t + 1, i, 0] - x - dx, places[t + 1, i, 1] - y - dy
        if gap_square(x0, y0, x1, y1) < reaches[i] * reaches[i]:
            if way > _MOVING and dx * (x0 + x1) + dy * (y0 + y1) > 0.0:
                paid = lanes[PAID, 0, k] + weights[COLLISION] * (1.0 + urgency) + weights[PROGRESS]
                lanes[PAID, 0, k], lanes[STATE, 0, k] = paid, ENDED
                return
            if lanes[STATE, 0, k] == FREE:
                lanes[PAID, 0, k], lanes[STATE, 0, k] = weights[COLLISION] * 0.5 * urgency, TOUCHED


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

    `samples` are v, w [m/s, rad/s] to have at the end of each step, shape (n_samples, n_steps, 2), replaced up to where
    a future runs into something; `limits` speed, yaw rate, acceleration, yaw acceleration; `world` is places, reaches,
    n and step of `extrapolate`, an instant after each step; `lanes` is memory, shape (LANES, 2, n_samples).
    """
    n_samples, n_steps = samples.shape[0], samples.shape[1]
    for k in range(n_samples):
        lanes[X, 0, k], lanes[Y, 0, k], lanes[HEADING_NOW, 0, k] = robot[0], robot[1], robot[2]
        lanes[V, 0, k], lanes[W, 0, k] = robot[3], robot[4]
        lanes[LEAST, 0, k], lanes[PAID, 0, k], lanes[STATE, 0, k] = comfort, 0.0, FREE
    for t in range(n_steps):
        _step(t, robot, samples, limits, world, comfort, lanes)
        v, w, met, state = lanes[V, (t + 1) & 1], lanes[W, (t + 1) & 1], lanes[MET, 0], lanes[STATE, 0]
        for k in range(n_samples):
            if state[k] != ENDED:
                samples[k, t, 0], samples[k, t, 1] = v[k], w[k]
                if met[k] != 0.0:
                    _meet(t, k, n_steps, world, weights, lanes)
    last = n_steps & 1
    sines, cosines = lanes[DY, 0], lanes[DX, 0]
    sin_cos_each(lanes[HEADING_NOW, last], sines, cosines)
    for k in range(n_samples):
        cost = lanes[PAID, 0, k]
        if lanes[STATE, 0, k] != ENDED:
            to_x, to_y = goal[0] - lanes[X, last, k], goal[1] - lanes[Y, last, k]
            far = np.sqrt(to_x * to_x + to_y * to_y)
            off = 1.0 - (cosines[k] * to_x + sines[k] * to_y) / max(far, 1e-9)
            cost += weights[PROGRESS] * far + weights[HEADING] * off * min(far, 1.0)
            cost += weights[GAP] * (1.0 - max(lanes[LEAST, 0, k], 0.0) / comfort)
        costs[k] = cost + weights[CONTROL] * costs[k]


@kernel
def next_speeds(
    robot: Floats, goal: tuple[float, float], speed: float, limits: Floats, obstacles: Floats,
    around: tuple[float, float, float], shift: float, noise: tuple[Floats, float, float], weights: Floats,
    halt: tuple[float, float], memory: Memory,
) -> tuple[float, float]:  # fmt: skip
    """Move the plan on by `shift` of its steps, replace it by the average of futures around it; return its first v, w.

    No faster than `speed`, and 0 where that would run into something within a time [s] at a radius [m]: `halt`.
    `around` is the robot's radius with its margin, the comfort [m], and the length of a step [s]; `noise` is spread and
    fresh of `sample`, and the temperature of `average`.
    """
    places, reaches, stream, pool, plan, samples, costs, lanes = memory
    radius, comfort, step = around
    spread, fresh, temperature = noise
    if shift > 0.0:
        shift_plan(plan, shift)
    n = extrapolate(robot, obstacles, limits[0], radius, comfort, step, places, reaches)
    sample(plan, limits[0], spread, fresh, stream, pool, samples, costs)
    score(robot, goal, limits, (places, reaches, n, step), weights, comfort, samples, costs, lanes)
    average(samples, costs, temperature, plan)
    v, w = min(plan[0, 0], speed), plan[0, 1]
    if halt[0] > 0.0 and runs_into(robot, v, w, obstacles, halt[1], halt[0], _HALT_STEP)[1] >= 0:
        v = 0.0
    return v, w


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
        self._plan, self._limits = np.zeros((o.n_steps, 2)), np.zeros(4)
        self._memory = self._memory_for(0)
        self._surroundings, self._route = Surroundings(), Route(o.margin)
        self._last = math.nan

    def _memory_for(self, n_obstacles: int) -> Memory:
        o = self._options
        return (
            np.empty((o.n_steps + 1, n_obstacles, 2)), np.empty(n_obstacles), self._stream, self._pool, self._plan,
            np.empty((o.n_samples, o.n_steps, 2)), np.empty(o.n_samples), np.empty((LANES, 2, o.n_samples)),
        )  # fmt: skip

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
        radius = task.robot_radius + o.margin
        ahead = radius + o.comfort + task.limits.speed * o.n_steps * o.step
        obstacles = self._surroundings.with_walls(observation, ahead)
        if len(obstacles) > len(self._memory[1]):
            self._memory = self._memory_for(len(obstacles))
        v, w = next_speeds(
            robot, aim[:2], speed, self._limits, obstacles, (radius, o.comfort, o.step), elapsed / o.step, self._noise,
            self._weights, (o.halt_time, task.robot_radius + o.halt_margin), self._memory,
        )  # fmt: skip
        return Command(v, w)

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
from parcours_navigation.planners.motion import Options, extrapolate, runs_into, settled
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import Command, Floats, Observation, Task

_PURPOSE = np.uint64(7)
_POOL = 8192
_WORD = (1 << 64) - 1
_HALT_STEP = 0.1

_CRUISE = 0.6
"""Fresh sequences are drawn around this share of top speed, straight ahead."""
_MOVING = 1e-3
"""A robot that moves less than this in a step closes no gap [m]."""
COLLISION, PROGRESS, HEADING, GAP, CONTROL = range(5)
"""Columns of the weights of a future's cost."""


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
def roll_out(
    robot: Floats,
    controls: Floats,
    goal_x: float,
    goal_y: float,
    limits: Floats,
    places: Floats,
    reaches: Floats,
    n: int,
    step: float,
    weights: Floats,
    comfort: float,
) -> float:
    """Return the cost of one future, and replace its speeds by those that the robot's limits let it have.

    `controls` are v, w [m/s, rad/s] to have at the end of each step, shape (n_steps, 2); `limits` speed, yaw rate,
    acceleration, yaw acceleration; `places`, `reaches` and `n` those of `extrapolate`, an instant after each step.
    """
    n_steps = controls.shape[0]
    reach_v, reach_w = limits[2] * step, limits[3] * step
    x, y, heading, v, w = robot[0], robot[1], robot[2], robot[3], robot[4]
    least, cost = comfort, 0.0
    touched = False
    for t in range(n_steps):
        new_v = min(max(min(max(controls[t, 0], v - reach_v), v + reach_v), 0.0), limits[0])
        new_w = min(max(min(max(controls[t, 1], w - reach_w), w + reach_w), -limits[1]), limits[1])
        way, turn = 0.5 * (v + new_v) * step, 0.5 * (w + new_w) * step
        v, w = new_v, new_w
        controls[t, 0], controls[t, 1] = v, w
        s, c = sin_cos(heading + 0.5 * turn)
        heading += turn
        dx, dy = way * c, way * s
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
        x += dx
        y += dy
    to_x, to_y = goal_x - x, goal_y - y
    far = float(np.sqrt(to_x * to_x + to_y * to_y))
    s, c = sin_cos(heading)
    off = 1.0 - (c * to_x + s * to_y) / max(far, 1e-9)
    cost += weights[PROGRESS] * far + weights[HEADING] * off * min(far, 1.0)
    return float(cost + weights[GAP] * (1.0 - max(least, 0.0) / comfort))


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
def score(
    robot: Floats,
    goal: tuple[float, float],
    limits: Floats,
    world: tuple[Floats, Floats, int, float],
    weights: Floats,
    comfort: float,
    samples: Floats,
    costs: Floats,
) -> None:
    """Add the cost of each future to the cost of its control; `world` is places, reaches, n and step of `roll_out`."""
    places, reaches, n, step = world
    for k in range(samples.shape[0]):
        cost = roll_out(robot, samples[k], goal[0], goal[1], limits, places, reaches, n, step, weights, comfort)
        costs[k] = cost + weights[CONTROL] * costs[k]


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
        self._spread = np.array([o.speed_spread, o.yaw_rate_spread, o.smooth])
        self._weights = np.array([o.collision, o.progress, o.heading, o.gap, o.control])
        self._stream, self._pool = np.zeros(1, np.uint64), np.empty(_POOL)
        self._plan, self._samples = np.zeros((o.n_steps, 2)), np.empty((o.n_samples, o.n_steps, 2))
        self._costs = np.empty(o.n_samples)
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
        sample(self._plan, top, self._spread, o.fresh, self._stream, self._pool, self._samples, self._costs)
        world = self._places, self._reaches, n, o.step
        score(robot, aim[:2], self._limits, world, self._weights, o.comfort, self._samples, self._costs)
        average(self._samples, self._costs, o.temperature, self._plan)
        v, w = min(float(self._plan[0, 0]), speed), float(self._plan[0, 1])
        radius = task.robot_radius + o.halt_margin
        if o.halt_time > 0.0 and runs_into(robot, v, w, obstacles, radius, o.halt_time, _HALT_STEP)[1] >= 0:
            v = 0.0
        return Command(v, w)

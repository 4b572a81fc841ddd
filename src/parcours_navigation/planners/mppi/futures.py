"""Random futures of a unicycle among moving discs -> their average, weighed by the exponential of their cost.

Sequences of speeds are drawn around the last plan and driven within the limits; the new plan is their average with
weights exp(-cost / temperature) (Williams, Wagener, Goldfain, Drews, Rehg, Boots, Theodorou, Information
theoretic MPC for model-based reinforcement learning, ICRA 2017, algorithm 2). Obstacles are extrapolated at constant
(v, w), and contact is found in continuous time.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import TAU, exp, log, sin_cos
from parcours.kernels import kernel
from parcours.streams import Stream, below, uniform
from parcours_navigation.planners.motion import gap_square
from parcours_navigation.protocol import Floats

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

    Args:
        robot: as in `Observation.robot`, shape (5,).
        controls: v, w [m/s, rad/s] to have at the end of each step, shape (n_steps, 2).
        goal_x: where to go [m].
        goal_y: its other part [m].
        limits: speed, yaw rate, acceleration, yaw acceleration [m/s, rad/s, m/s2, rad/s2], shape (4,).
        places: where the obstacles will be [m], shape (n_steps + 1, >= n, 2).
        reaches: sums of the radii [m], shape (>= n,).
        n: how many obstacles count.
        step: length of a step [s].
        weights: of COLLISION, PROGRESS, HEADING, GAP, CONTROL, shape (5,).
        comfort: gaps above this cost nothing [m].
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

    Args:
        plan: v, w of each step [m/s, rad/s], shape (n_steps, 2).
        top: the robot's top speed [m/s].
        spread: standard deviation of v and w, and the correlation of one step with the next, shape (3,).
        fresh: share of the sequences that do not start from the plan.
        stream: where they begin in the pool is drawn from it.
        pool: standard normal numbers, shape (> 2 n_steps,).
        samples: receives the sequences, shape (n_samples, n_steps, 2).
        bends: receives the sum of plan times disturbance over variance, the cost of control, shape (n_samples,).
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
    """Set the plan to the average of the sequences with weights exp(-cost / temperature); costs become weights.

    Args:
        samples: shape (n_samples, n_steps, 2).
        costs: shape (n_samples,).
        temperature: in units of the costs.
        plan: shape (n_steps, 2).
    """
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
    goal_x: float,
    goal_y: float,
    limits: Floats,
    places: Floats,
    reaches: Floats,
    n: int,
    step: float,
    weights: Floats,
    comfort: float,
    samples: Floats,
    costs: Floats,
) -> None:
    """Add the cost of each future to the cost of its control; arguments as in `roll_out`, for n_samples futures."""
    for k in range(samples.shape[0]):
        cost = roll_out(robot, samples[k], goal_x, goal_y, limits, places, reaches, n, step, weights, comfort)
        costs[k] = cost + weights[CONTROL] * costs[k]

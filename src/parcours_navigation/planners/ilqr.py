"""iLQR: accelerations of a unicycle that cost less, by a quadratic program along the horizon in each step.

Li, Todorov, Iterative linear quadratic regulator design for nonlinear biological movement systems (ICINCO 2004), with
accelerations kept within their limits as in Tassa, Mansard, Todorov, Control-limited differential dynamic programming
(ICRA 2014), and curvatures by Gauss and Newton. Speeds, obstacles and walls are penalties.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import heap_kernel, kernel
from parcours_navigation.planners.distance import look
from parcours_navigation.protocol import Floats

_TINY = 1e-9
_ROUND = 0.05
"""A distance to the aim is rounded off this near to it [m], so that it has a curvature everywhere."""
PROGRESS, ARRIVAL, NEARNESS, EFFORT, BOUNDS = range(5)
"""Places of the weights: of the distance to the aim on the way and at the end, of gaps, accelerations, and bounds."""

World = tuple[Floats, Floats, int, Floats, Floats, float, float]
"""places, reaches, n as in `extrapolate`; distances and frame as in `look`; the robot's radius with its margin [m]; the
gap above which nothing costs [m]."""


@kernel
def move(z: Floats, a: float, alpha: float, h: float, out: Floats) -> None:
    """Fill in the state x, y, heading, v, w after a step of h [s] at constant accelerations [m/s2, rad/s2]."""
    way, turn = (z[3] + 0.5 * a * h) * h, (z[4] + 0.5 * alpha * h) * h
    s, c = sin_cos(z[2] + 0.5 * turn)
    out[0], out[1], out[2] = z[0] + way * c, z[1] + way * s, z[2] + turn
    out[3], out[4] = z[3] + a * h, z[4] + alpha * h


@kernel
def slopes(z: Floats, a: float, alpha: float, h: float, by_z: Floats, by_u: Floats) -> None:
    """Fill in the derivatives of `move` by the state, shape (5, 5), and by the accelerations, shape (5, 2)."""
    way, turn = (z[3] + 0.5 * a * h) * h, (z[4] + 0.5 * alpha * h) * h
    s, c = sin_cos(z[2] + 0.5 * turn)
    by_z[:], by_u[:] = 0.0, 0.0
    for k in range(5):
        by_z[k, k] = 1.0
    by_z[0, 2], by_z[1, 2] = -way * s, way * c
    by_z[0, 3], by_z[1, 3] = h * c, h * s
    by_z[0, 4], by_z[1, 4] = -0.5 * h * way * s, 0.5 * h * way * c
    by_z[2, 4] = h
    by_u[0, 0], by_u[1, 0], by_u[3, 0] = 0.5 * h * h * c, 0.5 * h * h * s, h
    by_u[0, 1], by_u[1, 1] = -0.25 * h * h * way * s, 0.25 * h * h * way * c
    by_u[2, 1], by_u[4, 1] = 0.5 * h * h, h


@kernel
def _hinge(value: float, by: Floats, weight: float, gradient: Floats, hessian: Floats) -> float:
    """Return weight * value**2 and add its derivatives, where `by` are those of the value, shape (5,)."""
    for i in range(5):
        gradient[i] += 2.0 * weight * value * by[i]
        for j in range(5):
            hessian[i, j] += 2.0 * weight * by[i] * by[j]
    return weight * value * value


@heap_kernel
def state_cost(
    z: Floats,
    k: int,
    last: int,
    aim: tuple[float, float],
    limits: Floats,
    world: World,
    weights: Floats,
    gradient: Floats,
    hessian: Floats,
) -> float:
    """Return what it costs to be in a state at instant k of `last`; fill in the derivatives, shapes (5,) and (5, 5).

    `limits` are speed, yaw rate, acceleration, yaw acceleration, and the greatest curvature a car can drive (inf: any).
    """
    places, reaches, n, distances, frame, radius, comfort = world
    gradient[:], hessian[:] = 0.0, 0.0
    by = np.zeros(5)
    dx, dy = z[0] - aim[0], z[1] - aim[1]
    far = np.sqrt(dx * dx + dy * dy + _ROUND * _ROUND)
    pull = weights[ARRIVAL] if k == last else weights[PROGRESS] / last
    gradient[0], gradient[1] = pull * dx / far, pull * dy / far
    hessian[0, 0], hessian[1, 1] = pull * (1.0 - dx * dx / far / far) / far, pull * (1.0 - dy * dy / far / far) / far
    hessian[0, 1] = hessian[1, 0] = -pull * dx * dy / far / far / far
    cost = pull * far
    weight = weights[NEARNESS] * (1.0 - 0.5 * k / last)
    for i in range(n):
        ox, oy = z[0] - places[k, i, 0], z[1] - places[k, i, 1]
        reach = reaches[i] + comfort
        square = ox * ox + oy * oy
        if square < reach * reach:
            away = max(np.sqrt(square), _TINY)
            by[:] = 0.0
            by[0], by[1] = -ox / away, -oy / away
            cost += _hinge(reach - away, by, weight, gradient, hessian)
    room, gx, gy = look(distances, frame, z[0], z[1])
    if room < radius + comfort:
        by[:] = 0.0
        by[0], by[1] = -gx, -gy
        cost += _hinge(radius + comfort - room, by, weights[NEARNESS], gradient, hessian)
    over_v, over_w = max(z[3] - limits[0], min(z[3], 0.0)), max(z[4] - limits[1], min(z[4] + limits[1], 0.0))
    by[:] = 0.0
    by[3] = 1.0
    if over_v != 0.0:
        cost += _hinge(over_v, by, weights[BOUNDS], gradient, hessian)
    by[3], by[4] = 0.0, 1.0
    if over_w != 0.0:
        cost += _hinge(over_w, by, weights[BOUNDS], gradient, hessian)
    if limits[4] < np.inf:
        bend = abs(z[4]) - limits[4] * max(z[3], 0.0)
        if bend > 0.0:
            by[4] = 1.0 if z[4] > 0.0 else -1.0
            by[3] = -limits[4] if z[3] > 0.0 else 0.0
            cost += _hinge(bend, by, weights[BOUNDS], gradient, hessian)
    return float(cost)


@kernel
def drive(
    controls: Floats,
    h: float,
    aim: tuple[float, float],
    limits: Floats,
    world: World,
    weights: Floats,
    states: Floats,
    gradients: Floats,
    hessians: Floats,
) -> float:
    """Return the cost of accelerations, shape (n, 2), from states[0] on; fill in states (n + 1, 5) and derivatives."""
    last = len(controls)
    cost = 0.0
    for k in range(last):
        move(states[k], controls[k, 0], controls[k, 1], h, states[k + 1])
        a, alpha = controls[k, 0] / limits[2], controls[k, 1] / limits[3]
        cost += weights[EFFORT] * (a * a + alpha * alpha)
        cost += state_cost(states[k + 1], k + 1, last, aim, limits, world, weights, gradients[k + 1], hessians[k + 1])
    return cost


@kernel
def _box(q: Floats, curve: Floats, low: Floats, high: Floats, step: Floats, is_free: Floats) -> None:
    """Fill in the step within a box that makes q.step + step.curve.step / 2 least, and which of its two parts is free.

    A part that would leave the box stays on its side, and the other one makes the best of it.
    """
    determinant = curve[0, 0] * curve[1, 1] - curve[0, 1] * curve[0, 1]
    step[0] = -(curve[1, 1] * q[0] - curve[0, 1] * q[1]) / determinant
    step[1] = -(curve[0, 0] * q[1] - curve[0, 1] * q[0]) / determinant
    is_free[:] = 1.0
    for _ in range(2):
        for i in range(2):
            if is_free[i] > 0.0 and not low[i] <= step[i] <= high[i]:
                j = 1 - i
                step[i] = low[i] if step[i] < low[i] else high[i]
                is_free[i] = 0.0
                if is_free[j] > 0.0:
                    step[j] = -(q[j] + curve[0, 1] * step[i]) / curve[j, j]


@heap_kernel
def descend(
    controls: Floats,
    states: Floats,
    h: float,
    limits: Floats,
    weights: Floats,
    gradients: Floats,
    hessians: Floats,
    damping: float,
    steps: Floats,
    gains: Floats,
) -> None:
    """Fill in the change of each acceleration, shape (n, 2), and its answer to a change of the state, (n, 2, 5).

    The backward pass of iLQR: the cost to come is a quadratic, and `damping` is added to its curvature.
    """
    n = len(controls)
    value, curve = gradients[n].copy(), hessians[n].copy()
    by_z, by_u, low, high, is_free = np.empty((5, 5)), np.empty((5, 2)), np.empty(2), np.empty(2), np.empty(2)
    q_u, q_uu, q_ux, half = np.empty(2), np.empty((2, 2)), np.empty((2, 5)), np.empty((5, 5))
    q_x, q_xx = np.empty(5), np.empty((5, 5))
    for k in range(n - 1, -1, -1):
        slopes(states[k], controls[k, 0], controls[k, 1], h, by_z, by_u)
        for i in range(5):
            for j in range(5):
                half[i, j] = 0.0
                for m in range(5):
                    half[i, j] += curve[i, m] * by_z[m, j]
        for i in range(2):
            scale = limits[2 + i] * limits[2 + i]
            q_u[i] = 2.0 * weights[EFFORT] * controls[k, i] / scale
            for m in range(5):
                q_u[i] += by_u[m, i] * value[m]
            for j in range(5):
                q_ux[i, j] = 0.0
                for m in range(5):
                    q_ux[i, j] += by_u[m, i] * half[m, j]
            for j in range(2):
                q_uu[i, j] = (2.0 * weights[EFFORT] + damping) / scale if i == j else 0.0
                for m in range(5):
                    for p in range(5):
                        q_uu[i, j] += by_u[m, i] * curve[m, p] * by_u[p, j]
            low[i], high[i] = -limits[2 + i] - controls[k, i], limits[2 + i] - controls[k, i]
        _box(q_u, q_uu, low, high, steps[k], is_free)
        _answer(q_uu, q_ux, is_free, gains[k])
        for i in range(5):
            q_x[i] = gradients[k, i]
            for m in range(5):
                q_x[i] += by_z[m, i] * value[m]
            for j in range(5):
                q_xx[i, j] = hessians[k, i, j]
                for m in range(5):
                    q_xx[i, j] += by_z[m, i] * half[m, j]
        for i in range(5):
            value[i] = q_x[i]
            for p in range(2):
                value[i] += q_ux[p, i] * steps[k, p] + gains[k, p, i] * q_u[p]
                for r in range(2):
                    value[i] += gains[k, p, i] * q_uu[p, r] * steps[k, r]
            for j in range(5):
                curve[i, j] = q_xx[i, j]
                for p in range(2):
                    curve[i, j] += q_ux[p, i] * gains[k, p, j] + gains[k, p, i] * q_ux[p, j]
                    for r in range(2):
                        curve[i, j] += gains[k, p, i] * q_uu[p, r] * gains[k, r, j]


@kernel
def _answer(q_uu: Floats, q_ux: Floats, is_free: Floats, gain: Floats) -> None:
    """Fill in how the free accelerations answer to a change of the state, shape (2, 5); the others do not."""
    gain[:] = 0.0
    determinant = q_uu[0, 0] * q_uu[1, 1] - q_uu[0, 1] * q_uu[0, 1]
    for j in range(5):
        if is_free[0] > 0.0 and is_free[1] > 0.0:
            gain[0, j] = -(q_uu[1, 1] * q_ux[0, j] - q_uu[0, 1] * q_ux[1, j]) / determinant
            gain[1, j] = -(q_uu[0, 0] * q_ux[1, j] - q_uu[0, 1] * q_ux[0, j]) / determinant
        elif is_free[0] > 0.0:
            gain[0, j] = -q_ux[0, j] / q_uu[0, 0]
        elif is_free[1] > 0.0:
            gain[1, j] = -q_ux[1, j] / q_uu[1, 1]


@heap_kernel
def improve(
    controls: Floats,
    start: Floats,
    h: float,
    aim: tuple[float, float],
    limits: Floats,
    world: World,
    weights: Floats,
    iterations: int,
) -> float:
    """Improve accelerations, shape (n, 2), from the state `start`, shape (5,), and return their cost: never a greater.

    `iterations` quadratic programs are solved, each followed by at most four drives.
    """
    n = len(controls)
    states, gradients, hessians = np.empty((n + 1, 5)), np.zeros((n + 1, 5)), np.zeros((n + 1, 5, 5))
    new_states, new_gradients, new_hessians = states.copy(), gradients.copy(), hessians.copy()
    steps, gains, trial = np.empty((n, 2)), np.empty((n, 2, 5)), np.empty((n, 2))
    states[0] = start
    new_states[0] = start
    cost = drive(controls, h, aim, limits, world, weights, states, gradients, hessians)
    damping = 1e-3
    for _ in range(iterations):
        descend(controls, states, h, limits, weights, gradients, hessians, damping, steps, gains)
        share, is_better = 1.0, False
        for _ in range(4):
            for k in range(n):
                for i in range(2):
                    u = controls[k, i] + share * steps[k, i]
                    for j in range(5):
                        u += gains[k, i, j] * (new_states[k, j] - states[k, j])
                    trial[k, i] = min(max(u, -limits[2 + i]), limits[2 + i])
                move(new_states[k], trial[k, 0], trial[k, 1], h, new_states[k + 1])
            new = drive(trial, h, aim, limits, world, weights, new_states, new_gradients, new_hessians)
            if new < cost:
                is_better = True
                break
            share *= 0.4
        if not is_better:
            damping = min(damping * 30.0, 1e6)
            continue
        gain = cost - new
        controls[:], states[:], gradients[:], hessians[:] = trial, new_states, new_gradients, new_hessians
        cost = new
        damping = max(damping * 0.3, 1e-6)
        if gain < 1e-5:
            break
    return cost

"""A band of poses and the times between them, pulled tight by Levenberg and Marquardt's method.

Rösmann, Feiten, Wösch, Hoffmann, Bertram, Trajectory modification considering dynamic constraints of autonomous robots
(ROBOTIK 2012), and Efficient trajectory optimization using a sparse model (ECMR 2013): the sum of squares of the times
and of what violates speeds, accelerations, the rolling of wheels, and gaps. Each square speaks of at most three poses
in a row, so the normal equations are a band matrix, which is decomposed in place.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import heap_kernel, kernel
from parcours_navigation.planners.distance import look
from parcours_navigation.planners.motion import travel
from parcours_navigation.protocol import Floats

X, Y, TURN, TIME = range(4)
"""Columns of a band: a pose [m, m, rad], and the time to the next one [s]; shape (n, 4)."""

TIMES, SPEEDS, ROLLING, GAPS = range(4)
"""Places of the weights: of times, of speeds and accelerations over their limits, of slipping aside, of gaps."""

WIDTH = 11
"""Numbers of the matrix in each row: acceleration links this many variables in a row."""

SHORTEST = 0.02
"""No time between two poses is less [s]."""

_TINY = 1e-9
_SLOW = 1e-3
_WAIT = 5e-3
_WALL = 5.0
"""Walls weigh so much more than obstacles, of which nobody knows where they will be."""

Setting = tuple[Floats, Floats, Floats, float, float, Floats, Floats]
"""Speed and yaw rate now, shape (2,); limits as in `mpc`, shape (5,); weights; the robot's radius [m]; the gap that
is to be kept [m]; distances to walls and their frame, as in `distance.look`."""


@kernel
def _add(by: Floats, first: int, residual: float, weight: float, matrix: Floats, right: Floats) -> None:
    """Add a weighted square to the normal equations; `by` are its residual's derivatives by the variables from `first`.

    Row k of the matrix holds the products of variable k with itself and those before it, shape (4 n, WIDTH).
    """
    for a in range(WIDTH):
        if by[a] == 0.0:
            continue
        right[first + a] -= weight * by[a] * residual
        for b in range(a + 1):
            matrix[first + a, a - b] += weight * by[a] * by[b]


@kernel
def _segment(band: Floats, i: int, by_speed: Floats, by_rate: Floats, by_aside: Floats) -> tuple[float, float, float]:
    """Return (speed, yaw rate, slip) of the way from pose i to the next, and their derivatives by variables from i on.

    On an arc the chord lies along the mean heading: what it has aside of that is slip [m].
    """
    dx, dy, dt = band[i + 1, X] - band[i, X], band[i + 1, Y] - band[i, Y], band[i, TIME]
    s, c = sin_cos(0.5 * (band[i, TURN] + band[i + 1, TURN]))
    ahead, aside = c * dx + s * dy, c * dy - s * dx
    turn = band[i + 1, TURN] - band[i, TURN]
    by_speed[:], by_rate[:], by_aside[:] = 0.0, 0.0, 0.0
    by_speed[X], by_speed[Y], by_speed[TURN], by_speed[TIME] = -c / dt, -s / dt, 0.5 * aside / dt, -ahead / dt / dt
    by_speed[4 + X], by_speed[4 + Y], by_speed[4 + TURN] = c / dt, s / dt, 0.5 * aside / dt
    by_rate[TURN], by_rate[TIME], by_rate[4 + TURN] = -1.0 / dt, -turn / dt / dt, 1.0 / dt
    by_aside[X], by_aside[Y], by_aside[TURN] = s, -c, -0.5 * ahead
    by_aside[4 + X], by_aside[4 + Y], by_aside[4 + TURN] = -s, c, -0.5 * ahead
    return ahead / dt, turn / dt, aside


@kernel
def _over(value: float, limit: float) -> float:
    """Return by which share a value is beyond its limit on either side, signed; 0 within.

    >>> _over(-3.0, 2.0), _over(1.0, 2.0)
    (-0.5, 0.0)
    """
    if value > limit:
        return value / limit - 1.0
    if value < -limit:
        return value / limit + 1.0
    return 0.0


@heap_kernel
def weigh(band: Floats, n: int, obstacles: Floats, setting: Setting, matrix: Floats, right: Floats) -> float:
    """Return the cost of the first n poses of a band, and fill in the normal equations of its squares.

    `obstacles` are rows of `Observation.obstacles`, which keep their speeds.
    """
    now, limits, weights, _radius, _comfort, _distances, _frame = setting
    matrix[: 4 * n], right[: 4 * n] = 0.0, 0.0
    v_by, w_by, a_by = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    old_v_by, old_w_by, by = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    cost, time = 0.0, 0.0
    old_v, old_w, old_dt = now[0], now[1], 0.0
    for i in range(n - 1):
        v, w, slip = _segment(band, i, v_by, w_by, a_by)
        dt, first = band[i, TIME], 4 * i
        cost += weights[TIMES] * dt * dt + weights[ROLLING] * slip * slip
        _add(a_by, first, slip, weights[ROLLING], matrix, right)
        by[:] = 0.0
        by[TIME] = 1.0
        _add(by, first, dt, weights[TIMES], matrix, right)
        fast = _over(v, limits[0])
        if v < 0.0:  # driving backward is not wanted at all
            fast = v / limits[0]
        if fast != 0.0:
            by[:] = v_by / limits[0]
            cost += weights[SPEEDS] * fast * fast
            _add(by, first, fast, weights[SPEEDS], matrix, right)
        fast = _over(w, limits[1])
        if fast != 0.0:
            by[:] = w_by / limits[1]
            cost += weights[SPEEDS] * fast * fast
            _add(by, first, fast, weights[SPEEDS], matrix, right)
        if limits[4] < np.inf:
            tight = (abs(w) - limits[4] * abs(v)) / limits[1]
            if tight > 0.0:
                sign_w, sign_v = 1.0 if w > 0.0 else -1.0, 1.0 if v >= 0.0 else -1.0
                by[:] = (sign_w * w_by - limits[4] * sign_v * v_by) / limits[1]
                cost += weights[SPEEDS] * tight * tight
                _add(by, first, tight, weights[SPEEDS], matrix, right)
        between = 0.5 * (old_dt + dt) if i > 0 else dt
        for part in range(2):
            limit = limits[2 + part]
            rate = ((v - old_v) if part == 0 else (w - old_w)) / between
            fast = _over(rate, limit)
            if fast != 0.0:
                scale = 1.0 / (between * limit)
                new_by, last_by = (v_by, old_v_by) if part == 0 else (w_by, old_w_by)
                by[:] = 0.0
                shift = 4 if i > 0 else 0
                for a in range(7):
                    by[shift + a] += new_by[a] * scale
                by[shift + TIME] -= (0.5 if i > 0 else 1.0) * rate * scale
                if i > 0:
                    for a in range(7):
                        by[a] -= last_by[a] * scale
                    by[TIME] -= 0.5 * rate * scale
                cost += weights[SPEEDS] * fast * fast
                _add(by, first - shift, fast, weights[SPEEDS], matrix, right)
        old_v, old_w, old_dt = v, w, dt
        old_v_by[:], old_w_by[:] = v_by, w_by
        time += dt
        cost += _gaps(band, i + 1, time, obstacles, setting, by, matrix, right)
    return cost


@kernel
def _gaps(
    band: Floats,
    i: int,
    time: float,
    obstacles: Floats,
    setting: Setting,
    by: Floats,
    matrix: Floats,
    right: Floats,
) -> float:
    """Return what the gaps of pose i cost, `time` [s] from now, and add their squares."""
    _, _, weights, radius, comfort, distances, frame = setting
    x, y, cost = band[i, X], band[i, Y], 0.0
    room, gx, gy = look(distances, frame, x, y)
    if room < radius + comfort:
        lack = radius + comfort - room
        by[:] = 0.0
        by[X], by[Y] = -gx, -gy
        cost += _WALL * weights[GAPS] * lack * lack
        _add(by, 4 * i, lack, _WALL * weights[GAPS], matrix, right)
    for k in range(len(obstacles)):
        ox, oy = obstacles[k, 0], obstacles[k, 1]
        if obstacles[k, 3] != 0.0:
            ox, oy = travel(ox, oy, obstacles[k, 2], obstacles[k, 3], obstacles[k, 4], time)
        reach = radius + comfort + obstacles[k, 5]
        dx, dy = x - ox, y - oy
        square = dx * dx + dy * dy
        if square < reach * reach:
            away = max(np.sqrt(square), _TINY)
            by[:] = 0.0
            by[X], by[Y] = -dx / away, -dy / away
            cost += weights[GAPS] * (reach - away) * (reach - away)
            _add(by, 4 * i, reach - away, weights[GAPS], matrix, right)
    return cost


@kernel
def solve(matrix: Floats, right: Floats, n: int) -> bool:
    """Replace the right side of the n equations of a symmetric band matrix by the solution; the matrix is spent.

    Cholesky's decomposition, row by row. Returns whether the matrix is positive definite; if not, nothing is solved.
    """
    for i in range(n):
        for back in range(min(i, WIDTH - 1), -1, -1):
            j = i - back
            total = matrix[i, back]
            for m in range(max(0, i - WIDTH + 1, j - WIDTH + 1), j):
                total -= matrix[i, i - m] * matrix[j, j - m]
            if back > 0:
                matrix[i, back] = total / matrix[j, 0]
            elif not total > 0.0:
                return False
            else:
                matrix[i, 0] = np.sqrt(total)
    for i in range(n):
        for m in range(max(0, i - WIDTH + 1), i):
            right[i] -= matrix[i, i - m] * right[m]
        right[i] /= matrix[i, 0]
    for i in range(n - 1, -1, -1):
        for m in range(i + 1, min(n, i + WIDTH)):
            right[i] -= matrix[m, m - i] * right[m]
        right[i] /= matrix[i, 0]
    return True


@kernel
def _hold(matrix: Floats, right: Floats, k: int, n: int) -> None:
    """Take variable k of n out of the equations: it keeps its value."""
    for back in range(WIDTH):
        matrix[k, back] = 0.0
        if k + back < n:
            matrix[k + back, back] = 0.0
    matrix[k, 0], right[k] = 1.0, 0.0


@heap_kernel
def tighten(
    band: Floats, n: int, obstacles: Floats, setting: Setting, iterations: int, matrix: Floats, right: Floats
) -> float:
    """Pull the first n poses tight in this many steps, and return their cost; the first pose and the last place stay.

    `matrix` and `right` are working memory, shapes (>= 4 n, WIDTH) and (>= 4 n,).
    """
    cost = weigh(band, n, obstacles, setting, matrix, right)
    old = np.empty((n, 4))
    spare_matrix, spare_right = np.empty((4 * n, WIDTH)), np.empty(4 * n)
    damping = 10.0
    for _ in range(iterations):
        spare_matrix[:], spare_right[:] = matrix[: 4 * n], right[: 4 * n]
        for k in range(4 * n):
            matrix[k, 0] += damping
        for k in (X, Y, TURN, 4 * (n - 1) + X, 4 * (n - 1) + Y, 4 * (n - 1) + TIME):
            _hold(matrix, right, k, 4 * n)
        old[:] = band[:n]
        is_better = False
        new = cost
        if solve(matrix, right, 4 * n):
            for i in range(n):
                for part in range(4):
                    band[i, part] += min(max(right[4 * i + part], -0.5), 0.5)
                band[i, TIME] = max(band[i, TIME], SHORTEST)
            new = weigh(band, n, obstacles, setting, matrix, right)
            is_better = new < cost
        if is_better:
            gain = cost - new
            cost, damping = new, max(0.2 * damping, 1e-6)
            if gain < 1e-5 * cost:
                break
        else:
            band[:n] = old
            matrix[: 4 * n], right[: 4 * n] = spare_matrix, spare_right
            damping = min(10.0 * damping, 1e6)
    return cost


@heap_kernel
def resize(band: Floats, n: int, wanted: float, least: int) -> int:
    """Return how many poses the band has once times are near to `wanted` [s]: long ones are halved, short ones joined.

    At most one pose is put in or taken out beside each; `least` poses stay, len(band) is the most.
    """
    i = 0
    while i < n - 1:
        dt = band[i, TIME]
        if dt > 1.5 * wanted and n < len(band):
            for k in range(n, i + 1, -1):
                band[k] = band[k - 1]
            n += 1
            for part in range(3):
                band[i + 1, part] = 0.5 * (band[i, part] + band[i + 2, part])
            band[i, TIME], band[i + 1, TIME] = 0.5 * dt, 0.5 * dt
            i += 1
        elif dt < 0.5 * wanted and n > least and i + 2 < n:
            band[i, TIME] = dt + band[i + 1, TIME]
            for k in range(i + 1, n - 1):
                band[k] = band[k + 1]
            n -= 1
        i += 1
    return n


@heap_kernel
def lay(band: Floats, way: Floats, heading: float, limits: Floats, wanted: float) -> int:
    """Lay a band along a way, shape (k, 2), from a pose at its start, and return how many poses it has, at least 3.

    It turns on the spot first if it has to turn much (not a car); the poses are at most len(band), as far apart as top
    speed and the `wanted` time [s] have them, or farther.
    """
    length = 0.0
    for k in range(1, len(way)):
        dx, dy = way[k, 0] - way[k - 1, 0], way[k, 1] - way[k - 1, 1]
        length += np.sqrt(dx * dx + dy * dy)
    n_legs = min(max(int(length / (limits[0] * wanted)) + 1, 2), len(band) - 4)
    band[0, X], band[0, Y], band[0, TURN] = way[0, 0], way[0, 1], heading
    n, at, gone, spacing = 1, 1, 0.0, length / n_legs
    before = heading
    for leg in range(1, n_legs + 1):
        while at < len(way) - 1 and gone + _leg(way, at) < leg * spacing:
            gone += _leg(way, at)
            at += 1
        share = min((leg * spacing - gone) / max(_leg(way, at), _TINY), 1.0)
        x = way[at - 1, 0] + share * (way[at, 0] - way[at - 1, 0])
        y = way[at - 1, 1] + share * (way[at, 1] - way[at - 1, 1])
        dx, dy = x - band[n - 1, X], y - band[n - 1, Y]
        if dx * dx + dy * dy > _TINY:
            before = before + wrap(atan2(dy, dx) - before)
        turn = abs(before - band[n - 1, TURN])
        if leg == 1 and turn > 0.5 and limits[4] == np.inf:
            band[n] = band[n - 1]
            band[n, TURN] = before
            band[n - 1, TIME] = max(turn / limits[1], SHORTEST)
            turn = 0.0
            n += 1
        band[n, X], band[n, Y], band[n, TURN] = x, y, before
        band[n - 1, TIME] = max(spacing / limits[0], turn / limits[1], SHORTEST)
        n += 1
    band[n - 1, TIME] = SHORTEST
    return n


@kernel
def _leg(way: Floats, k: int) -> float:
    dx, dy = way[k, 0] - way[k - 1, 0], way[k, 1] - way[k - 1, 1]
    return float(np.sqrt(dx * dx + dy * dy))


@kernel
def _waits(band: Floats) -> bool:
    """Return whether a band stands at its first pose for a while: a valley that descent does not leave by itself."""
    dx, dy, turn = band[1, X] - band[0, X], band[1, Y] - band[0, Y], band[1, TURN] - band[0, TURN]
    return bool(dx * dx + dy * dy < _WAIT * _WAIT and abs(turn) < 10.0 * _WAIT)


@heap_kernel
def begin_at(band: Floats, n: int, x: float, y: float, heading: float, end_x: float, end_y: float) -> int:
    """Let a band start at the robot's pose, and end at a place [m]; what it has passed is dropped; return its length.

    Of the first half of the poses the nearest one is the first, as in the paper's planner.
    """
    nearest, least = 0, np.inf
    for k in range(max(n // 2, 1)):
        dx, dy = band[k, X] - x, band[k, Y] - y
        turn = wrap(band[k, TURN] - heading)
        square = dx * dx + dy * dy + 0.01 * turn * turn
        if square < least:
            nearest, least = k, square
    if nearest > 0 and n - nearest >= 3:
        for k in range(n - nearest):
            band[k] = band[k + nearest]
        n -= nearest
    while n > 3 and _waits(band):
        for k in range(1, n - 1):
            band[k] = band[k + 1]
        n -= 1
    turned = band[0, TURN] + wrap(heading - band[0, TURN])
    band[0, X], band[0, Y], band[0, TURN] = x, y, turned
    band[n - 1, X], band[n - 1, Y] = end_x, end_y
    return n


@kernel
def speeds_of(band: Floats) -> tuple[float, float]:
    """Return the speed [m/s] and yaw rate [rad/s] from the first pose to the second."""
    dx, dy, dt = band[1, X] - band[0, X], band[1, Y] - band[0, Y], max(band[0, TIME], _SLOW)
    s, c = sin_cos(0.5 * (band[0, TURN] + band[1, TURN]))
    return (c * dx + s * dy) / dt, (band[1, TURN] - band[0, TURN]) / dt

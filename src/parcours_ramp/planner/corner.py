"""A corner between two straight legs, rounded by a quadratic Bezier curve with equal legs: geometry and speed.

With leg length d and turning angle phi the control points are C0 = corner - d*u1, C1 = corner, C2 = corner + d*u2. Put
s = sin(phi/2), c = cos(phi/2) and x = (2u - 1) s/c, the slope against the middle, and r = c sqrt(1 + x^2); then
|B'| = 2 d r, the curvature is s c / (d r^3), greatest in the middle, and the way from the middle is
d c^2 / (2 s) (x sqrt(1 + x^2) + asinh x).
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import log, sin_cos
from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import SAMPLE

_STEEPEST = math.sqrt(0.2)
AT_ONCE = 0.875  # Share of what the yaw rate may change by in a sample that the beginning of a corner takes


@kernel
def corner_rate(turn: float, parameters: Record) -> float:
    """Return the greatest constant speed on a corner per metre of leg [1/s] within the yaw limits; 0 for a hairpin.

    Args:
        turn: turning angle phi [rad], either sign.
    """
    s, c = sin_cos(0.5 * abs(turn))
    if c <= 1e-6:
        return 0.0
    if s <= 1e-9:
        return np.inf
    # Curvature begins at once: within one sample the yaw rate may change by alpha_max * SAMPLE, an eighth of which is
    # left for the climb within that sample. In between curvature changes with the way by 3 s^2 c^2 x / (d^2 r^6),
    # most where x^2 = 1/5, or at the ends of a corner too flat to have such a place.
    rate = min(parameters.w_max * c * c / s, AT_ONCE * parameters.alpha_max * SAMPLE / (s * c))
    steepest = _STEEPEST if s > _STEEPEST * c else s / c
    r_square = c * c * (1.0 + steepest * steepest)
    climbs, may_climb = 3.0 * s * s * c * c * steepest, parameters.alpha_max * r_square * r_square * r_square
    return float(rate if rate * rate * climbs <= may_climb else np.sqrt(may_climb / climbs))


@kernel
def corner_speed(leg: float, turn: float, parameters: Record) -> float:
    """Return the greatest constant speed [m/s] on the corner that keeps speed and yaw within their limits.

    Args:
        leg: leg length d [m].
        turn: turning angle phi [rad], either sign.
        parameters: PARAMETERS; v_max, w_max and alpha_max are read.
    """
    return float(min(parameters.v_max, leg * corner_rate(turn, parameters)))


@kernel
def _doubled_area(x: float) -> float:
    """Return x sqrt(1 + x^2) + asinh x for x >= 0."""
    r = np.sqrt(1.0 + x * x)
    return float(x * r + log(x + r))


@kernel
def _length(leg: float, s: float, c: float) -> float:
    """Return what `corner_length` does, from sine and cosine of half the turning angle."""
    return float(leg * c * c / s * _doubled_area(s / c)) if s > 1e-6 else 2.0 * leg


@kernel
def corner_length(leg: float, turn: float) -> float:
    """Return the length of the curve [m]."""
    s, c = sin_cos(0.5 * abs(turn))
    return _length(leg, s, c)


@kernel
def _slope_by_newton(way: float) -> float:
    """Return x >= 0 with x sqrt(1 + x^2) + asinh x = way, for way >= 0."""
    x = 0.5 * way / np.sqrt(np.sqrt(1.0 + 0.11 * way * way))
    for _ in range(4):
        x -= 0.5 * (_doubled_area(x) - way) / np.sqrt(1.0 + x * x)
    return float(x)


_PER_UNIT, _KNOWN = 32, 40
_FINE = 4


def _slopes() -> list[float]:
    """Return the slope every 1/_PER_UNIT: the solution of 2 sqrt(1 + x^2) dx = dy by Runge and Kutta's fourth order."""

    def rise(x: float) -> float:
        return 0.5 / math.sqrt(1.0 + x * x)

    x, h, slopes = 0.0, 1.0 / (_PER_UNIT * _FINE), [0.0]
    for _ in range(_KNOWN * _PER_UNIT + 1):
        for _ in range(_FINE):
            k1 = rise(x)
            k2 = rise(x + 0.5 * h * k1)
            k3 = rise(x + 0.5 * h * k2)
            x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rise(x + h * k3))
        slopes.append(x)
    return slopes


_SLOPES = np.array(_slopes())
_RISES = 0.5 / np.sqrt(1.0 + _SLOPES * _SLOPES) / _PER_UNIT
"""The slope, and its change from entry to entry, every 1/32 up to 40: interpolated between them it is exact to 1e-9."""


@kernel
def slope_at(way: float) -> float:
    """Return x with x sqrt(1 + x^2) + asinh x = way, the slope of a parabola after some way from its vertex."""
    y = abs(way)
    if y >= _KNOWN:
        x = _slope_by_newton(y)
    else:
        place = y * _PER_UNIT
        k = int(place)
        t = place - k
        x0, x1, d0, d1 = _SLOPES[k], _SLOPES[k + 1], _RISES[k], _RISES[k + 1]
        a, b = d0 - (x1 - x0), (x1 - x0) - d1
        x = x0 + t * (x1 - x0 + (1.0 - t) * (a * (1.0 - t) + b * t))
    return float(x if way >= 0.0 else -x)


@kernel
def shape_corner(piece: Record) -> None:
    """Set length, and what `place_on_corner` needs, of the CURVE of a PIECE, from its leg and angle."""
    s, c = sin_cos(0.5 * abs(piece.angle))
    piece.length = _length(piece.leg, s, c)
    piece.half_s, piece.half_c = s, c
    piece.per_way = 2.0 * s / (piece.leg * c * c)
    piece.per_slope = 0.5 * c / s


@kernel
def place_on_corner(piece: Record, way: float) -> tuple[float, float, float]:
    """Return (x [m], y [m], slope against the corner's middle) after `way` [m] along the CURVE of a PIECE."""
    slope = slope_at((way - 0.5 * piece.length) * piece.per_way)
    u = min(max(0.5 + slope * piece.per_slope, 0.0), 1.0)
    before, after = piece.leg * u * (2.0 - u), piece.leg * u * u
    return piece.x + before * piece.c + after * piece.to_c, piece.y + before * piece.s + after * piece.to_s, slope

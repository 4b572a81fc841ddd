"""A corner between two straight legs, rounded by a quadratic Bezier curve with equal legs: geometry and speed.

With leg length d and turning angle phi the control points are C0 = corner - d*u1, C1 = corner, C2 = corner + d*u2. Put
s = sin(phi/2), c = cos(phi/2), t = u - 1/2 and r(t) = sqrt(c^2 + 4 s^2 t^2); then |B'| = 2 d r, the curvature is
sin(phi) / (2 d r^3), greatest in the middle, and the arc length has a closed form.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import log, sin_cos
from parcours.kernels import Record, kernel
from parcours.planners.ramp.messages import SAMPLE


@kernel
def corner_speed(leg: float, turn: float, parameters: Record) -> float:
    """Return the greatest constant speed [m/s] on the corner that keeps yaw rate and yaw acceleration in their limits.

    Args:
        leg: leg length d [m].
        turn: turning angle phi [rad], either sign.
        parameters: PARAMETERS; v_max, w_max and alpha_max are read.
    """
    s, c = sin_cos(0.5 * abs(turn))
    if c <= 1e-6 or leg <= 1e-6:
        return 0.0
    if s <= 1e-9:
        return float(parameters.v_max)
    at_ends = s * c / leg
    in_middle = s / (leg * c * c)
    # Curvature begins at once: within one sample the yaw rate may change by alpha_max * SAMPLE, an eighth of which is
    # left for the climb within that sample. In between it climbs from the ends to the middle over about 0.9 of a leg,
    # at no more than 2.25 times its mean rate.
    at_once = 0.875 * parameters.alpha_max * SAMPLE
    speed = min(parameters.v_max, parameters.w_max / in_middle, at_once / at_ends)
    climb = in_middle - at_ends
    if climb > 0.0:
        speed = min(speed, np.sqrt(parameters.alpha_max * 0.4 * leg / climb))
    return float(speed)


@kernel
def _half_length(t: float, s: float, c: float) -> float:
    """Return the arc length from the middle of the curve to t, in units of 2 d."""
    r = np.sqrt(c * c + 4.0 * s * s * t * t)
    if s < 1e-6:
        return float(t)
    return float(0.5 * t * r + c * c / (4.0 * s) * log((2.0 * s * t + r) / c))


@kernel
def corner_length(leg: float, turn: float) -> float:
    """Return the length of the curve [m].

    >>> round(corner_length(1.0, 0.0), 9)
    2.0
    """
    s, c = sin_cos(0.5 * abs(turn))
    return 4.0 * leg * _half_length(0.5, s, c)


@kernel
def corner_at(way: float, guess: float, leg: float, turn: float) -> tuple[float, float]:
    """Return (curve parameter u, signed curvature [1/m]) after `way` [m] along the curve; `guess` is a nearby u."""
    s, c = sin_cos(0.5 * abs(turn))
    target = way / (2.0 * leg) - _half_length(0.5, s, c)
    t = guess - 0.5
    for _ in range(8):
        step = (_half_length(t, s, c) - target) / np.sqrt(c * c + 4.0 * s * s * t * t)
        t = min(max(t - step, -0.5), 0.5)
        if abs(step) < 1e-12:
            break
    r = np.sqrt(c * c + 4.0 * s * s * t * t)
    bend = s * c / (leg * r * r * r)
    return t + 0.5, bend if turn >= 0.0 else -bend

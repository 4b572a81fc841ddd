"""A stretch of way, the speeds at its ends and two limits -> the fastest speed profile, in closed form.

The profile is a trapezoid over time: speed up at the limiting acceleration, hold, slow down. It serves lengths [m, m/s,
m/s2] and angles [rad, rad/s, rad/s2] alike.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import kernel


@kernel
def reachable(speed: float, length: float, acceleration: float) -> float:
    """Return the greatest speed after `length` from `speed`, or the greatest before it that can still be slowed."""
    return float(np.sqrt(speed * speed + 2.0 * acceleration * length))


@kernel
def trapezoid(
    length: float, v0: float, v1: float, cap: float, acceleration: float
) -> tuple[float, float, float, float]:
    """Return (peak speed, time speeding up, time holding, time slowing down) over `length` from v0 to v1.

    The end speeds must be reachable from each other within the length and not exceed the cap.
    """
    peak = min(cap, np.sqrt(0.5 * (v0 * v0 + v1 * v1) + acceleration * length))
    peak = max(peak, v0, v1)
    up, down = (peak - v0) / acceleration, (peak - v1) / acceleration
    held = length - 0.5 * (v0 + peak) * up - 0.5 * (peak + v1) * down
    hold = max(held, 0.0) / peak if peak > 0.0 else 0.0
    return peak, up, hold, down


@kernel
def along(
    time: float, v0: float, peak: float, up: float, hold: float, down: float, acceleration: float
) -> tuple[float, float]:
    """Return (way made, speed) at `time` into the profile."""
    if time < up:
        return v0 * time + 0.5 * acceleration * time * time, v0 + acceleration * time
    way = 0.5 * (v0 + peak) * up
    time -= up
    if time < hold:
        return way + peak * time, peak
    way += peak * hold
    time = min(time - hold, down)
    return way + peak * time - 0.5 * acceleration * time * time, peak - acceleration * time

"""How the others are detected: reach, field of view, occlusion, noise, and detections lost, late and false.

truth, one row a body ──► late by whole observations ──► in reach and view, not hidden ──► lost? ──► noise ──► rows
                                                                                  nobody there, now and then ──┘
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import PI, TAU, atan2, log, sin_cos, wrap
from parcours.kernels import Record, heap_kernel, kernel
from parcours.streams import Stream, between, uniform
from parcours_navigation.ground.clearance import sees

Floats = NDArray[np.float64]

DETECTION = np.dtype(
    [
        ("reach", "f8"),  # [m]
        ("half_view", "f8"),  # half of the field of view [rad]
        ("occlusion", "i8"),  # 1 if walls and bodies hide what is behind them
        ("position_noise", "f8"),  # standard deviation of a coordinate [m]
        ("velocity_noise", "f8"),  # of the speed [m/s]
        ("dropped", "f8"),  # share
        ("false", "f8"),  # mean number an observation
        ("late", "i8"),  # observations
        ("perfect", "i8"),  # 1 if nothing of this has an effect
    ]
)
"""How one world's sensor works."""

MOST_FALSE = 4
"""Most detections of nobody in one observation."""

_NEAR = 3.0  # Where false detections appear if the reach is endless [m]


@kernel
def normal(stream: Stream) -> float:
    """Return the next number of the stream, normal with mean 0 and standard deviation 1."""
    radius = np.sqrt(-2.0 * log(1.0 - uniform(stream)))
    return float(radius * sin_cos(TAU * uniform(stream) - PI)[1])


@kernel
def is_hidden(rows: Floats, k: int, x: float, y: float) -> bool:
    """Return whether another body stands between (x, y) [m] and the middle of body k."""
    dx, dy = rows[k, 0] - x, rows[k, 1] - y
    square = dx * dx + dy * dy
    for i in range(len(rows)):
        if i == k or square == 0.0:
            continue
        ox, oy = rows[i, 0] - x, rows[i, 1] - y
        along = (ox * dx + oy * dy) / square
        if 0.0 < along < 1.0:
            aside = ox * dy - oy * dx
            if aside * aside < rows[i, 5] * rows[i, 5] * square:
                return True
    return False


@heap_kernel
def detect(
    truth: Floats, packed: Floats, x: float, y: float, heading: float, sensor: Record, stream: Stream, rows: Floats
) -> int:
    """Fill rows with what is detected of `truth` from a pose [m, m, rad]; return how many.

    Args:
        truth: x, y, heading, speed, yaw rate, radius of each body, in SI units, shape (n, 6).
        packed: the ground.
        sensor: DETECTION; `late` is the caller's.
        rows: room for what is detected, in the order of the bodies, false ones last, shape (n + MOST_FALSE, 6).
    """
    m = 0
    for k in range(len(truth)):
        dx, dy = truth[k, 0] - x, truth[k, 1] - y
        if dx * dx + dy * dy > sensor.reach * sensor.reach:
            continue
        if sensor.half_view < PI and abs(wrap(atan2(dy, dx) - heading)) > sensor.half_view:
            continue
        if sensor.occlusion and (is_hidden(truth, k, x, y) or not sees(packed, x, y, truth[k, 0], truth[k, 1])):
            continue
        if sensor.dropped > 0.0 and uniform(stream) < sensor.dropped:
            continue
        rows[m] = truth[k]
        if sensor.position_noise > 0.0:
            rows[m, 0] += sensor.position_noise * normal(stream)
            rows[m, 1] += sensor.position_noise * normal(stream)
        if sensor.velocity_noise > 0.0:
            rows[m, 3] += sensor.velocity_noise * normal(stream)
        m += 1
    for _ in range(MOST_FALSE):
        if sensor.false <= 0.0 or uniform(stream) * MOST_FALSE >= sensor.false:
            continue
        reach = sensor.reach if sensor.reach < 1e6 else _NEAR
        s, c = sin_cos(wrap(heading + between(stream, -sensor.half_view, sensor.half_view)))
        far = reach * np.sqrt(uniform(stream))
        rows[m, 0], rows[m, 1] = x + far * c, y + far * s
        rows[m, 2], rows[m, 3], rows[m, 4] = between(stream, -PI, PI), between(stream, 0.0, 1.0), 0.0
        rows[m, 5] = between(stream, 0.1, 0.3)
        m += 1
    return m

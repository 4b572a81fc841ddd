"""An obstacle as sensed -> where it is expected to be: standing, on a line, or on an arc (published rules).

A line reaches 12 s ahead; an arc ends after pi radians or 5 s, whichever comes first; after that the obstacle is
expected to stand. No uncertainty, no acceleration, no walls.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import PI, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import HORIZON, SAMPLE

STANDS = 0.01  # Below this speed an obstacle is expected to stay [m/s]
STRAIGHT = 0.01  # Below this yaw rate it is expected to go straight [rad/s]
LONGEST_ARC = 5.0  # An arc is predicted for at most this time [s]
_OFF = 0.04  # An arc is taken for a chord as long as it strays from it by less than this [m]


@kernel
def predicted_place(prediction: Record, place: float) -> tuple[float, float]:
    """Return where the obstacle is expected to be at a fractional sample of the PREDICTION, (x, y) [m]."""
    if prediction.n == 1:
        return prediction.x[0], prediction.y[0]
    place = min(max(place, 0.0), prediction.n - 1.0)
    j = int(place)
    k = min(j + 1, prediction.n - 1)
    share = place - j
    x = prediction.x[j] + share * (prediction.x[k] - prediction.x[j])
    y = prediction.y[j] + share * (prediction.y[k] - prediction.y[j])
    return x, y


@kernel
def coarseness(prediction: Record) -> float:
    """Return by how much two predictions of one motion may differ as each is straight from sample to sample [m]."""
    return float(0.25 * abs(prediction.speed * prediction.turn) * SAMPLE * SAMPLE)


@kernel
def predicted_until(prediction: Record, begins: int) -> float:
    """Return up to which sample of what begins then [ns] the way is predicted; inf for an obstacle that stands."""
    return prediction.n - 1.0 - (begins - prediction.stamp) * 1e-9 / SAMPLE if prediction.n > 1 else np.inf


@kernel
def change_of(prediction: Record, obstacle: Record, stamp: int) -> tuple[float, float]:
    """Return by how much the prediction changes at most when it is made again [m]; inf if that is unknown.

    The first holds until the predicted way ends, apart from its coarseness, and is next to nothing while the obstacle
    does as predicted. The second holds at any time: whenever the prediction is made again, its way ends farther on.

    Args:
        stamp: when that was sensed [ns].
    """
    pose = obstacle.pose
    speed = pose.v if abs(pose.v) >= STANDS else 0.0
    if speed != prediction.speed or (speed != 0.0 and pose.w != prediction.turn):
        return np.inf, np.inf
    if speed == 0.0:
        strayed = max(abs(pose.x - prediction.x[0]), abs(pose.y - prediction.y[0])) * 1.5
        return strayed, strayed
    elapsed = (stamp - prediction.stamp) * 1e-9
    s0, c0 = prediction.s, prediction.c
    x, y = prediction.x[0] + speed * elapsed * c0, prediction.y[0] + speed * elapsed * s0
    turned = pose.heading - prediction.heading
    if abs(pose.w) >= STRAIGHT:
        turned -= pose.w * elapsed
        s1, c1 = sin_cos(prediction.heading + pose.w * elapsed)
        x = prediction.x[0] + speed / pose.w * (s1 - s0)
        y = prediction.y[0] - speed / pose.w * (c1 - c0)
    turned = abs(wrap(turned))
    strayed = 1.5 * max(abs(pose.x - x), abs(pose.y - y)) + turned * abs(speed) * SAMPLE * HORIZON
    return strayed, strayed + abs(speed) * elapsed


@kernel
def predict(obstacle: Record, stamp: int, prediction: Record) -> None:
    """Fill the PREDICTION for an OBSTACLE_STATE that was sensed at `stamp` [ns]."""
    pose = obstacle.pose
    prediction.radius, prediction.stamp = obstacle.radius, stamp
    prediction.x[0], prediction.y[0] = pose.x, pose.y
    prediction.n, prediction.speed, prediction.straight, prediction.bend = 1, 0.0, np.inf, 0.0
    prediction.heading, prediction.turn = pose.heading, pose.w
    if abs(pose.v) < STANDS:
        return
    prediction.speed = pose.v
    s, c = sin_cos(pose.heading)
    prediction.s, prediction.c = s, c
    if abs(pose.w) < STRAIGHT:
        prediction.n = HORIZON
        for i in range(1, HORIZON):
            way = pose.v * i * SAMPLE
            prediction.x[i], prediction.y[i] = pose.x + way * c, pose.y + way * s
        return
    prediction.n = min(int(min(PI / abs(pose.w), LONGEST_ARC) / SAMPLE) + 1, HORIZON)
    prediction.bend = abs(pose.v * pose.w) / 8.0
    prediction.straight = np.sqrt(_OFF / prediction.bend)
    arc_radius = pose.v / pose.w
    centre_x, centre_y = pose.x - arc_radius * s, pose.y + arc_radius * c
    step_s, step_c = sin_cos(pose.w * SAMPLE)
    for i in range(1, prediction.n):
        s, c = s * step_c + c * step_s, c * step_c - s * step_s
        prediction.x[i], prediction.y[i] = centre_x + arc_radius * s, centre_y - arc_radius * c

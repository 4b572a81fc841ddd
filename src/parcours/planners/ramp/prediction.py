"""An obstacle as sensed -> where it is expected to be: standing, on a line, or on an arc (published rules).

A line reaches 12 s ahead; an arc ends after pi radians or 5 s, whichever comes first; after that the obstacle is
expected to stand. No uncertainty, no acceleration, no walls.
"""

from __future__ import annotations

from parcours.elementary import PI, sin_cos
from parcours.kernels import Record, kernel
from parcours.planners.ramp.messages import HORIZON, SAMPLE

STANDS = 0.01
"""Below this speed an obstacle is expected to stay [m/s]."""

STRAIGHT = 0.01
"""Below this yaw rate it is expected to go straight [rad/s]."""

LONGEST_ARC = 5.0
"""An arc is predicted for at most this time [s]."""


@kernel
def predict(obstacle: Record, stamp: int, prediction: Record) -> None:
    """Fill the PREDICTION for an OBSTACLE_STATE that was sensed at `stamp` [ns]."""
    pose = obstacle.pose
    prediction.radius, prediction.stamp = obstacle.radius, stamp
    prediction.x[0], prediction.y[0] = pose.x, pose.y
    prediction.n, prediction.speed = 1, 0.0
    if abs(pose.v) < STANDS:
        return
    prediction.speed = abs(pose.v)
    s, c = sin_cos(pose.heading)
    if abs(pose.w) < STRAIGHT:
        prediction.n = HORIZON
        for i in range(1, HORIZON):
            way = pose.v * i * SAMPLE
            prediction.x[i], prediction.y[i] = pose.x + way * c, pose.y + way * s
        return
    prediction.n = min(int(min(PI / abs(pose.w), LONGEST_ARC) / SAMPLE) + 1, HORIZON)
    arc_radius = pose.v / pose.w
    centre_x, centre_y = pose.x - arc_radius * s, pose.y + arc_radius * c
    step_s, step_c = sin_cos(pose.w * SAMPLE)
    for i in range(1, prediction.n):
        s, c = s * step_c + c * step_s, c * step_c - s * step_s
        prediction.x[i], prediction.y[i] = centre_x + arc_radius * s, centre_y - arc_radius * c

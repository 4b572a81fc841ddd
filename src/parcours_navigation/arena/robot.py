"""The robot's body: a unicycle that follows commanded speeds within its speed and acceleration limits.

Speeds rise or fall towards the command at the limiting acceleration. Over one tick the body follows a chord: at 0.01 s,
0.25 m/s, pi/2 rad/s, 1 m/s2 and 2/3 pi rad/s2 it strays by less than 3e-8 m at constant speeds and 2.1e-7 m while they
change.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos, wrap
from parcours.kernels import Record, kernel

ROBOT = np.dtype(
    [
        ("x", "f8"),  # [m]
        ("y", "f8"),  # [m]
        ("heading", "f8"),  # [rad], counter-clockwise from x
        ("v", "f8"),  # forward speed [m/s]
        ("w", "f8"),  # yaw rate [rad/s]
        ("command_v", "f8"),  # what was last commanded [m/s]
        ("command_w", "f8"),  # [rad/s]
        ("v_max", "f8"),  # [m/s]
        ("w_max", "f8"),  # [rad/s]
        ("a_max", "f8"),  # [m/s2]
        ("alpha_max", "f8"),  # [rad/s2]
        ("radius", "f8"),  # [m]
    ]
)
"""State and limits of the robot."""


@kernel
def _towards(value: float, target: float, reach: float) -> float:
    """Return the value moved towards the target by at most `reach`."""
    return value + min(max(target - value, -reach), reach)


@kernel
def drive(robot: Record, dt: float) -> None:
    """Move the robot by dt [s] under its last command, within its limits."""
    v0, w0 = robot.v, robot.w
    v = _towards(v0, min(max(robot.command_v, -robot.v_max), robot.v_max), robot.a_max * dt)
    w = _towards(w0, min(max(robot.command_w, -robot.w_max), robot.w_max), robot.alpha_max * dt)
    mean_v, mean_w = 0.5 * (v0 + v), 0.5 * (w0 + w)
    if mean_v != 0.0:
        # The chord of the tick's arc points along the heading half-way through the turn.
        s, c = sin_cos(robot.heading + 0.5 * mean_w * dt)
        robot.x += mean_v * dt * c
        robot.y += mean_v * dt * s
    if mean_w != 0.0:
        robot.heading = wrap(robot.heading + mean_w * dt)
    robot.v, robot.w = v, w

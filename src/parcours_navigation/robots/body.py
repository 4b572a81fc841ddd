"""The robot's body, whatever its drive: where it is, what it can do, what was asked of it, where it believes to be."""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.arena.robot import ROBOT

UNICYCLE, DIFFERENTIAL, CAR, HOLONOMIC = range(4)
"""Kinds of drives."""

MOST_DELAY = 100
"""A command takes effect after at most this many ticks."""

BODY = np.dtype(
    [
        ("kind", "i8"),  # before what it shares with ROBOT, which numba would else take it for
        # x, y, heading, v, w, command_v, command_w, v_max, w_max, a_max, alpha_max, radius: the command is the one that
        # has come through the delay, v the speed ahead
        *((name, "f8") for name in ROBOT.names or ()),
        ("vy", "f8"),  # speed to the left, of a holonomic body [m/s]
        ("command_vy", "f8"),  # [m/s]
        ("lever", "f8"),  # another body follows a velocity with the point so far ahead of its place [m]
        # differential drive
        ("track_width", "f8"),  # between the wheels [m]
        ("wheel_max", "f8"),  # a wheel's greatest speed at its rim [m/s]
        ("wheel_acceleration", "f8"),  # [m/s2]
        ("left", "f8"),  # speed of the left wheel [m/s]
        ("right", "f8"),
        # car
        ("wheelbase", "f8"),  # between the axles; its place is that of the rear one [m]
        ("steering_max", "f8"),  # [rad]
        ("steering_rate", "f8"),  # [rad/s]
        ("steering", "f8"),  # angle of the front wheels, to the left [rad]
        # delay
        ("asked", "f8", (3,)),  # what was last asked: ahead, to the left, yaw rate [m/s, m/s, rad/s]
        ("delay", "i8"),  # ticks until it takes effect
        ("oldest", "i8"),  # where in `queue` the next command is
        ("queue", "f8", (MOST_DELAY, 3)),
        # odometry
        ("drifts", "i8"),  # 0: it believes what is so
        ("way_scale", "f8"),  # it believes to have gone 1 + way_scale times its way
        ("turn_scale", "f8"),  # ... to have turned 1 + turn_scale times its turn
        ("way_noise", "f8"),  # standard deviation after one metre [m]
        ("turn_noise", "f8"),  # ... of the heading after one radian [rad]
        ("turn_noise_way", "f8"),  # ... of the heading after one metre [rad]
        ("believed_x", "f8"),  # where it believes to be [m]
        ("believed_y", "f8"),
        ("believed_heading", "f8"),  # [rad]
        ("seed", "u8"),  # where its stream starts
        ("stream", "u8", (1,)),
    ]
)
"""State, limits and odometry of a body; made by `robots.kinds.Body`."""


@kernel
def begin_body(body: Record, x: float, y: float, heading: float, speed: float) -> None:
    """Put the body at its start: a pose [m, m, rad] at a speed ahead [m/s], which is also what was asked so far."""
    body.x, body.y, body.heading = x, y, heading
    body.v, body.vy, body.w = speed, 0.0, 0.0
    body.left = body.right = speed
    body.steering = 0.0
    body.command_v, body.command_vy, body.command_w = speed, 0.0, 0.0
    body.asked[0], body.asked[1], body.asked[2] = speed, 0.0, 0.0
    body.oldest = 0
    for k in range(body.delay):
        body.queue[k, 0], body.queue[k, 1], body.queue[k, 2] = speed, 0.0, 0.0
    body.believed_x, body.believed_y, body.believed_heading = x, y, heading
    body.stream[0] = body.seed


@kernel
def command_body(body: Record, vx: float, vy: float, w: float) -> None:
    """Ask the body for speeds ahead and to the left [m/s] and a yaw rate [rad/s]; a `Command` has vy = 0.

    A body that cannot move sideways turns instead, so that the point `lever` ahead of its place gets that velocity.
    """
    if body.kind != HOLONOMIC:
        w += vy / body.lever
        vy = 0.0
    body.asked[0], body.asked[1], body.asked[2] = vx, vy, w


@kernel
def take_command(body: Record) -> None:
    """Let what was asked `delay` ticks ago take effect. Called once a tick."""
    if body.delay == 0:
        body.command_v, body.command_vy, body.command_w = body.asked[0], body.asked[1], body.asked[2]
        return
    k = body.oldest
    body.command_v, body.command_vy, body.command_w = body.queue[k, 0], body.queue[k, 1], body.queue[k, 2]
    body.queue[k, 0], body.queue[k, 1], body.queue[k, 2] = body.asked[0], body.asked[1], body.asked[2]
    body.oldest = (k + 1) % body.delay

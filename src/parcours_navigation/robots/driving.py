"""One tick of any body: its command, its drive within its limits, its odometry.

Over a tick a body goes the chord of the arc at its mean speeds, as `arena.robot.drive` has it, which drives the
unicycle itself.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours_navigation.arena.robot import drive
from parcours_navigation.robots.body import CAR, DIFFERENTIAL, UNICYCLE, take_command
from parcours_navigation.robots.odometry import believe


@kernel
def _towards(value: float, target: float, reach: float) -> float:
    """Return the value moved towards the target by at most `reach`."""
    return value + min(max(target - value, -reach), reach)


@kernel
def _held(value: float, most: float) -> float:
    """Return the value brought into [-most, most]."""
    return min(max(value, -most), most)


@kernel
def _go(body: Record, v: float, vy: float, w: float, dt: float) -> None:
    """Move the body by dt [s] at mean speeds ahead and to the left [m/s] and a mean yaw rate [rad/s]."""
    s, c = sin_cos(body.heading + 0.5 * w * dt)
    body.x += (v * c - vy * s) * dt
    body.y += (v * s + vy * c) * dt
    if w != 0.0:
        body.heading = wrap(body.heading + w * dt)


@kernel
def drive_differential(body: Record, dt: float) -> None:
    """Drive two wheels: each speeds up or brakes by itself towards what the command asks of it.

    A command that is too fast for a wheel is slowed down as a whole, so that its curve stays.
    """
    v, w = _held(body.command_v, body.v_max), _held(body.command_w, body.w_max)
    half = 0.5 * body.track_width
    left, right = v - half * w, v + half * w
    fastest = max(abs(left), abs(right))
    if fastest > body.wheel_max:
        left, right = left * body.wheel_max / fastest, right * body.wheel_max / fastest
    step = body.wheel_acceleration * dt
    new_left, new_right = _towards(body.left, left, step), _towards(body.right, right, step)
    mean_left, mean_right = 0.5 * (body.left + new_left), 0.5 * (body.right + new_right)
    body.left, body.right = new_left, new_right
    body.v, body.w = 0.5 * (new_left + new_right), (new_right - new_left) / body.track_width
    _go(body, 0.5 * (mean_left + mean_right), 0.0, (mean_right - mean_left) / body.track_width, dt)


@kernel
def steering_for(v: float, w: float, wheelbase: float, now: float) -> float:
    """Return the steering angle [rad] at which a car's rear axle goes at v [m/s] and w [rad/s]; `now` if both are 0.

    >>> round(steering_for(1.0, 1.0, 1.0, 0.0), 6)  # a circle as wide as the car is long
    0.785398
    """
    if v == 0.0 and w == 0.0:
        return now
    return atan2(wheelbase * w if v >= 0.0 else -wheelbase * w, abs(v))


@kernel
def drive_car(body: Record, dt: float) -> None:
    """Drive a car: speed and steering angle move towards what the command asks; standing, it only steers.

    The curve is that of the command, w / v, also while the speed is another one still.
    """
    #         ⟋ steering
    #   ┌──▯─┐             rear axle at the place: w = v tan(steering) / wheelbase, and the tightest circle has the
    #   ●────▯─            radius wheelbase / tan(steering_max)
    #   └──▯─┘
    v, w = _held(body.command_v, body.v_max), _held(body.command_w, body.w_max)
    angle = _held(steering_for(v, w, body.wheelbase, body.steering), body.steering_max)
    steering = _towards(body.steering, angle, body.steering_rate * dt)
    speed = _towards(body.v, v, body.a_max * dt)
    mean_v = 0.5 * (body.v + speed)
    s, c = sin_cos(0.5 * (body.steering + steering))
    mean_w = mean_v * s / (c * body.wheelbase)
    s, c = sin_cos(steering)
    body.v, body.steering, body.w = speed, steering, speed * s / (c * body.wheelbase)
    if mean_v != 0.0:
        _go(body, mean_v, 0.0, mean_w, dt)


@kernel
def drive_holonomic(body: Record, dt: float) -> None:
    """Drive any way at once: the velocity in the body's own frame moves straight towards the command.

    Speed and acceleration are limited as vectors, whatever their direction.
    """
    want_x, want_y = body.command_v, body.command_vy
    speed = np.sqrt(want_x * want_x + want_y * want_y)
    if speed > body.v_max:
        want_x, want_y = want_x * body.v_max / speed, want_y * body.v_max / speed
    dx, dy = want_x - body.v, want_y - body.vy
    change, most = np.sqrt(dx * dx + dy * dy), body.a_max * dt
    if change > most:
        want_x, want_y = body.v + dx * most / change, body.vy + dy * most / change
    w = _towards(body.w, _held(body.command_w, body.w_max), body.alpha_max * dt)
    mean_x, mean_y, mean_w = 0.5 * (body.v + want_x), 0.5 * (body.vy + want_y), 0.5 * (body.w + w)
    body.v, body.vy, body.w = want_x, want_y, w
    _go(body, mean_x, mean_y, mean_w, dt)


@kernel
def drive_body(body: Record, dt: float) -> None:
    """Move the BODY by one tick of dt [s] under the command that has come through, within its limits."""
    take_command(body)
    x, y, heading = body.x, body.y, body.heading
    if body.kind == UNICYCLE:
        drive(body, dt)
    elif body.kind == DIFFERENTIAL:
        drive_differential(body, dt)
    elif body.kind == CAR:
        drive_car(body, dt)
    else:
        drive_holonomic(body, dt)
    believe(body, x, y, heading)


@kernel
def world_velocity(body: Record) -> tuple[float, float]:
    """Return the body's velocity (x, y) in the world's frame [m/s]."""
    s, c = sin_cos(body.heading)
    return body.v * c - body.vy * s, body.v * s + body.vy * c

"""Robots as a world file gives them: kind, shape, limits, delay and odometry, checked; and some that exist."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from parcours.elementary import PI, sin_cos
from parcours.errors import BadRequest, require_known
from parcours.kernels import Record
from parcours.streams import starts
from parcours_navigation.protocol import Floats, Limits, Robot
from parcours_navigation.robots.body import BODY, CAR, DIFFERENTIAL, HOLONOMIC, MOST_DELAY, UNICYCLE, begin_body

PURPOSE = 0x6F646F6D
"""Purpose of the stream that draws odometry noise (ASCII for `odom`)."""

Kind = Literal["unicycle", "differential", "car", "holonomic"]
KINDS: dict[str, int] = {"unicycle": UNICYCLE, "differential": DIFFERENTIAL, "car": CAR, "holonomic": HOLONOMIC}
"""What `kind` may be."""


def _within(what: str, value: object, low: float, high: float, unit: str) -> None:
    span = f"{low:g} to {high:g} {unit}".rstrip()
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        rule = f"it must be a number from {span}, but is {value!r}"
    elif not low <= value <= high:
        rule = f"it must lie in {span}, but is {value:g}"
    else:
        return
    raise BadRequest(f"robot, {what}", rule, "give a number in that range", slug="robot-range")


@dataclass(frozen=True, slots=True)
class Odometry:
    """How wrong a robot measures its own way; see `robots.odometry`."""

    way_scale: float = 0.0  # 0.01: it believes each way to be one per cent longer
    turn_scale: float = 0.0
    way_noise: float = 0.0  # standard deviation after one metre [m]
    turn_noise: float = 0.0  # ... of the heading after one radian [rad]
    turn_noise_way: float = 0.0  # ... of the heading after one metre [rad]

    def __post_init__(self) -> None:
        for name in ("way_scale", "turn_scale"):
            _within(f"odometry, {name}", getattr(self, name), -0.5, 0.5, "")
        for name in ("way_noise", "turn_noise", "turn_noise_way"):
            _within(f"odometry, {name}", getattr(self, name), 0.0, 1.0, "")

    @property
    def is_exact(self) -> bool:
        """Whether it believes what is so."""
        return not any(getattr(self, each.name) for each in fields(self))


@dataclass(frozen=True, slots=True)
class Body:
    """A robot's body.

    Raises BadRequest if a value is out of its range, or one that the kind needs is missing.
    """

    kind: Kind = "unicycle"
    radius: float = 0.125  # of its disc, or of the circle round its footprint [m]
    footprint: tuple[tuple[float, float], ...] = ()  # corners of a convex polygon, counter-clockwise [m]; none: a disc
    speed: float = 0.25  # top speed, either way [m/s]
    yaw_rate: float = PI / 2  # [rad/s], either way
    acceleration: float = 1.0  # speeding up and braking; not of a differential drive [m/s2]
    yaw_acceleration: float = 2.0 * PI / 3.0  # of unicycle and holonomic bodies [rad/s2]
    track_width: float = 0.0  # differential: between the wheels [m]
    wheel_speed: float = 0.0  # ... a wheel's greatest speed at its rim [m/s]
    wheel_acceleration: float = 0.0  # [m/s2]
    wheelbase: float = 0.0  # car: between the axles; its place is that of the rear one [m]
    steering: float = 0.0  # ... greatest angle of its front wheels [rad]
    steering_rate: float = 0.0  # [rad/s]
    delay: float = 0.0  # from a command to its effect, in whole ticks [s]
    odometry: Odometry = Odometry()

    def __post_init__(self) -> None:
        require_known(self.kind, tuple(KINDS), "robot, kind", slug="robot-kind")
        ranges = {
            "radius": (0.001, 100.0, "m"), "speed": (0.001, 100.0, "m/s"), "yaw_rate": (0.001, 100.0, "rad/s"),
            "acceleration": (0.001, 1000.0, "m/s2"), "yaw_acceleration": (0.001, 1000.0, "rad/s2"),
            "delay": (0.0, 0.01 * MOST_DELAY, "s"),
        }  # fmt: skip
        if self.kind == "differential":
            ranges |= {"track_width": (0.001, 100.0, "m"), "wheel_speed": (0.001, 100.0, "m/s")}
            ranges |= {"wheel_acceleration": (0.001, 1000.0, "m/s2")}
        if self.kind == "car":
            ranges |= {"wheelbase": (0.001, 100.0, "m"), "steering": (0.001, 1.5, "rad")}
            ranges |= {"steering_rate": (0.001, 100.0, "rad/s")}
        for name, (low, high, unit) in ranges.items():
            _within(name, getattr(self, name), low, high, unit)
        if self.footprint:
            _require_convex(self.footprint, self.radius)

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of its place [m]; 0 if it can turn where it stands.

        >>> round(PRESETS["f1tenth"].turning_radius, 3)
        0.742
        """
        if self.kind != "car":
            return 0.0
        s, c = sin_cos(self.steering)
        return self.wheelbase * c / s

    @property
    def limits(self) -> Limits:
        """What planners know of its limits."""
        if self.kind == "differential":
            half = 0.5 * self.track_width
            speed, rate = min(self.speed, self.wheel_speed), min(self.yaw_rate, self.wheel_speed / half)
            return Limits(speed, rate, self.wheel_acceleration, self.wheel_acceleration / half)
        return Limits(self.speed, self.yaw_rate, self.acceleration, self.yaw_acceleration)

    @property
    def robot(self) -> Robot:
        """What planners know of its kind and shape."""
        corners: Floats | None = np.array(self.footprint, np.float64) if self.footprint else None
        return Robot(self.kind, corners, self.track_width, self.wheelbase, self.steering, self.steering_rate)

    def record(
        self,
        x: float,
        y: float,
        heading: float,
        speed: float = 0.0,
        *,
        seed: int = 0,
        case: int = 0,
        tick: float = 0.01,
    ) -> Record:
        """Return a record of BODY at a pose [m, m, rad] and speed [m/s]; seed and case choose the odometry's noise.

        >>> body = PRESETS["paper"].record(0.0, 0.0, 0.5)
        >>> float(body.heading), float(body.v_max)
        (0.5, 0.25)
        """
        body = np.zeros(1, BODY).view(np.recarray)[0]
        body.kind, body.radius, body.lever = KINDS[self.kind], self.radius, self.radius
        body.v_max, body.w_max, body.a_max, body.alpha_max = (
            self.speed, self.yaw_rate, self.acceleration, self.yaw_acceleration,
        )  # fmt: skip
        body.track_width, body.wheel_max, body.wheel_acceleration = (
            self.track_width, self.wheel_speed, self.wheel_acceleration,
        )  # fmt: skip
        body.wheelbase, body.steering_max, body.steering_rate = self.wheelbase, self.steering, self.steering_rate
        body.delay = min(math.floor(self.delay / tick + 0.5), MOST_DELAY)
        for each in fields(Odometry):
            body[each.name] = getattr(self.odometry, each.name)
        body.drifts = not self.odometry.is_exact
        body.seed = starts(seed, np.array([case], np.int64), PURPOSE)[0]
        begin_body(body, x, y, heading, speed)
        return body


def _require_convex(corners: tuple[tuple[float, float], ...], radius: float) -> None:
    """Raise BadRequest unless the corners go round a convex polygon counter-clockwise, within the radius."""
    where, turned = "robot, footprint", 0.0
    if len(corners) < 3 or any(len(corner) != 2 for corner in corners):
        rule = f"it must be three corners x, y or more, but is {corners!r}"
        raise BadRequest(where, rule, "write [[x, y], ...]", slug="robot-footprint")
    for k, (x, y) in enumerate(corners):
        _within(f"footprint, corner {k + 1}", x, -100.0, 100.0, "m")
        _within(f"footprint, corner {k + 1}", y, -100.0, 100.0, "m")
        (x1, y1), (x2, y2) = corners[(k + 1) % len(corners)], corners[(k + 2) % len(corners)]
        cross = (x1 - x) * (y2 - y1) - (y1 - y) * (x2 - x1)
        turned += math.atan2(cross, (x1 - x) * (x2 - x1) + (y1 - y) * (y2 - y1))
        if cross <= 0.0:
            rule = (
                f"its corners must go round a convex polygon counter-clockwise, but ({x1:g}, {y1:g}) does not turn left"
            )
            raise BadRequest(where, rule, "turn the order round, or leave the corner out", slug="robot-footprint")
        if x * x + y * y > radius * radius * (1.0 + 1e-9):
            rule = f"the circle round it must hold all corners, but ({x:g}, {y:g}) is outside {radius:g} m"
            raise BadRequest(where, rule, "give a larger radius", slug="robot-footprint")
    if turned > 3.0 * PI:  # a star turns left at every corner, too
        raise BadRequest(where, "its corners must go round once", "put them in order", slug="robot-footprint")


def _box(front: float, back: float, width: float) -> tuple[tuple[float, float], ...]:
    half = 0.5 * width
    return ((front, -half), (front, half), (-back, half), (-back, -half))


PRESETS = {
    # the robot of the paper's arena
    "paper": Body(),
    # ROBOTIS e-manual: 0.22 m/s, 2.84 rad/s, wheels 0.16 m apart, 138 x 178 mm; acceleration ours
    "turtlebot3-burger": Body(
        "differential", 0.114, speed=0.22, yaw_rate=2.84, track_width=0.16, wheel_speed=0.25, wheel_acceleration=2.5
    ),
    # Clearpath data sheet: 508 x 430 mm, 2 m/s; yaw rate as in the BARN challenge's set-up; accelerations ours
    "jackal": Body(
        "differential", 0.334, _box(0.254, 0.254, 0.43), speed=2.0, yaw_rate=3.14, track_width=0.376, wheel_speed=2.0,
        wheel_acceleration=5.0,
    ),
    # F1TENTH gym's car: lf + lr = 0.3302 m, 0.4189 rad, 3.2 rad/s, 9.51 m/s2, 0.58 x 0.31 m; speed held to 5 m/s
    "f1tenth": Body(
        "car", 0.49, _box(0.455, 0.125, 0.31), speed=5.0, yaw_rate=7.0, acceleration=9.51, wheelbase=0.3302,
        steering=0.4189, steering_rate=3.2,
    ),
    # KUKA youBot's base: 580 x 380 mm, 0.8 m/s; yaw rate and accelerations ours
    "youbot": Body("holonomic", 0.347, _box(0.29, 0.29, 0.38), speed=0.8, yaw_rate=1.5, acceleration=1.5),
}  # fmt: skip
"""Robots by name. Where a source says nothing the comment says that the number is ours."""

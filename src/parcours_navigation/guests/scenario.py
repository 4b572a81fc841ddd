"""The setting that all cases of a campaign share, checked at the door: robot, start, goal, clock, deadlines."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from parcours.elementary import PI
from parcours.errors import BadRequest
from parcours_navigation.protocol import Limits

TICK = 0.01
"""Observations fall on ticks of the world, which are this far apart [s]."""

_LIMITS = Limits(speed=0.25, yaw_rate=PI / 2.0, acceleration=1.0, yaw_acceleration=2.0 * PI / 3.0)


@dataclass(frozen=True, slots=True)
class Scenario:
    """Where the robot starts and is to go, what it can do, and how the planner is asked. The defaults are the paper's.

    Raises BadRequest if a value is out of its range.

    >>> Scenario(period=0.0)
    Traceback (most recent call last):
    parcours.errors.BadRequest: scenario, period: it must be at least 0.01 s and at most the time limit, but is 0.0 \
[scenario-range]
    """

    start: tuple[float, float, float] = (0.0, 0.0, PI / 4.0)  # x, y, heading of the robot [m, m, rad]
    start_speed: float = 0.249  # how fast it drives at the start, which is also the first command [m/s]
    goal: tuple[float, float] = (2.0, 2.0)  # x, y [m]
    goal_tolerance: float = 0.2  # as near as this counts as reached [m]
    limits: Limits = field(default=_LIMITS)  # of the robot
    arena: float = 2.0  # side of the square in which obstacles begin [m]
    time_limit: float = 20.0  # length of a case [s]; see `SystemCases.end` from when on
    watched_on: float = 0.0  # how long an unfinished case is watched beyond its end [s]
    period: float = 0.05  # between two observations [s], a multiple of the world's tick of 0.01 s
    command_delay: float = 0.0  # an answer takes effect this long after its observation [s], a multiple of 0.01 s
    # a call of the planner that takes longer than this ends the case as an error [s of wall clock]; in the first case
    # of a process six times as long is granted, for imports and compilation
    call_timeout: float = 10.0

    def __post_init__(self) -> None:
        for name, values in (("start", self.start), ("goal", self.goal)):
            if len(values) != (3 if name == "start" else 2) or not all(_within(v, -1e4, 1e4) for v in values):
                _refuse(name, f"{'x, y, heading' if name == 'start' else 'x, y'} are within 1e4 of 0", values)
        for name in ("speed", "yaw_rate", "acceleration", "yaw_acceleration"):
            value = getattr(self.limits, name)
            if not _within(value, 1e-6, 1e3):
                _refuse(f"limits.{name}", "it must be above 0 (at least 1e-6) and at most 1000", value)
        if not _within(abs(self.start_speed), 0.0, self.limits.speed):
            _refuse("start_speed", f"it must be within the limit of {self.limits.speed} m/s", self.start_speed)
        for name, low, high, rule in (
            ("goal_tolerance", 1e-6, 1e3, "it must be above 0 and at most 1000 m"),
            ("arena", 1e-3, 1e3, "it must be above 0 and at most 1000 m"),
            ("time_limit", TICK, 3600.0, "it must be from 0.01 to 3600 s"),
            ("watched_on", 0.0, 3600.0, "it must be from 0 to 3600 s"),
            ("period", TICK, self.time_limit, "it must be at least 0.01 s and at most the time limit"),
            ("command_delay", 0.0, 10.0, "it must be from 0 to 10 s"),
            ("call_timeout", 0.05, 86400.0, "it must be from 0.05 s to a day"),
        ):
            if not _within(getattr(self, name), low, high):
                _refuse(name, rule, getattr(self, name))
        for name in ("period", "command_delay", "time_limit", "watched_on"):
            ticks = getattr(self, name) / TICK
            if abs(ticks - round(ticks)) > 1e-6:
                _refuse(name, "it must be a whole number of the world's ticks of 0.01 s", getattr(self, name))

    def require_room(self, robot_radius: float) -> None:
        """Raise BadRequest unless a robot of that radius [m] fits into the arena."""
        if self.arena < 2.0 * robot_radius:
            rule = f"the robot must fit in, whose diameter is {2.0 * robot_radius} m"
            _refuse("arena", rule, self.arena)


def _within(value: object, low: float, high: float) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and low <= value <= high


def _refuse(name: str, rule: str, value: object) -> None:
    raise BadRequest(f"scenario, {name}", f"{rule}, but is {value}", slug="scenario-range")

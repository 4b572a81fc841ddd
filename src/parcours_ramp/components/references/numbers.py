"""The numbers RAMP runs by, once more, and angles and profiles in their plainest form."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SAMPLE = 0.1  # Between two states of a trajectory [s]
NEVER = 9999.0  # The time of what never happens [s]
LONGEST = 50.0  # A trajectory is cut off there [s]
KNOTS = 8  # How many knots' times a trajectory has

Floats = NDArray[np.float64]
Places = NDArray[np.complex128]


class RoundingDecidesError(Exception):
    """Rounding decides: it turns by pi, to either side, or looks for a place that it is at."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """What docs/ramp.md and its sources say of the robot and the planner; margins are those of `guarded`."""

    v_max: float = 0.25  # [m/s]
    w_max: float = math.pi / 2  # [rad/s]
    a_max: float = 1.0  # [m/s2]
    alpha_max: float = 2 * math.pi / 3  # [rad/s2]
    robot_radius: float = 0.125  # [m]
    arena: float = 2.0  # [m]
    operator_distance: float = 0.25  # [m]
    q_collision: float = 1e4
    q_orientation: float = 1e5
    estimate_v: float = 0.125  # [m/s]
    estimate_w: float = math.pi / 8  # [rad/s]
    plan_margin: float = 0.05  # [m]
    may_leave: bool = True

    @classmethod
    def of(cls, given: Mapping[str, object] | None) -> Numbers:
        """Return the numbers with those that are given by name in the place of defaults; others are left aside."""
        names = {one.name for one in dataclasses.fields(cls)}
        return cls(**{name: value for name, value in (given or {}).items() if name in names})  # type: ignore[arg-type]


def wrapped(angle: float) -> float:
    """Return the angle in [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def told(heading: float) -> float | None:
    """Return a heading, or None where rounding decides whether it is -pi or pi."""
    return None if abs(math.pi - abs(heading)) < 1e-7 else heading


def unit(heading: float) -> complex:
    """Return the vector of length 1 that points there."""
    return complex(math.cos(heading), math.sin(heading))


@dataclass(frozen=True, slots=True)
class Profile:
    """How a way of some length is driven as fast as can be: speed up, hold, slow down."""

    v0: float
    peak: float
    rate: float
    up: float  # [s]
    hold: float  # [s]
    down: float  # [s]

    @classmethod
    def over(cls, length: float, v0: float, v1: float, cap: float, rate: float) -> Profile:
        """Return the fastest profile from v0 to v1."""
        peak = max(v0, v1, min(cap, math.sqrt((v0**2 + v1**2) / 2 + rate * length)))
        left = length - (peak**2 - v0**2) / (2 * rate) - (peak**2 - v1**2) / (2 * rate)
        return cls(v0, peak, rate, (peak - v0) / rate, max(left, 0.0) / peak if peak else 0.0, (peak - v1) / rate)

    @property
    def lasts(self) -> float:
        """How long it takes [s]."""
        return self.up + self.hold + self.down

    def at(self, time: Floats) -> tuple[Floats, Floats]:
        """Return way made and speed at times [s] since its start."""
        up = np.clip(time, 0.0, self.up)
        hold = np.clip(time - self.up, 0.0, self.hold)
        down = np.clip(time - self.up - self.hold, 0.0, self.down)
        way = self.v0 * up + self.rate * up**2 / 2 + self.peak * (hold + down) - self.rate * down**2 / 2
        speed = np.where(time < self.up, self.v0 + self.rate * up, self.peak - self.rate * down)
        return way, speed

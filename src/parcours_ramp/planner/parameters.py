"""The numbers RAMP runs by, with the published values as defaults, and the two schedules.

`original` behaves as the published system does: one planner thread that blocks, and an imminent-collision check whose
look-ahead shrinks and whose times are misaligned. `guarded` is the repair: the check is a task of its own with a
constant, aligned look-ahead on the motion that is really left, and what is too near may be left again; it limits the
speed near obstacles; and plans wait for a robot that looks elsewhere.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal, NoReturn

import numpy as np

from parcours.errors import BadRequest
from parcours.kernels import Record

ORIGINAL, GUARDED = 0, 1  # The schedules, as kernels know them


@dataclass(frozen=True, slots=True)
class Parameters:
    """Parameters of RAMP. Sources: the paper [P], the paper-era code [S], its later versions [L], or ours."""

    schedule: Literal["original", "guarded"] = "guarded"
    v_max: float = 0.25  # top speed [m/s] [P]
    w_max: float = 1.5707963267948966  # top yaw rate [rad/s] [L]
    a_max: float = 1.0  # acceleration limit [m/s2] [S]
    alpha_max: float = 2.0943951023931953  # yaw acceleration limit [rad/s2] [S]
    robot_radius: float = 0.125  # [m]; with obstacles of 0.1 m contact is at [S]'s 0.225 m between centres
    arena: float = 2.0  # knot points are drawn in [0, arena]^2 [m] [P]
    population: int = 5  # members [S]
    planning_rate: float = 20.0  # [Hz] [S]
    control_period: float = 2.0  # longest time between two control cycles [s] [S]
    halted_period: float = 0.2  # ... while halted, guarded schedule only [s]; ours
    knot_distance: float = 0.33  # between knots of a random path [m] [S]
    operator_distance: float = 0.25  # between a new knot and the others [m] [S]
    q_collision: float = 1e4  # infeasible by collision costs this / time to collision [S]
    q_orientation: float = 1e5  # infeasible by orientation costs this * angle / pi [S]
    estimate_v: float = 0.125  # speed assumed for the way not generated [m/s] [S]
    estimate_w: float = 0.39269908169872414  # turning rate assumed there [rad/s] [S]
    plan_margin: float = 0.0  # clearance a feasible trajectory keeps [m]; original 0 [S], guarded: see `guarded()`
    guard_margin: float = 0.0  # clearance below which the guard halts the robot [m]
    guard_horizon: float = 1.0  # look-ahead of the guard, guarded schedule only [s]; ours
    obstacle_speed: float = 0.5  # at which a standing obstacle may set out, guarded schedule only [m/s]; Table VII
    looks_ahead: bool = True  # the guard looks a constant time ahead, at robot and obstacles at the same instants
    may_leave: bool = True  # a trajectory that begins too near to an obstacle may lead away from it
    halts_at_once: bool = True  # control does not wait for the next 0.1 s point to halt
    reaction: float = 0.06  # from then until the robot brakes [s]; sensing period and guard, ours

    def record(self) -> Record:
        """Return the parameters as a record of dtype PARAMETERS, which kernels read."""
        record = np.zeros(1, PARAMETERS).view(np.recarray)[0]
        for name in PARAMETERS.names or ():
            value = getattr(self, name)
            record[name] = value if name != "schedule" else (ORIGINAL if value == "original" else GUARDED)
        return record

    def __post_init__(self) -> None:
        for name in _REALS:
            value = getattr(self, name)
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            least = 0.0 if name in _MAY_BE_ZERO else 1e-9
            if not is_number or not least <= value < 1e9:
                given = f"{'above 0' if least else 'at least 0'} and below 1e9, but is {value!r}"
                _refuse(name, f"it must be a number {given}")
        for name in _SWITCHES:
            if type(getattr(self, name)) is not bool:
                _refuse(name, f"it must be true or false, but is {getattr(self, name)!r}")
        if type(self.population) is not int or not 1 <= self.population <= 16:
            _refuse("population", f"it must be a whole number from 1 to 16, but is {self.population!r}")
        if self.arena < 2.0 * self.robot_radius:
            diameter = 2.0 * self.robot_radius
            _refuse("arena", f"the robot must fit in, whose diameter is {diameter} m, but it is {self.arena} m")
        if self.schedule not in ("original", "guarded"):
            _refuse("schedule", f"it must be 'original' or 'guarded', but is {self.schedule!r}")


def _refuse(name: str, rule: str) -> NoReturn:
    raise BadRequest(f"RAMP parameter {name!r}", rule, slug="parameter-range")


_MAY_BE_ZERO = ("knot_distance", "operator_distance", "plan_margin", "guard_margin", "guard_horizon")
_SWITCHES = ("looks_ahead", "may_leave", "halts_at_once")
_REALS = tuple(
    field.name for field in dataclasses.fields(Parameters) if field.name not in ("schedule", "population", *_SWITCHES)
)

# The layout of `Parameters.record()`.
PARAMETERS = np.dtype([(each.name, "f8" if each.name in _REALS else "i8") for each in dataclasses.fields(Parameters)])


def original(**changes: float) -> Parameters:
    """Return the parameters of the published system."""
    return Parameters(schedule="original", **{**dict.fromkeys(_SWITCHES, False), **changes})  # type: ignore[arg-type]


def guarded(**changes: float) -> Parameters:
    """Return the parameters of the repaired system."""
    return Parameters(schedule="guarded", **{"plan_margin": 0.05, "guard_margin": 0.025, **changes})  # type: ignore[arg-type]

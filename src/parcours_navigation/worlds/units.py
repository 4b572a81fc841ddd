"""The unit of each number of a world file, so that a radius of `22 s` is a finding and not 22 m.

A number without a unit is in SI units and fits anywhere; one with a unit must have the dimension of its key. Angles
count as plain numbers, as in formulas (`parcours_navigation.requirements.vocabulary`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from parcours.model.expression import Apply, Binary, Expression, Literal, Name, Unary
from parcours.model.expression.parsing import UNITS
from parcours_navigation.requirements.vocabulary import Dimension, Meaning, named

_NAMES = {
    "m": "aisle apron area arrive bounds cell corridor depth discs door ends_outside footprint gap goal goals least "
         "length map margin most noise path places points polygons position_noise radius range reach room shelf size "
         "tolerance track_width wall wall_range walls way_noise wheelbase width",
    "s": "announced between delay ends_at_rest horizon late later moves pause relax time_limit waits wall_horizon",
    "rad": "field_of_view first_beam heading heading_tolerance steering tilt turn_noise turn_noise_way",
    "m/s": "speed speed_spread start_speed velocity_noise wheel_speed",
    "rad/s": "steering_rate turn turn_rate yaw_rate",
    "m/s^2": "acceleration cohesion strength wall_strength wheel_acceleration",
    "rad/s^2": "yaw_acceleration",
    "s/m": "ahead",
    "1/s^2": "stiffness",
    "1": "beams clutter columns desks drawn_goals dropped effort false fill group hurry missing n nearest number only "
         "rooms rows seed side slowest slowing smoothing turn_scale turning way_scale yields",
}  # fmt: skip
UNIT_OF = {name: unit for unit, names in _NAMES.items() for name in names.split()} | {
    "start": "m m rad",
    "others, start": "s",
    "random-walk, turn": "rad",
}
"""Key, or what holds it and the key -> SI unit of its number; of a list whose items differ, the unit of each."""

_PLAIN: Dimension = (0.0, 0.0)
_LENGTHS, _TIMES = ("m", "cm", "mm", "km"), ("s", "ms", "us", "min")
_SI = re.compile(r"(1|m|s|rad)(\^?[0-9])?(/(m|s)(\^?[0-9])?)?")
_NOT_SI = re.compile(
    rf"({'|'.join(one for one in UNITS if UNITS[one] != 1.0)})(?![a-z])|.+/({'|'.join(_TIMES[1:])}|h)$"
)


def unit_of(what: str, holder: str = "") -> str:
    """Return the SI unit of the number that a message calls so, "" where it is not known.

    >>> unit_of("the world, robot, speed"), unit_of("the world, task, start[2]"), unit_of("others 1, start")
    ('m/s', 'rad', 's')
    """
    *above, last = what.split(", ")
    name, _, at = re.sub(r" \d+", "", last).partition("[")
    group = above[-1].partition(" ")[0] if above else ""
    units = (UNIT_OF.get(f"{holder}, {name}") or UNIT_OF.get(f"{group}, {name}") or UNIT_OF.get(name, "")).split()
    places = re.findall(r"\d+", at)
    return units[min(int(places[-1]), len(units) - 1)] if len(units) > 1 and places else " ".join(units[:1])


def is_scaled(unit: str) -> bool:
    """Return whether a unit is known, and no SI unit.

    >>> [one for one in ("m/s2", "deg", "km/h", "people", "1", "cm") if is_scaled(one)]
    ['deg', 'km/h', 'cm']
    """
    return _NOT_SI.match(unit) is not None


def fault_of(number: Expression, unit: str, inputs: Mapping[str, str]) -> str:
    """Return what is wrong with the unit of a number, in words; "" if nothing is.

    Args:
        number: what stands in the file.
        unit: its SI unit, "" where any will do.
        inputs: the units of the names that it may read.
    """
    try:
        found = _dimension(number, inputs)
    except _Differ as differ:
        return f"what is added or compared must have one unit, but is in {differ}"
    if not unit or found is None or found == _of(unit):
        return ""
    here = "an angle or a share" if found == _PLAIN else f"in {named(found)}"
    return f"it must be {'a plain number' if unit == '1' else f'in {unit}'}, but is {here}"


class _Differ(Exception):
    """Two parts of a number have different units."""


def _of(unit: str) -> Dimension:
    return Meaning(re.sub(r"(?<=[a-z])(?=[0-9])", "^", unit), "").dimension


def _dimension(node: Expression, inputs: Mapping[str, str]) -> Dimension | None:
    """Return the dimension of a number; None of one without a unit, which fits any."""
    match node:
        case Literal(_, unit) if unit:
            return (1.0, 0.0) if unit in _LENGTHS else (0.0, 1.0) if unit in _TIMES else _PLAIN
        case Name(("s" | "s2") as name):
            return 0.0, 2.0 if name == "s2" else 1.0
        case Name(name):
            unit = inputs.get(name, "1")
            return None if unit == "1" or not _SI.fullmatch(unit) else _of(unit)
        case Unary(_, operand):
            return _dimension(operand, inputs)
        case Binary(("*" | "/") as sign, left, right):
            one, other = _dimension(left, inputs), _dimension(right, inputs)
            if one is None and other is None:
                return None
            (a, b), (c, d) = one or _PLAIN, other or _PLAIN  # a share or a multiple of what has a unit has that unit
            by = 1.0 if sign == "*" else -1.0
            return a + by * c, b + by * d
        case Binary(_, left, right) | Apply("min" | "max", (left, right)):
            one, other = _dimension(left, inputs), _dimension(right, inputs)
            if one is not None and other is not None and one != other:
                raise _Differ(f"{named(one)} and {named(other)}")
            return other if one is None else one
        case Apply("abs", (operand,)):
            return _dimension(operand, inputs)
        case _:
            return None

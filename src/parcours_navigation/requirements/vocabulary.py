"""The names that formulas read, with their units: the signals of a track, and the values of a whole case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from parcours_navigation.measures.table import METRICS

Dimension: TypeAlias = tuple[float, float]
"""Powers of metre and second; an angle has neither."""

FLAG = "flag"
"""The unit of a signal that is on or off: 1 while it is on, -1 while it is off."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a name stands for."""

    unit: str  # SI; "1" for a number without one, FLAG for what is on or off
    words: str

    @property
    def dimension(self) -> Dimension:
        """Its powers of metre and second.

        >>> Meaning("m^2/s^3", "").dimension, Meaning("rad/s", "").dimension
        ((2.0, -3.0), (0.0, -1.0))
        """
        powers = {"m": 0.0, "s": 0.0}
        for sign, side in zip((1.0, -1.0), self.unit.split("/"), strict=False):
            base, _, power = side.partition("^")
            if base in powers:
                powers[base] += sign * float(power or 1)
        return powers["m"], powers["s"]


SIGNALS: dict[str, Meaning] = {
    "time": Meaning("s", "since the case began"),
    "x": Meaning("m", "of the robot's centre"),
    "y": Meaning("m", "of the robot's centre"),
    "heading": Meaning("rad", "of the robot, counter-clockwise from x, in [-pi, pi)"),
    "speed": Meaning("m/s", "of the robot, never negative"),
    "forward_speed": Meaning("m/s", "of the robot along its heading, negative where it backs"),
    "yaw_rate": Meaning("rad/s", "of the robot, counter-clockwise positive"),
    "acceleration": Meaning("m/s^2", "change of forward_speed since the sample before; 0 at the first"),
    "yaw_acceleration": Meaning("rad/s^2", "change of yaw_rate since the sample before; 0 at the first"),
    "clearance": Meaning("m", "gap to what is closest, negative in overlap; infinite where there is nothing"),
    "time_to_collision": Meaning(
        "s",
        "until a moving robot drives into something if all go on as since the sample before, negative where it does",
    ),
    "goal_distance": Meaning("m", "from the robot's centre to the goal"),
    "heading_error": Meaning("rad", "from the robot's heading to the direction of the goal, in [-pi, pi)"),
    "travelled": Meaning("m", "length of the robot's way so far"),
    "imminent": Meaning(FLAG, "the planner signals imminent collision"),
}
"""The signals of a track, sampled every 50 ms, in the order of the rows that `signals.take` fills."""

_ENDS = {
    "time": Meaning("s", "when the case ended"),
    "clearance": Meaning("m", "least gap to anything during the case, also between samples"),
    "goal_distance": Meaning("m", "from the robot to the goal when the case ended"),
    "x": Meaning("m", "of the robot when the case ended"),
    "y": Meaning("m", "of the robot when the case ended"),
    "heading": Meaning("rad", "of the robot when the case ended"),
    "travelled": Meaning("m", "length of the robot's way when the case ended"),
    "halts": Meaning("1", "how often the planner signalled imminent collision"),
    "switches": Meaning("1", "how often the planner changed what it follows"),
    "contacts": Meaning("1", "contacts that the robot caused, alone or not"),
}

VALUES: dict[str, Meaning] = _ENDS | {
    one.name: Meaning(one.unit, one.definition) for one in METRICS if one.name not in _ENDS
}
"""The values of a whole case, which `fail:` reads: how it ended, and its measures (docs/metrics.md)."""


def unit_of(dimension: Dimension | None) -> str:
    """Return the unit of a dimension, "1" if it has none or is not known.

    >>> unit_of((1.0, -2.0)), unit_of(None)
    ('m/s^2', '1')
    """
    return "1" if dimension is None or dimension == (0.0, 0.0) else named(dimension)


def named(dimension: Dimension) -> str:
    """Return the unit of a dimension in words; that of a plain number is `1`."""
    powers = [(name, power) for name, power in zip("ms", dimension, strict=True) if power]
    above = " ".join(_power(name, power) for name, power in powers if power > 0.0)
    below = " ".join(_power(name, -power) for name, power in powers if power < 0.0)
    return f"{above or '1'}/{below}" if below else above or "1"


def _power(name: str, power: float) -> str:
    return name if power == 1.0 else f"{name}^{power:g}"

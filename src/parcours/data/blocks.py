"""A block: an interval of values, or a single one, whose values stand for each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from parcours.errors import BadDomain


@dataclass(frozen=True, slots=True)
class Block:
    """An interval of values that stand for each other; each end belongs to it or not.

    `name` is what rules and reports call it, where the interval itself is not name enough.

    Raises:
        BadDomain: an end is not finite, or the block holds no value.

    >>> 1.0 in Block(1.0, 1.5, low_closed=False)
    False
    """

    low: float
    high: float
    low_closed: bool = True
    high_closed: bool = True
    name: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise BadDomain(f"block {self}", "the ends of a block must be finite", slug="block-infinite")
        if self.first > self.last:
            raise BadDomain(
                f"block {self}", "a block must hold at least one value", "widen or drop it", slug="block-empty"
            )

    def __contains__(self, value: float) -> bool:
        """Return whether the value [unit of the domain] lies in the block."""
        return self.first <= value <= self.last

    def __str__(self) -> str:
        return f"{'[' if self.low_closed else '('}{self.low:g}, {self.high:g}{']' if self.high_closed else ')'}"

    @property
    def label(self) -> str:
        """What rules and reports call the block: its name, else its value or interval.

        >>> Block(0.0, 1.0).label, Block(2.0, 2.0).label, Block(0.0, 1.0, name="near").label
        ('[0, 1]', '2', 'near')
        """
        if self.name or not self.is_point:
            return self.name or str(self)
        short = f"{self.low:g}"
        return short if float(short) == self.low else repr(self.low)

    @property
    def is_point(self) -> bool:
        """Whether the block holds one value only."""
        return self.low == self.high

    @property
    def width(self) -> float:
        """The distance between the ends [unit of the domain]."""
        return self.high - self.low

    @property
    def first(self) -> float:
        """The least floating-point number in the block [unit of the domain]."""
        return self.low if self.low_closed else math.nextafter(self.low, math.inf)

    @property
    def last(self) -> float:
        """The greatest floating-point number in the block [unit of the domain]."""
        return self.high if self.high_closed else math.nextafter(self.high, -math.inf)


def point(value: float, name: str = "") -> Block:
    """Return the block that holds one value only."""
    return Block(value, value, name=name)

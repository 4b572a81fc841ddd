"""Blocks: intervals of values, or single ones, whose values stand for each other; and the checks of a partition."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

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


def check_blocks(where: str, unit: str, blocks: Sequence[Block], stated: Block | None, kind: str) -> None:
    """Raise BadDomain unless the blocks of numbers ascend without gap or overlap, and fill the stated range.

    Single values may stand apart, and integers need no shared ends: `[0, 3]`, `[4, 7]`. Blocks of angles may fill a
    whole circle, but not more.
    """
    if not blocks:
        raise BadDomain(where, "a domain must have at least one block", slug="blocks-none")
    _check_names(where, blocks)
    for below, above in pairwise(blocks):
        if kind == "integer" and below.high < above.low and math.floor(below.last) + 1 == math.ceil(above.first):
            continue  # no whole number lies between them
        if below.high < above.low and not (below.is_point and above.is_point):
            rule = f"blocks must leave no gap, but {below} precedes {above}"
            raise BadDomain(where, rule, "let one block begin where the other ends", slug="blocks-gap")
        if below.high > above.low or (below.is_point and above.is_point and below.high == above.low):
            rule = f"blocks must ascend without overlap, but {below} precedes {above}"
            raise BadDomain(where, rule, "sort them and let one begin where the other ends", slug="blocks-overlap")
        if below.high == above.low and below.high_closed == above.low_closed:
            owners = "both" if above.low_closed else "neither"
            rule = f"{above.low:g} {unit} must belong to one block, but {owners} of {below} and {above} holds it"
            raise BadDomain(where, rule, "close exactly one of the two ends", slug="blocks-edge")
    low, high = blocks[0].low, blocks[-1].high
    if stated and (stated.low, stated.high) != (low, high):
        span = Block(low, high, blocks[0].low_closed, blocks[-1].high_closed)
        rule = f"blocks must fill the range {stated}, but they fill {span}"
        raise BadDomain(where, rule, "correct the range or the outer blocks", slug="blocks-range")
    if kind == "angle":
        _check_circle(where, blocks)
    if kind == "integer":
        _check_whole(where, blocks)


def check_enumeration(where: str, blocks: Sequence[Block], invalid: Sequence[Block], values: Sequence[str]) -> None:
    """Raise BadDomain unless every name is in one block, and every block holds names."""
    if not blocks:
        raise BadDomain(where, "a domain must have at least one block", slug="blocks-none")
    for value, times in Counter(values).items():
        if times > 1:
            raise BadDomain(where, f"a value must be listed once, but {value!r} is {times} times", slug="values-double")
    places = [place for b in (*blocks, *invalid) for place in range(math.ceil(b.first), math.floor(b.last) + 1)]
    if sorted(places) != list(range(len(values))) or list(blocks) != sorted(blocks, key=lambda block: block.low):
        rule = f"each of its {len(values)} values must be in one block, in order, but places {places} are"
        raise BadDomain(where, rule, slug="values-blocks")
    _check_names(where, blocks)


def check_invalid(where: str, blocks: Sequence[Block], invalid: Sequence[Block], kind: str) -> None:
    """Raise BadDomain unless the invalid blocks lie apart from the valid ones, from each other and off the circle."""
    if kind == "angle" and invalid:
        rule = "an angle has no invalid blocks, since every number is some angle"
        raise BadDomain(where, rule, "make it real", slug="blocks-invalid")
    if kind == "integer":
        _check_whole(where, invalid)
    _check_names(where, [*blocks, *invalid])
    ascending = sorted([*blocks, *invalid], key=lambda block: (block.first, block.last))
    for below, above in pairwise(ascending):
        if below.last >= above.first:
            rule = f"an invalid block must lie apart from the others, but {below.label} meets {above.label}"
            raise BadDomain(where, rule, "open one of the ends, or shorten it", slug="blocks-invalid")


def _check_names(where: str, blocks: Sequence[Block]) -> None:
    for name, times in Counter(block.name for block in blocks if block.name).items():
        if times > 1:
            rule = f"blocks must be told apart by their names, but {times} are called {name!r}"
            raise BadDomain(where, rule, "name them", slug="block-names")


def _check_whole(where: str, blocks: Sequence[Block]) -> None:
    for block in blocks:
        if math.ceil(block.first) > math.floor(block.last):
            rule = f"every block of an integer domain must hold a whole number, but {block} holds none"
            raise BadDomain(where, rule, "widen it or make the domain real", slug="block-empty")


def _check_circle(where: str, blocks: Sequence[Block]) -> None:
    low, high = blocks[0].low, blocks[-1].high
    turn = 2.0 * math.pi
    if not (-math.pi <= low <= math.pi and high - low <= turn + 1e-9):
        rule = f"angles must begin within -pi .. pi and go round once at most, but these fill [{low:g}, {high:g}]"
        raise BadDomain(where, rule, "write the block across pi as (3*pi/4, -3*pi/4]", slug="blocks-circle")
    if high - low > turn - 1e-9 and blocks[0].low_closed and blocks[-1].high_closed and not blocks[0].is_point:
        rule = f"{low:g} rad must belong to one block, but it is the end of {blocks[0]} and of {blocks[-1]}"
        raise BadDomain(where, rule, "close exactly one of the two ends", slug="blocks-edge")

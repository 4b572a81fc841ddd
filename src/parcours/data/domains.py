"""Input domains, in units, split into blocks, and the input model that puts them in order.

A domain is the range one input may take. Its blocks partition it, so that any value of a block stands for the
others (Ammann & Offutt, Introduction to Software Testing, 2008, ch. 4). An input model is the ordered list of
domains with the constraints that a row of values must meet.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from parcours.data.constraints import Constraint
from parcours.errors import BadDomain

Kind: TypeAlias = Literal["real", "integer"]
"""What a domain's values are: any number of the range, or the whole numbers of it."""

Closed: TypeAlias = Literal["left", "right"]
"""Which neighbour owns an inner edge: `left` means blocks [a, b), `right` means blocks (a, b]."""

OUTSIDE = -1
"""The block index of a value that lies in no block of its domain."""


@dataclass(frozen=True, slots=True)
class Block:
    """An interval of values that stand for each other; each end belongs to it or not.

    Raises:
        BadDomain: an end is not finite, or the block holds no value.

    >>> 1.0 in Block(1.0, 1.5, low_closed=False)
    False
    """

    low: float
    high: float
    low_closed: bool = True
    high_closed: bool = True

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise BadDomain(f"block {self}", "the ends of a block must be finite", slug="block-infinite")
        if self.first > self.last:
            raise BadDomain(
                f"block {self}",
                "a block must hold at least one value",
                "widen or drop it",
                slug="block-empty",
            )

    def __contains__(self, value: float) -> bool:
        """Return whether the value [unit of the domain] lies in the block."""
        return self.first <= value <= self.last

    def __str__(self) -> str:
        return f"{'[' if self.low_closed else '('}{self.low:g}, {self.high:g}{']' if self.high_closed else ')'}"

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


@dataclass(frozen=True, slots=True)
class Domain:
    """The range one input may take, as blocks that partition it.

    `stated` is the range as its source states it; it has the ends of the blocks' hull, but an end may be open
    in one and closed in the other. There the blocks decide, since it is the blocks that coverage is counted
    on.

    Raises:
        BadDomain: the blocks leave a gap, overlap or descend; the stated range ends elsewhere; a block of an
            integer
            domain holds no whole number.
    """

    name: str
    unit: str
    blocks: tuple[Block, ...]
    kind: Kind = "real"
    stated: Block | None = None
    doc: str = ""

    def __post_init__(self) -> None:
        where = f"domain {self.name!r}"
        if not self.blocks:
            raise BadDomain(where, "a domain must have at least one block", slug="blocks-none")
        for below, above in pairwise(self.blocks):
            if below.high < above.low:
                raise BadDomain(
                    where,
                    f"blocks must leave no gap, but {below} precedes {above}",
                    "let one block begin where the other ends",
                    slug="blocks-gap",
                )
            if below.high > above.low:
                raise BadDomain(
                    where,
                    f"blocks must ascend without overlap, but {below} precedes {above}",
                    "sort them and let one begin where the other ends",
                    slug="blocks-overlap",
                )
            if below.high_closed == above.low_closed:
                owners = "both" if above.low_closed else "neither"
                raise BadDomain(
                    where,
                    f"{above.low:g} {self.unit} must belong to one block, but {owners} of {below} and {above} holds it",
                    "close exactly one of the two ends",
                    slug="blocks-edge",
                )
        if self.stated and (self.stated.low, self.stated.high) != (self.span.low, self.span.high):
            raise BadDomain(
                where,
                f"blocks must fill the range {self.stated}, but they fill {self.span}",
                "correct the range or the outer blocks",
                slug="blocks-range",
            )
        for block in self.blocks:
            if self.kind == "integer" and math.ceil(block.first) > math.floor(block.last):
                raise BadDomain(
                    where,
                    f"every block of an integer domain must hold a whole number, but {block} holds none",
                    "widen it or make the domain real",
                    slug="block-empty",
                )

    def __contains__(self, value: float) -> bool:
        """Return whether the value [unit] lies in one of the blocks."""
        return self.block_of(value) != OUTSIDE

    @property
    def span(self) -> Block:
        """The hull of the blocks [unit]: from the first block's low end to the last block's high end."""
        first, last = self.blocks[0], self.blocks[-1]
        return Block(first.low, last.high, first.low_closed, last.high_closed)

    def block_of(self, value: float) -> int:
        """Return the index of the block that holds the value [unit], or OUTSIDE.

        >>> split("v", "m/s", [0.0, 0.25, 0.5]).block_of(0.25)
        0
        """
        return int(self.blocks_of(np.array([value]))[0])

    def blocks_of(self, values: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the index of the block that holds each value, or OUTSIDE.

        Args:
            values: [unit], any shape.
        """
        lasts = np.array([block.last for block in self.blocks])
        # Block i is the first whose last number is not below the value, since blocks ascend and leave no gap.
        index = np.searchsorted(lasts, values, side="left")
        inside = (values >= self.span.first) & (values <= self.span.last)
        if self.kind == "integer":
            inside &= np.floor(values) == values
        return np.where(inside, index, OUTSIDE).astype(np.int64)


@dataclass(frozen=True, slots=True)
class InputModel:
    """The inputs of a test in order, the rules a row of their values must meet, and where both come from.

    `domains` has the order of the columns of every table of rows or values; `constraints` speak of domain
    names only.
    """

    name: str
    domains: tuple[Domain, ...]
    constraints: tuple[Constraint, ...] = ()
    source: str = ""
    doc: str = ""
    repeat: int = 1

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the inputs, in column order."""
        return tuple(domain.name for domain in self.domains)

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of blocks of each input, in column order."""
        return tuple(len(domain.blocks) for domain in self.domains)


def split(name: str, unit: str, edges: Sequence[float], *, closed: Closed = "right", kind: Kind = "real") -> Domain:
    """Return the domain whose blocks lie between consecutive edges; both outer ends belong to it.

    Args:
        name: what the input is called in the model.
        unit: SI unit of the edges.
        edges: at least two block ends [unit], strictly increasing, shape (n_blocks + 1,).
        closed: `right` gives an inner edge to the block below it, `left` to the block above.
        kind: whether all numbers between the edges are meant, or the whole ones.

    Raises:
        BadDomain: the edges are too few, or do not increase.

    Example: linear velocity of an obstacle, cut at the robot's own top speed.

    >>> v = split("v", "m/s", [0.0, 0.25, 0.5])
    >>> [0.25 in block for block in v.blocks]
    [True, False]
    >>> [str(block) for block in split("v", "m/s", [0.0, 0.25, 0.5], closed="left").blocks]
    ['[0, 0.25)', '[0.25, 0.5]']
    """
    where = f"domain {name!r}"
    if len(edges) < 2:
        raise BadDomain(where, f"a domain needs at least two edges, but {len(edges)} given", slug="edges-few")
    for low, high in pairwise(edges):
        if not low < high:
            raise BadDomain(
                where,
                f"edges must increase, but {high:g} {unit} follows {low:g} {unit}",
                "sort the edges and drop doubles",
                slug="edges-order",
            )
    n = len(edges) - 1
    blocks = tuple(
        Block(
            float(edges[i]),
            float(edges[i + 1]),
            low_closed=closed == "left" or i == 0,
            high_closed=closed == "right" or i == n - 1,
        )
        for i in range(n)
    )
    return Domain(name, unit, blocks, kind)

"""Input domains, in units, split into blocks.

A domain is the range one input may take. Its blocks partition it, so that any value of a block stands for the
others (Ammann & Offutt, Introduction to Software Testing, 2008, ch. 4). Values are numbers: reals, integers, angles on
a circle, or the places of names in an enumeration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from parcours.data.blocks import Block, check_blocks, check_enumeration, check_invalid
from parcours.errors import BadDomain

Kind: TypeAlias = Literal["real", "integer", "angle", "enumeration"]
"""What a domain's values are: any number of the range, the whole numbers of it, angles in (-pi, pi], or names."""

Closed: TypeAlias = Literal["left", "right"]
"""Which neighbour owns an inner edge: `left` means blocks [a, b), `right` means blocks (a, b]."""

OUTSIDE = -1
"""The block index of a value that lies in no block of its domain."""


@dataclass(frozen=True, slots=True)
class Domain:
    """The range one input may take, as blocks that partition it.

    Attributes:
        name: what rules call the input.
        unit: of its values.
        blocks: ascending intervals that leave no gap, or single values, which may stand apart. Blocks of an angle
            [rad] may go on beyond pi: [3, 4] holds the angles from 3 to pi, and those from -pi to 4 - 2 pi.
        kind: what its values are.
        stated: the range as its source states it; it has the ends of the blocks' hull, but an end may be open in
            one and closed in the other. There the blocks decide, since it is the blocks that coverage is counted on.
        doc: what the input means.
        values: the names of an enumeration; its blocks hold their places, counted from 0.
        invalid: blocks for negative tests, apart from the others; their indices follow those of `blocks`.
        bases: indices of the blocks that base choice starts from.
        step: how far `just inside` is from a boundary [unit]; None for the default of boundaries.py.

    Raises:
        BadDomain: the blocks leave a gap, overlap or descend; the stated range ends elsewhere; a block of an integer
            domain holds no whole number; names and blocks of an enumeration do not match; an invalid block overlaps.
    """

    name: str
    unit: str
    blocks: tuple[Block, ...]
    kind: Kind = "real"
    stated: Block | None = None
    doc: str = ""
    values: tuple[str, ...] = ()
    invalid: tuple[Block, ...] = ()
    bases: tuple[int, ...] = (0,)
    step: float | None = None

    def __post_init__(self) -> None:
        where = f"domain {self.name!r}"
        if self.kind == "enumeration":
            check_enumeration(where, self.blocks, self.invalid, self.values)
        else:
            check_blocks(where, self.unit, self.blocks, self.stated, self.kind)
        check_invalid(where, self.blocks, self.invalid, self.kind)
        if not self.bases or not all(0 <= base < len(self.blocks) for base in self.bases):
            raise BadDomain(where, f"bases must be valid blocks, but are {list(self.bases)}", slug="block-base")

    def __contains__(self, value: float) -> bool:
        """Return whether the value [unit] lies in one of the valid blocks."""
        return 0 <= self.block_of(value) < len(self.blocks)

    @property
    def span(self) -> Block:
        """The hull of the blocks [unit]: from the first block's low end to the last block's high end."""
        first, last = self.blocks[0], self.blocks[-1]
        return Block(first.low, last.high, first.low_closed, last.high_closed)

    @property
    def choices(self) -> tuple[Block, ...]:
        """All blocks by index, the invalid ones last."""
        return self.blocks + self.invalid

    @property
    def labels(self) -> tuple[str, ...]:
        """What rules and reports call each of `choices`."""
        return tuple(block.label for block in self.choices)

    def block_of(self, value: float) -> int:
        """Return the index among `choices` of the block that holds the value [unit], or OUTSIDE.

        >>> split("v", "m/s", [0.0, 0.25, 0.5]).block_of(0.25)
        0
        """
        return int(self.blocks_of(np.array([value]))[0])

    def blocks_of(self, values: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the index among `choices` of the block that holds each value, or OUTSIDE."""
        if self.kind == "angle":
            values = unrolled(values, self.span)
        firsts, lasts = (np.array([getattr(b, end) for b in self.blocks]) for end in ("first", "last"))
        # Block i is the first whose last number is not below the value, since blocks ascend.
        index = np.minimum(np.searchsorted(lasts, values, side="left"), len(lasts) - 1)
        inside = (values >= firsts[index]) & (values <= lasts[index])
        found = np.where(inside, index, OUTSIDE).astype(np.int64)
        for place, block in enumerate(self.invalid):
            found[(values >= block.first) & (values <= block.last)] = len(self.blocks) + place
        if self.kind in ("integer", "enumeration"):
            found[np.floor(values) != values] = OUTSIDE
        return found

    def shown(self, value: float) -> str:
        """Return a value [unit] as people write it: the name, if it is that of an enumeration.

        >>> enumeration("gear", ("slow", "fast")).shown(1.0), split("v", "m/s", [0.0, 0.5]).shown(0.125)
        ('fast', '0.125')
        """
        is_name = self.kind == "enumeration" and value in range(len(self.values))
        return self.values[int(value)] if is_name else f"{value:.9g}"


def unrolled(values: NDArray[np.float64], span: Block) -> NDArray[np.float64]:
    """Return angles [rad] as those numbers, equal modulo 2 pi, that lie within a span where that is possible.

    >>> unrolled(np.array([-3.0, 3.0, 10.0]), Block(3.0, 4.0)).round(4).tolist()
    [3.2832, 3.0, 3.7168]
    """
    # The block [3, 4] crosses pi, where angles jump to -pi; it is looked at as one piece of the number line:
    #
    #     -pi ──]────────────────────[── pi         ──[──pi──]──
    #       4 - 2 pi                 3                3      4
    turn = 2.0 * math.pi
    with np.errstate(invalid="ignore"):
        plain = (values > -math.pi) & (values <= math.pi)
        angles = np.where(plain, values, math.pi - np.mod(math.pi - values, turn))
        angles = np.where(angles < span.first, angles + turn, angles)
        return np.where(angles > span.last, angles - turn, angles)


def enumeration(name: str, values: Sequence[str], *, doc: str = "") -> Domain:
    """Return the enumeration in which each name is a block.

    Raises:
        BadDomain: there is no name, or one twice.

    >>> enumeration("mode", ["auto", "manual"]).labels
    ('auto', 'manual')
    """
    blocks = tuple(Block(place, place, name=value) for place, value in enumerate(values))
    return Domain(name, "1", blocks, "enumeration", doc=doc, values=tuple(values))


def split(name: str, unit: str, edges: Sequence[float], *, closed: Closed = "right", kind: Kind = "real") -> Domain:
    """Return the domain whose blocks lie between consecutive edges; both outer ends belong to it.

    A full circle of angles is an exception: its ends are one angle, which belongs to one block.

    Args:
        name: what the input is called in the model.
        unit: SI unit of the edges.
        edges: at least two block ends [unit], strictly increasing, shape (n_blocks + 1,).
        closed: `right` gives an inner edge to the block below it, `left` to the block above.
        kind: whether all numbers between the edges are meant, the whole ones, or angles.

    Raises:
        BadDomain: the edges are too few, or do not increase.

    Example: the speed of a lift, cut where it counts as fast.

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
            rule = f"edges must increase, but {high:g} {unit} follows {low:g} {unit}"
            raise BadDomain(where, rule, "sort the edges and drop doubles", slug="edges-order")
    n = len(edges) - 1
    is_circle = kind == "angle" and abs(edges[-1] - edges[0] - 2.0 * math.pi) < 1e-9
    blocks = tuple(
        Block(
            float(edges[i]),
            float(edges[i + 1]),
            low_closed=closed == "left" or (i == 0 and not is_circle),
            high_closed=closed == "right" or (i == n - 1 and not is_circle),
        )
        for i in range(n)
    )
    return Domain(name, unit, blocks, kind)

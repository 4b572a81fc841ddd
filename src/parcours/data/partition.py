"""Blocks to a complaint unless they partition their domain: no gap, no overlap, one owner for each edge."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from parcours.data.blocks import Block
from parcours.errors import BadDomain


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
            raise BadDomain(
                where,
                f"blocks must leave no gap, but {below} precedes {above}",
                "let one block begin where the other ends",
                slug="blocks-gap",
            )
        if below.high > above.low or (below.is_point and above.is_point and below.high == above.low):
            raise BadDomain(
                where,
                f"blocks must ascend without overlap, but {below} precedes {above}",
                "sort them and let one begin where the other ends",
                slug="blocks-overlap",
            )
        if below.high == above.low and below.high_closed == above.low_closed:
            owners = "both" if above.low_closed else "neither"
            raise BadDomain(
                where,
                f"{above.low:g} {unit} must belong to one block, but {owners} of {below} and {above} holds it",
                "close exactly one of the two ends",
                slug="blocks-edge",
            )
    low, high = blocks[0].low, blocks[-1].high
    if stated and (stated.low, stated.high) != (low, high):
        span = Block(low, high, blocks[0].low_closed, blocks[-1].high_closed)
        raise BadDomain(
            where,
            f"blocks must fill the range {stated}, but they fill {span}",
            "correct the range or the outer blocks",
            slug="blocks-range",
        )
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
        raise BadDomain(
            where,
            f"each of its {len(values)} values must be in one block, in order, but places {places} are",
            slug="values-blocks",
        )
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
            raise BadDomain(
                where,
                f"an invalid block must lie apart from the others, but {below.label} meets {above.label}",
                "open one of the ends, or shorten it",
                slug="blocks-invalid",
            )


def _check_names(where: str, blocks: Sequence[Block]) -> None:
    for name, times in Counter(block.name for block in blocks if block.name).items():
        if times > 1:
            rule = f"blocks must be told apart by their names, but {times} are called {name!r}"
            raise BadDomain(where, rule, "name them", slug="block-names")


def _check_whole(where: str, blocks: Sequence[Block]) -> None:
    for block in blocks:
        if math.ceil(block.first) > math.floor(block.last):
            raise BadDomain(
                where,
                f"every block of an integer domain must hold a whole number, but {block} holds none",
                "widen it or make the domain real",
                slug="block-empty",
            )


def _check_circle(where: str, blocks: Sequence[Block]) -> None:
    low, high = blocks[0].low, blocks[-1].high
    turn = 2.0 * math.pi
    if not (-math.pi <= low <= math.pi and high - low <= turn + 1e-9):
        rule = f"angles must begin within -pi .. pi and go round once at most, but these fill [{low:g}, {high:g}]"
        raise BadDomain(where, rule, "write the block across pi as (3*pi/4, -3*pi/4]", slug="blocks-circle")
    if high - low > turn - 1e-9 and blocks[0].low_closed and blocks[-1].high_closed and not blocks[0].is_point:
        rule = f"{low:g} rad must belong to one block, but it is the end of {blocks[0]} and of {blocks[-1]}"
        raise BadDomain(where, rule, "close exactly one of the two ends", slug="blocks-edge")

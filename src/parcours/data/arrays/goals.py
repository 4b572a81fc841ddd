"""Numbers the combinations of blocks (tuples) that an array must hold, and counts those it holds.

A tuple is a choice of one block for each column of a set. Tuples are numbered through: those of set s begin at
`start[s]`, and within it count as digits do. So a table of rows is measured by one `bincount`, and the compiled
searches add and subtract numbers instead of comparing tuples.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from parcours.data.rules import OPEN, Rules
from parcours.errors import BadRequest

MAX_TUPLES = 30_000_000
"""Most tuples that an array is built or measured for."""

_AT_ONCE = 4_000_000

Ints = NDArray[np.int64]

# A pair-wise covering array of three columns with 2, 2 and 3 blocks, and the numbers of its tuples:
#
#     row   c0 c1 c2     set s   columns   start[s]   number of a tuple (its blocks as digits)
#      0     0  0  0       0      c0 c1       0       0 + 2 * b0 + b1       0 ..  3
#      1     0  1  1       1      c0 c2       4       4 + 3 * b0 + b2       4 ..  9
#      2     1  0  2       2      c1 c2      10      10 + 3 * b1 + b2      10 .. 15
#      3     1  1  0
#      4     0  0  1      `strides` are 2, 1 and 3, 1 and 3, 1. Row 1 holds 0 + 1 = 1, 4 + 1 = 5, 10 + 4 = 14.
#      5     ...          When b2 of a row changes by d, its tuples in sets 1 and 2 move by d, that in set 0 stays.


class GoalTables(NamedTuple):
    """What compiled code knows of goals and rules; every array is int64 but `needed` and `allowed`, which are bool.

    Sets of columns: `columns`, `strides` of shape (n_sets, width), filled up with stride 0; `widths` (n_sets,);
    `start` (n_sets + 1,). `of_column`, `set_of`, `place_of`: for column c, entries of_column[c] .. of_column[c + 1]
    name the sets that hold it, and where. Rules alike: `rule_columns`, `rule_strides`, `rule_widths`, `rule_start`
    into the flat `allowed`; `rules_of_column`, `rule_of`.
    """

    sizes: Ints
    columns: Ints
    strides: Ints
    widths: Ints
    start: Ints
    of_column: Ints
    set_of: Ints
    place_of: Ints
    needed: NDArray[np.bool_]
    rule_columns: Ints
    rule_strides: Ints
    rule_widths: Ints
    rule_start: Ints
    allowed: NDArray[np.bool_]
    rules_of_column: Ints
    rule_of: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Goals:
    """Which combinations of blocks the rows of an array must hold.

    Attributes:
        sizes: the number of (valid) blocks of each column.
        sets: the sets of columns of which every combination is wanted.
        rules: which rows are allowed at all.
        layout: the same for compiled code; `layout.needed` says which tuples can stand in an allowed row.
    """

    sizes: tuple[int, ...]
    sets: tuple[tuple[int, ...], ...]
    rules: Rules
    layout: GoalTables

    @property
    def n_tuples(self) -> int:
        """The number of tuples, those that cannot stand in an allowed row included."""
        return int(self.layout.start[-1])

    @property
    def n_needed(self) -> int:
        """The number of tuples that some allowed row holds."""
        return int(self.layout.needed.sum())

    def numbers(self, rows: Ints) -> Ints:
        """Return the numbers of the tuples that rows hold, shape (n_rows, n_sets)."""
        layout = self.layout
        found = np.repeat(layout.start[np.newaxis, :-1], len(rows), axis=0)
        for place in range(layout.columns.shape[1]):
            found += rows[:, layout.columns[:, place]] * layout.strides[:, place]
        return found

    def held(self, rows: Ints) -> NDArray[np.bool_]:
        """Return which tuples stand in some row, shape (n_tuples,).

        Args:
            rows: blocks, shape (n_rows, n_columns).
        """
        found = np.zeros(self.n_tuples, dtype=bool)
        for part in np.array_split(rows, max(1, len(rows) * len(self.sets) // _AT_ONCE)):
            found[self.numbers(part).ravel()] = True
        return found

    def missing(self, rows: Ints) -> Ints:
        """Return the numbers of the tuples that are wanted, but stand in no row."""
        return np.flatnonzero(self.layout.needed & ~self.held(rows))

    def are_met_by(self, rows: Ints) -> bool:
        """Return whether the rows are allowed and hold every tuple that an allowed row can hold."""
        return bool(self.rules.hold(rows).all()) and not len(self.missing(rows))

    def row_with(self, number: int) -> Ints | None:
        """Return an allowed row that holds the tuple with that number; None if there is none: then it is not needed."""
        row = np.full(len(self.sizes), OPEN)
        for column, block in self.tuple_of(number):
            row[column] = block
        found = self.rules.complete(row)
        if found is None:
            self.layout.needed[number] = False
        return found

    def tuple_of(self, number: int) -> tuple[tuple[int, int], ...]:
        """Return the tuple with that number as (column, block) pairs.

        >>> goals_of((2, 3), 2).tuple_of(5)
        ((0, 1), (1, 2))
        """
        index = int(np.searchsorted(self.layout.start, number, side="right")) - 1
        columns = self.sets[index]
        blocks = np.unravel_index(number - int(self.layout.start[index]), [self.sizes[c] for c in columns])
        return tuple((column, int(block)) for column, block in zip(columns, blocks, strict=True))


def goals_of(
    sizes: Sequence[int], strength: int, groups: Iterable[tuple[Sequence[int], int]] = (), rules: Rules | None = None
) -> Goals:
    """Return the goals of t-wise coverage: all combinations of blocks of every t columns.

    Args:
        sizes: the number of blocks of each column, all positive.
        strength: t, how many columns are combined; with fewer columns, all of them.
        groups: mixed strength: columns that are combined by another strength among themselves.
        rules: which rows are allowed; all, if None.

    Raises:
        BadRequest: there are more than MAX_TUPLES tuples.
    """
    wanted = [(range(len(sizes)), strength), *groups]
    n = sum(math.comb(len(columns), min(t, len(columns))) for columns, t in wanted)
    if n <= MAX_TUPLES:
        chosen = list(chain.from_iterable(combinations(sorted(of), min(t, len(of))) for of, t in wanted))
        kept = _without_parts(set(chosen))
        n = sum(math.prod(sizes[c] for c in columns) for columns in kept)
    if n > MAX_TUPLES:
        rule = f"at most {MAX_TUPLES} combinations are counted, but there are {n} or more"
        where = f"{strength}-wise coverage of {len(sizes)} parameters"
        remedy = "lower the strength, or give it to a group of parameters only"
        raise BadRequest(where, rule, remedy, slug="tuples-many")
    rules = rules or Rules(sizes)
    return Goals(tuple(sizes), kept, rules, _layout(sizes, kept, rules))


def _without_parts(sets: set[tuple[int, ...]]) -> tuple[tuple[int, ...], ...]:
    """Return the sets that are no part of another one: who holds the whole holds the part."""
    widths = {len(each) for each in sets}
    parts = {part for each in sets for width in widths if width < len(each) for part in combinations(each, width)}
    return tuple(sorted(sets - parts))


def _layout(sizes: Sequence[int], sets: tuple[tuple[int, ...], ...], rules: Rules) -> GoalTables:
    columns, strides, widths, start = _packed([(each, [sizes[c] for c in each]) for each in sets])
    needed = [rules.possible(each, sizes).ravel() for each in sets]
    tables = rules.tables
    rule_columns, rule_strides, rule_widths, rule_start = _packed([(t.columns, t.allowed.shape) for t in tables])
    holding = _by_column(len(sizes), sets)
    ruling = _by_column(len(sizes), [table.columns for table in tables])
    return GoalTables(
        np.array(sizes), columns, strides, widths, start, *holding, np.concatenate([*needed, np.zeros(0, bool)]),
        rule_columns, rule_strides, rule_widths, rule_start,
        np.concatenate([*(table.allowed.ravel() for table in tables), np.zeros(0, bool)]), *ruling[:2],
    )  # fmt: skip


def _packed(sets: Sequence[tuple[Sequence[int], Sequence[int]]]) -> tuple[Ints, Ints, Ints, Ints]:
    """Return columns, strides, widths and where the tuples of each set start."""
    width = max((len(columns) for columns, _ in sets), default=0)
    columns, strides = np.zeros((2, len(sets), width), dtype=np.int64)
    start = np.zeros(len(sets) + 1, dtype=np.int64)
    for index, (members, sizes) in enumerate(sets):
        columns[index, : len(members)] = members
        strides[index, : len(members)] = [math.prod(sizes[place + 1 :]) for place in range(len(members))]
        start[index + 1] = start[index] + math.prod(sizes)
    return columns, strides, np.array([len(members) for members, _ in sets], dtype=np.int64), start


def _by_column(n_columns: int, sets: Sequence[Sequence[int]]) -> tuple[Ints, Ints, Ints]:
    """Return for each column where its entries begin, and the entries: which set holds it, and at which place."""
    entries = sorted((c, index, place) for index, members in enumerate(sets) for place, c in enumerate(members))
    table = np.array(entries, dtype=np.int64).reshape(len(entries), 3)
    return np.searchsorted(table[:, 0], np.arange(n_columns + 1)), table[:, 1].copy(), table[:, 2].copy()

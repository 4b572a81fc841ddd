"""Decides which rows of blocks the rules allow, and whether a part of a row can be completed.

A rule speaks of a few columns and allows some of the combinations of their blocks. Rules that share columns form a
component; the allowed rows of a component are listed where they are few enough, so that what can be combined is read
off the list; elsewhere blocks that a rule leaves without partners are struck out (generalised arc consistency), and a
depth-first search, with a limit on its steps, decides what is left.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadDomain

MAX_CELLS = 1_000_000
"""Most combinations of blocks that one rule is tabulated for."""

MAX_LISTED = 200_000
"""Most allowed rows of a component that are listed."""

MAX_STEPS = 1_000
"""Most choices that one search for an allowed row takes back or makes, besides one for each column."""

MAX_CHECKS = 20_000
"""Most combinations in components without a list that are checked for what they strike out; more count as possible."""

OPEN = -1
"""Stands in a row where no block is chosen yet."""

_SOME_ROW = "some row of blocks must be allowed"

Ints = NDArray[np.int64]
_Masks = list[NDArray[np.bool_]]
"""Which blocks each column may still take; the arrays are replaced, never changed."""


@dataclass(frozen=True, slots=True, eq=False)
class RuleTable:
    """Which combinations of blocks a rule allows: `allowed` has one axis a column, in the order of `columns`."""

    name: str
    columns: tuple[int, ...]
    allowed: NDArray[np.bool_]


class UndecidedError(Exception):
    """A search took too many steps to say whether there is an allowed row."""


class Rules:
    """All rules of a table with these numbers of blocks.

    Args:
        sizes: the number of blocks of each column that a free choice may take.
        tables: the rules; their axes may be longer than `sizes`, for invalid blocks, which are never chosen freely.
        source: what the rules belong to, for messages.

    Raises:
        BadDomain: no row at all is allowed, and lists and what is struck out at once show it; `require_row` decides
            the rest.
    """

    def __init__(self, sizes: Sequence[int], tables: Sequence[RuleTable] = (), source: str = "rules") -> None:
        self.sizes = tuple(sizes)
        self.tables = tuple(table for table in tables if not table.allowed.all())
        self._checks = MAX_CHECKS
        self.source = source
        self.lost_steps = 0  # choices that searches took back
        lengths = list(self.sizes)
        for table in self.tables:
            for column, length in zip(table.columns, table.allowed.shape, strict=True):
                lengths[column] = length
        self._open = [np.arange(length) < size for length, size in zip(lengths, self.sizes, strict=True)]
        self._on = [[table for table in self.tables if c in table.columns] for c in range(len(self.sizes))]
        self._component = [OPEN] * len(self.sizes)
        self._listed: list[tuple[tuple[int, ...], Ints] | None] = []
        never = any(not table.columns for table in self.tables)  # a rule of constants that does not hold
        for members in () if never else self._components():
            for column in {c for table in members for c in table.columns}:
                self._component[column] = len(self._listed)
            self._listed.append(self._rows_of(members))
        never = never or any(listed is not None and not len(listed[1]) for listed in self._listed)
        if never or not self._narrow(self._masks({}), range(len(self.sizes))):
            self._refuse()

    def require_row(self) -> None:
        """Raise BadDomain where no row is allowed, or the search for one takes too long to say."""
        try:
            if self.complete(np.full(len(self.sizes), OPEN)) is None:
                self._refuse()
        except UndecidedError:
            rule = f"{_SOME_ROW}, but {MAX_STEPS} choices did not find one, nor that there is none"
            remedy = "make the rules simpler, or give a row that they allow as a must-have row"
            raise BadDomain(self.source, rule, remedy, slug="rules-undecided") from None

    def _refuse(self) -> NoReturn:
        remedy = "loosen one of " + ", ".join(repr(table.name) for table in self.tables[:8])
        raise BadDomain(self.source, f"{_SOME_ROW}, but the rules leave none", remedy, slug="no-valid-row")

    @property
    def are_listed(self) -> bool:
        """Whether `possible` is exact: the allowed rows of every component are listed."""
        return None not in self._listed

    def broken(self, rows: Ints) -> NDArray[np.bool_]:
        """Return which rules each row breaks, shape (n_rows, n_rules)."""
        found = np.zeros((len(rows), len(self.tables)), dtype=bool)
        for index, table in enumerate(self.tables):
            found[:, index] = ~table.allowed[tuple(rows[:, c] for c in table.columns)]
        return found

    def hold(self, rows: Ints) -> NDArray[np.bool_]:
        """Return which rows break no rule, shape (n_rows,)."""
        good: NDArray[np.bool_] = np.logical_not(self.broken(rows).any(axis=1))
        return good

    def possible(self, columns: Sequence[int], sizes: Sequence[int]) -> NDArray[np.bool_]:
        """Return which combinations of blocks of these columns can stand in an allowed row, one axis a column.

        Exact where the allowed rows are listed; elsewhere, what is not struck out at once counts as possible.
        """
        found = np.ones([sizes[c] for c in columns], dtype=bool)
        for component in {self._component[c] for c in columns} - {OPEN}:
            places = [place for place, c in enumerate(columns) if self._component[c] == component]
            part = self._possible_within(component, [columns[place] for place in places])
            found &= part.reshape([size if place in places else 1 for place, size in enumerate(found.shape)])
        return found

    def complete(self, row: Ints, prefer: Ints | None = None) -> Ints | None:
        """Return an allowed row that has the given blocks, or None if there is none.

        Args:
            row: blocks, OPEN where they are free, shape (n_columns,).
            prefer: blocks to take where the rules leave a choice, shape (n_columns,); the first ones, if None.

        Raises:
            UndecidedError: MAX_STEPS choices did not decide it.
        """
        first = np.zeros(len(self.sizes), dtype=np.int64) if prefer is None else prefer
        masks = self._masks({c: int(block) for c, block in enumerate(row) if block != OPEN})
        found = self._search(masks, first)
        if found is None:
            return None
        return np.array([b if m[b] else int(np.argmax(m)) for m, b in zip(found, first, strict=True)], dtype=np.int64)

    def _components(self) -> Iterator[list[RuleTable]]:
        left = dict.fromkeys(self.tables)
        while left:
            members: list[RuleTable] = []
            reached = [next(iter(left))]
            while reached:
                table = reached.pop()
                if table in left:
                    del left[table]
                    members.append(table)
                    reached += [other for c in table.columns for other in self._on[c] if other in left]
            yield members

    def _rows_of(self, members: list[RuleTable]) -> tuple[tuple[int, ...], Ints] | None:
        """Return the columns of a component and its allowed rows, or None where they are too many to list."""
        columns: list[int] = []
        rows = np.zeros((1, 0), dtype=np.int64)
        for table in members:
            new = [c for c in table.columns if c not in columns]
            n = math.prod(self.sizes[c] for c in new)
            if len(rows) * n > MAX_LISTED:
                return None
            added = np.array(list(itertools.product(*(range(self.sizes[c]) for c in new))), dtype=np.int64)
            added = added.reshape(n, len(new))
            rows = np.hstack([np.repeat(rows, len(added), axis=0), np.tile(added, (len(rows), 1))])
            columns += new
            rows = rows[table.allowed[tuple(rows[:, columns.index(c)] for c in table.columns)]]
        return tuple(columns), rows

    def _possible_within(self, component: int, columns: Sequence[int]) -> NDArray[np.bool_]:
        found = np.zeros([self.sizes[c] for c in columns], dtype=bool)
        listed = self._listed[component]
        if listed is not None:
            found[tuple(listed[1][:, listed[0].index(c)] for c in columns)] = True
            return found
        for blocks in np.ndindex(*found.shape):
            self._checks -= 1
            chosen = dict(zip(columns, blocks, strict=True))
            found[blocks] = self._checks < 0 or self._narrow(self._masks(chosen), columns)
        return found

    def _masks(self, chosen: dict[int, int]) -> _Masks:
        """Return for each column the blocks it may take; a chosen one may be invalid, so lie beyond the free ones."""
        masks = list(self._open)
        for column, block in chosen.items():
            masks[column] = np.arange(max(len(masks[column]), block + 1)) == block
        return masks

    def _search(self, masks: _Masks, prefer: Ints) -> _Masks | None:
        """Return masks of which any choice in ruled columns is allowed: there, each leaves one block; or None."""
        steps = MAX_STEPS + len(masks)
        if not self._narrow(masks, range(len(masks))):
            return None
        ruled = [c for c in range(len(masks)) if self._component[c] != OPEN]
        levels: list[tuple[_Masks, int, list[int]]] = []  # what was open, the column chosen there, blocks left to try
        while True:
            widths = [(int(np.count_nonzero(masks[c])), c) for c in ruled]
            # The column with fewest blocks left fails first, if it fails: that cuts off most of the search.
            width, column = min((each for each in widths if each[0] > 1), default=(0, OPEN))
            if not width:
                return masks
            blocks = np.flatnonzero(masks[column]).tolist()
            if prefer[column] in blocks:  # the last one is tried first
                blocks.append(blocks.pop(blocks.index(prefer[column])))
            levels.append((masks, column, blocks))
            while True:
                while levels and not levels[-1][2]:
                    levels.pop()
                    self.lost_steps += 1
                if not levels:
                    return None
                before, column, left = levels[-1]
                steps -= 1
                if steps < 0:
                    raise UndecidedError
                masks = list(before)
                masks[column] = np.arange(len(masks[column])) == left.pop()
                if self._narrow(masks, (column,)):
                    break

    # Arc consistency, for a rule over columns a and b after b lost block 1 (o allowed, . forbidden, x gone):
    #
    #              b0 b1 b2            block 1 of a stood on b1 alone, so it goes too, and the
    #         a0    o  x  .            other rules on a are looked at again
    #         a1    .  x  .   <- gone
    #         a2    .  x  o
    def _narrow(self, masks: _Masks, changed: Iterable[int]) -> bool:
        """Strike out every block that some rule leaves without partners; return False if a column has none left."""
        left = {table: None for c in changed for table in self._on[c]}
        while left:
            table, _ = left.popitem()
            blocks = [np.flatnonzero(masks[c]) for c in table.columns]
            part = table.allowed[np.ix_(*blocks)]
            for axis, column in enumerate(table.columns):
                supported = part.any(axis=tuple(a for a in range(part.ndim) if a != axis))
                if not supported.all():
                    masks[column] = masks[column].copy()
                    masks[column][blocks[axis][~supported]] = False
                    if not supported.any():
                        return False
                    left |= {other: None for other in self._on[column] if other is not table}
        return True

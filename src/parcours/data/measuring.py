"""Measures the coverage of a table of values: blocks hit, combinations of blocks held and missing.

For combinations, a row counts only if each of its values lies in a valid block and it breaks no rule: what a test of
invalid values meets besides says nothing about valid ones. HeldCombinations that the rules forbid are not wanted.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.data.arrays.goals import Goals, goals_of
from parcours.data.constraints import meets
from parcours.data.domains import OUTSIDE
from parcours.data.inputs import InputModel, rules_of
from parcours.data.rules import UndecidedError
from parcours.data.selecting import Rows
from parcours.errors import BadRequest

MOST_SHOWN = 100
"""Most missing combinations, and most rows that do not count, that are put in words unless asked for more."""


@dataclass(frozen=True, slots=True)
class BlockCoverage:
    """How often each block of each parameter was hit, and how many values lay in no block.

    `model` says which parameters and blocks are meant; `counts` has one entry a block, the invalid ones last;
    `outside` one entry a parameter.
    """

    model: InputModel
    counts: tuple[tuple[int, ...], ...]
    outside: tuple[int, ...]
    n_rows: int

    def __add__(self, other: BlockCoverage) -> BlockCoverage:
        """Return that of two tables together; both are of the same model."""
        pairs = zip(self.counts, other.counts, strict=True)
        counts = tuple(tuple(a + b for a, b in zip(*both, strict=True)) for both in pairs)
        outside = tuple(a + b for a, b in zip(self.outside, other.outside, strict=True))
        return BlockCoverage(self.model, counts, outside, self.n_rows + other.n_rows)

    @property
    def n_blocks(self) -> int:
        """The number of blocks there are to hit, those for negative tests included."""
        return sum(len(domain.choices) for domain in self.model.domains)

    @property
    def n_hit(self) -> int:
        """The number of blocks hit at least once."""
        return sum(count > 0 for counts in self.counts for count in counts)

    @property
    def uncovered(self) -> tuple[str, ...]:
        """The blocks that no value hit, as `parameter in block unit`, or `parameter = name`."""
        return tuple(
            f"{domain.name} = {block.name}" if block.name else f"{domain.name} in {block} {domain.unit}"
            for domain, counts in zip(self.model.domains, self.counts, strict=True)
            for block, count in zip(domain.choices, counts, strict=True)
            if not count
        )

    @property
    def is_complete(self) -> bool:
        """Whether every block was hit and no value lay outside: these values satisfy Each Choice."""
        return not self.uncovered and not any(self.outside)


def cover(model: InputModel, table: NDArray[np.float64]) -> BlockCoverage:
    """Return which blocks a table of values hits.

    Args:
        model: the input model whose blocks are meant.
        table: values in the units of the domains, shape (n_rows, n_parameters); no row at all is a table too.

    Raises:
        BadRequest: the table has another number of columns than the model has parameters.
    """
    counts, outside = [], []
    for domain, index in zip(model.domains, model.blocks_of(table).T, strict=True):
        counts.append(tuple(np.bincount(index[index != OUTSIDE], minlength=len(domain.choices)).tolist()))
        outside.append(int(np.sum(index == OUTSIDE)))
    return BlockCoverage(model, tuple(counts), tuple(outside), len(table))


@dataclass(frozen=True, slots=True)
class TupleCoverage:
    """How many combinations of blocks a table holds.

    Attributes:
        strength: how many inputs a combination has; groups of the model have their own.
        n_rows: rows of the table.
        n_counted: rows that count: all values valid, no rule broken.
        n_wanted: combinations that an allowed row can hold.
        n_held: those that a counted row holds.
        n_forbidden: combinations that the rules forbid.
        missing: the first of those that are missing, in words.
        uncounted: the first rows that do not count, from 1, each with the reason.
    """

    strength: int
    n_rows: int
    n_counted: int
    n_wanted: int
    n_held: int
    n_forbidden: int
    missing: tuple[str, ...]
    uncounted: tuple[tuple[int, str], ...]

    @property
    def n_missing(self) -> int:
        """How many combinations are missing."""
        return self.n_wanted - self.n_held

    @property
    def share(self) -> float:
        """Held combinations as a share of those wanted."""
        return self.n_held / self.n_wanted if self.n_wanted else 1.0

    @property
    def is_complete(self) -> bool:
        """Whether nothing is missing."""
        return self.n_held == self.n_wanted


def measure(
    table: NDArray[np.float64], model: InputModel, strength: int = 2, *, most_shown: int = MOST_SHOWN
) -> TupleCoverage:
    """Return the t-wise coverage of a table of values, wherever it comes from.

    Args:
        table: values in the units of the domains, names of enumerations by their places, shape (n_rows, n_inputs).
        model: whose blocks and rules are meant.
        strength: t, at least 1.
        most_shown: how many missing combinations, and how many rows that do not count, to put in words.

    Raises:
        BadRequest: the table has another number of columns than the model has inputs, the strength is below 1, or
            there are too many combinations to count.
        BadDomain: the rules leave no row.
    """
    if strength < 1:
        raise BadRequest("coverage of a table", f"the strength must be at least 1, but is {strength}", slug="strength")
    found = HeldCombinations(model, strength)
    counts = found.add(table)
    held, missing = found.held(most_shown=most_shown)
    # Rows are counted from 1 for people, as an editor counts the lines of a table.
    uncounted = np.flatnonzero(~counts)[:most_shown]
    blocks = model.blocks_of(table[uncounted])
    return TupleCoverage(
        strength, len(table), int(counts.sum()), found.n_wanted, held, found.n_forbidden, missing,
        tuple((int(row) + 1, _reason(model, table[row], of)) for row, of in zip(uncounted, blocks, strict=True)),
    )  # fmt: skip


class HeldCombinations:
    """The combinations of blocks that tables hold together, of all rows and of groups of them, table after table.

    Args:
        model: whose blocks and rules are meant.
        strength: how many inputs a combination has, at least 1.
        n_groups: how many groups of rows are told apart.

    Raises BadRequest, BadDomain: as `measure`.
    """

    def __init__(self, model: InputModel, strength: int, n_groups: int = 1) -> None:
        self._model, self._rules = model, rules_of(model)
        self._goals = goals_of(model.sizes, strength, model.column_groups, self._rules)
        self._held = np.zeros((n_groups, self._goals.n_tuples), bool)
        self._is_sure = self._rules.are_listed  # that what is wanted can be held

    @property
    def n_wanted(self) -> int:
        """How many there are that an allowed row can hold, as far as was looked into: exact once `held` was called."""
        return self._goals.n_needed

    @property
    def n_forbidden(self) -> int:
        """How many there are that none can hold."""
        return self._goals.n_tuples - self._goals.n_needed

    def add(self, table: NDArray[np.float64], groups: NDArray[np.int64] | None = None) -> NDArray[np.bool_]:
        """Take note of rows and return which of them count, shape (n_rows,).

        Args:
            table: values as `measure` takes them.
            groups: the group of each row, shape (n_rows,); all are of the first if not given.
        """
        counts = allowed(self._model, table)
        blocks = self._model.blocks_of(table[counts])
        of = np.zeros(len(blocks), np.int64) if groups is None else groups[counts]
        for group in np.unique(of):
            self._held[group] |= self._goals.held(blocks[of == group])
        return counts

    def held(self, group: int | None = None, most_shown: int = MOST_SHOWN) -> tuple[int, tuple[str, ...]]:
        """Return how many of those wanted rows of a group hold, or any, and the first of the others in words."""
        needed, seen = self._goals.layout.needed, self._held.any(axis=0)
        if not self._is_sure:  # the goals hold some combinations that no allowed row can hold: each is looked at here
            for number in np.flatnonzero(needed & ~seen):
                _find_row(self._goals, int(number))
            self._is_sure = True
        missing = np.flatnonzero(needed & ~(seen if group is None else self._held[group]))
        words = tuple(self._model.in_words(self._goals.tuple_of(int(number))) for number in missing[:most_shown])
        return self.n_wanted - len(missing), words


def allowed(model: InputModel, table: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which rows have valid values only and break no rule, shape (n_rows,). Raises as `measure`."""
    blocks, rules = model.blocks_of(table), rules_of(model)
    counts: NDArray[np.bool_] = ((blocks != OUTSIDE) & (blocks < np.array(model.sizes))).all(axis=1)
    counts[counts] = rules.hold(blocks[counts])
    for constraint in model.constraints:
        if constraint.over == "values" and counts.any():
            columns = {name: table[counts, column] for column, name in enumerate(model.names)}
            counts[counts] = meets(constraint, columns)
    return counts


def _find_row(goals: Goals, number: int) -> None:
    """Look for a row that holds a combination: if there is none, it is no longer wanted; undecided, it still is."""
    with contextlib.suppress(UndecidedError):
        goals.row_with(number)


def _reason(model: InputModel, values: NDArray[np.float64], blocks: Rows) -> str:
    for domain, value, block in zip(model.domains, values, blocks, strict=True):
        if block == OUTSIDE:
            return f"{domain.name} = {domain.shown(value)} lies in no block"
        if block >= len(domain.blocks):
            return f"{domain.name} = {domain.shown(value)} lies in an invalid block"
    rules = rules_of(model)
    for table, is_broken in zip(rules.tables, rules.broken(blocks[np.newaxis])[0], strict=True):
        if is_broken:
            return f"it breaks {table.name!r}"
    columns = {name: values[column : column + 1] for column, name in enumerate(model.names)}
    broken = (c.name for c in model.constraints if c.over == "values" and not meets(c, columns)[0])
    return f"it breaks {next(broken)!r}"

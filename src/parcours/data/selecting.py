"""Lists the rows of blocks that satisfy a criterion, of block counts alone (Ammann & Offutt, 2008, ch. 4).

The rows of a criterion stand in an endless table: its first `n_rows` satisfy the criterion, so do the next
`n_rows`, and so on. Each Choice shuffles every repetition by seed, so that blocks meet in ever new
pairings; so do pair-wise and t-wise, by exchanging the blocks of each column. Random rows satisfy nothing: they are
what the others are measured against, in the number of Each Choice. Any row is found by its number
alone; nothing is listed that was not asked for.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, require_known
from parcours.streams import ROWS, starts, uniforms

LARGEST_LISTING = 1_000_000
"""Most rows that are listed without being asked for by number."""

Rows = NDArray[np.int64]
"""Block indices, shape (n_rows, n_parameters)."""


@dataclass(frozen=True, slots=True)
class CombinationCriterion:
    """A way to combine blocks: how many rows satisfy it, and which blocks stand in which row.

    Attributes:
        n_rows: block counts to the number of rows of one repetition.
        rows: block counts, row numbers of shape (n,), and a seed to rows of shape (n, n_parameters).
    """

    n_rows: Callable[[Sequence[int]], int]
    rows: Callable[[Sequence[int], NDArray[np.int64], int], Rows]


def count(criterion: str, sizes: Sequence[int]) -> int:
    """Return how many rows one repetition of the criterion has.

    Args:
        criterion: a name in CRITERIA.
        sizes: the number of blocks of each parameter, all positive.

    Raises:
        BadRequest: the criterion is unknown, or there is no parameter, or one without a block.
    """
    return _found(criterion, sizes).n_rows(sizes)


def select(criterion: str, sizes: Sequence[int], numbers: NDArray[np.int64] | None = None, *, seed: int = 0) -> Rows:
    """Return block indices, shape (n_rows, n_parameters): one repetition, or those with the numbers given.

    Args:
        criterion: a name in CRITERIA.
        sizes: the number of blocks of each parameter, all positive.
        numbers: which rows of the endless table, not negative, shape (n,); None for the first repetition.
        seed: the campaign's seed.

    Raises:
        BadRequest: the criterion is unknown, a number is negative, or one repetition is too long to be
            listed.
    """
    found = _found(criterion, sizes)
    if numbers is None:
        n = found.n_rows(sizes)
        if n > LARGEST_LISTING:
            rule = f"at most {LARGEST_LISTING} rows are listed at once, but it has {n}"
            raise BadRequest(f"criterion {criterion!r}", rule, "ask for rows by number", slug="rows-too-many")
        numbers = np.arange(n)
    if numbers.size and numbers.min() < 0:
        raise BadRequest("rows", f"a row number must not be negative, but {numbers.min()} given", slug="row-number")
    return found.rows(sizes, numbers, seed)


def _found(criterion: str, sizes: Sequence[int]) -> CombinationCriterion:
    require_known(criterion, list(CRITERIA), "combination criterion", slug="unknown-criterion")
    if not sizes or min(sizes) < 1:
        rule = f"every parameter must have a block, but the counts are {list(sizes)}"
        raise BadRequest("combination criterion", rule, slug="blocks-none")
    return CRITERIA[criterion]


def _each_choice(sizes: Sequence[int], numbers: NDArray[np.int64], seed: int) -> Rows:
    """Each block stands in one row at least; a parameter with fewer blocks than rows fills up at random."""
    places, n = max(sizes), len(sizes)
    repetitions, where = np.unique(numbers // places, return_inverse=True)
    words = uniforms(starts(seed, repetitions, ROWS), 0, 2 * n * places).reshape(len(repetitions), 2, n, places)
    # Ranks of random words are a random permutation: ranks below the block count place each block once.
    ranks = np.argsort(np.argsort(words[:, 0], axis=2, kind="stable"), axis=2, kind="stable")
    blocks = np.array(sizes)[:, np.newaxis]
    table = np.where(ranks < blocks, ranks, np.minimum((words[:, 1] * blocks).astype(np.int64), blocks - 1))
    return table[where, :, numbers % places]


def _random(sizes: Sequence[int], numbers: NDArray[np.int64], seed: int) -> Rows:
    """Every block of a parameter is as likely in every row."""
    words = uniforms(starts(seed, numbers, ROWS), 0, len(sizes)).reshape(len(numbers), len(sizes))
    blocks = np.array(sizes)
    found: Rows = np.minimum((words * blocks).astype(np.int64), blocks - 1)
    return found


def _base_choice(sizes: Sequence[int], numbers: NDArray[np.int64], seed: int) -> Rows:
    """The base row has the first block of every parameter; each further row changes one parameter."""
    rows = np.zeros((len(numbers), len(sizes)), dtype=np.int64)
    left = numbers % (1 + sum(size - 1 for size in sizes))
    for column, size in enumerate(sizes):
        rows[:, column] = np.where((left >= 1) & (left < size), left, 0)
        left = np.where(left >= size, left - (size - 1), 0)
    return rows


def _all_combinations(sizes: Sequence[int], numbers: NDArray[np.int64], seed: int) -> Rows:
    """Row numbers count the combinations as digits do, the last parameter fastest."""
    rows = np.empty((len(numbers), len(sizes)), dtype=np.int64)
    left = numbers
    for column in range(len(sizes) - 1, -1, -1):
        left, rows[:, column] = np.divmod(left, sizes[column])
    return rows


@functools.lru_cache(maxsize=64)
def _array(sizes: tuple[int, ...], strength: int) -> Rows:
    """Return the covering array of one repetition, the same whatever the seed: so its length is known without one."""
    from parcours.data.arrays.building import covering_array
    from parcours.data.arrays.goals import goals_of

    return covering_array(goals_of(sizes, strength)).rows


def _combined(strength: int) -> CombinationCriterion:
    """Return the criterion under which the blocks of every `strength` parameters meet in all combinations."""

    def n_rows(sizes: Sequence[int]) -> int:
        return len(_array(tuple(sizes), strength))

    def rows(sizes: Sequence[int], numbers: NDArray[np.int64], seed: int) -> Rows:
        array = _array(tuple(sizes), strength)
        repetitions, where = np.unique(numbers // len(array), return_inverse=True)
        words = uniforms(starts(seed, repetitions, ROWS), 0, sum(sizes))
        ends = np.cumsum([0, *sizes])
        table = np.empty((len(numbers), len(sizes)), dtype=np.int64)
        for column in range(len(sizes)):
            # Renaming the blocks of a column keeps every tuple covered: each repetition is another array.
            exchanged = np.argsort(words[:, ends[column] : ends[column + 1]], axis=1, kind="stable")
            table[:, column] = exchanged[where, array[numbers % len(array), column]]
        return table

    return CombinationCriterion(n_rows, rows)


CRITERIA: Final[dict[str, CombinationCriterion]] = {
    "each_choice": CombinationCriterion(max, _each_choice),
    "random": CombinationCriterion(max, _random),
    "base_choice": CombinationCriterion(lambda sizes: 1 + sum(size - 1 for size in sizes), _base_choice),
    "pairwise": _combined(2),
    **{f"{strength}-wise": _combined(strength) for strength in range(3, 7)},
    "all_combinations": CombinationCriterion(math.prod, _all_combinations),
}
"""Combination criteria by name."""

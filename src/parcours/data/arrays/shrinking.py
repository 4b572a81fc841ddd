"""Compiled: repairs an array that lost a row, by tabu search, until it holds everything again (after Lin et al. 2015).

Each move takes a missing tuple at random and looks at all rows that lack it in one column only; it changes the cell
after which fewest tuples are missing, but none that was changed just before. Now and then it writes a tuple into any
row, to get away from where it is. Only integers decide, so a seed and a number of moves give the same array on every
machine. (J. Lin, C. Luo, S. Cai, K. Su, D. Hao, L. Zhang, "TCA: an efficient two-mode meta-heuristic algorithm for
combinatorial test generation", ASE 2015.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from parcours.data.arrays.goals import GoalTables, Ints
from parcours.data.arrays.growing import is_permitted, number_in, set_of
from parcours.kernels import kernel
from parcours.streams import Stream, below

TENURE = 1
"""For how many moves a changed cell stays as it is."""

WALK = 1000
"""One move in this many writes a tuple into any row."""

_NEVER = -(1 << 40)


class DamagedArray(NamedTuple):
    """An array under repair, all int64: its rows, how often each tuple stands in it, and which are missing.

    `rows` (n_rows, n_columns); `counts` and `place` (n_tuples,): place[t] is where tuple t stands in `missing`, or -1;
    `changed` (n_rows, n_columns): the move that changed a cell last; `state`: [number of missing tuples, moves made,
    tuples looked up].
    """

    rows: Ints
    counts: Ints
    missing: Ints
    place: Ints
    changed: Ints
    state: Ints


def table_of(layout: GoalTables, rows: Ints) -> DamagedArray:
    """Return the rows as a table under repair."""
    n = int(layout.start[-1])
    counts, place, missing = np.zeros(n, np.int64), np.full(n, -1), np.empty(n, np.int64)
    table = DamagedArray(rows.copy(), counts, missing, place, np.full(rows.shape, _NEVER), np.zeros(3, np.int64))
    _count(layout, table)
    return table


@kernel
def _count(layout: GoalTables, table: DamagedArray) -> None:
    for row in table.rows:
        for set_ in range(len(layout.widths)):
            table.counts[number_in(layout, row, set_)] += 1
    for number in range(len(table.counts)):
        if layout.needed[number] and table.counts[number] == 0:
            table.place[number] = table.state[0]
            table.missing[table.state[0]] = number
            table.state[0] += 1


@kernel
def _loss(layout: GoalTables, table: DamagedArray, row: int, column: int, block: int) -> int:
    """Return how many more tuples are missing when the cell has this block."""
    cells = table.rows[row]
    step = block - cells[column]
    loss = 0
    for entry in range(layout.of_column[column], layout.of_column[column + 1]):
        set_ = layout.set_of[entry]
        old = number_in(layout, cells, set_)
        new = old + step * layout.strides[set_, layout.place_of[entry]]
        if table.counts[old] == 1 and layout.needed[old]:
            loss += 1
        if table.counts[new] == 0 and layout.needed[new]:
            loss -= 1
    table.state[2] += 2 * (layout.of_column[column + 1] - layout.of_column[column])
    return loss


@kernel
def _change(layout: GoalTables, table: DamagedArray, row: int, column: int, block: int) -> None:
    cells = table.rows[row]
    step = block - cells[column]
    for entry in range(layout.of_column[column], layout.of_column[column + 1]):
        set_ = layout.set_of[entry]
        old = number_in(layout, cells, set_)
        new = old + step * layout.strides[set_, layout.place_of[entry]]
        table.counts[old] -= 1
        if table.counts[old] == 0 and layout.needed[old]:
            table.missing[table.state[0]] = old
            table.place[old] = table.state[0]
            table.state[0] += 1
        table.counts[new] += 1
        if table.counts[new] == 1 and layout.needed[new]:
            table.state[0] -= 1
            last = table.missing[table.state[0]]
            table.missing[table.place[new]] = last
            table.place[last] = table.place[new]
            table.place[new] = -1
    cells[column] = block
    table.changed[row, column] = table.state[1]


@kernel
def _can_change(layout: GoalTables, cells: Ints, column: int, block: int) -> bool:
    old = cells[column]
    cells[column] = block
    can = is_permitted(layout, cells, column)
    cells[column] = old
    return can


@kernel
def _write(layout: GoalTables, table: DamagedArray, row: int, set_: int, rest: int) -> None:
    """Write a tuple into a row, whatever that costs, as far as the rules allow it cell by cell."""
    for p in range(layout.widths[set_]):
        column, block = layout.columns[set_, p], rest // layout.strides[set_, p]
        rest %= layout.strides[set_, p]
        if table.rows[row, column] != block and _can_change(layout, table.rows[row], column, block):
            _change(layout, table, row, column, block)


@kernel
def repair(layout: GoalTables, table: DamagedArray, fixed: int, work: int, stream: Stream) -> bool:
    """Change cells until no tuple is missing, or `work` tuples were looked up.

    Args:
        layout: the goals.
        table: the array; changed in place.
        fixed: how many of its first rows must stay as they are.
        work: how many tuples may be looked up.
        stream: random numbers.

    Returns:
        Whether no tuple is missing.
    """
    n = len(table.rows)
    end = table.state[2] + work
    while table.state[0] > 0 and table.state[2] < end and n > fixed:
        table.state[1] += 1
        table.state[2] += n
        number = table.missing[below(stream, table.state[0])]
        set_ = set_of(layout, number)
        whole = number - layout.start[set_]
        # A row that lacks the tuple in one column only gets it by one change; the one that costs least is made.
        best_row, best_column, best_block, least, oldest = -1, -1, -1, 1 << 40, 0
        if below(stream, WALK) > 0:
            for row in range(fixed, n):
                lacking, column, block, rest = 0, -1, -1, whole
                for p in range(layout.widths[set_]):
                    wanted = rest // layout.strides[set_, p]
                    rest %= layout.strides[set_, p]
                    if table.rows[row, layout.columns[set_, p]] != wanted:
                        lacking += 1
                        column, block = layout.columns[set_, p], wanted
                        if lacking > 1:
                            break
                if lacking != 1 or not _can_change(layout, table.rows[row], column, block):
                    continue
                loss, changed = _loss(layout, table, row, column, block), table.changed[row, column]
                if table.state[1] - changed <= TENURE and table.state[0] + loss > 0:
                    continue
                if loss < least or (loss == least and changed < oldest):
                    best_row, best_column, best_block, least, oldest = row, column, block, loss, changed
        if best_row >= 0:
            _change(layout, table, best_row, best_column, best_block)
        else:
            _write(layout, table, fixed + below(stream, n - fixed), set_, whole)
    return bool(table.state[0] == 0)

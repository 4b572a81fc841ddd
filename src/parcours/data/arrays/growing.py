"""Compiled: grows an array row by row, each row the best of several greedy ones (after AETG, Cohen et al. 1997).

A candidate starts from a tuple that is still missing and takes the other columns in random order, each time the block
that adds most tuples with the columns taken before.
"""

from __future__ import annotations

import numpy as np

from parcours.data.arrays.goals import GoalTables, Ints
from parcours.kernels import heap_kernel, kernel
from parcours.streams import Stream, below


@kernel
def is_permitted(layout: GoalTables, row: Ints, column: int) -> bool:
    """Return whether no rule on this column is broken; a rule with an open column (below 0) is not yet."""
    for entry in range(layout.rules_of_column[column], layout.rules_of_column[column + 1]):
        rule = layout.rule_of[entry]
        cell = layout.rule_start[rule]
        is_whole = True
        for place in range(layout.rule_widths[rule]):
            block = row[layout.rule_columns[rule, place]]
            is_whole = is_whole and block >= 0
            cell += block * layout.rule_strides[rule, place]
        if is_whole and not layout.allowed[cell]:
            return False
    return True


@kernel
def number_in(layout: GoalTables, row: Ints, set_: int) -> int:
    """Return the number of the tuple that a whole row has in a set of columns."""
    number = int(layout.start[set_])
    for place in range(layout.widths[set_]):
        number += row[layout.columns[set_, place]] * layout.strides[set_, place]
    return number


@kernel
def _gain(layout: GoalTables, row: Ints, column: int, place: Ints) -> int:
    """Return how many missing tuples the block in this column makes with the columns taken so far."""
    gain = 0
    for entry in range(layout.of_column[column], layout.of_column[column + 1]):
        set_ = layout.set_of[entry]
        number = layout.start[set_]
        is_whole = True
        for p in range(layout.widths[set_]):
            block = row[layout.columns[set_, p]]
            if block < 0:
                is_whole = False
                break
            number += block * layout.strides[set_, p]
        if is_whole and place[number] >= 0:
            gain += 1
    return gain


@kernel
def _fill(layout: GoalTables, row: Ints, order: Ints, n_open: int, place: Ints, stream: Stream) -> int:
    """Fill the open columns of a row greedily, in the order given; return the gain, or -1 at a dead end."""
    total = 0
    for index in range(n_open):
        column = order[index]
        best, most, ties = -1, -1, 0
        for block in range(layout.sizes[column]):
            row[column] = block
            if not is_permitted(layout, row, column):
                continue
            gain = _gain(layout, row, column, place)
            if gain > most:
                best, most, ties = block, gain, 1
            elif gain == most:
                ties += 1
                if below(stream, ties) == 0:
                    best = block
        if best < 0:
            return -1
        row[column] = best
        total += most
    return total


@kernel
def set_of(layout: GoalTables, number: int) -> int:
    """Return the index of the set of columns that the tuple with this number combines."""
    low, high = 0, len(layout.start)
    while high - low > 1:
        middle = (low + high) // 2
        if layout.start[middle] <= number:
            low = middle
        else:
            high = middle
    return low


@kernel
def _start_from(layout: GoalTables, row: Ints, order: Ints, set_: int, number: int, stream: Stream) -> int:
    """Put a tuple into an empty row, the other columns into a random order; return how many those are, or -1."""
    row[:] = -1
    rest = number - layout.start[set_]
    for p in range(layout.widths[set_]):
        row[layout.columns[set_, p]] = rest // layout.strides[set_, p]
        rest %= layout.strides[set_, p]
    n_open = 0
    for column in range(len(row)):
        if row[column] < 0:
            other = below(stream, n_open + 1)
            order[n_open] = order[other]
            order[other] = column
            n_open += 1
        elif not is_permitted(layout, row, column):
            return -1
    return n_open


@heap_kernel
def grow(
    layout: GoalTables, rows: Ints, n: int, missing: Ints, n_missing: int, candidates: int, stream: Stream
) -> Ints:
    """Add rows until nothing is missing, the table is full, or no candidate could be completed.

    Args:
        layout: the goals.
        rows: room for the array, shape (n_most, n_columns); rows 0 .. n - 1 are there already.
        n: number of rows that are there.
        missing: numbers of the tuples that no row holds, first `n_missing` entries; shuffled and shortened here.
        n_missing: how many those are.
        candidates: how many rows to choose each new one from.
        stream: random numbers.

    Returns:
        The number of rows, and how many tuples are still missing: the first ones of `missing`.
    """
    place = np.full(layout.start[-1], -1, dtype=np.int64)
    # `missing` is a set in an array: what is found swaps places with the last entry, so taking it out costs nothing.
    for index in range(n_missing):
        place[missing[index]] = index
    best, row, order = np.empty_like(rows[0]), np.empty_like(rows[0]), np.empty_like(rows[0])
    while n_missing > 0 and n < len(rows):
        most = -1
        for _ in range(candidates):
            number = missing[below(stream, n_missing)]
            set_ = set_of(layout, number)
            n_open = _start_from(layout, row, order, set_, number, stream)
            gain = _fill(layout, row, order, n_open, place, stream) if n_open >= 0 else -1
            if gain > most:
                most = gain
                best[:] = row
        if most < 0:
            break
        rows[n] = best
        n += 1
        for set_ in range(len(layout.widths)):
            index = place[number_in(layout, best, set_)]
            if index >= 0:
                n_missing -= 1
                last = missing[n_missing]
                missing[n_missing] = missing[index]
                place[missing[n_missing]] = -1
                missing[index] = last
                if index != n_missing:
                    place[last] = index
    return np.array([n, n_missing])

"""Block counts, base blocks and rules become the rows of base choice and multiple base choice (Ammann & Offutt, ch. 4).

Base rows hold one base of each parameter; every other row changes one parameter of a base row to one of its other
blocks. With at most m bases a parameter and m_i of B_i blocks being bases, these are m + m * sum (B_i - m_i) rows.
Where the rules forbid a row, other parameters leave their base, as few as the search happens to find.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from parcours.data.rules import OPEN, Rules, UndecidedError
from parcours.data.selecting import Rows


def base_rows(
    sizes: Sequence[int], bases: Sequence[Sequence[int]], rules: Rules
) -> tuple[Rows, tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """Return the rows, each once, the (column, block) pairs that no allowed row holds, and those not decided.

    >>> base_rows([3, 2], [[0, 1], [0]], Rules([3, 2]))[0].tolist()
    [[0, 0], [2, 0], [0, 1], [1, 0], [1, 1]]
    """
    rows: dict[tuple[int, ...], None] = {}
    forbidden: dict[tuple[int, int], None] = {}
    undecided: dict[tuple[int, int], None] = {}
    for index in range(max(len(each) for each in bases)):
        base = np.array([each[index % len(each)] for each in bases], dtype=np.int64)
        changes = [(c, b) for c, size in enumerate(sizes) for b in range(size) if b not in bases[c]]
        for change in ((OPEN, OPEN), *changes):
            try:
                row = _allowed(base, change, rules)
            except UndecidedError:
                if change[0] == OPEN:
                    rules.require_row()  # else each block would take as long, for nothing
                else:
                    undecided[change] = None
                continue
            if row is not None:
                rows[tuple(row.tolist())] = None
            elif change[0] != OPEN:
                forbidden[change] = None
    held = np.array(list(rows), dtype=np.int64).reshape(len(rows), len(sizes))
    return held, tuple(forbidden), tuple(undecided)


def _allowed(base: Rows, change: tuple[int, int], rules: Rules) -> Rows | None:
    """Return the base row with one change, or a row that the rules allow in its place. Raises UndecidedError."""
    column, block = change
    row = base.copy()
    if column != OPEN:
        row[column] = block
    if rules.hold(row[np.newaxis])[0]:
        return row
    open_ = np.full(len(base), OPEN)
    if column != OPEN:
        open_[column] = block
    return rules.complete(open_, row)

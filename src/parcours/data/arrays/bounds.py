"""Goals become a number of rows that no array can go below."""

from __future__ import annotations

from parcours.data.arrays.constructions import fewest_halves
from parcours.data.arrays.goals import Goals

_THREES = (11, 15)
"""From so many three-block columns on, pair-wise arrays have at least so many rows (Izquierdo-Marquez & Torres-Jimenez,
"New optimal covering arrays using an orderly algorithm", 2018: 15 is the optimum of 11 to 20 columns)."""


def fewest_rows(goals: Goals) -> int:
    """Return a lower bound: each row holds one tuple of every set, and more where theory knows more.

    >>> from parcours.data.arrays.goals import goals_of
    >>> [fewest_rows(goals_of(sizes, 2)) for sizes in ([3] * 4, [3] * 5, [2] * 100, [9, 3, 3, 2])]
    [9, 10, 10, 27]
    """
    needed, start = goals.layout.needed, goals.layout.start
    fewest = max((int(needed[start[i] : start[i + 1]].sum()) for i in range(len(goals.sets))), default=1)
    strengths = {len(each) for each in goals.sets}
    if goals.rules.tables or strengths != {2}:
        return max(fewest, 1)
    paired = len({column for each in goals.sets for column in each})
    if len(goals.sets) != paired * (paired - 1) // 2:
        return fewest
    for v in range(3, max(goals.sizes) + 1):
        wide = sum(size >= v for size in goals.sizes)
        if wide > v + 1:  # v * v rows would be v - 1 Latin squares and more, but there are v - 1 at most
            fewest = max(fewest, v * v + 1)
        if v == 3 and wide >= _THREES[0]:
            fewest = max(fewest, _THREES[1])
    return max(fewest, fewest_halves(wide)) if (wide := sum(size >= 2 for size in goals.sizes)) >= 2 else fewest

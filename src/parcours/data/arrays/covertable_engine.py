"""Asks covertable, a package of other authors, for an array: a second opinion on small goals.

Its greedy criterion often starts from fewer rows than ours. It takes seconds where there are many tuples or must-have
rows, so goals with more than MAX_TUPLES or MAX_MUST are not given to it: a limit on its work that is the same on every
machine. Whatever it returns is verified like everything else.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from parcours.data.arrays.goals import Goals, Ints
from parcours.data.rules import RuleTable

MAX_TUPLES = 3_000
"""Most tuples that are given to covertable: more take it longer than a second."""

MAX_MUST = 3_000
"""Most must-have rows that are given to covertable: as many take it a second."""


def covertable_rows(goals: Goals, must: Ints, *, seed: int, deadline: float) -> Ints | None:
    """Return the rows that covertable finds for these goals, or None if it found none in time."""
    from covertable import Controller

    factors = [list(range(size)) for size in goals.sizes]
    strength = min((len(each) for each in goals.sets), default=1)
    controller = Controller(
        factors,
        strength=strength,
        salt=str(seed),
        sub_models=[{"fields": list(each), "strength": len(each)} for each in goals.sets if len(each) > strength],
        presets=[dict(enumerate(row)) for row in must.tolist()],
        constraints=[_condition(table) for table in goals.rules.tables],
    )
    rows = []
    for row in controller.make_async():
        rows.append(row)
        if time.perf_counter() > deadline:
            return None
    return np.array(rows, dtype=np.int64).reshape(len(rows), len(factors))


def _condition(table: RuleTable) -> dict[str, Any]:
    def is_allowed(row: dict[int, int]) -> bool:
        return bool(table.allowed[tuple(row[column] for column in table.columns)])

    return {"operator": "fn", "requires": list(table.columns), "evaluate": is_allowed}

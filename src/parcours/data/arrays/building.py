"""Searches the smallest covering array: constructions and greedy growth first, then it takes rows away one by one.

Every stage's array is verified against the goals before it is used. Without a time budget the effort is a fixed amount
of work, so that a seed gives the same array on every machine that has numba; with one, the clock decides when to stop.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from parcours.data.arrays.constructions import constructions, fewest_halves
from parcours.data.arrays.covertable_engine import MAX_MUST, MAX_TUPLES, covertable_rows
from parcours.data.arrays.goals import Goals, Ints
from parcours.data.arrays.growing import grow
from parcours.data.arrays.shrinking import repair, table_of
from parcours.data.rules import UndecidedError
from parcours.kernels import require_numba
from parcours.streams import ROWS, starts

EFFORT = 150_000_000
"""Most tuples that are looked up without a time budget: a few seconds."""

PATIENCE = 30_000_000
"""After how many tuples looked up without success a size counts as the last, without a time budget; ten times what
came before, if that is more."""

LEAST_GROWTH = 1.0
"""How long growing may take whatever the budget [s]: an array that lacks combinations is worth little."""

LOST_STEPS = 30_000
"""Most choices that searches for allowed rows take back while an array grows without a time budget: a few seconds."""

_PART = 20_000_000  # tuples looked up while growing between two looks at the clock
_ANY = 1_000_000  # rows
_PIECE = 3_000_000  # tuples looked up between two looks at the clock
_COUNTS = 4  # how often all tuples of an array are looked up to take a row away and to verify the result
_CANDIDATES, _GROWTH = 50, 200_000_000

_THREES = (11, 15)
"""From 11 three-block columns on, pair-wise arrays have at least 15 rows (Izquierdo-Marquez & Torres-Jimenez,
"New optimal covering arrays using an orderly algorithm", 2018: 15 is the optimum of 11 to 20 columns)."""

Progress = Callable[[str, int, int], None]
"""Gets what goes on, the number of rows found, and the fewest there can be."""


@dataclass(frozen=True, slots=True)
class Stage:
    """One way to an array: what it is called, the rows it came to, and when it was done [s]."""

    name: str
    n_rows: int
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class CoveringArray:
    """An array that holds every tuple that can be held, and what is known about its size.

    Attributes:
        rows: blocks, shape (n_rows, n_columns).
        fewest: no array has fewer rows.
        stages: how its size came about.
        infeasible: numbers of the tuples that no allowed row can hold.
        undecided: numbers of the tuples that no row was found for within the limits of the search.
    """

    rows: Ints
    fewest: int
    stages: tuple[Stage, ...]
    infeasible: tuple[int, ...] = ()
    undecided: tuple[int, ...] = ()


def covering_array(
    goals: Goals,
    must: Ints | None = None,
    *,
    budget: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> CoveringArray:
    """Return few rows that are allowed and hold every tuple of the goals that an allowed row can hold.

    Args:
        goals: what must be held, and which rows are allowed; a tuple that cannot be decided is no longer needed there.
        must: rows that the rules allow, which stay and come first, shape (n_must, n_columns).
        budget: how long to search [s], compiling not counted, though growing may take LEAST_GROWTH; None for a fixed
            effort. What growing did not come to is undecided.
        progress: gets every smaller array.

    Raises:
        BadRequest: there is no numba: the search would take hours, and a shorter one would find other rows.
        BadDomain: the rules leave no row, or the search for a first one took too long.
    """
    require_numba("covering arrays")
    if must is None:
        must = np.zeros((0, len(goals.sizes)), dtype=np.int64)
    if not len(must):
        goals.rules.require_row()
    return _Search(goals, must, budget, seed, progress).array()


def fewest_rows(goals: Goals) -> int:
    """Return a lower bound: each row holds one tuple of every set, and more where theory knows more."""
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


class _Search:
    """One search; `best` is the smallest verified array so far."""

    def __init__(self, goals: Goals, must: Ints, budget: float | None, seed: int, progress: Progress | None) -> None:
        self.goals, self.must, self.seed, self.budget = goals, must, seed, budget
        self.progress = progress or (lambda what, done, total: None)
        self.stream = starts(seed, np.array([0]), ROWS)
        self.begun = time.perf_counter()
        self.lost_before = goals.rules.lost_steps
        self.stages: list[Stage] = []
        self.undecided: list[int] = []
        self.best = must
        self.fewest = max(fewest_rows(goals), len(must))

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.begun

    #     grown row by row ──┬──> fewest rows so far ──> one row less ──> repaired? ──> ... until time or effort ends
    #     constructions ─────┤                            ^                │ no, long
    #     covertable ────────┘                            └── another greedy array
    def array(self) -> CoveringArray:
        needed = self.goals.layout.needed
        self.compile()
        rows, left = self.grown()
        self.keep("grown row by row", rows)
        if len(left) or len(self.best) > self.fewest:
            for name, rows in self.others(_ANY if len(left) else len(self.best)):
                if self.goals.are_met_by(rows):
                    if len(left):
                        self.best, left = rows, left[:0]
                    self.keep(name, rows)
        # What growing did not come to is given up here, so that later stages do not fail for lack of it.
        needed[left] = False
        self.undecided += left.tolist()
        if self.goals.rules.tables:  # less is needed than it seemed
            self.fewest = max(fewest_rows(self.goals), len(self.must))
        self.shrink()
        infeasible = np.setdiff1d(np.flatnonzero(~needed), np.array(self.undecided, dtype=np.int64)).tolist()
        return CoveringArray(self.best, self.fewest, tuple(self.stages), tuple(infeasible), tuple(self.undecided))

    def compile(self) -> None:
        """Compile what is compiled, if need be, and only then start the clock of the budget."""
        layout, room = self.goals.layout, np.zeros((1, len(self.goals.sizes)), dtype=np.int64)
        grow(layout, room, 0, np.zeros(1, dtype=np.int64), 0, 1, self.stream)
        repair(layout, table_of(layout, room[:0]), 0, 0, self.stream)
        self.begun = time.perf_counter()

    def keep(self, name: str, rows: Ints) -> None:
        """Note a stage, and take its array if it is the smallest."""
        self.stages.append(Stage(name, len(rows), self.seconds))
        if len(self.stages) == 1 or len(rows) < len(self.best):
            self.best = rows
            self.progress(name, len(rows), self.fewest)

    def others(self, most: int) -> Iterator[tuple[str, Ints]]:
        """Yield the arrays that need no rules and no must-have rows, constructed ones of fewer than `most` rows."""
        sizes, sets = self.goals.sizes, self.goals.sets
        if self.goals.rules.tables or not sets:
            return
        strengths = {len(each) for each in sets}
        if len(strengths) == 1 and not len(self.must):
            yield from constructions(sizes, strengths.pop(), self.seed, most)
        if self.goals.n_tuples <= MAX_TUPLES and len(self.must) <= MAX_MUST and len(self.best) > self.fewest:
            deadline = math.inf if self.budget is None else self.begun + self.budget
            rows = covertable_rows(self.goals, self.must, seed=self.seed, deadline=deadline)
            if rows is not None:
                yield "covertable", rows

    def grown(self) -> tuple[Ints, Ints]:
        """Return the must-have rows and as many as it takes, found greedily, and the tuples that there was no time for.

        What the search for a row cannot decide is noted."""
        goals, layout = self.goals, self.goals.layout
        missing = goals.missing(self.must)
        rows, n, n_missing = self.must, len(self.must), len(missing)
        cost = max(1, len(layout.set_of) * max(goals.sizes) // 2)
        candidates = int(np.clip(_GROWTH // (cost * max(1, len(goals.sets))), 4, _CANDIDATES))
        step = max(1, _PART // (cost * candidates))
        while n_missing and self.may_grow():
            table = np.full((n + min(n + 64, step), len(goals.sizes)), 0, dtype=np.int64)
            table[:n] = rows[:n]
            before = n
            n, n_missing = map(int, grow(layout, table, n, missing, n_missing, candidates, self.stream))
            rows = table
            # Greedy candidates all ended in rules: ask the exact search for a row with one missing tuple.
            if n_missing and n == before:
                added = self.completed(int(missing[n_missing - 1]))
                if added is not None:
                    rows[n] = added
                    n += 1
                left = missing[:n_missing][~goals.held(rows[:n])[missing[:n_missing]]]
                n_missing = len(left)
                missing[:n_missing] = left
                if added is None:
                    n_missing -= 1  # the last one, which no row holds, is left out
            self.progress("grown row by row", n, self.fewest)
        return rows[:n].copy(), missing[:n_missing].copy()

    def may_grow(self) -> bool:
        if self.budget is not None:
            return time.perf_counter() - self.begun < max(self.budget, LEAST_GROWTH)
        return self.goals.rules.lost_steps - self.lost_before < LOST_STEPS

    def completed(self, number: int) -> Ints | None:
        """Return an allowed row that holds a tuple, if there is one; note the tuple if that takes too long to say."""
        try:
            found = self.goals.row_with(number)
        except UndecidedError:
            found = None
            self.goals.layout.needed[number] = False
            self.undecided.append(number)
        return found

    def shrink(self) -> None:
        """Take rows away one by one, and repair what is left, as long as that goes."""
        spent, spent_before, n_starts = 0, 0, 0
        fixed = len(self.must)
        table = stage = None
        while len(self.best) > max(self.fewest, fixed) and self.goes_on(spent, spent_before):
            if table is None:
                table = table_of(self.goals.layout, self.without_a_row(self.best))
                spent += _COUNTS * len(table.rows) * len(self.goals.sets)
            begun = int(table.state[2])
            done = repair(self.goals.layout, table, fixed, _PIECE, self.stream)
            spent += int(table.state[2]) - begun
            if done:
                if not self.goals.are_met_by(table.rows):
                    raise AssertionError("a repaired array holds everything")
                self.best, table, spent_before = table.rows, None, spent
                stage = Stage("fewer rows", len(self.best), self.seconds)
                self.progress("fewer rows", len(self.best), self.fewest)
            # Long without success: start over from another greedy array, cut to the size that is wanted.
            elif spent - spent_before > (n_starts + 1) * 4 * PATIENCE:
                n_starts += 1
                table = table_of(self.goals.layout, self.cut(self.grown()[0], len(self.best) - 1))
        if stage:
            self.stages.append(stage)

    def goes_on(self, spent: int, spent_before: int) -> bool:
        if self.budget is not None:
            return time.perf_counter() - self.begun < self.budget
        return spent < EFFORT and spent - spent_before < max(PATIENCE, 10 * spent_before)

    def cut(self, rows: Ints, n: int) -> Ints:
        while len(rows) > n:
            rows = self.without_a_row(rows)
        return rows

    def without_a_row(self, rows: Ints) -> Ints:
        """Return the rows without the one that alone holds fewest tuples; must-have rows stay."""
        numbers = self.goals.numbers(rows)
        counts = np.bincount(numbers.ravel(), minlength=self.goals.n_tuples)
        alone = ((counts[numbers] == 1) & self.goals.layout.needed[numbers]).sum(axis=1)
        return np.delete(rows, len(self.must) + int(np.argmin(alone[len(self.must) :])), axis=0)

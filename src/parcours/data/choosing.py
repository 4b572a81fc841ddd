"""Chooses rows of blocks that satisfy a criterion within the rules of a model (Ammann & Offutt, 2008, ch. 4).

Unlike `selecting`, which knows block counts only, this keeps to the rules of the model, counts must-have rows, combines
groups by their own strength, starts base choice from the bases, and adds a row for each invalid block.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from parcours.data.arrays.goals import goals_of
from parcours.data.constraints import meets
from parcours.data.domains import OUTSIDE
from parcours.data.drawing import draw
from parcours.data.inputs import InputModel, rules_of
from parcours.data.rules import OPEN, Rules, UndecidedError
from parcours.data.selecting import CRITERIA, LARGEST_LISTING, Rows, count, select
from parcours.errors import BadRequest, require_known

if TYPE_CHECKING:
    from parcours.data.arrays.building import Progress, Stage

STRENGTHS = {"each_choice": 1, "pairwise": 2, "3-wise": 3, "4-wise": 4, "5-wise": 5, "6-wise": 6}
"""Criteria by how many inputs they combine."""

LISTED = 1_000
"""Most undecided combinations that are put into words."""

MODEL_CRITERIA = tuple(name for known in CRITERIA for name in (
    ("base_choice", "multiple_base_choice") if known == "base_choice" else (known,)))  # fmt: skip
"""Names of the criteria that a model can be asked for."""


@dataclass(frozen=True, slots=True, eq=False)
class RowSelection:
    """Rows of blocks that satisfy a criterion, and what is known about them.

    Attributes:
        model: whose blocks they are.
        criterion: what they satisfy.
        rows: block indices, shape (n_rows, n_inputs): must-have rows, then the others, then those of negative tests.
        must: the values of the must-have rows, shape (n_must, n_inputs).
        n_negative: how many rows at the end have an invalid block.
        fewest: no table without those has fewer rows.
        stages: how a covering array came about.
        infeasible: combinations that the rules forbid, in words.
        undecided: combinations for which the search for an allowed row took too long, in words, LISTED at most.
        n_undecided: how many those are.
    """

    model: InputModel
    criterion: str
    rows: Rows
    must: NDArray[np.float64]
    n_negative: int
    fewest: int
    stages: tuple[Stage, ...] = ()
    infeasible: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    n_undecided: int = 0

    def values(self, seed: int = 0, n: int | None = None) -> NDArray[np.float64]:
        """Return rows of values, shape (n_rows, n_inputs); must-have rows keep theirs. Raises as `draw`.

        Args:
            seed: of the values.
            n: how many rows: the first ones, or further sets of the criterion after the first; one set, if None.
        """
        blocks = self.extended(len(self.rows) if n is None else n, seed)
        drawn = draw(self.model, blocks[len(self.must) :], np.arange(len(self.must), len(blocks)), seed=seed)
        return np.concatenate([self.must[: len(blocks)], drawn])

    def extended(self, n: int, seed: int) -> Rows:
        """Return n rows of blocks: the first ones, or these and the same again; each choice shuffles each set."""
        is_free = not rules_of(self.model).tables and not self.model.groups and len(self.rows) == max(self.model.sizes)
        if self.criterion == "each_choice" and is_free and not len(self.must):
            return select("each_choice", self.model.sizes, np.arange(n), seed=seed)
        again = self.rows[len(self.must) :] if len(self.must) < len(self.rows) else self.rows
        return np.concatenate([self.rows, again[np.arange(max(0, n - len(self.rows))) % len(again)]])[:n]


def choose(
    model: InputModel,
    criterion: str,
    *,
    must: NDArray[np.float64] | None = None,
    budget: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> RowSelection:
    """Return the rows that satisfy a criterion within the rules of a model.

    Args:
        criterion: a name in MODEL_CRITERIA.
        must: values of rows that must be there and count, shape (n_must, n_inputs).
        budget: how long to search for a smaller covering array [s]; None for a fixed effort of a few seconds at
            most, whose result depends on the seed only.
        progress: follows the search of a covering array.

    Raises:
        BadRequest: the criterion is unknown, there are too many rows or tuples to list, or a must-have row lies in
            no block or breaks a rule.
        BadDomain: the rules leave no row.

    >>> from parcours.data.schema import parse_input_model
    >>> model = parse_input_model('''
    ... parcours: data/1
    ... name: print
    ... parameters:
    ...   paper: {kind: enumeration, values: [A4, A3, roll], invalid: [none]}
    ...   tray: {kind: enumeration, values: [upper, lower]}
    ...   both: {kind: enumeration, values: ["yes", "no"]}
    ... constraints:
    ...   roll: {row: "paper != 'roll' || tray == 'lower'"}
    ... ''', "print.yaml")
    >>> chosen = choose(model, "pairwise")
    >>> len(chosen.rows), chosen.n_negative, chosen.infeasible
    (7, 1, ('paper = roll, tray = upper',))
    """
    require_known(criterion, MODEL_CRITERIA, "combination criterion", slug="unknown-criterion")
    values = np.zeros((0, len(model.domains))) if must is None else must
    given = _must_blocks(model, values)
    is_negative = (given >= np.array(model.sizes)).any(axis=1)
    positive = given[~is_negative]
    chosen = _positive(model, criterion, positive, budget, seed, progress)
    negative, forbidden, undecided = _negative(model, given[is_negative])
    return replace(
        chosen,
        rows=np.concatenate([given, chosen.rows[len(positive) :], negative]),
        must=values,
        n_negative=len(negative),
        infeasible=chosen.infeasible + forbidden,
        undecided=chosen.undecided + undecided,
        n_undecided=chosen.n_undecided + len(undecided),
    )


def _positive(
    model: InputModel, criterion: str, must: Rows, budget: float | None, seed: int, progress: Progress | None
) -> RowSelection:
    rules = rules_of(model)
    is_free = not rules.tables and not len(must)
    nothing = np.zeros((0, len(model.domains)))
    if criterion in STRENGTHS and not (criterion == "each_choice" and is_free and not model.groups):
        goals = goals_of(model.sizes, STRENGTHS[criterion], model.column_groups, rules)
        from parcours.data.arrays.building import covering_array  # compiled code is loaded only where it runs

        array = covering_array(goals, must, budget=budget, seed=seed, progress=progress)
        infeasible, undecided = (
            tuple(model.in_words(goals.tuple_of(number)) for number in numbers)
            for numbers in (array.infeasible, array.undecided[:LISTED])
        )
        return RowSelection(
            model, criterion, array.rows, nothing, 0, array.fewest, array.stages, infeasible, undecided,
            len(array.undecided),
        )  # fmt: skip
    infeasible = undecided = ()
    if criterion.endswith("base_choice"):
        bases = [d.bases if criterion == "multiple_base_choice" else d.bases[:1] for d in model.domains]
        rows, *left = base_rows(model.sizes, bases, rules)
        infeasible, undecided = (tuple(model.in_words([pair]) for pair in pairs) for pairs in left)
    elif criterion == "each_choice":
        rows = select(criterion, model.sizes, seed=seed)
    else:
        rows = select(criterion, model.sizes)
        rows = rows[rules.hold(rows)]
    known = {row.tobytes() for row in must}
    others = [row for row in rows if row.tobytes() not in known]
    rows = np.concatenate([must, np.array(others, dtype=np.int64).reshape(len(others), len(model.domains))])
    return RowSelection(
        model, criterion, rows, nothing, 0, len(rows), (), infeasible, undecided, len(undecided)
    )  # fmt: skip


def _negative(model: InputModel, must: Rows) -> tuple[Rows, tuple[str, ...], tuple[str, ...]]:
    """Return a row for each invalid block that no must-have row tests alone, all else valid and at its base.

    With them come the blocks that the rules forbid, and those for which the search took too long, in words."""
    # One invalid value a row: a system that refuses the row says which value it refused only if there is one.
    rules, sizes = rules_of(model), np.array(model.sizes)
    invalid = must >= sizes
    tested = {(int(np.argmax(row)), int(blocks[np.argmax(row)])) for row, blocks in zip(invalid, must, strict=True)
              if row.sum() == 1}  # fmt: skip
    base = np.array([domain.bases[0] for domain in model.domains], dtype=np.int64)
    rows, forbidden, undecided = [], [], []
    for column, domain in enumerate(model.domains):
        for block in range(len(domain.blocks), len(domain.choices)):
            if (column, block) in tested:
                continue
            row = np.full(len(sizes), OPEN)
            row[column] = block
            try:
                found = rules.complete(row, base)
            except UndecidedError:
                undecided.append(model.in_words([(column, block)]))
                continue
            if found is None:
                forbidden.append(model.in_words([(column, block)]))
            else:
                rows.append(found)
    return np.array(rows, dtype=np.int64).reshape(len(rows), len(sizes)), tuple(forbidden), tuple(undecided)


def base_rows(
    sizes: Sequence[int], bases: Sequence[Sequence[int]], rules: Rules
) -> tuple[Rows, tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """Return the rows of (multiple) base choice, the (column, block) pairs that no allowed row holds, those undecided.

    Base rows hold one base of each input; every other row changes one input of a base row to one of its other blocks:
    with at most m bases an input and m_i of B_i blocks being bases, m + m * sum (B_i - m_i) rows. Where the rules
    forbid a row, other inputs leave their base, as few as the search happens to find.

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


def _must_blocks(model: InputModel, values: NDArray[np.float64]) -> Rows:
    blocks = model.blocks_of(values)
    for row, column in np.argwhere(blocks == OUTSIDE)[:1]:
        domain = model.domains[column]
        rule = f"each value must lie in a block, but {domain.name} = {domain.shown(values[row, column])} lies in none"
        raise BadRequest(f"must-have row {row + 1}", rule, slug="must-row")
    columns = {name: values[:, column] for column, name in enumerate(model.names)}
    rules = rules_of(model)
    over_values = [c for c in model.constraints if c.over == "values" and len(values)]
    # Rules over blocks come last: a rule over values, which they enclose, says more about the row.
    broken = [(c.name, ~meets(c, columns)) for c in over_values]
    broken += [(table.name, rules.broken(blocks)[:, i]) for i, table in enumerate(rules.tables)]
    for name, rows in broken:
        for row in np.flatnonzero(rows)[:1]:
            rule = f"it must break no rule, but breaks {name!r}"
            raise BadRequest(f"must-have row {row + 1}", rule, slug="must-row")
    return blocks


def set_size(model: InputModel, criterion: str) -> tuple[int, int]:
    """Return how many rows a criterion takes, without those of negative tests, and the fewest it could take.

    Combinations that are too many to list are counted as if there were no rules. Raises as `choose`.
    """
    if criterion == "all_combinations" and math.prod(model.sizes) > LARGEST_LISTING:
        return count(criterion, model.sizes), count(criterion, model.sizes)
    chosen = choose(model, criterion)
    return len(chosen.rows) - chosen.n_negative, chosen.fewest

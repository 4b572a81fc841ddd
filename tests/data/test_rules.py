"""What rules allow, and which combinations can be completed, is what trying every row says."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from parcours.data import rules as rules_module
from parcours.data.arrays import building
from parcours.data.arrays.building import covering_array
from parcours.data.arrays.goals import goals_of
from parcours.data.bounds import may_hold
from parcours.data.constraints import Constraint, meets
from parcours.data.rules import OPEN, Rules, RuleTable
from parcours.errors import BadDomain
from parcours.model.expression import Expression, parse_expression

TABLES = st.lists(
    st.tuples(st.sets(st.integers(0, 4), min_size=1, max_size=3), st.integers(0, 2**32)), min_size=1, max_size=4
)
SIZES = (3, 2, 3, 2, 2)
EVERY = np.array(list(itertools.product(*map(range, SIZES))))


def made(parts: list[tuple[set[int], int]], share: float = 0.3) -> list[RuleTable]:
    found = []
    for number, (columns, seed) in enumerate(parts):
        shape = [SIZES[c] for c in sorted(columns)]
        allowed = np.random.default_rng(seed).random(shape) > share
        found.append(RuleTable(f"rule {number}", tuple(sorted(columns)), allowed))
    return found


def allowed_rows(tables: list[RuleTable]) -> list[tuple[int, ...]]:
    return [tuple(row) for row in EVERY.tolist() if all(t.allowed[tuple(row[c] for c in t.columns)] for t in tables)]


@pytest.mark.parametrize("is_listed", [True, False], ids=["listed", "searched"])
@settings(max_examples=60, deadline=None)
@given(parts=TABLES)
@example(parts=[({0, 1, 3}, 1), ({1, 3}, 2)])  # what is struck out at once is less than what is impossible
@example(parts=[({0, 1}, 17299603), ({0, 1, 2}, 0), ({0, 1, 2}, 3_097_031_473), ({2}, 1)])  # and leaves no row
def test_rules_allow_and_complete_what_enumeration_does(is_listed: bool, parts: list[tuple[set[int], int]]) -> None:
    tables = made(parts)
    rows = allowed_rows(tables)
    with pytest.MonkeyPatch.context() as patch:
        if not is_listed:
            patch.setattr(rules_module, "MAX_LISTED", 0)
        if not rows:
            with pytest.raises(BadDomain, match="no-valid-row"):
                rules = Rules(SIZES, tables)
                assert not is_listed  # then the search decides it
                rules.require_row()
            return
        rules = Rules(SIZES, tables)
    assert rules.are_listed == (is_listed or not rules.tables)
    assert {tuple(row) for row in EVERY[rules.hold(EVERY)].tolist()} == set(rows)
    for columns in itertools.combinations(range(5), 2):
        slow = {tuple(row[c] for c in columns) for row in rows}
        possible = {tuple(found) for found in np.argwhere(rules.possible(columns, SIZES)).tolist()}
        assert possible == slow if rules.are_listed else possible >= slow  # only a list says that nothing else is
        for blocks in itertools.product(*(range(SIZES[c]) for c in columns)):
            open_ = np.full(5, OPEN)
            open_[list(columns)] = blocks
            row = rules.complete(open_)
            assert (row is not None) == (blocks in slow)
            assert row is None or (tuple(row) in rows and tuple(row[list(columns)]) == blocks)


@settings(max_examples=40, deadline=None)
@given(TABLES, st.integers(1, 3))
def test_arrays_hold_every_combination_that_rules_leave_and_no_row_that_they_forbid(
    parts: list[tuple[set[int], int]], strength: int
) -> None:
    tables = made(parts)
    rows = allowed_rows(tables)
    if not rows:
        return
    goals = goals_of(SIZES, strength, rules=Rules(SIZES, tables))
    array = covering_array(goals, budget=0.01)
    assert {tuple(row) for row in array.rows.tolist()} <= set(rows)
    for columns in itertools.combinations(range(5), strength):
        slow = {tuple(row[c] for c in columns) for row in rows}
        assert {tuple(row) for row in array.rows[:, columns].tolist()} == slow
    n = sum(len({tuple(row[c] for c in columns) for row in rows}) for columns in goals.sets)
    assert len(array.infeasible) == goals.n_tuples - n and not array.undecided


def test_a_search_that_takes_too_long_ends_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    # 11 columns of 10 blocks, all different: no row, but it takes long to see.
    sizes = [10] * 11
    different = ~np.eye(10, dtype=bool)
    pairs = [RuleTable(f"{a}/{b}", (a, b), different) for a, b in itertools.combinations(range(11), 2)]
    monkeypatch.setattr(rules_module, "MAX_STEPS", 5)
    rules = Rules(sizes, pairs)
    with pytest.raises(rules_module.UndecidedError):
        rules.complete(np.full(11, OPEN))
    with pytest.raises(BadDomain, match="rules-undecided"):
        covering_array(goals_of(sizes, 1, rules=rules), budget=0.0)
    monkeypatch.setattr(building, "LOST_STEPS", 0)
    array = covering_array(goals_of([3] * 4, 2, rules=Rules([3] * 4, [RuleTable("r", (0, 1), ~np.eye(3, dtype=bool))])))
    assert not len(array.rows) and len(array.undecided) == 6 + 5 * 9 and len(array.infeasible) == 3


POINTS = st.lists(st.tuples(*[st.integers(-6, 6)] * 4), min_size=1, max_size=5)
CONDITIONS = [
    "x * y - x <= 2", "x / (y * y + 1) > 1", "abs(x) % 3 == 1", "hypot(x, y) < 3", "min(x, y, 2) != max(x - 1, 0)",
    "!(x < y) || x == 3 && y >= -2", "floor(x / 2) == y", "sqrt(abs(x)) > y", "(x < 0) == (y < 0)", "-x + 2 * y > 0.5",
]  # fmt: skip


@pytest.mark.parametrize("text", CONDITIONS)
@settings(max_examples=40, deadline=None)
@given(boxes=POINTS, shares=st.lists(st.floats(0, 1), min_size=2, max_size=2))
def test_what_bounds_call_impossible_no_value_between_them_meets(
    text: str, boxes: list[tuple[int, int, int, int]], shares: list[float]
) -> None:
    rule: Expression = parse_expression(text)
    table = np.array(boxes, dtype=float) / 2
    x, y = np.sort(table[:, :2], axis=1), np.sort(table[:, 2:], axis=1)
    chance = may_hold(rule, {"x": (x[:, 0], x[:, 1]), "y": (y[:, 0], y[:, 1])})
    inside = {"x": x[:, 0] + shares[0] * np.ptp(x, axis=1), "y": y[:, 0] + shares[1] * np.ptp(y, axis=1)}
    assert not (meets(Constraint("c", rule), inside) & ~chance).any()
    exact = may_hold(rule, {"x": (x[:, 0], x[:, 0]), "y": (y[:, 0], y[:, 0])})
    assert (exact == meets(Constraint("c", rule), {"x": x[:, 0], "y": y[:, 0]})).all()

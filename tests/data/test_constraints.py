"""The answer for a whole table is that of the guard language, row by row."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from parcours.data.constraints import Constraint, meets
from parcours.errors import BadDomain, BadModel
from parcours.model.expression import (
    Apply,
    Binary,
    Expression,
    Literal,
    Name,
    Unary,
    evaluate,
    parse_expression,
)

NUMBERS: st.SearchStrategy[Expression] = st.deferred(
    lambda: st.one_of(
        st.sampled_from([Name("x"), Name("y")]),
        st.integers(0, 9).map(Literal),
        st.sampled_from([0.5, 1.5]).map(Literal),
        st.builds(Unary, st.just("-"), NUMBERS),
        st.builds(Binary, st.sampled_from("+-*/%"), NUMBERS, NUMBERS),
        st.builds(lambda f, a: Apply(f, (a,)), st.sampled_from(["abs", "floor", "sqrt"]), NUMBERS),
        st.builds(lambda f, a, b: Apply(f, (a, b)), st.sampled_from(["min", "max"]), NUMBERS, NUMBERS),
    )
)
CONDITIONS: st.SearchStrategy[Expression] = st.deferred(
    lambda: st.one_of(
        st.booleans().map(Literal),
        st.builds(Binary, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), NUMBERS, NUMBERS),
        st.builds(Unary, st.just("!"), CONDITIONS),
        st.builds(Binary, st.sampled_from(["&&", "||", "==", "!="]), CONDITIONS, CONDITIONS),
    )
)
# Small dyadic numbers: sums and products of a few of them are exact, so that both ways must agree to the bit.
VALUES = st.lists(st.tuples(st.integers(-8, 8), st.integers(-8, 8)), min_size=1, max_size=6)


@settings(max_examples=200)
@given(CONDITIONS, VALUES)
def test_a_table_is_judged_as_its_rows_are(rule: Expression, rows: list[tuple[int, int]]) -> None:
    table = np.array(rows, dtype=float) / 4
    try:
        slow = [evaluate(rule, {"x": float(x), "y": float(y)}) for x, y in table]
    except BadModel:
        slow = []
    constraint = Constraint("c", rule)
    columns = {"x": table[:, 0], "y": table[:, 1]}
    if slow:
        assert meets(constraint, columns).tolist() == slow
    else:
        with pytest.raises(BadDomain, match="constraint-undefined"):
            meets(constraint, columns)


@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(0.01, 100))
def test_distances_off_the_limit_are_judged_as_the_language_does(x: float, y: float, limit: float) -> None:
    rule = parse_expression(f"hypot(x, y, 0) >= {limit}")
    assume(abs(np.hypot(x, y) - limit) > 1e-9)
    columns = {"x": np.array([x]), "y": np.array([y])}
    assert meets(Constraint("c", rule), columns)[0] == evaluate(rule, {"x": x, "y": y})


def test_a_constraint_without_a_value_names_itself_and_the_remedy() -> None:
    constraint = Constraint("ratio", parse_expression("1 / x < 2"))
    with pytest.raises(BadDomain, match=r"constraint 'ratio'.*1 / x < 2.*divide by zero.*constraint-undefined"):
        meets(constraint, {"x": np.array([1.0, 0.0])})


def test_a_constraint_knows_the_inputs_it_speaks_of() -> None:
    assert Constraint("c", parse_expression("hypot(x1, y1) > z")).inputs == {"x1", "y1", "z"}

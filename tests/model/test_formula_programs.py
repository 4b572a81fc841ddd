"""Formulas as functions of Python have the values and errors of their evaluation node by node, whatever they read."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadModel
from parcours.model.expression import evaluate, parse_formula
from parcours.model.expression.programs import program
from parcours.model.expression.syntax import Binary, FieldAccess, Literal, Name
from parcours.model.fitting import fitting, misfit
from parcours.model.structure import Field, MessageClass

FORMULAS = [
    "it.a + it.b <= it.c", "it.a * it.b - it.c > 0 && it.flag", "!it.flag || it.a == it.b", "it.word == 'up'",
    "all s in it.list: s.v <= it.a", "some s in it.list: abs(s.v) > 1 && s.v != it.b",
    "(sum s in it.list: s.v) >= it.a",
    "all k in 1..size(it.list) - 1: near(it.list[k].v, it.list[k - 1].v, 0.5)", "it.list[it.n].v > 0",
    "all k in 0..it.n: all j in k..it.n: it.list[j].v + k >= j", "hypot(it.a, it.b) / it.c < 3", "it.a % it.b == 1",
    "min(it.a, it.b) <= max(it.c, 2) => wrap(it.a) < pi", "atan2(it.a, it.b) > sqrt(it.c)", "-it.a < floor(it.b)",
    "it.a * 1e308 * it.b > it.c", "last.a <= it.a", "it.n * it.n * it.n > 0",
    "all s in it.list: all s in it.list: s.v > 0",
]  # fmt: skip
numbers = st.one_of(
    st.integers(-3, 3), st.floats(-4, 4), st.sampled_from([0.0, -0.0, 1e308, -1e308, math.inf, math.nan, 2**62, 2**63])
)
anything: st.SearchStrategy[object] = st.one_of(
    numbers, st.booleans(), st.sampled_from(["up", "", "x"]), st.just([]), st.just({"v": 1.0})
)
usual = st.one_of(numbers, numbers, numbers, anything)
items = st.lists(
    st.one_of(st.fixed_dictionaries({"v": usual}), st.fixed_dictionaries({"v": st.floats(-2, 2)})), max_size=4
)
messages = st.fixed_dictionaries(
    {"a": usual, "b": usual, "c": usual, "flag": st.one_of(st.booleans(), anything),
     "word": st.one_of(st.just("up"), anything),
     "n": st.one_of(st.integers(-2, 4), anything), "list": st.one_of(items, items, items, anything)},
    optional={"more": anything},
)  # fmt: skip


def said(make: Any, known: dict[str, object]) -> object:
    try:
        return make(known)
    except BadModel as error:
        return error.slug, error.rule


@pytest.mark.parametrize("text", FORMULAS)
@given(it=messages, last=st.one_of(st.none(), messages))
def test_a_program_says_what_the_evaluation_says(
    text: str, it: dict[str, object], last: dict[str, object] | None
) -> None:
    formula = parse_formula(text)
    known: dict[str, object] = {"it": it, "pi": math.pi} | ({"last": last} if last is not None else {})
    wanted, found = said(lambda k: evaluate(formula, k, "test"), known), said(program(formula, "test"), known)
    assert repr(found) == repr(wanted)


def test_names_and_texts_of_a_formula_are_constants() -> None:
    hostile = "'); raise SystemExit #\n\0\\\""
    formula = Binary("==", FieldAccess(Name("it"), hostile), Literal(hostile))
    assert program(formula, hostile)({"it": {hostile: hostile}}) is True
    assert program(formula, hostile)({"it": {hostile: "other"}}) is False


def test_deep_formulas_are_evaluated_all_the_same() -> None:
    formula = parse_formula("(" * 40 + "it" + " + 1)" * 40 + " == 40")
    assert program(formula)({"it": 0}) is True


CLASSES = {
    "Point": MessageClass("Point", (Field("x", "real"), Field("n", "int"), Field("on", "bool"), Field("w", "text"))),
    "Way": MessageClass("Way", (Field("of", "Point"), Field("all", "Point", shape=("n",)),
                                Field("two", "real", shape=(2,)), Field("next", "Way"))),
}  # fmt: skip
points = st.fixed_dictionaries(
    {}, optional={"x": anything, "n": anything, "on": anything, "w": anything, "z": anything}
)
ways = st.fixed_dictionaries({}, optional={"of": points, "all": st.lists(points, max_size=2), "two": st.one_of(
    st.lists(st.floats(), max_size=3), anything), "next": st.fixed_dictionaries(
    {}, optional={"of": points})})  # fmt: skip


@given(ways)
def test_what_plainly_fits_a_class_is_no_misfit(way: dict[str, object]) -> None:
    if fitting(CLASSES, CLASSES["Way"])(way):
        assert misfit(CLASSES, CLASSES["Way"], way) == ""


def test_usual_messages_fit_plainly() -> None:
    point = {"x": 1.0, "n": 2, "on": True, "w": "a"}
    way = {"of": point, "all": [point, point], "two": [1.0, 2.0], "next": {"of": point}}
    fits = fitting(CLASSES, CLASSES["Way"])
    assert fits(way)
    assert not fits({**way, "two": [1.0]}) and not fits({**way, "of": {"x": True}}) and not fits({"other": 1})

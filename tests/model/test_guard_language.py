"""The guard and action language: text, tree, value and type agree."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadModel
from parcours.model.expression import (
    BOOL,
    INT,
    REAL,
    TEXT,
    Apply,
    Assignment,
    Binary,
    Call,
    Expression,
    FieldAccess,
    Literal,
    Name,
    Type,
    Unary,
    evaluate,
    parse_actions,
    parse_expression,
    type_of,
)
from parcours.model.expression.parsing import MAX_DEPTH, MAX_LENGTH, RESERVED
from parcours.model.expression.syntax import LEVELS

identifiers = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True).filter(lambda name: name not in RESERVED)
constants = st.one_of(
    st.booleans(),
    st.integers(0, 2**63 - 1),
    st.floats(0, allow_infinity=False).filter(lambda value: math.copysign(1, value) > 0),
    st.text(max_size=8),
)


def _compound(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    return st.one_of(
        st.builds(Unary, st.sampled_from("!-"), inner),
        st.builds(Binary, st.sampled_from(sorted(LEVELS)), inner, inner),
        st.builds(FieldAccess, inner, identifiers),
        st.builds(Apply, st.just("max"), st.lists(inner, min_size=2, max_size=3).map(tuple)),
    )


trees = st.recursive(st.builds(Literal, constants) | st.builds(Name, identifiers), _compound, max_leaves=20)


@given(trees)
def test_the_text_of_a_tree_parses_back_to_the_tree(tree: Expression) -> None:
    assert parse_expression(str(tree)) == tree


@given(st.lists(st.builds(Assignment, identifiers, trees) | st.builds(Call, identifiers, st.tuples(trees)), min_size=1))
def test_actions_parse_back_too(actions: list[Assignment | Call]) -> None:
    text = "; ".join(map(str, actions))
    if len(text) <= MAX_LENGTH:
        assert parse_actions(text) == tuple(actions)


@given(st.text(alphabet="ab1.'\"()!&|=<>+-*/%,;:\\ \n", max_size=30) | st.text(max_size=20))
def test_any_text_is_a_tree_or_a_complaint(text: str) -> None:
    try:
        tree = parse_expression(text)
    except BadModel as error:
        assert str(error).startswith("expression: ") and error.slug in {"syntax", "overflow", "unknown-function"}
    else:
        assert parse_expression(str(tree)) == tree


numeric = st.recursive(
    st.builds(Literal, st.integers(0, 9)) | st.just(Name("x")),
    lambda inner: st.builds(Unary, st.just("-"), inner) | st.builds(Binary, st.sampled_from("+-*/%"), inner, inner),
    max_leaves=8,
)


@given(numeric, st.integers(-3, 3))
def test_arithmetic_is_that_of_python(tree: Expression, x: int) -> None:
    try:
        expected = eval(str(tree), {"x": x})
    except ZeroDivisionError:
        with pytest.raises(BadModel, match="division-by-zero"):
            evaluate(tree, {"x": x})
    else:
        assert evaluate(tree, {"x": x}) == expected


typed = st.recursive(
    st.builds(Literal, st.booleans() | st.integers(0, 9) | st.floats(0, 9) | st.sampled_from(["a", "b"]))
    | st.sampled_from([Name("flag"), Name("n"), Name("v"), Name("word"), FieldAccess(Name("ob"), "x"), Name("ob")]),
    _compound,
    max_leaves=12,
)
TYPES = {"flag": BOOL, "n": INT, "v": REAL, "word": TEXT, "ob": Type("Pose")}
CLASSES = {"Pose": {"x": REAL}}
VALUES: dict[str, object] = {"flag": True, "n": 3, "v": 0.5, "word": "a", "ob": {"x": 2.0}}


@given(typed)
def test_what_is_well_typed_has_a_value_of_its_type(tree: Expression) -> None:
    try:
        type_ = type_of(tree, TYPES, CLASSES)
    except BadModel as error:
        assert "^" in str(error)
        return
    try:
        value = evaluate(tree, VALUES)
    except BadModel as error:
        assert error.slug in {"division-by-zero", "overflow"}
    else:
        kinds = {"bool": (bool,), "int": (int,), "real": (int, float), "text": (str,), "Pose": (dict,)}
        assert isinstance(value, kinds[type_.name])


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("a and b or not c", "a && b || !c"),
        ("a || b && c", "a || b && c"),
        ("(a || b) && c", "(a || b) && c"),
        ("a - (b - c) - d", "a - (b - c) - d"),
        ("-ob.x*2", "-ob.x * 2"),
        ('mode == "fast"', "mode == 'fast'"),
        (r"'it\'s \u{e9}\n'", r"'it\'s é\u{a}'"),
        ("(a < b) == c", "(a < b) == c"),
        (".5 + 1e3", "0.5 + 1000.0"),
    ],
)
def test_canonical_text(text: str, same: str) -> None:
    assert str(parse_expression(text)) == same


@pytest.mark.parametrize(
    ("text", "slug", "shown"),
    [
        ("", "syntax", "found the end in"),
        ("a = b", "syntax", "compare with =="),
        ("a < b < c", "syntax", "join two comparisons by &&"),
        ("a & b", "syntax", "write &&"),
        ("f(1)", "unknown-function", "Known: abs"),
        ("'open", "syntax", "close the text"),
        (r"'\q'", "syntax", "escape"),
        ("a b", "syntax", '"a ^b"'),
        ("a.(b)", "syntax", "a field name"),
        ("9223372036854775808", "overflow", "64 bits"),
        ("1e999", "overflow", "64 bits"),
        ("and", "syntax", "a value"),
        ("__import__('os')", "unknown-function", "Known"),
        ("a\u00e9", "syntax", "sign of the language"),
    ],
)
def test_a_complaint_names_the_place_and_the_remedy(text: str, slug: str, shown: str) -> None:
    with pytest.raises(BadModel) as caught:
        parse_expression(text, "guard of 'p1'")
    assert caught.value.slug == slug
    assert str(caught.value).startswith("guard of 'p1': ") and shown in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "(" * 2000 + "a" + ")" * 2000,
        "!" * 4000 + "a",
        "a" + " && a" * 800,
        "a" + ".b" * 2000,
        "max(" * 1000,
        "a" * (MAX_LENGTH + 1),
    ],
)
def test_hostile_text_is_refused_by_size(text: str) -> None:
    with pytest.raises(BadModel, match="expression-size"):
        parse_expression(text)


def test_a_chain_up_to_the_limit_is_read_shown_and_computed() -> None:
    tree = parse_expression(" && ".join(["a"] * (MAX_DEPTH - 1)))
    assert evaluate(tree, {"a": True}) is True and parse_expression(str(tree)) == tree


@pytest.mark.parametrize(
    ("text", "slug", "shown"),
    [
        ("n && flag", "type", '"^n && flag"'),
        ("!n", "type", '"!^n"'),
        ("flag + 1", "type", '"^flag + 1"'),
        ("flag == 1", "type", '"^flag == 1"'),
        ("ob == ob", "type", "like base types"),
        ("nn > 0", "unknown-name", "did you mean 'n'"),
        ("ob.y > 0", "unknown-field", "Known: x"),
        ("n.x > 0", "type", "only a message has fields"),
        ("size(n) > 0", "type", "works on a list"),
        ("sqrt(1, 2) > 0", "arity", "takes 1 arguments"),
        ("mode == 'fsat'", "enum-value", "did you mean 'fast'"),
    ],
)
def test_a_type_error_shows_its_place(text: str, slug: str, shown: str) -> None:
    types = {**TYPES, "mode": Type("enum", ("slow", "fast"))}
    with pytest.raises(BadModel) as caught:
        type_of(parse_expression(text), types, CLASSES)
    assert caught.value.slug == slug and shown in str(caught.value)


@pytest.mark.parametrize(
    ("text", "type_"),
    [
        ("n + n", INT),
        ("n + v", REAL),
        ("n / n", REAL),
        ("floor(v)", INT),
        ("max(n, v)", REAL),
        ("n == v", BOOL),
        ("hypot(n, n)", REAL),
        ("word != 'x'", BOOL),
    ],
)
def test_types_follow_the_operands(text: str, type_: Type) -> None:
    assert type_of(parse_expression(text), TYPES, CLASSES) == type_


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("flag || 1 / 0 > 0", True),
        ("!flag && unknown", False),
        ("-7 % 3", 2),
        ("7 / 2", 3.5),
        ("size(points) == 2", True),
        ("min(3, 1.5) + max(1, 2) + abs(-1)", 4.5),
        ("sqrt(2.25) + hypot(3, 4) + floor(-0.5)", 5.5),
        ("word == 'a'", True),
        ("1 == 1.0", True),
    ],
)
def test_values(text: str, value: object) -> None:
    assert evaluate(parse_expression(text), {**VALUES, "points": (1, 2)}) == value


@pytest.mark.parametrize(
    ("text", "slug"),
    [
        ("1 % 0", "division-by-zero"),
        ("sqrt(-1)", "negative-root"),
        ("9223372036854775807 + 1", "overflow"),
        ("1e308 * 10", "overflow"),
        ("nothing", "no-value"),
        ("ob.y", "no-value"),
        ("word.x", "no-value"),
        ("n && flag", "type"),
        ("flag + 1", "type"),
        ("word == 1", "type"),
        ("size(word)", "type"),
    ],
)
def test_what_has_no_value_says_why(text: str, slug: str) -> None:
    with pytest.raises(BadModel) as caught:
        evaluate(parse_expression(text), VALUES)
    assert caught.value.slug == slug

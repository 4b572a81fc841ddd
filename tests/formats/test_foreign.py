"""Foreign expressions and statements: each translation does what the foreign language does, or is refused by name."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadModel
from parcours.model.expression import evaluate, parse_expression
from parcours_formats.guard_languages import Scope, branches, guard, variables
from parcours_formats.guard_languages.javascript import javascript

Values = dict[str, object]
KINDS = {"i": "int", "j": "int", "k": "int", "p": "bool", "q": "bool"}


def _truncated(a: int, b: int) -> int:
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def _remainder(a: int, b: int) -> int:
    return a - b * _truncated(a, b)


class Twin:
    """Makes up an expression in C with what it is worth, by C's rules, for given values."""

    def __init__(self, source: random.Random, values: Values) -> None:
        self.source, self.values = source, values

    def number(self, depth: int) -> tuple[str, int]:
        if depth == 0 or self.source.random() < 0.2:
            if self.source.random() < 0.5:
                name = self.source.choice("ijk")
                return name, int(str(self.values[name]))
            constant = self.source.randrange(9)
            return str(constant), constant
        match self.source.randrange(7):
            case 0:
                (a, x), (b, y) = self.number(depth - 1), self.number(depth - 1)
                worth = {"+": x + y, "-": x - y, "*": x * y, "<?": min(x, y), ">?": max(x, y)}
                operator = self.source.choice(list(worth))
                return f"({a} {operator} {b})", worth[operator]
            case 1:
                (a, x), divisor = self.number(depth - 1), self.source.choice([-3, -2, 1, 2, 5])
                return f"({a} / ({divisor}))", _truncated(x, divisor)
            case 2:
                (a, x), divisor = self.number(depth - 1), self.source.choice([-3, 1, 2, 5])
                return f"({a} % ({divisor}))", _remainder(x, divisor)
            case 3:
                (a, x) = self.number(depth - 1)
                return f"(-{a})", -x
            case 4 | 5:
                (c, z), (a, x), (b, y) = self.truth(depth - 1), self.number(depth - 1), self.number(depth - 1)
                return f"({c} ? {a} : {b})", x if z else y
            case _:
                (a, x) = self.truth(depth - 1)
                return f"(0 + {a})", int(x)

    def truth(self, depth: int) -> tuple[str, bool]:
        if depth == 0 or self.source.random() < 0.2:
            name = self.source.choice("pq")
            return name, bool(self.values[name])
        match self.source.randrange(5):
            case 0:
                (a, x), (b, y) = self.number(depth - 1), self.number(depth - 1)
                signs: dict[str, bool] = {
                    "==": x == y,
                    "!=": x != y,
                    "<": x < y,
                    "<=": x <= y,
                    ">": x > y,
                    ">=": x >= y,
                }
                sign = self.source.choice(list(signs))
                return f"({a} {sign} {b})", signs[sign]
            case 1:
                (a, z), (b, w) = self.truth(depth - 1), self.truth(depth - 1)
                joins = {"&&": z and w, "and": z and w, "||": z or w, "or": z or w, "imply": not z or w, "==": z == w}
                join = self.source.choice(list(joins))
                return f"({a} {join} {b})", joins[join]
            case 2:
                (a, z) = self.truth(depth - 1)
                return self.source.choice([f"(!{a})", f"(not {a})"]), not z
            case 3:
                (c, z), (a, x), (b, y) = self.truth(depth - 1), self.truth(depth - 1), self.truth(depth - 1)
                return f"({c} ? {a} : {b})", x if z else y
            case _:
                (a, n) = self.number(depth - 1)
                return f"({a} || false)", n != 0


seeds = st.integers(0, 2**32)


def _values(source: random.Random) -> Values:
    numbers: Values = {name: source.randrange(-7, 8) for name in "ijk"}
    return numbers | {name: source.random() < 0.5 for name in "pq"}


@given(seeds)
@settings(max_examples=300, deadline=None)
def test_a_condition_in_c_is_worth_the_same_here(seed: int) -> None:
    source = random.Random(seed)
    values = _values(source)
    text, expected = Twin(source, values).truth(3)
    try:
        found = guard(text, "uppaal", "twin", KINDS)
    except BadModel as error:
        assert error.slug == "expression-size"
        return
    assert evaluate(found, values) == expected
    assert parse_expression(str(found)) == found


@given(seeds)
@settings(max_examples=200, deadline=None)
def test_statements_have_one_branch_for_every_start_and_it_does_the_same(seed: int) -> None:
    source = random.Random(seed)
    start = _values(source)
    after, parts = dict(start), []
    for _ in range(source.randint(1, 4)):
        twin = Twin(source, after)
        text, value = twin.number(2)
        name = source.choice("ijk")
        if source.random() < 0.4:
            condition, holds = twin.truth(1)
            parts.append(f"if ({condition}) {{ {name} = {text}; }} else {name}++;")
            after[name] = value if holds else int(str(after[name])) + 1
        else:
            sign = source.choice(["=", ":=", "+=", "-="])
            old = int(str(after[name]))
            after[name] = {"=": value, ":=": value, "+=": old + value, "-=": old - value}[sign]
            parts.append(f"{name} {sign} {text};")
    try:
        found = branches(" ".join(parts), Scope("uppaal", KINDS), "twin")
    except BadModel as error:
        assert error.slug == "expression-size"
        return
    [taken] = [branch for branch in found if evaluate(branch.guard, start)]
    now = dict(start)
    for action in taken.actions:
        now[action.target] = evaluate(action.value, now)
    assert now == after


@given(seeds)
@settings(max_examples=200, deadline=None)
def test_javascript_of_an_expression_reads_back_to_one_of_the_same_value(seed: int) -> None:
    source = random.Random(seed)
    values = _values(source)
    text, _ = Twin(source, values).truth(3)
    try:
        ours = guard(text, "uppaal", "twin", KINDS)
        back = guard(javascript(ours), "javascript", "back", KINDS)
    except BadModel as error:
        assert error.slug == "expression-size"
        return
    assert evaluate(back, values) == evaluate(ours, values)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x === 1 && y !== 2", "x == 1 && y != 2"),
        ("n", "n != 0"),
        ("!n", "n == 0"),
        ("word", "word != ''"),
        ("ready == (n > 1)", "ready == (n > 1)"),
        ("n % 2 == 0", "n % 2 == 0"),
        ("Math.max(n, 2) >= 0x1F", "max(n, 2) >= 31"),
        ("word == 'it\\'s'", "word == 'it\\'s'"),
        ("word == '\\u00e9\\ud83d\\ude00'", "word == 'é😀'"),
        ("a // not this\n || b /* nor this */", "a || b"),
        ("1 < 2 && ready", "ready"),
        ("(n > 1 ? 2 : 3) == 2", "n > 1"),
    ],
)
def test_javascript_conditions_are_said_in_our_words(text: str, expected: str) -> None:
    kinds = {"n": "int", "ready": "bool", "word": "text", "a": "bool", "b": "bool", "x": "int", "y": "int"}
    assert str(guard(text, "javascript", "here", kinds)) == expected


@pytest.mark.parametrize(
    ("text", "language", "named"),
    [
        ("f(x) > 1", "javascript", "a call of the function 'f'"),
        ("eval('1')", "javascript", "a call of the function 'eval'"),
        ("x.push(1)", "javascript", "a call of the function 'x.push'"),
        ("x & 1", "javascript", "the bit operator '&'"),
        ("x << 1", "uppaal", "the bit operator '<<'"),
        ("x ** 2 > 1", "javascript", "the operator '**'"),
        ("a.b", "javascript", "a field 'b' of an object"),
        ("a[1]", "javascript", "an element of a list"),
        ("[1, 2]", "javascript", "a list"),
        ("{a: 1}", "javascript", "an object"),
        ("function () { }", "javascript", "'function'"),
        ("() => 1", "javascript", "must stand"),
        ("new Date", "javascript", "'new'"),
        ("x = 1", "javascript", "an assignment inside an expression"),
        ("x++ > 1", "javascript", "'++' inside an expression"),
        ("`a`", "javascript", "a text template"),
        ("x' == 0", "uppaal", "a derivative"),
        ("x + 'b' == 'ab'", "javascript", 'are joined by +, but "x" varies'),
        ("'a' - 'b' == 1", "javascript", "- on texts"),
        ("+'5' == 5", "javascript", "- on texts"),
        ("'n' + 1e21 == 'n'", "javascript", "varies"),
        ("x == null", "javascript", "the value 'null'"),
        ("(1 || 'a') == 1", "javascript", "|| on values"),
    ],
)
def test_what_our_language_cannot_say_is_refused_by_name(text: str, language: str, named: str) -> None:
    with pytest.raises(BadModel) as caught:
        guard(text, "uppaal" if language == "uppaal" else "javascript", "m.json:3: guard of 'e1'")
    assert named in str(caught.value) and str(caught.value).startswith("m.json:3: guard of 'e1': ")
    assert caught.value.slug in ("foreign-construct", "foreign-syntax")


@pytest.mark.parametrize("text", ["while (x) { x--; }", "for (;;) {}", "x = function () {}", "x = y = 1", "f()"])
def test_statements_that_loop_or_call_are_refused(text: str) -> None:
    with pytest.raises(BadModel, match="foreign-construct"):
        branches(text, Scope("javascript"), "here")


@pytest.mark.parametrize(
    "text", ["(" * 5000 + "x" + ")" * 5000, "!" * 5000 + "x", "x == " * 5000 + "x", "x ? " * 500 + "x", "/*" * 90_000]
)
def test_deep_and_unclosed_texts_are_refused_at_once(text: str) -> None:
    with pytest.raises(BadModel, match=r"expression-size|foreign-syntax"):
        guard(text, "javascript", "here")


def test_nested_choices_are_bounded() -> None:
    text = "x = " + " + ".join(f"(a{number} ? 1 : 2)" for number in range(30))
    with pytest.raises(BadModel, match="expression-size"):
        branches(text, Scope("javascript"), "here")


def test_lines_may_end_statements_of_javascript() -> None:
    [branch] = branches("x = 1\ny = 2\n\n z += x;", Scope("javascript"), "here")
    assert [str(each) for each in branch.actions] == ["x := 1", "y := 2", "z := z + x"]


def test_an_integer_that_is_given_a_real_is_a_real() -> None:
    [start] = branches("a = 1; b = a; t = 'x'; v = -2", Scope("javascript"), "here")
    [later] = branches("b = a / 2; a = b", Scope("javascript"), "here")
    found = variables(start.actions, later.actions, "here")
    assert [(each.name, each.type, each.initial) for each in found] == [
        ("a", "real", 1.0),
        ("b", "real", 1.0),
        ("t", "text", "x"),
        ("v", "int", -2),
    ]

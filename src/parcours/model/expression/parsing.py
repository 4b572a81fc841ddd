"""The tokenizer and parser of the guard and action language.

    expression := unary (operator unary)*        precedence in syntax.LEVELS; comparisons do not chain
    unary      := ('!' | 'not' | '-') unary | atom
    atom       := literal [unit] | name | function '(' expression, ... ')' | '(' expression ')', then '.' field, ...
    actions    := action (';' action)*           action := name ':=' expression | name '(' expression, ... ')'

Formulas over messages have more:

    formula    := expression ['=>' formula]
    atom       += '[' expression ']' after an atom; ('all' | 'some' | 'sum') name 'in' range ':' formula
    range      := expression ['..' expression]

Nothing is ever evaluated here, and text from a hostile file costs at most MAX_LENGTH characters and MAX_DEPTH
levels.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from math import isfinite
from typing import Any, TypeVar

from parcours.errors import one_of
from parcours.model.expression.evaluation import FORMULA_FUNCTIONS, FUNCTIONS, INTEGER_LIMIT
from parcours.model.expression.syntax import (
    COMPARISONS,
    LEVELS,
    Apply,
    Assignment,
    Binary,
    Call,
    Each,
    Expression,
    FieldAccess,
    Item,
    Literal,
    Name,
    Unary,
)
from parcours.model.expression.tokens import Token, Tokens

MAX_LENGTH = 4096
"""Longest text of one guard, action or message list [characters]."""

MAX_DEPTH = 100
"""Deepest syntax tree, so that every later walk over it may recurse."""

RESERVED = {"true", "false", "and", "or", "not"}
"""Words of the language, which cannot be names."""

_WORDS = {"and": "&&", "or": "||", "not": "!"}
_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\n]+)
      | (?P<real>(?:[0-9]+\.(?!\.)[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[0-9]+[eE][+-]?[0-9]+)
      | (?P<int>[0-9]+)
      | (?P<name>[A-Za-z_][A-Za-z0-9_]*)
      | (?P<text>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")
      | (?P<sign>:=|==|=>|!=|<=|>=|&&|\|\||\.\.|[-+*/%<>!().,;:\[\]])""",
    re.VERBOSE | re.DOTALL,
)
UNITS = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "rad": 1.0,
    "deg": math.pi / 180,
}  # fmt: skip
"""What may follow a number, and what it is multiplied by: values are in SI units."""

EACH = ("all", "some", "sum")
"""What a quantifier makes of its bodies: all hold, one holds, their sum."""

_HINTS = {
    "=": "compare with ==, assign with :=",
    "&": "write &&",
    "|": "write ||",
    **dict.fromkeys("'\"", "close the text with the same quote"),
}
_ESCAPE = re.compile(r"\\(?:u\{(?P<code>[0-9a-fA-F]{1,6})\}|(?P<other>.))", re.DOTALL)
_Result = TypeVar("_Result")


def parse_expression(text: str, where: str = "expression") -> Expression:
    """Return the syntax tree of an expression.

    Args:
        text: e.g. `"!tcp_socket && size(points) >= 2"`; at most MAX_LENGTH characters.
        where: what the text belongs to, for the error message.

    Raises:
        BadModel: the text is no expression, is too long or too deeply nested. The message shows where, by a
            caret.

    >>> str(parse_expression("not a and (b<c+1)"))
    '!a && b < c + 1'
    >>> parse_expression("a && && b", "p2")
    Traceback (most recent call last):
    ...
    parcours.errors.BadModel: p2: a value must stand at the caret, but found '&&' in "a && ^&& b" [syntax]
    """
    return _whole(text, where, _Parser.expression)


def parse_formula(text: str, where: str = "formula") -> Expression:
    """Return the syntax tree of a formula: an expression that may also have `=>`, `[...]` and quantifiers.

    Raises:
        BadModel: as for parse_expression.

    >>> str(parse_formula("feasible => all k in 1..size(it): abs(it[k].v) <= 5 cm"))
    '!feasible || (all k in 1..size(it): abs(it[k].v) <= 0.05)'
    """
    return _whole(text, where, _Formula.formula, _Formula)


def parse_actions(text: str, where: str = "action") -> tuple[Assignment | Call, ...]:
    """Return the actions of a text such as `"a := b + 1; pause()"`, in order.

    Raises:
        BadModel: as for parse_expression.

    >>> [str(action) for action in parse_actions("n := n+1 ; pause()")]
    ['n := n + 1', 'pause()']
    """
    return _whole(text, where, lambda parser: parser.several(parser.action))


def parse_calls(text: str, where: str = "message") -> tuple[Call, ...]:
    """Return the calls of a text such as `"request(path); stop"`; parentheses may be left out when empty."""
    return _whole(text, where, lambda parser: parser.several(parser.call))


def _whole(text: str, where: str, parse: Callable[[Any], _Result], make: type[_Parser] | None = None) -> _Result:
    parser = (make or _Parser)(text, where)
    result = parse(parser)
    if parser.token.kind != "end":
        parser.fail("an operator or the end must stand")
    return result


class _Parser(Tokens):
    """Recursive descent over one text."""

    functions = FUNCTIONS

    pattern = _TOKEN
    hints = _HINTS
    noun = "an expression"
    most = (MAX_LENGTH, MAX_DEPTH)
    shorten = ("write it shorter, or split it", "split it over several transitions")
    slugs = ("syntax", "expression-size")

    def expression(self, level: int = 1) -> Expression:
        self.enter()
        left = self.unary()
        chain = 0
        while (operator := _WORDS.get(self.token.text, self.token.text)) in LEVELS:
            own = LEVELS[operator]
            if own < level or self.token.kind == "text":
                break
            if isinstance(left, Binary) and {operator, left.operator} <= COMPARISONS and chain:
                self.fail("the end of the comparison must stand", "join two comparisons by &&")
            self.position += 1
            left = Binary(operator, left, self.expression(own + 1))
            chain += 1
            if self.nesting + chain > MAX_DEPTH:
                self.too_deep()
        self.nesting -= 1
        return left

    def unary(self) -> Expression:
        operator = _WORDS.get(self.token.text, self.token.text)
        if self.token.kind != "text" and operator in ("!", "-"):
            self.position += 1
            self.enter()
            operand = self.unary()
            self.nesting -= 1
            return Unary(operator, operand)
        result = self.atom()
        fields = 0
        while (longer := self.part_of(result)) is not None:
            result = longer
            fields += 1
            if self.nesting + fields > MAX_DEPTH:
                self.too_deep()
        return result

    def part_of(self, whole: Expression) -> Expression | None:
        return FieldAccess(whole, self.name("a field name")) if self.accept(".") else None

    def inner(self) -> Expression:
        return self.expression()

    def atom(self) -> Expression:
        token = self.token
        if self.accept("("):
            inner = self.inner()
            self.expect(")")
            return inner
        if token.kind == "text":
            self.position += 1
            return Literal(self._unquoted(token))
        if token.kind in ("int", "real"):
            self.position += 1
            return self._in_unit(self._number(token))
        if token.kind == "name" and token.text in ("true", "false"):
            self.position += 1
            return Literal(token.text == "true")
        name = self.name("a value")
        if self.token.kind == "sign" and self.token.text == "(":
            if name not in self.functions:
                self.position -= 1
                self.fail("a known function must stand", one_of(name, sorted(self.functions)), slug="unknown-function")
            return Apply(name, self.arguments())
        return Name(name)

    def several(self, rule: Callable[[], _Result]) -> tuple[_Result, ...]:
        found = [rule()]
        while self.accept(";") and self.token.kind != "end":
            found.append(rule())
        return tuple(found)

    def action(self) -> Assignment | Call:
        name = self.name("an action")
        if self.accept(":="):
            return Assignment(name, self.expression())
        if not (self.token.kind == "sign" and self.token.text == "("):
            self.fail("':=' or '(' must stand", "write name := value, or name() for an operation")
        return Call(name, self.arguments())

    def call(self) -> Call:
        name = self.name("a channel")
        return Call(name, self.arguments() if self.token.kind == "sign" and self.token.text == "(" else ())

    def arguments(self) -> tuple[Expression, ...]:
        self.expect("(")
        if self.accept(")"):
            return ()
        found = [self.expression()]
        while self.accept(","):
            found.append(self.expression())
        self.expect(")")
        return tuple(found)

    def name(self, wanted: str) -> str:
        token = self.token
        if token.kind != "name" or token.text in RESERVED:
            self.fail(f"{wanted} must stand")
        self.position += 1
        return token.text

    def _in_unit(self, number: int | float) -> Literal:
        if self.token.kind != "name" or self.token.text in _WORDS:
            return Literal(number)
        unit = self.token.text
        if unit not in UNITS:
            self.fail("an operator or a unit must stand", one_of(unit, list(UNITS)), slug="unknown-unit")
        self.position += 1
        return Literal(number * UNITS[unit], unit)

    def _number(self, token: Token) -> int | float:
        # Digits are counted first: converting a very long one costs quadratic time.
        if token.kind == "int" and len(token.text.lstrip("0")) <= 19 and int(token.text) <= INTEGER_LIMIT:
            return int(token.text)
        if token.kind == "int" or not isfinite(float(token.text)):
            rule = f"a number must fit 64 bits, but {token.text[:24]} does not,"
            self.fail_at(token.at, rule, slug="overflow")
        return float(token.text)

    def _unquoted(self, token: Token) -> str:
        def plain(match: re.Match[str]) -> str:
            code, other = match["code"], match["other"]
            if code is not None and int(code, 16) <= 0x10FFFF:
                return chr(int(code, 16))
            simple = {"n": "\n", "t": "\t", "\\": "\\", "'": "'", '"': '"'}
            if other not in simple:
                self.fail_at(token.at, f"a text knows no escape {match.group()!r}", r"use \\ \' \n \t or \u{hex}")
            return simple[other]

        return _ESCAPE.sub(plain, token.text[1:-1])


class _Formula(_Parser):
    """A parser that knows quantifiers, items of lists and `=>`, too."""

    functions = FORMULA_FUNCTIONS

    def formula(self) -> Expression:
        self.enter()
        left = self.expression()
        if self.accept("=>"):
            left = Binary("||", Unary("!", left), self.formula())
        self.nesting -= 1
        return left

    inner = formula

    def part_of(self, whole: Expression) -> Expression | None:
        if not self.accept("["):
            return super().part_of(whole)
        index = self.expression()
        self.expect("]")
        return Item(whole, index)

    def atom(self) -> Expression:
        # `all` and its like are words only where `name in` follows, so that fields and variables may be called so.
        kind, name, word = (self.tokens[min(self.position + k, len(self.tokens) - 1)] for k in range(3))
        if kind.text not in EACH or name.kind != "name" or word.text != "in":
            return super().atom()
        self.position += 1
        bound = self.name("a name")
        self.position += 1
        first = self.expression()
        last = self.expression() if self.accept("..") else None
        self.expect(":")
        return Each(kind.text, bound, first, last, self.formula())

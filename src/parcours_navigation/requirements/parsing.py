"""Parses requirements and pass rules: signal temporal logic, in units, over names of one vocabulary.

    formula    := either ['->' formula]                       either := both ('or' both)*
    both       := until ('and' until)*                        until  := unary ['until' [interval] unary]
    unary      := ('not' | ('always' | 'eventually') [interval]) unary | comparison
    comparison := sum [('<' | '<=' | '>' | '>=') sum]          interval := '[' time ',' (time | 'end') ']'
    sum        := product (('+' | '-') product)*              product := factor (('*' | '/') factor)*
    factor     := '-' factor | number [unit] | name | function '(' formula, ... ')' | '(' formula ')'

Without an interval a temporal operator looks from its sample to the end. Text from a hostile file costs at most
`expression.parsing.MAX_LENGTH` characters and `tokens.MAX_DEPTH` levels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite

from parcours.errors import one_of
from parcours.model.expression.parsing import UNITS
from parcours.model.expression.tokens import Token
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.requirements.syntax import (
    FUNCTIONS,
    Arithmetic,
    Comparison,
    Constant,
    Formula,
    Function,
    Interval,
    Junction,
    Negative,
    Not,
    Number,
    Signal,
    Timed,
    Until,
)
from parcours_navigation.requirements.tokens import MAX_DEPTH, FormulaTokens
from parcours_navigation.requirements.vocabulary import FLAG, SIGNALS, Dimension, Meaning, named

TEMPORAL = ("always", "eventually", "until")
RESERVED = frozenset((*TEMPORAL, "and", "or", "not", "end", "true", "false"))
"""Words of the language, which are no names."""

LONGEST = 86_400
"""Longest time of an interval [s]."""

_TIMES = {"s": 10**9, "ms": 10**6, "us": 10**3, "min": 60 * 10**9}
_DIMENSIONS: dict[str, Dimension] = {
    **dict.fromkeys(("m", "cm", "mm", "km"), (1.0, 0.0)),
    **dict.fromkeys(("s", "ms", "us", "min"), (0.0, 1.0)),
    **dict.fromkeys(("rad", "deg"), (0.0, 0.0)),
}


@dataclass(frozen=True, slots=True)
class _Part:
    """What was parsed: a number, with its dimension if it has one (a plain number fits any), or a formula."""

    node: Number | Formula
    at: int
    is_formula: bool = False
    dimension: Dimension | None = None
    depth: int = 1


@dataclass(frozen=True, slots=True)
class Parsed:
    """A formula, and the dimension of its robustness if all its comparisons have the same."""

    formula: Formula
    dimension: Dimension | None


def parse(
    text: str, where: str = "formula", names: Mapping[str, Meaning] = SIGNALS, *, temporal: bool = True
) -> Parsed:
    """Return the formula of a text.

    Args:
        text: e.g. "always[0, end] (clearance > 5 cm)".
        where: what the text belongs to, for the error message.
        names: what may be read.
        temporal: whether temporal operators are allowed.

    Raises:
        BadRequest: the text is no formula, too long or too deep, a name is unknown, a time is no whole number of
            samples, or metres meet seconds. A caret shows where.

    >>> str(parse("imminent -> eventually[0, 1.5 s] speed<1 cm/s").formula.right.interval)
    '[0 s, 1.5 s]'
    >>> parse("clearence > 0", "keeps-away")
    Traceback (most recent call last):
    parcours.errors.BadRequest: keeps-away: a signal must be known at the caret, but found 'clearence' in \
"^clearence > 0"; did you mean 'clearance'? ... [require-name]
    """
    parser = _Parser(text, where, names, temporal)
    formula = parser.whole()
    found = parser.compared
    return Parsed(formula, found[0] if found and all(one == found[0] for one in found) else None)


def parse_number(text: str, where: str, names: Mapping[str, Meaning]) -> tuple[Number, Dimension | None]:
    """Return the number of a text over names, and its dimension. Raises BadRequest as `parse` does."""
    parser = _Parser(text, where, names, False)
    part = parser.formula()
    if parser.token.kind != "end":
        parser.fail("an operator or the end must stand", "")
    return parser._number_of(part), part.dimension


class _Parser(FormulaTokens):
    """Recursive descent over one text."""

    def __init__(self, text: str, where: str, names: Mapping[str, Meaning], temporal: bool) -> None:
        super().__init__(text, where)
        self.names, self.temporal = names, temporal
        self.compared: list[Dimension | None] = []

    def whole(self) -> Formula:
        found = self._formula_of(self.formula())
        if self.token.kind != "end":
            hint = "join two comparisons by `and`" if self.token.text in ("<", "<=", ">", ">=") else ""
            self.fail("an operator or the end must stand", hint)
        return found

    def formula(self) -> _Part:
        self.enter()
        left = self._chain("or", lambda: self._chain("and", self.until))
        if self.accept("->"):
            right = self.formula()
            left = self._joined("->", left, right)
        self.nesting -= 1
        return left

    def until(self) -> _Part:
        left = self.unary()
        if self.token.text != "until":
            return left
        first = self._formula_of(left)
        interval = self._interval()
        right = self.unary()
        node = Until(first, interval, self._formula_of(right))
        if self.token.text == "until":
            self.fail("an operator or the end must stand", "put parentheses around one `until`")
        return self._made(node, left.at, left, right)

    def unary(self) -> _Part:
        token = self.token
        if token.text not in ("not", "always", "eventually"):
            return self.comparison()
        self.enter()
        node: Formula
        if token.text == "not":
            self.position += 1
            inner = self.unary()
            node = Not(self._formula_of(inner))
        else:
            interval = self._interval()
            operator = "always" if token.text == "always" else "eventually"
            inner = self.unary()
            node = Timed(operator, interval, self._formula_of(inner))  # type: ignore[arg-type]
        self.nesting -= 1
        return self._made(node, token.at, inner)

    def comparison(self) -> _Part:
        left = self.sum()
        token = self.token
        if token.text not in ("<", "<=", ">", ">="):
            return left
        self.position += 1
        right = self.sum()
        dimension = self._same(left, right, token)
        self.compared.append(dimension)
        node = Comparison(token.text, self._number_of(left), self._number_of(right))
        return self._made(node, left.at, left, right)

    def sum(self) -> _Part:
        left = self.product()
        while self.token.text in ("+", "-"):
            token = self._operator()
            right = self.product()
            dimension = self._same(left, right, token)
            node = Arithmetic(token.text, self._number_of(left), self._number_of(right))
            left = self._made(node, left.at, left, right, is_formula=False, dimension=dimension)
        return left

    def product(self) -> _Part:
        left = self.factor()
        while self.token.text in ("*", "/"):
            token = self._operator()
            right = self.factor()
            node = Arithmetic(token.text, self._number_of(left), self._number_of(right))
            dimension = None
            if left.dimension is not None and right.dimension is not None:  # a plain number may stand for any unit
                (a, b), (c, d) = left.dimension, right.dimension
                sign = 1.0 if token.text == "*" else -1.0
                dimension = a + sign * c, b + sign * d
            left = self._made(node, left.at, left, right, is_formula=False, dimension=dimension)
        return left

    def factor(self) -> _Part:
        token = self.token
        if self.accept("-"):
            self.enter()
            inner = self.factor()
            self.nesting -= 1
            node = Negative(self._number_of(inner))
            return self._made(node, token.at, inner, is_formula=False, dimension=inner.dimension)
        if self.accept("("):
            found = self.formula()
            self.expect(")")
            return found
        if token.kind == "number":
            return self.constant()
        if token.kind != "name" or token.text in RESERVED:
            self.fail("a value must stand")
        self.position += 1
        if self.token.text == "(":
            return self.function(token)
        if token.text not in self.names:
            self.position -= 1
            what = "a signal" if self.temporal else "a value of a case"
            hint = one_of(token.text, sorted(self.names))
            if not self.temporal and token.text in SIGNALS:
                hint = f"{token.text} changes during a case: write `require: always ...` instead. {hint}"
            self.fail(f"{what} must be known", hint, "require-name")
        meaning = self.names[token.text]
        if meaning.unit == FLAG:
            return _Part(Signal(token.text), token.at, True)
        return _Part(Signal(token.text), token.at, False, meaning.dimension)

    def function(self, token: Token) -> _Part:
        if token.text not in FUNCTIONS:
            self.position -= 1
            self.fail("a known function must stand", one_of(token.text, sorted(FUNCTIONS)), "require-name")
        self.expect("(")
        given = [self.formula()]
        while self.accept(","):
            given.append(self.formula())
        self.expect(")")
        n = FUNCTIONS[token.text]
        if len(given) != n:
            rule = f"{token.text} takes {n} argument{'s' * (n != 1)}, but {len(given)} stand"
            self.fail_at(token.at, rule, "", "require-syntax")
        dimension = given[0].dimension
        for one in given[1:]:
            dimension = self._same(given[0], one, token)
        if token.text == "sqrt" and dimension is not None:
            dimension = dimension[0] / 2.0, dimension[1] / 2.0
        arguments = tuple(self._number_of(one) for one in given)
        node = Function(token.text, arguments)
        return self._made(node, token.at, *given, is_formula=False, dimension=dimension)

    def constant(self) -> _Part:
        token = self.token
        value = float(token.text)
        if not isfinite(value):
            self.fail("a number of 64 bits must stand")
        self.position += 1
        if self.token.kind != "name" or self.token.text in RESERVED:
            return _Part(Constant(value), token.at)
        unit = self.token.text
        if unit not in UNITS:
            self.fail("an operator or a unit must stand", one_of(unit, list(UNITS)), "require-unit")
        self.position += 1
        value, (metres, seconds) = value * UNITS[unit], _DIMENSIONS[unit]
        if self.token.text == "/" and self.tokens[self.position + 1].text == "s":
            self.position += 2
            seconds -= 1.0
            if self.accept("^"):
                if self.token.text != "2":
                    self.fail("2 must stand", "units of motion are m/s and m/s^2", "require-unit")
                self.position += 1
                seconds -= 1.0
        return _Part(Constant(value), token.at, False, (metres, seconds))

    def _interval(self) -> Interval:
        word = self.token
        if not self.temporal:
            rule = f"a rule over a whole case has no {word.text!r}, but one stands"
            self.fail_at(word.at, rule, "write it as a requirement, under `require`", "require-syntax")
        self.position += 1
        start = self.token
        if not self.accept("["):
            return Interval(0, None)
        first, unit = self._time()
        self.expect(",")
        if self.token.text == "end":
            self.position += 1
            self.expect("]")
            return Interval(self._samples(first, unit or "s", start), None)
        last, last_unit = self._time()
        self.expect("]")
        least, most = (
            self._samples(*one, start) for one in ((first, unit or last_unit or "s"), (last, last_unit or "s"))
        )
        if most < least:
            rule = "an interval must not end before it begins, but this one does"
            self.fail_at(start.at, rule, "write [earliest, latest]", "require-interval")
        return Interval(least, most)

    def _time(self) -> tuple[Fraction, str]:
        token = self.token
        if token.kind != "number":
            self.fail("a time must stand", "an interval is like [0, 1.5 s] or [2 s, end]", "require-interval")
        if len(token.text) > 24 or not isfinite(float(token.text)) or float(token.text) > LONGEST * 1e6:
            self.fail(f"a time of at most {LONGEST} s must stand", "", "require-interval")
        self.position += 1
        unit = ""
        if self.token.kind == "name" and self.token.text not in RESERVED:
            unit = self.token.text
            if unit not in _TIMES:
                self.fail("a unit of time must stand", one_of(unit, list(_TIMES)), "require-unit")
            self.position += 1
        return Fraction(token.text), unit

    def _samples(self, time: Fraction, unit: str, start: Token) -> int:
        nanoseconds = time * _TIMES[unit]
        n = nanoseconds / TRACK_PERIOD
        if nanoseconds > LONGEST * 10**9:
            self.fail_at(start.at, f"a time must be at most {LONGEST} s, but is longer", "", "require-interval")
        if n.denominator != 1:
            period = TRACK_PERIOD * 1e-9
            rule = f"a time must be a whole number of samples of {period:g} s, but is {float(nanoseconds) * 1e-9:g} s"
            near = int(n) * period
            hint = f"write {near:g} s or {near + period:g} s"
            self.fail_at(start.at, rule, hint, "require-interval")
        return int(n)

    def _chain(self, word: str, inner: Callable[[], _Part]) -> _Part:
        left = inner()
        while self.token.text == word:
            self._operator()
            left = self._joined(word, left, inner())
        return left

    def _joined(self, word: str, left: _Part, right: _Part) -> _Part:
        node = Junction(word, self._formula_of(left), self._formula_of(right))  # type: ignore[arg-type]
        return self._made(node, left.at, left, right)

    def _operator(self) -> Token:
        token = self.token
        self.position += 1
        return token

    def _made(
        self, node: Number | Formula, at: int, *of: _Part, is_formula: bool = True, dimension: Dimension | None = None
    ) -> _Part:
        depth = 1 + max(one.depth for one in of)
        if depth > MAX_DEPTH:
            self.too_deep()
        return _Part(node, at, is_formula, dimension, depth)

    def _formula_of(self, part: _Part) -> Formula:
        if not part.is_formula:
            rule = "a formula must stand at the caret, but found a number"
            self.fail_at(part.at, rule, "compare it with another number", "require-kind")
        return part.node  # type: ignore[return-value]

    def _number_of(self, part: _Part) -> Number:
        if part.is_formula:
            rule = "a number must stand at the caret, but found a formula"
            self.fail_at(part.at, rule, "use `and`, `or`, `not` or `->` of formulas", "require-kind")
        return part.node  # type: ignore[return-value]

    def _same(self, left: _Part, right: _Part, token: Token) -> Dimension | None:
        """Return the dimension that both have; a plain number has any."""
        one, other = left.dimension, right.dimension
        if one is not None and other is not None and one != other:
            rule = f"both sides of {token.text!r} must have the same unit, but are in {named(one)} and {named(other)}"
            self.fail_at(token.at, rule, "a plain number fits any unit", "require-unit")
        return one if one is not None else other

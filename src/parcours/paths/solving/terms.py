"""Terms of the solver z3 for the guard and action language, each with the condition under which it has a value.

Integers are mathematical, with the 64-bit limits stated; texts and values of enumerations are numbered, as the
language only compares them. Reals are taken in one of two ways:

- `exact`: real numbers, and constants as written. Whatever is found so is run again in floating point.
- `rounded`: each result of an operation may differ from the real one by the rounding error of a 64-bit float.
  Every run in floating point is among these, so what is impossible here is impossible.

Numbers of time (anything compared with a clock) are exact in both.
"""

from __future__ import annotations

import operator as operators
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import z3

from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Type, Unary
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.expression.syntax import names

UNIT_ROUNDOFF = Fraction(1, 2**53)
"""Largest relative error of one operation on 64-bit floats (IEEE 754, round to nearest)."""

LEAST_FLOAT = Fraction(1, 2**1074)
"""Largest absolute error of one where results are too small to be normal."""

COMPARED = {
    "==": operators.eq, "!=": operators.ne,
    "<": operators.lt, "<=": operators.le, ">": operators.gt, ">=": operators.ge,
}  # fmt: skip

Value = Any
"""A z3 expression: z3 carries no types."""


class NoTerm(Exception):
    """Something has no faithful translation; the text says what."""


@dataclass(frozen=True, slots=True)
class Term:
    """A value, and the condition under which it has one (no division by zero, no overflow)."""

    value: Value
    defined: Value


class Symbols:
    """Texts and numbers that stand for them."""

    def __init__(self) -> None:
        self._codes: dict[str, int] = {}
        self._texts: list[str] = []

    def code(self, text: str) -> int:
        """Return the number of a text."""
        if text not in self._codes:
            self._codes[text] = len(self._texts)
            self._texts.append(text)
        return self._codes[text]

    def text(self, code: int) -> str:
        """Return the text of a number, and of any other number a text that none here equals."""
        if 0 <= code < len(self._texts):
            return self._texts[code]
        text = f"text{code}"
        while text in self._codes:
            text += "_"
        return text


def constant(value: object, symbols: Symbols, *, exact: bool = True) -> Value:
    """Return the z3 term of a constant."""
    match value:
        case bool():
            return z3.BoolVal(value)
        case int():
            return z3.IntVal(value)
        case float():
            return rational(Fraction(repr(value)) if exact else Fraction(value))
        case str():
            return z3.IntVal(symbols.code(value))
    raise NoTerm(f"{value!r} is not a constant")


def rational(number: Fraction) -> Value:
    """Return the z3 term of a fraction."""
    return z3.Q(number.numerator, number.denominator)


def variable(name: str, type_: Type) -> Value:
    """Return a z3 constant, in the sense of a free symbol, of a type of the language."""
    if not type_.rank:
        match type_.name:
            case "bool":
                return z3.Bool(name)
            case "int" | "enum" | "text":
                return z3.Int(name)
            case "real":
                return z3.Real(name)
    raise NoTerm(f"{name} is {type_}, of which nothing is computed")


Lookup = Callable[[Expression, Type], Value]
"""From a name, a field or the size of a list, with its type, to its term."""


class Translator:
    """Translates the expressions of one transition into terms of z3.

    `sides` collects the conditions on helper symbols, such as roots and rounding errors, that the solver must be given
    along with the terms; `rounds` says whether floating point may round something.
    """

    def __init__(
        self, types_of: Callable[[Expression], Type], lookup: Lookup, symbols: Symbols, clocks: Mapping[str, object],
        fresh: Callable[[], str], *, exact: bool,
    ) -> None:  # fmt: skip
        self._types_of, self._lookup, self._symbols, self._clocks = types_of, lookup, symbols, clocks
        self._fresh, self._exact = fresh, exact
        self.sides: list[Value] = []
        self.rounds = False

    def term(self, node: Expression) -> Term:
        """Return the term of an expression. Raises NoTerm where there is none."""
        return self._of(node, timed=False)

    def stored(self, term: Value, type_: Type) -> Value:
        """Return a value as a variable keeps it: an integer becomes a real where one is declared."""
        return self._real(term) if type_.name == "real" else term

    def _of(self, node: Expression, *, timed: bool) -> Term:
        match node:
            case Literal(value):
                return _sure(constant(value, self._symbols, exact=self._exact or timed))
            case Name() | FieldAccess() | Apply("size", (Name() | FieldAccess(),)):
                return _sure(self._lookup(node, self._types_of(node)))
            case Unary(operator, operand):
                inner = self._of(operand, timed=timed)
                return Term(z3.Not(inner.value) if operator == "!" else -inner.value, inner.defined)
            case Binary("&&" | "||" as operator, left, right):
                first, second = self._of(left, timed=timed), self._of(right, timed=timed)
                reads = first.value if operator == "&&" else z3.Not(first.value)
                value = (z3.And if operator == "&&" else z3.Or)(first.value, second.value)
                return Term(value, _all(first.defined, _implied(reads, second.defined)))
            case Binary(operator, left, right) if operator in COMPARED:
                timed = timed or not names(node).isdisjoint(self._clocks)
                first, second = self._of(left, timed=timed), self._of(right, timed=timed)
                return Term(COMPARED[operator](first.value, second.value), _all(first.defined, second.defined))
            case Binary(operator, left, right):
                return self._arithmetic(
                    operator, self._of(left, timed=timed), self._of(right, timed=timed), timed=timed
                )
            case Apply(function, arguments):
                return self._function(function, [self._of(each, timed=timed) for each in arguments], timed=timed)
        raise NoTerm(f"{node} has no translation")

    def _arithmetic(self, operator: str, left: Term, right: Term, *, timed: bool) -> Term:
        a, b, defined = left.value, right.value, _all(left.defined, right.defined)
        if operator == "%":
            return self._modulo(a, b, _all(defined, b != 0), timed=timed)
        if operator == "/":
            quotient = z3.ToReal(a) / z3.ToReal(b) if a.is_int() and b.is_int() else self._real(a) / self._real(b)
            return Term(self._rounded(quotient, timed=timed), _all(defined, b != 0))
        if not (a.is_int() and b.is_int()):
            a, b = self._real(a, timed=timed), self._real(b, timed=timed)
        value = a + b if operator == "+" else a - b if operator == "-" else a * b
        if value.is_int():
            return Term(value, _all(defined, fits(value)))
        return Term(self._rounded(value, timed=timed), defined)

    def _modulo(self, a: Value, b: Value, defined: Value, *, timed: bool) -> Term:
        if a.is_int() and b.is_int():
            rest = a % b  # z3 takes 0 <= rest < |b|
            return Term(z3.If(z3.And(b < 0, rest != 0), rest + b, rest), defined)
        a, b = self._real(a, timed=timed), self._real(b, timed=timed)
        rest = a - b * z3.ToReal(z3.ToInt(a / b))
        return Term(self._rounded(rest, timed=timed, size=_absolute(b)), defined)

    def _function(self, function: str, arguments: list[Term], *, timed: bool) -> Term:
        defined = _all(*(each.defined for each in arguments))
        values = [each.value for each in arguments]
        match function:
            case "abs":
                return Term(_absolute(values[0]), defined)
            case "floor":
                value = values[0] if values[0].is_int() else z3.ToInt(values[0])
                return Term(value, _all(defined, fits(value)))
            case "min" | "max":
                chosen = values[0]
                for value in values[1:]:
                    nearer = value < chosen if function == "min" else value > chosen
                    chosen = z3.If(nearer, value, chosen)
                return Term(chosen, defined)
            case "sqrt" | "hypot":
                reals = [self._real(value, timed=timed) for value in values]
                square = reals[0] if function == "sqrt" else z3.Sum([real * real for real in reals])
                root = z3.Real(self._fresh())
                self.sides.append(z3.Implies(square >= 0, z3.And(root >= 0, root * root == square)))
                # hypot may be wrong in its last place: twice the error of one rounding.
                return Term(self._rounded(root, timed=timed, size=2 * root), _all(defined, square >= 0))
        raise NoTerm(f"{function} has no translation")

    def _real(self, value: Value, *, timed: bool = False) -> Value:
        if value.is_real():
            return value
        return z3.ToReal(value) if z3.is_int_value(value) else self._rounded(z3.ToReal(value), timed=timed)

    def _rounded(self, value: Value, *, timed: bool, size: Value = None) -> Value:
        # The value, or in rounded arithmetic any number close enough to it.
        if timed:
            return value
        self.rounds = True
        if self._exact:
            return value
        result = z3.Real(self._fresh())
        error = rational(UNIT_ROUNDOFF) * (_absolute(value) if size is None else size) + rational(LEAST_FLOAT)
        self.sides.append(z3.And(result - value <= error, value - result <= error))
        return result


def is_constant(value: Value) -> bool:
    """Return whether a term is a constant."""
    return bool(z3.is_int_value(value) or z3.is_rational_value(value) or z3.is_true(value) or z3.is_false(value))


def fits(value: Value) -> Value:
    """Return the condition that an integer fits 64 bits."""
    if z3.is_int_value(value):
        return z3.BoolVal(abs(value.as_long()) <= INTEGER_LIMIT)
    return z3.And(value >= -INTEGER_LIMIT, value <= INTEGER_LIMIT)


def _absolute(value: Value) -> Value:
    return z3.If(value >= 0, value, -value)


def _sure(value: Value) -> Term:
    return Term(value, z3.BoolVal(True))


def _all(*conditions: Value) -> Value:
    real = [each for each in conditions if not z3.is_true(each)]
    return z3.And(real) if real else z3.BoolVal(True)


def _implied(condition: Value, then: Value) -> Value:
    return then if z3.is_true(then) else z3.Implies(condition, then)

"""Evaluates expressions.

Integers and reals are 64-bit: what leaves that range is an error, as is a division by zero. `/` divides as
reals; `%` has the sign of its divisor; `&&` and `||` read their right side only when it matters.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sized
from typing import NoReturn, TypeAlias

from parcours.errors import BadModel
from parcours.model.expression.syntax import Apply, Binary, Expression, Field, Literal, Name, Unary, render

Value: TypeAlias = object
"""bool, int, float or str; a Mapping from field names for a message; anything sized for a list."""

INTEGER_LIMIT = 2**63 - 1
"""Largest integer; the smallest is its negative."""


def _size(value: object) -> int:
    if isinstance(value, Sized) and not isinstance(value, str | Mapping):
        return len(value)
    raise TypeError


FUNCTIONS: dict[str, tuple[Callable[..., object], int, int]] = {
    "abs": (abs, 1, 1),
    "floor": (math.floor, 1, 1),
    "hypot": (math.hypot, 1, 8),
    "max": (max, 2, 8),
    "min": (min, 2, 8),
    "size": (_size, 1, 1),
    "sqrt": (math.sqrt, 1, 1),
}
"""Built-in functions: what computes them, and the fewest and most arguments."""

_ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "%": operator.mod,
}  # fmt: skip
_ORDER: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip


def evaluate(expression: Expression, valuation: Mapping[str, Value], where: str = "expression") -> Value:
    """Return the value of an expression.

    Args:
        valuation: a value for each name read: bool, int, float, str, or a Mapping for a message.
        where: what the expression belongs to, for the error message.

    Raises:
        BadModel: a name or field has no value, the operand of an operator has the wrong type, a number leaves
            64 bits, a division by zero or the root of a negative number. A caret marks the culprit in the
            canonical text.
    """
    return _Evaluation(expression, valuation, where).of(expression)


class _Evaluation:
    def __init__(self, root: Expression, valuation: Mapping[str, Value], where: str) -> None:
        self.root, self.valuation, self.where = root, valuation, where

    def of(self, node: Expression) -> Value:
        match node:
            case Literal(constant):
                return constant
            case Name(id):
                if id not in self.valuation:
                    self.fail(node, f"a name must have a value, but {id!r} has none", "no-value")
                return self.valuation[id]
            case Field(of, name):
                record = self.of(of)
                if not isinstance(record, Mapping) or name not in record:
                    self.fail(node, f"a field must have a value, but {name!r} has none", "no-value")
                found: Value = record[name]
                return found
            case Unary("!", operand):
                return not self.truth(operand)
            case Unary(_, operand):
                return -self.number(operand)
            case Binary("&&", left, right):
                return self.truth(left) and self.truth(right)
            case Binary("||", left, right):
                return self.truth(left) or self.truth(right)
            case Binary("==", left, right):
                return self.equal(node, self.of(left), self.of(right))
            case Binary("!=", left, right):
                return not self.equal(node, self.of(left), self.of(right))
            case Binary(sign, left, right) if sign in _ORDER:
                return _ORDER[sign](self.number(left), self.number(right))
            case Binary(sign, left, right):
                return self.bounded(node, lambda: _ARITHMETIC[sign](self.number(left), self.number(right)))
            case Apply("size", (argument,)):
                value = self.of(argument)
                return self.bounded(node, lambda: _size(value))
            case Apply(function, arguments):
                compute, fewest, most = FUNCTIONS[function]
                if not fewest <= len(arguments) <= most:
                    self.fail(node, f"{function} takes {fewest} to {most} arguments, but got {len(arguments)}", "arity")
                return self.bounded(node, lambda: compute(*map(self.number, arguments)))

    def truth(self, node: Expression) -> bool:
        value = self.of(node)
        if not isinstance(value, bool):
            self.fail(node, f"a condition must be true or false, but is {value!r}", "type")
        return value

    def number(self, node: Expression) -> int | float:
        value = self.of(node)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(node, f"an operand must be a number, but is {value!r}", "type")
        return value

    def equal(self, node: Expression, left: Value, right: Value) -> bool:
        kinds = {_kind(left), _kind(right)}
        if len(kinds) != 1 or not kinds <= {"bool", "number", "text"}:
            self.fail(node, f"only like values compare, but these are {left!r} and {right!r}", "type")
        return left == right

    # One place turns what Python makes of bad operands into findings: a guard must never crash a run.
    def bounded(self, node: Expression, compute: Callable[[], object]) -> Value:
        try:
            value = compute()
        except ZeroDivisionError:
            self.fail(node, "a divisor must not be zero, but it is", "division-by-zero")
        except ValueError:
            self.fail(node, "a root must be taken of 0 or more, but this number is negative", "negative-root")
        except OverflowError:
            self.fail(node, "a number must fit 64 bits, but this one does not", "overflow")
        except TypeError:
            self.fail(node, "size must be taken of a list, but this is none", "type")
        fits = isinstance(value, int) and -INTEGER_LIMIT <= value <= INTEGER_LIMIT
        if not fits and not (isinstance(value, float) and math.isfinite(value)):
            self.fail(node, "a number must fit 64 bits, but this one does not", "overflow")
        return value

    def fail(self, node: Expression, rule: str, slug: str) -> NoReturn:
        raise BadModel(self.where, f'{rule} in "{render(self.root, marked=node)}"', slug=slug)


def _kind(value: Value) -> str:
    if isinstance(value, bool):
        return "bool"
    if isinstance(value, int | float):
        return "number"
    return "text" if isinstance(value, str) else "other"

"""Evaluates expressions.

Integers and reals are 64-bit: what leaves that range is an error, as is a division by zero. `/` divides as
reals; `%` has the sign of its divisor; `&&` and `||` read their right side only when it matters.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from functools import lru_cache
from typing import NoReturn, TypeAlias

from parcours.errors import BadModel
from parcours.model.expression.syntax import (
    Apply,
    Binary,
    Each,
    Expression,
    FieldAccess,
    Item,
    Literal,
    Name,
    Unary,
    render,
)

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

FORMULA_FUNCTIONS: dict[str, tuple[Callable[..., object], int, int]] = {
    **FUNCTIONS,
    "atan2": (math.atan2, 2, 2),
    "cos": (math.cos, 1, 1),
    "near": (lambda one, other, tolerance: abs(one - other) <= tolerance, 3, 3),
    "sin": (math.sin, 1, 1),
    "wrap": (lambda angle: math.remainder(angle, math.tau), 1, 1),
}
"""Those of formulas, which no solver need understand: `wrap` brings an angle to -pi..pi [rad]."""

_ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "%": operator.mod,
}  # fmt: skip
_ORDER: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip


Code: TypeAlias = Callable[[Mapping[str, Value]], Value]
"""A compiled expression: a value for each name -> its value."""


def evaluate(expression: Expression, valuation: Mapping[str, Value], where: str = "expression") -> Value:
    """Return the value of an expression.

    Args:
        valuation: a value for each name read: bool, int, float, str, or a Mapping for a message.
        where: what the expression belongs to, for the error message.

    Raises:
        BadModel: a name or field has no value, the operand of an operator has the wrong type, a number leaves
            64 bits, a division by zero or the root of a negative number, no such item. A caret marks the culprit in
            the canonical text.
    """
    return compiled(expression, where)(valuation)


@lru_cache(maxsize=4096)
def compiled(expression: Expression, where: str = "expression") -> Code:
    """Return what evaluates an expression again and again; it raises what `evaluate` raises."""
    return _Compiler(expression, where).of(expression)


class _Compiler:
    # Each node becomes a closure over those of its operands: an oracle looks at every sample of a trajectory.
    def __init__(self, root: Expression, where: str) -> None:
        self.root, self.where = root, where

    def of(self, node: Expression) -> Code:
        match node:
            case Literal(constant):
                return lambda known: constant
            case Name(id):
                return self.name(node, id)
            case FieldAccess(of, name):
                return self.field(node, self.of(of), name)
            case Item(of, index):
                return self.item(node, self.of(of), self.number(index))
            case Each():
                return self.each(node)
            case Unary("!", operand):
                holds = self.truth(operand)
                return lambda known: not holds(known)
            case Unary(_, operand):
                number = self.number(operand)
                return lambda known: -number(known)
            case Binary("&&", left, right):
                first, second = self.truth(left), self.truth(right)
                return lambda known: first(known) and second(known)
            case Binary("||", left, right):
                first, second = self.truth(left), self.truth(right)
                return lambda known: first(known) or second(known)
            case Binary("==" | "!=" as sign, left, right):
                return self.equal(node, sign, self.of(left), self.of(right))
            case Binary(sign, left, right):
                return self.binary(node, sign, self.number(left), self.number(right))
            case Apply("size", (argument,)):
                value = self.of(argument)
                return self.bounded(node, lambda known: _size(value(known)))
            case Apply(function, arguments):
                return self.apply(node, function, [self.number(argument) for argument in arguments])

    def name(self, node: Expression, id: str) -> Code:
        def read(known: Mapping[str, Value]) -> Value:
            try:
                return known[id]
            except KeyError:
                self.fail(node, f"a name must have a value, but {id!r} has none", "no-value")

        return read

    def field(self, node: Expression, record: Code, name: str) -> Code:
        def read(known: Mapping[str, Value]) -> Value:
            value = record(known)
            # The types that data have are asked for first: an oracle comes here for every sample of a trajectory.
            if not (type(value) is dict or isinstance(value, Mapping)) or name not in value:
                self.fail(node, f"a field must have a value, but {name!r} has none", "no-value")
            found: Value = value[name]
            return found

        return read

    def item(self, node: Expression, items: Code, index: Callable[[Mapping[str, Value]], int | float]) -> Code:
        def read(known: Mapping[str, Value]) -> Value:
            values, at = items(known), index(known)
            if not isinstance(values, list | Sequence) or not isinstance(at, int) or not 0 <= at < len(values):
                n = len(values) if isinstance(values, Sized) else 0
                self.fail(node, f"a list of {n} has items from 0 on, but none is at {at}", "no-item")
            found: Value = values[at]
            return found

        return read

    def each(self, node: Each) -> Code:
        items, name = self.items(node), node.name
        if node.kind == "sum":
            number = self.number(node.body)

            def total(known: Mapping[str, Value]) -> Value:
                inner = dict(known)
                found: int | float = 0
                for inner[name] in items(known):
                    found += number(inner)
                return found

            return self.bounded(node, total)
        holds, wanted = self.truth(node.body), node.kind == "some"

        def decide(known: Mapping[str, Value]) -> Value:
            inner = dict(known)
            for inner[name] in items(known):
                if holds(inner) is wanted:
                    return wanted
            return not wanted

        return decide

    def items(self, node: Each) -> Callable[[Mapping[str, Value]], Iterable[object]]:
        """Return what gives the values that the name of a quantifier takes."""
        if node.last is None:
            values = self.of(node.first)

            def listed(known: Mapping[str, Value]) -> Iterable[object]:
                found = values(known)
                if not isinstance(found, Sequence) or isinstance(found, str):
                    self.fail(node.first, f"a quantifier goes through a list, but this is {found!r:.60}", "type")
                return found

            return listed
        first, last = self.number(node.first), self.number(node.last)
        return lambda known: range(math.ceil(first(known)), math.floor(last(known)) + 1)

    def binary(self, node: Expression, sign: str, left: Callable[..., int | float],
               right: Callable[..., int | float]) -> Code:  # fmt: skip
        if sign in _ORDER:
            compare = _ORDER[sign]
            return lambda known: compare(left(known), right(known))
        compute = _ARITHMETIC[sign]
        return self.bounded(node, lambda known: compute(left(known), right(known)))

    def apply(self, node: Expression, function: str, arguments: Sequence[Callable[..., int | float]]) -> Code:
        compute, fewest, most = FORMULA_FUNCTIONS[function]
        if not fewest <= len(arguments) <= most:
            self.fail(node, f"{function} takes {fewest} to {most} arguments, but got {len(arguments)}", "arity")
        if function == "near":
            return lambda known: compute(*[argument(known) for argument in arguments])
        return self.bounded(node, lambda known: compute(*[argument(known) for argument in arguments]))

    def truth(self, node: Expression) -> Callable[[Mapping[str, Value]], bool]:
        code = self.of(node)
        if _is_truth(node):
            return code  # type: ignore[return-value]  # what it is made of was looked at already

        def read(known: Mapping[str, Value]) -> bool:
            value = code(known)
            if not isinstance(value, bool):
                self.fail(node, f"a condition must be true or false, but is {value!r}", "type")
            return value

        return read

    def number(self, node: Expression) -> Callable[[Mapping[str, Value]], int | float]:
        code = self.of(node)
        if _is_number(node):
            return code  # type: ignore[return-value]

        def read(known: Mapping[str, Value]) -> int | float:
            value = code(known)
            if type(value) is float or type(value) is int:
                return value
            if isinstance(value, bool) or not isinstance(value, int | float):
                self.fail(node, f"an operand must be a number, but is {value!r}", "type")
            return value

        return read

    def equal(self, node: Expression, sign: str, left: Code, right: Code) -> Code:
        wanted = sign == "=="

        def compare(known: Mapping[str, Value]) -> Value:
            one, other = left(known), right(known)
            kinds = {_kind(one), _kind(other)}
            if len(kinds) != 1 or not kinds <= {"bool", "number", "text"}:
                self.fail(node, f"only like values compare, but these are {one!r} and {other!r}", "type")
            return (one == other) is wanted

        return compare

    # One place turns what Python makes of bad operands into findings: a guard must never crash a run.
    def bounded(self, node: Expression, compute: Code) -> Code:
        def read(known: Mapping[str, Value]) -> Value:
            try:
                value = compute(known)
            except ZeroDivisionError:
                self.fail(node, "a divisor must not be zero, but it is", "division-by-zero")
            except ValueError:
                self.fail(node, "a root must be taken of 0 or more, but this number is negative", "negative-root")
            except OverflowError:
                self.fail(node, "a number must fit 64 bits, but this one does not", "overflow")
            except TypeError:
                self.fail(node, "size must be taken of a list, but this is not one", "type")
            fits = isinstance(value, int) and -INTEGER_LIMIT <= value <= INTEGER_LIMIT
            if not fits and not (isinstance(value, float) and math.isfinite(value)):
                self.fail(node, "a number must fit 64 bits, but this one does not", "overflow")
            return value

        return read

    def fail(self, node: Expression, rule: str, slug: str) -> NoReturn:
        raise BadModel(self.where, f'{rule} in "{render(self.root, marked=node)}"', slug=slug)


def _is_truth(node: Expression) -> bool:
    match node:
        case Unary(sign, _) | Binary(sign, _, _):
            return sign not in _ARITHMETIC
        case Each(kind, _, _, _, _):
            return kind != "sum"
        case Apply(function, _):
            return function == "near"
        case _:
            return False


def _is_number(node: Expression) -> bool:
    match node:
        case Literal(value):
            return type(value) in (int, float)
        case Unary() | Binary() | Each() | Apply():
            return not _is_truth(node)
        case _:
            return False


def _kind(value: Value) -> str:
    if isinstance(value, bool):
        return "bool"
    if isinstance(value, int | float):
        return "number"
    return "text" if isinstance(value, str) else "other"

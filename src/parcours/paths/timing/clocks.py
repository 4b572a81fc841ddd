"""The bounds that a condition over clocks puts on the times of events, in each way it can hold.

A clock that was last set at event r to c reads, at event i, the time of i less the time of r plus c. So a
comparison of a clock, or of the difference of two, with a number is one bound of a temporal network. Numbers are
taken as written: 0.1 is a tenth, and a data value is the decimal that prints it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from parcours.errors import BadModel
from parcours.model.expression import Binary, Expression, Literal, Name, Unary, evaluate, names
from parcours.model.expression.syntax import COMPARISONS
from parcours.paths.timing.network import TimeLimit

Setting = tuple[int, Fraction]
"""The event that set a clock last, and to what [s]."""

MAX_WAYS = 64
"""A condition that can hold in more ways than these is not taken apart."""

_NOT = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}


class NoBound(Exception):
    """A condition is not one that a temporal network can hold; the text says which part."""


@dataclass(frozen=True, slots=True)
class ClockConstraint:
    """What must hold at an event.

    Attributes:
        expression: over clocks, and data where it is a guard.
        at: the event's number.
        clocks: how each clock of the component was last set.
        why: what demands it, for people.
        guards: the number of the event it is the guard of; 0 for an invariant.
    """

    expression: Expression
    at: int
    clocks: Mapping[str, Setting]
    why: str
    guards: int = 0


Way = tuple[TimeLimit, ...]
"""Bounds that together make a condition hold."""


def ways(condition: ClockConstraint, known: Mapping[str, object] | None = None) -> list[Way]:
    """Return the ways in which a condition can hold; none if it cannot."""
    return _Reader(condition, known).ways(condition.expression, positive=True, alone=True)


class _Reader:
    def __init__(self, condition: ClockConstraint, known: Mapping[str, object] | None) -> None:
        self.condition, self.known = condition, known

    def ways(self, node: Expression, *, positive: bool, alone: bool) -> list[Way]:
        if not self.timed(node):
            return self.data(node, positive=positive, alone=alone)
        match node:
            case Unary("!", operand):
                return self.ways(operand, positive=not positive, alone=alone)
            case Binary("&&" | "||" as operator, left, right) if (operator == "&&") == positive:
                first, second = (self.ways(side, positive=positive, alone=alone) for side in (left, right))
                if len(first) * len(second) > MAX_WAYS:
                    raise NoBound(f"{node} can hold in more than {MAX_WAYS} ways")
                return [one + other for one, other in product(first, second)]
            case Binary("&&" | "||", left, right):
                found = [way for side in (left, right) for way in self.ways(side, positive=positive, alone=False)]
                return list(dict.fromkeys(found))
            case Binary(operator, left, right) if operator in COMPARISONS:
                return list(self.comparison(operator if positive else _NOT[operator], node))
            case _:
                raise NoBound(f"{node} is no comparison")

    def timed(self, node: Expression) -> bool:
        return not names(node).isdisjoint(self.condition.clocks)

    def data(self, node: Expression, *, positive: bool, alone: bool) -> list[Way]:
        if isinstance(node, Literal):
            return [()] if node.value is positive else []
        if self.known is None:
            if not alone:
                raise NoBound(f"{node} decides together with clocks")
            return [()]
        try:
            return [()] if evaluate(node, self.known) is positive else []
        except BadModel as error:
            raise NoBound(f"{node} has no value: {error.rule}") from None

    def comparison(self, operator: str, node: Binary) -> Iterator[Way]:
        factors, number = self.linear(Binary("-", node.left, node.right))
        plus = [name for name, factor in factors.items() if factor == 1]
        minus = [name for name, factor in factors.items() if factor == -1]
        if len(plus) > 1 or len(minus) > 1 or len(plus) + len(minus) != sum(f != 0 for f in factors.values()):
            raise NoBound(f"{node} compares neither a clock nor a difference of clocks")
        # plus - minus + number compared with 0, and each clock is the time of `at` less that of its setting.
        at = self.condition.at
        since, offset = self.condition.clocks[plus[0]] if plus else (at, Fraction(0))
        other, other_offset = self.condition.clocks[minus[0]] if minus else (at, Fraction(0))
        constant = number + offset - other_offset
        # The compared value is t(other) - t(since) + constant.
        strict = operator in ("<", ">", "!=")
        below = TimeLimit(since, other, -constant, strict, self.condition.why)
        above = TimeLimit(other, since, constant, strict, self.condition.why)
        match operator:
            case "<" | "<=":
                yield (below,)
            case ">" | ">=":
                yield (above,)
            case "==":
                yield (below, above)
            case _:
                yield (below,)
                yield (above,)

    def linear(self, node: Expression) -> tuple[dict[str, Fraction], Fraction]:
        """Return the factor of each clock in a sum, and the rest."""
        match node:
            case Literal(value):
                return {}, decimal(value)
            case Name(id) if self.timed(node):
                return {id: Fraction(1)}, Fraction(0)
            case Unary("-", operand):
                return _scaled(self.linear(operand), Fraction(-1))
            case Binary("+", left, right):
                return _sum(self.linear(left), self.linear(right))
            case Binary("-", left, right):
                return _sum(self.linear(left), _scaled(self.linear(right), Fraction(-1)))
            case Binary("*", left, right) if not (self.timed(left) and self.timed(right)):
                clocks, factor = (left, right) if self.timed(left) else (right, left)
                return _scaled(self.linear(clocks), self.linear(factor)[1])
            case Binary("/", left, right) if self.timed(left) and not self.timed(right) and self.linear(right)[1]:
                return _scaled(self.linear(left), 1 / self.linear(right)[1])
        if self.timed(node):
            raise NoBound(f"{node} is no sum of clocks and numbers")
        if self.known is None and names(node):
            raise NoBound(f"{node} is compared with a clock, but depends on data")
        try:
            return {}, decimal(evaluate(node, self.known or {}))
        except BadModel as error:
            raise NoBound(f"{node} has no value: {error.rule}") from None


def decimal(value: object) -> Fraction:
    """Return a number as it is written: 0.1 is a tenth, not its nearest binary fraction.

    >>> decimal(0.1) + decimal(0.2) == decimal(0.3)
    True
    """
    return Fraction(repr(value))


Linear = tuple[dict[str, Fraction], Fraction]


def _scaled(linear: Linear, factor: Fraction) -> Linear:
    return {name: each * factor for name, each in linear[0].items()}, linear[1] * factor


def _sum(left: Linear, right: Linear) -> Linear:
    factors = dict(left[0])
    for name, each in right[0].items():
        factors[name] = factors.get(name, Fraction(0)) + each
    return factors, left[1] + right[1]

"""What an expression shows of itself: its kind, that it is never negative, how deep it is."""

from __future__ import annotations

from collections.abc import Mapping, Set

from parcours.model.expression import Apply, Binary, Expression, Field, Literal, Name, Unary

KINDS = {bool: "bool", int: "int", float: "real", str: "text"}
"""The type of each kind of constant."""


def kind_of(node: Expression, kinds: Mapping[str, str]) -> str:
    """Return bool, int, real or text as far as the expression tells, else an empty text.

    >>> kind_of(Binary("/", Name("n"), Literal(2)), {"n": "int"}), kind_of(Name("m"), {})
    ('real', '')
    """
    match node:
        case Literal(value):
            return KINDS[type(value)]
        case Name(id):
            return kinds.get(id, "")
        case Unary("!", _) | Binary("&&" | "||" | "==" | "!=" | "<" | "<=" | ">" | ">=", _, _):
            return "bool"
        case Unary(_, operand):
            return kind_of(operand, kinds)
        case Binary("/", _, _) | Apply("sqrt" | "hypot", _):
            return "real"
        case Apply("floor" | "size", _):
            return "int"
        case Binary(_, left, right):
            return _wider(kind_of(left, kinds), kind_of(right, kinds))
        case Apply(_, arguments):
            kind = "int"
            for argument in arguments:
                kind = _wider(kind, kind_of(argument, kinds))
            return kind
        case _:
            return ""


def _wider(one: str, other: str) -> str:
    return "real" if "real" in (one, other) else "int" if one == other == "int" else ""


def is_natural(node: Expression, naturals: Set[str]) -> bool:
    """Return whether the expression shows that its value is never negative; `naturals` are such variables.

    >>> is_natural(Binary("+", Name("n"), Literal(1)), {"n"}), is_natural(Name("m"), {"n"})
    (True, False)
    """
    match node:
        case Literal(value):
            return isinstance(value, int | float)
        case Name(id):
            return id in naturals
        case Binary("+" | "*" | "/" | "%", left, right):
            return is_natural(left, naturals) and is_natural(right, naturals)
        case Apply("abs" | "sqrt" | "hypot", _):
            return True
        case Apply("floor" | "min" | "max", arguments):
            return all(is_natural(each, naturals) for each in arguments)
        case _:
            return False


def depth(node: Expression) -> int:
    """Return how many nodes the longest way down a tree has."""
    match node:
        case Field(of, _):
            return 1 + depth(of)
        case Unary(_, operand):
            return 1 + depth(operand)
        case Binary(_, left, right):
            return 1 + max(depth(left), depth(right))
        case Apply(_, arguments):
            return 1 + max((depth(argument) for argument in arguments), default=0)
        case _:
            return 1

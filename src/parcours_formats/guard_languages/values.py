"""Expressions with constants worked out, and values that depend on a condition: what translations are made of.

Our language has no `c ? a : b`, no numbers that are truth values and a `/` that never truncates. A value that
needs one of these is a list of cases: conditions of which exactly one holds, each with the value under it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from dataclasses import replace
from itertools import product
from math import prod
from typing import TypeAlias

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, Field, Literal, Name, Unary, evaluate
from parcours.model.structure import Component

TRUE, FALSE = Literal(True), Literal(False)

MAX_CASES = 256
"""Most cases of one value; each is a branch of a guard or a transition of its own."""

_CHAIN = 16

Cases: TypeAlias = list[tuple[Expression, Expression]]
"""(condition, value) pairs: exactly one condition holds."""


def always(value: Expression) -> Cases:
    """Return the cases of a value that depends on nothing."""
    return [(TRUE, value)]


def joined(where: str, make: Callable[..., Expression], *operands: Cases) -> Cases:
    """Return the cases of an operation whose operands have cases."""
    count = prod(map(len, operands))
    if count > MAX_CASES:
        rule = f"a translated value has at most {MAX_CASES} cases, but this one has {count}"
        raise BadModel(where, rule, "split the expression", slug="expression-size")
    found: Cases = []
    for chosen in product(*operands):
        condition = conjunction(case for case, _ in chosen)
        if condition != FALSE:
            found.append((condition, make(*(value for _, value in chosen))))
    return found


def holds(cases: Cases) -> Expression:
    """Return the one condition that cases of truth values amount to."""
    return disjunction(conjunction((condition, value)) for condition, value in cases)


def conjunction(parts: Iterable[Expression]) -> Expression:
    """Return the expression that holds when all parts do; false if two of them exclude each other on sight.

    >>> str(conjunction([TRUE, Name("a"), Name("b"), Name("a")])), str(conjunction([Name("a"), negation(Name("a"))]))
    ('a && b', 'false')
    """
    found = _chain("&&", parts, TRUE, FALSE)
    known: dict[Expression, Expression] = {}
    for part in conjuncts(found):
        match part:
            case Binary("==", left, right) if is_constant(right) and known.setdefault(left, right) != right:
                return FALSE
    return found


def conjuncts(condition: Expression) -> list[Expression]:
    """Return the parts of a conjunction.

    >>> [str(part) for part in conjuncts(conjunction([Name("a"), Name("b"), Name("c")]))]
    ['a', 'b', 'c']
    """
    if isinstance(condition, Binary) and condition.operator == "&&":
        return [*conjuncts(condition.left), *conjuncts(condition.right)]
    return [condition]


def disjunction(parts: Iterable[Expression]) -> Expression:
    """Return the expression that holds when one part does."""
    return _chain("||", parts, FALSE, TRUE)


def _chain(operator: str, parts: Iterable[Expression], neutral: Literal, strong: Literal) -> Expression:
    found: dict[Expression, None] = {}
    for part in parts:
        if part == strong or negation(part) in found:
            return strong
        if part != neutral:
            found[part] = None
    return _tree(operator, list(found)) if found else neutral


def _tree(operator: str, parts: list[Expression]) -> Expression:
    # Long chains are halved, so that depth grows with the logarithm of their length.
    if len(parts) > _CHAIN:
        middle = len(parts) // 2
        return Binary(operator, _tree(operator, parts[:middle]), _tree(operator, parts[middle:]))
    result = parts[0]
    for part in parts[1:]:
        result = Binary(operator, result, part)
    return result


_OPPOSITE = {"==": "!=", "!=": "==", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


def negation(part: Expression) -> Expression:
    """Return the expression that holds when the part does not.

    >>> str(negation(Binary("<", Name("x"), Literal(3)))), str(negation(Name("ready")))
    ('x >= 3', '!ready')
    """
    match part:
        case Literal(value):
            return Literal(not value)
        case Unary("!", operand):
            return operand
        case Binary(operator, left, right) if operator in _OPPOSITE:
            return Binary(_OPPOSITE[operator], left, right)
        case _:
            return Unary("!", part)


def folded(node: Expression) -> Expression:
    """Return the node, or the constant it is when all its parts are constants and it has a value."""
    match node:
        case Unary("-", Literal()):
            return node
        case Unary("-", Unary("-", operand)):
            return operand
        case Unary(_, operand):
            parts: tuple[Expression, ...] = (operand,)
        case Binary("&&", left, right):
            return conjunction((left, right))
        case Binary("||", left, right):
            return disjunction((left, right))
        case Binary(_, left, right):
            parts = (left, right)
        case Apply(_, arguments):
            parts = arguments
        case _:
            return node
    if not all(is_constant(part) for part in parts):
        return _neutral(node)
    try:
        return literal(evaluate(node, {}))
    except BadModel:
        return node


def _neutral(node: Expression) -> Expression:
    match node:
        case Binary("+" | "-", left, Literal(0)) | Binary("*" | "/", left, Literal(1)):
            return left
        case Binary("+", Literal(0), right) | Binary("*", Literal(1), right):
            return right
        case _:
            return node


def is_constant(node: Expression) -> bool:
    """Return whether a node is a literal, perhaps with a minus before it."""
    return isinstance(node.operand if isinstance(node, Unary) and node.operator == "-" else node, Literal)


def literal(value: object) -> Expression:
    """Return the expression of a constant; a negative number is a minus before a literal.

    >>> str(literal(-2)), str(literal(True))
    ('-2', 'true')
    """
    if isinstance(value, int | float) and not isinstance(value, bool) and value < 0:
        return Unary("-", Literal(-value))
    assert isinstance(value, bool | int | float | str)
    return Literal(value)


def replaced(node: Expression, values: Mapping[str, Expression]) -> Expression:
    """Return the expression with names replaced by values.

    >>> str(replaced(Binary("<", Name("x"), Name("y")), {"x": Literal(3)}))
    '3 < y'
    """
    match node:
        case Name(id):
            return values.get(id, node)
        case Field(of, _):
            return replace(node, of=replaced(of, values))
        case Unary(_, operand):
            return folded(replace(node, operand=replaced(operand, values)))
        case Binary(_, left, right):
            return folded(replace(node, left=replaced(left, values), right=replaced(right, values)))
        case Apply(_, arguments):
            return folded(replace(node, arguments=tuple(replaced(each, values) for each in arguments)))
        case _:
            return node


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


def naturals_of(component: Component) -> set[str]:
    """Return the variables of a component that are never negative, as their ranges say."""
    ranges = {each.name: each.domain for each in component.variables if isinstance(each.domain, range)}
    return {name for name, domain in ranges.items() if domain and domain[0] >= 0}

"""Expressions with constants worked out, and values that depend on a condition: what translations are made of.

Our language has no `c ? a : b`, no numbers that are truth values and a `/` that never truncates. A value that
needs one of these is a list of cases: conditions of which exactly one holds, each with the value under it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from itertools import product
from math import prod
from typing import TypeAlias, TypeVar

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Unary, evaluate
from parcours.model.expression.syntax import parts
from parcours.model.structure import Component

TRUE, FALSE = Literal(True), Literal(False)

MAX_CASES = 256
"""Most cases of one value; each is a branch of a guard or a transition of its own."""

_CHAIN = 16

Cases: TypeAlias = list[tuple[Expression, Expression]]
"""(condition, value) pairs: exactly one condition holds."""


_T = TypeVar("_T")


def always(value: Expression) -> Cases:
    """Return the cases of a value that depends on nothing."""
    return [(TRUE, value)]


def joined(where: str, make: Callable[..., _T], *operands: Cases) -> list[tuple[Expression, _T]]:
    """Return the cases of an operation whose operands have cases: every combination that is not impossible."""
    bounded(prod(map(len, operands)), where)
    found = []
    for chosen in product(*operands):
        condition = conjunction(case for case, _ in chosen)
        if condition != FALSE:
            found.append((condition, make(*(value for _, value in chosen))))
    return found


def bounded(count: int, where: str) -> None:
    """Raise BadModel if a value has more than MAX_CASES cases."""
    if count > MAX_CASES:
        rule = f"a translated value has at most {MAX_CASES} cases, but this one has {count}"
        raise BadModel(where, rule, "split the expression", slug="expression-size")


def holds(cases: Cases) -> Expression:
    """Return the one condition that cases of truth values amount to."""
    return disjunction(conjunction((condition, value)) for condition, value in cases)


def conjunction(parts: Iterable[Expression]) -> Expression:
    """Return the expression that holds when all parts do; false if two of them exclude each other on sight.

    >>> str(conjunction([TRUE, Name("a"), Name("b"), Name("a")])), str(conjunction([Name("a"), negation(Name("a"))]))
    ('a && b', 'false')
    """
    # Choices multiply, so that what cannot hold is dropped where that is cheap to see; it need not be complete.
    found = _chain("&&", parts, TRUE, FALSE)
    known: dict[Expression, Expression] = {}
    for part in conjuncts(found):
        match part:
            case Binary("==", left, right) if is_constant(right) and known.setdefault(left, right) != right:
                return FALSE
    return found


def conjuncts(condition: Expression) -> list[Expression]:
    """Return the parts of a conjunction."""
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
        case Literal() | Name() | FieldAccess() | Unary("-", Literal()):
            return node
        case Unary("-", Unary("-", operand)):
            return operand
        case Binary("&&", left, right):
            return conjunction((left, right))
        case Binary("||", left, right):
            return disjunction((left, right))
    if all(map(is_constant, parts(node))):
        try:
            return literal(evaluate(node, {}))
        except BadModel:
            return node
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
    """Return the expression with names replaced by values, and constants worked out.

    >>> str(replaced(Binary("<", Name("x"), Name("y")), {"x": Literal(3)}))
    '3 < y'
    """
    match node:
        case Name(id):
            return values.get(id, node)
        case FieldAccess(of, name):
            return FieldAccess(replaced(of, values), name)
        case Unary(operator, operand):
            return folded(Unary(operator, replaced(operand, values)))
        case Binary(operator, left, right):
            return folded(Binary(operator, replaced(left, values), replaced(right, values)))
        case Apply(function, arguments):
            return folded(Apply(function, tuple(replaced(each, values) for each in arguments)))
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
        case Binary() | Apply():
            inner = {kind_of(part, kinds) for part in parts(node)}
            return "real" if "real" in inner else "int" if inner <= {"int"} else ""
        case _:
            return ""


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
    return 1 + max(map(depth, parts(node)), default=0)


def naturals_of(component: Component) -> set[str]:
    """Return the variables of a component that are never negative, as their ranges say."""
    ranges = {each.name: each.domain for each in component.variables if isinstance(each.domain, range)}
    return {name for name, domain in ranges.items() if domain and domain[0] >= 0}

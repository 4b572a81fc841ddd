"""The syntax tree of the guard and action language, and its canonical text.

`str` of a tree parses back to an equal tree. Guards and actions have six kinds of node, so that another tool (a
solver, an exporter) translates the language in one page. Formulas over messages have two more: `Item` and `Each`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias, cast

LEVELS: dict[str, int] = {
    "||": 1,
    "&&": 2,
    **dict.fromkeys(("==", "!=", "<", "<=", ">", ">="), 3),
    **dict.fromkeys(("+", "-"), 4),
    **dict.fromkeys(("*", "/", "%"), 5),
}
"""How tightly each binary operator binds; all group to the left, and comparisons do not chain."""

COMPARISONS = frozenset(("==", "!=", "<", "<=", ">", ">="))
_UNARY_LEVEL, _ATOM_LEVEL = 6, 7


class _Node:
    __slots__ = ()

    def __str__(self) -> str:
        return render(cast("Expression", self))


@dataclass(frozen=True, slots=True, eq=False)
class Literal(_Node):
    """A constant: true or false, an integer, a real or a text. Not negative: -1 is `Unary('-', Literal(1))`.

    >>> Literal(1) == Literal(1.0), Literal(1) == Literal(True)
    (False, False)
    """

    value: bool | int | float | str
    unit: str = ""
    """In which a number was written; the value is in SI units."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Literal):
            return NotImplemented
        return type(self.value) is type(other.value) and self.value == other.value

    def __hash__(self) -> int:
        return hash((type(self.value).__name__, self.value))


@dataclass(frozen=True, slots=True)
class Name(_Node):
    """A variable, or the name an event gave to the message it received."""

    id: str


@dataclass(frozen=True, slots=True)
class FieldAccess(_Node):
    """The field `name` of the message that `of` stands for."""

    of: Expression
    name: str


@dataclass(frozen=True, slots=True)
class Unary(_Node):
    """`!` (not) or `-` (negative) before an operand."""

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary(_Node):
    """Two operands joined by one of the operators of LEVELS."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Apply(_Node):
    """One of the built-in functions, applied: `hypot(x, y)`."""

    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Item(_Node):
    """The item of a list at an index, counted from 0: `points[k]`."""

    of: Expression
    index: Expression


@dataclass(frozen=True, slots=True)
class Each(_Node):
    """`all s in points: s.v <= 1`, or of whole numbers `all k in 0..n: ...`, both ends among them; or `some`, `sum`."""

    kind: str
    name: str
    first: Expression
    """The list, or the least number."""
    last: Expression | None
    """The greatest number; None for a list."""
    body: Expression


Expression: TypeAlias = Literal | Name | FieldAccess | Unary | Binary | Apply | Item | Each


@dataclass(frozen=True, slots=True)
class Assignment:
    """The action `target := value`."""

    target: str
    value: Expression

    def __str__(self) -> str:
        return f"{self.target} := {self.value}"


@dataclass(frozen=True, slots=True)
class Call:
    """An abstract operation, such as `modify(population)`: named in tests, not computed by the model."""

    name: str
    arguments: tuple[Expression, ...] = ()

    def __str__(self) -> str:
        return f"{self.name}({', '.join(map(str, self.arguments))})"


def render(node: Expression, marked: Expression | None = None) -> str:
    """Return the canonical text of a tree, with a caret before the node that is `marked` (the same object)."""
    return _render(node, marked, 0)


def _render(node: Expression, marked: Expression | None, level: int) -> str:
    match node:
        case Literal(value):
            # A number before a field needs parentheses: "0.x" starts with the real "0.".
            text, own = _constant(value), _ATOM_LEVEL if isinstance(value, bool | str) else _UNARY_LEVEL
        case Name(id):
            text, own = id, _ATOM_LEVEL
        case FieldAccess(of, name):
            text, own = f"{_render(of, marked, _ATOM_LEVEL)}.{name}", _ATOM_LEVEL
        case Apply(function, arguments):
            inner = ", ".join(_render(argument, marked, 0) for argument in arguments)
            text, own = f"{function}({inner})", _ATOM_LEVEL
        case Item(of, index):
            text, own = f"{_render(of, marked, _ATOM_LEVEL)}[{_render(index, marked, 0)}]", _ATOM_LEVEL
        case Each(kind, bound, least, greatest, body):
            end = f"..{_render(greatest, marked, 0)}" if greatest is not None else ""
            text, own = f"{kind} {bound} in {_render(least, marked, 0)}{end}: {_render(body, marked, 0)}", 0
        case Unary(operator, operand):
            text, own = operator + _render(operand, marked, _UNARY_LEVEL), _UNARY_LEVEL
        case Binary(operator, left, right):
            own = LEVELS[operator]
            # A comparison is no operand of a comparison, on either side; other operators group to the left.
            first = _render(left, marked, own + 1 if operator in COMPARISONS else own)
            text = f"{first} {operator} {_render(right, marked, own + 1)}"
    if own < level:
        text = f"({text})"
    return f"^{text}" if node is marked else text


def _constant(value: bool | int | float | str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return "'" + "".join(map(_escaped, value)) + "'"
    return repr(value)


def _escaped(character: str) -> str:
    if character in "\\'":
        return "\\" + character
    return character if character.isprintable() else f"\\u{{{ord(character):x}}}"


def parts(node: Expression) -> tuple[Expression, ...]:
    """Return what a node is directly made of, left to right."""
    match node:
        case FieldAccess(of, _):
            return (of,)
        case Unary(_, operand):
            return (operand,)
        case Binary(_, left, right):
            return left, right
        case Apply(_, arguments):
            return arguments
        case Item(of, index):
            return of, index
        case Each(_, _, first, last, body):
            return (first, body) if last is None else (first, last, body)
        case _:
            return ()


def walk(node: Expression) -> Iterator[Expression]:
    """Yield the node and everything below it, outermost first, left to right."""
    yield node
    for part in parts(node):
        yield from walk(part)


def substitute(node: Expression, replace: Callable[[Expression], Expression | None]) -> Expression:
    """Return the tree with every part replaced for which `replace` returns something, outermost first."""
    if (new := replace(node)) is not None:
        return new
    match node:
        case FieldAccess(of, name):
            return FieldAccess(substitute(of, replace), name)
        case Unary(operator, operand):
            return Unary(operator, substitute(operand, replace))
        case Binary(operator, left, right):
            return Binary(operator, substitute(left, replace), substitute(right, replace))
        case Apply(function, arguments):
            return Apply(function, tuple(substitute(argument, replace) for argument in arguments))
        case Item(of, index):
            return Item(substitute(of, replace), substitute(index, replace))
        case Each(kind, name, first, last, body):
            ends = substitute(first, replace), None if last is None else substitute(last, replace)
            return Each(kind, name, *ends, substitute(body, replace))
        case _:
            return node


def names(node: Expression) -> frozenset[str]:
    """Return the names that an expression reads; those that a quantifier binds are not among them."""
    if isinstance(node, Name):
        return frozenset((node.id,))
    below = [names(part) for part in parts(node)]
    if isinstance(node, Each):
        below[-1] -= {node.name}
    return frozenset().union(*below)

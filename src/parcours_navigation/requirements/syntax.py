"""The syntax tree of a requirement: signal temporal logic over the samples of a track, and its canonical text.

O. Maler and D. Nickovic, Monitoring Temporal Properties of Continuous Signals, FORMATS 2004. `str` of a tree parses
back to an equal tree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Literal, TypeAlias, cast

from parcours_navigation.facts import TRACK_PERIOD


@dataclass(frozen=True, slots=True)
class Constant:
    """A number, in SI units, not negative."""

    value: float


@dataclass(frozen=True, slots=True)
class Signal:
    """The value of a signal at a sample; alone, where a formula stands, a flag: it holds while it is above 0."""

    name: str


@dataclass(frozen=True, slots=True)
class Negative:
    """A number with its sign turned."""

    operand: Number


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """Two numbers joined by + - * or /."""

    operator: str
    left: Number
    right: Number


@dataclass(frozen=True, slots=True)
class Function:
    """One of FUNCTIONS of one or two numbers."""

    name: str
    arguments: tuple[Number, ...]


Number: TypeAlias = Constant | Signal | Negative | Arithmetic | Function

FUNCTIONS = {"abs": 1, "hypot": 2, "max": 2, "min": 2, "sqrt": 1}
"""Functions of numbers, and how many arguments each takes."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two numbers compared by < <= > or >=."""

    operator: str
    left: Number
    right: Number


@dataclass(frozen=True, slots=True)
class Not:
    """A formula that must not hold."""

    operand: Formula


@dataclass(frozen=True, slots=True)
class Junction:
    """Two formulas joined by `and`, `or` or `->`."""

    operator: Literal["and", "or", "->"]
    left: Formula
    right: Formula


@dataclass(frozen=True, slots=True)
class Interval:
    """Samples that a temporal operator looks at, counted from the one at which it is asked, both ends included."""

    first: int
    last: int | None  # None: to the end of the track

    def __str__(self) -> str:
        last = "end" if self.last is None else _seconds(self.last)
        return f"[{_seconds(self.first)}, {last}]"


@dataclass(frozen=True, slots=True)
class Timed:
    """`always` or `eventually` in an interval."""

    operator: Literal["always", "eventually"]
    interval: Interval
    operand: Formula


@dataclass(frozen=True, slots=True)
class Until:
    """`left until[...] right`: right holds at a sample of the interval, and left at every sample before that one."""

    left: Formula
    interval: Interval
    right: Formula


Formula: TypeAlias = Signal | Comparison | Not | Junction | Timed | Until
Node: TypeAlias = Number | Formula

_LEVELS = {"->": 1, "or": 2, "and": 3, "until": 4, "not": 5, "compare": 6, "+": 7, "-": 7, "*": 8, "/": 8, "sign": 9}
_ATOM = 10


def parts(node: Node) -> tuple[Node, ...]:
    """Return what a node is directly made of, left to right."""
    match node:
        case Negative(operand) | Not(operand) | Timed(_, _, operand):
            return (operand,)
        case Function(_, arguments):
            return arguments
        case Arithmetic(_, left, right) | Comparison(_, left, right) | Junction(_, left, right) | Until(left, _, right):
            return left, right
        case _:
            return ()


def walk(node: Node) -> Iterator[Node]:
    """Yield the node and everything below it, outermost first, left to right."""
    yield node
    for part in parts(node):
        yield from walk(part)


def is_safety(formula: Formula) -> bool:
    """Return whether what violates a formula violates it whatever follows; False also where that takes a closer look.

    >>> slow = Comparison("<", Signal("speed"), Constant(1.0))
    >>> is_safety(Timed("always", Interval(0, None), slow)), is_safety(Timed("eventually", Interval(0, None), slow))
    (True, False)
    """
    if not any(isinstance(one, Timed | Until) for one in walk(formula)):
        return True
    match formula:
        case Timed("always", _, operand):
            return is_safety(operand)
        case Junction("->", left, right):
            return is_safety(Not(left)) and is_safety(right)
        case Junction(_, left, right):
            return is_safety(left) and is_safety(right)
        case _:
            return False


def replaced(node: Node, by: Mapping[str, Number]) -> Node:
    """Return a node with numbers in the place of some signals."""
    if isinstance(node, Signal):
        return by.get(node.name, node)
    changed: dict[str, Any] = {}
    for one in fields(node):
        value = getattr(node, one.name)
        if isinstance(value, tuple):
            changed[one.name] = tuple(replaced(each, by) for each in value)
        elif is_dataclass(value) and not isinstance(value, Interval):
            changed[one.name] = replaced(cast(Node, value), by)
    return replace(node, **changed)


def signals(node: Node) -> frozenset[str]:
    """Return the names that a formula reads."""
    return frozenset(one.name for one in walk(node) if isinstance(one, Signal))


def render(node: Node) -> str:
    """Return the canonical text of a tree: parentheses only where they are needed.

    >>> render(Timed("always", Interval(0, None), Comparison(">", Signal("clearance"), Constant(0.05))))
    'always[0 s, end] clearance > 0.05'
    """
    return _render(node, 0)


def _render(node: Node, level: int) -> str:
    match node:
        case Constant(value):
            text, own = repr(value), _ATOM
        case Signal(name):
            text, own = name, _ATOM
        case Function(name, arguments):
            text, own = f"{name}({', '.join(_render(one, 0) for one in arguments)})", _ATOM
        case Negative(operand):
            own = _LEVELS["sign"]
            text = f"-{_render(operand, own)}"
        case Not(operand):
            own = _LEVELS["not"]
            text = f"not {_render(operand, own)}"
        case Timed(operator, interval, operand):
            own = _LEVELS["not"]
            text = f"{operator}{interval} {_render(operand, own)}"
        case Until(left, interval, right):
            own = _LEVELS["until"]
            text = f"{_render(left, own + 1)} until{interval} {_render(right, own + 1)}"
        case Comparison(operator, left, right):
            own = _LEVELS["compare"]
            text = f"{_render(left, own + 1)} {operator} {_render(right, own + 1)}"
        case Arithmetic(operator, left, right):
            own = _LEVELS[operator]
            text = f"{_render(left, own)} {operator} {_render(right, own + 1)}"
        case Junction("->", left, right):  # groups to the right
            own = _LEVELS["->"]
            text = f"{_render(left, own + 1)} -> {_render(right, own)}"
        case Junction(operator, left, right):
            own = _LEVELS[operator]
            text = f"{_render(left, own)} {operator} {_render(right, own + 1)}"
    return f"({text})" if own < level else text


def _seconds(samples: int) -> str:
    nanoseconds = samples * TRACK_PERIOD
    whole, rest = divmod(nanoseconds, 1_000_000_000)
    return f"{whole}.{rest:09d}".rstrip("0").rstrip(".") + " s"

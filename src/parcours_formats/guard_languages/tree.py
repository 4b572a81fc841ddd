"""The syntax tree of a foreign text: values and statements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Constant:
    """A number, a text or a truth value."""

    value: bool | int | float | str


@dataclass(frozen=True, slots=True)
class Identifier:
    """A name of the foreign model."""

    name: str


@dataclass(frozen=True, slots=True)
class Index:
    """An element of an array."""

    of: Tree
    index: Tree


@dataclass(frozen=True, slots=True)
class Member:
    """A field of a record."""

    of: Tree
    name: str


@dataclass(frozen=True, slots=True)
class Prefix:
    """`!` or `-` before an operand."""

    operator: str
    operand: Tree


@dataclass(frozen=True, slots=True)
class Infix:
    """Two operands joined by an operator of LEVELS, in our spelling."""

    operator: str
    left: Tree
    right: Tree


@dataclass(frozen=True, slots=True)
class Choice:
    """`condition ? yes : no`."""

    condition: Tree
    yes: Tree
    no: Tree


@dataclass(frozen=True, slots=True)
class Applied:
    """A function with its arguments; `function` is its path, e.g. `Math.max`."""

    function: str
    arguments: tuple[Tree, ...]


@dataclass(frozen=True, slots=True)
class Quantified:
    """UPPAAL's `forall (i : range) body`, or exists, or sum."""

    quantifier: str
    name: str
    low: Tree
    high: Tree | None
    body: Tree


@dataclass(frozen=True, slots=True)
class Record:
    """JavaScript's `{a: value, ...}`, with the names of its fields."""

    fields: tuple[tuple[str, Tree], ...]


@dataclass(frozen=True, slots=True)
class Series:
    """JavaScript's `[value, ...]`."""

    items: tuple[Tree, ...]


Tree: TypeAlias = (
    Constant | Identifier | Index | Member | Prefix | Infix | Choice | Applied | Quantified | Record | Series
)


@dataclass(frozen=True, slots=True)
class Set:
    """`place = value`; `a += b` is the same as `a = a + b`."""

    place: Tree
    value: Tree


@dataclass(frozen=True, slots=True)
class When:
    """`if (condition) yes else no`."""

    condition: Tree
    yes: tuple[Statement, ...]
    no: tuple[Statement, ...]


class Other:
    """A statement that only one language has; who reads that language knows its kinds."""

    __slots__ = ()


Statement: TypeAlias = Set | When | Other

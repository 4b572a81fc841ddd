"""What UPPAAL's declarations say, as written: types, variables, functions, instances, the system line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from parcours_formats.guard_languages.tokens import Tokens
from parcours_formats.guard_languages.tree import Tree


@dataclass(frozen=True, slots=True)
class TypeTree:
    """A type as written: int, bool, clock, chan, double, struct or the name of another, with its bounds or fields."""

    base: str
    prefixes: frozenset[str] = frozenset()
    low: Tree | None = None
    high: Tree | None = None
    fields: tuple[Declared, ...] = ()


Initial: TypeAlias = "Tree | tuple[Initial, ...]"


@dataclass(frozen=True, slots=True)
class Declared:
    """A variable, constant, channel, clock, parameter or (`is_type`) the name of a type."""

    name: str
    type: TypeTree
    line: int
    lengths: tuple[Tree | TypeTree, ...] = ()
    initial: Initial | None = None
    is_reference: bool = False
    is_type: bool = False


@dataclass(frozen=True, slots=True)
class Routine:
    """A function: the position of its body among the tokens of its text."""

    name: str
    result: TypeTree
    parameters: tuple[Declared, ...]
    tokens: Tokens
    body: int
    line: int


@dataclass(frozen=True, slots=True)
class Instance:
    """`name(parameters) = template(arguments);`."""

    name: str
    parameters: tuple[Declared, ...]
    template: str
    arguments: tuple[Tree, ...]
    line: int


@dataclass(frozen=True, slots=True)
class System:
    """`system A, B < C;`; `is_ranked` tells that processes have priorities."""

    names: tuple[str, ...]
    is_ranked: bool
    line: int


@dataclass(frozen=True, slots=True)
class Aside:
    """Something that has no counterpart and does not matter to what can happen, by its name."""

    what: str
    line: int


Declaration: TypeAlias = Declared | Routine | Instance | System | Aside

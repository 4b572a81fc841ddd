"""What a UPPAAL system is made of: variables, arrays, structs, channels and constants, made from their shapes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

from parcours.errors import BadModel
from parcours.model.expression import Expression
from parcours_formats.guard_languages.values import TRUE, literal
from parcours_formats.uppaal.declarations import Routine

MAX_CELLS = 200_000
"""Most variables, channels and constants of a system, each element of an array counted."""

MAX_CHOICES = 50_000
"""Most values over which a quantifier, a selection or a parameter is written out."""

MAX_WORK = 30_000
"""Most instances of quantified conditions and selections that a system is written out to."""

WORK_OF_PROCESS = 10
"""How many more such instances each process adds."""


@dataclass(frozen=True, slots=True)
class TypeShape:
    """A type, worked out: `kind` is bool, int, real, clock, chan, struct or void.

    `low` and `high` bound an integer, if it has bounds; `lengths` are those of an array, outermost first.
    """

    kind: str
    low: int | None = None
    high: int | None = None
    prefixes: frozenset[str] = frozenset()
    fields: tuple[tuple[str, TypeShape], ...] = ()
    lengths: tuple[int, ...] = ()

    def values(self, where: str) -> Iterable[int | bool]:
        """Return the values of the type in order. Raises BadModel if there are more than MAX_CHOICES."""
        if self.kind == "bool" and not self.lengths:
            return (False, True)
        if self.kind != "int" or self.low is None or self.high is None or self.lengths:
            rule = "only a bounded type can be written out, but this one is not bounded"
            raise BadModel(where, rule, "write int[lowest, highest]", slug="expansion-size")
        if self.high - self.low >= MAX_CHOICES:
            count = self.high - self.low + 1
            rule = f"a range is written out for at most {MAX_CHOICES} values, but this one has {count}"
            raise BadModel(where, rule, "make the range smaller", slug="expansion-size")
        return range(self.low, self.high + 1)


@dataclass(frozen=True, slots=True)
class UppaalVariable:
    """A variable or clock; `id` is unique in the system. `low` and `high` bound an integer, if it has bounds."""

    id: str
    kind: str
    initial: bool | int | float
    low: int | None
    high: int | None
    is_global: bool
    line: int


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """A constant, or the value a parameter was given: (condition, value) pairs of which one condition holds."""

    cases: tuple[tuple[Expression, Expression], ...]


@dataclass(frozen=True, slots=True)
class UppaalChannel:
    """A channel."""

    id: str
    is_urgent: bool
    is_broadcast: bool
    line: int


@dataclass(frozen=True, slots=True)
class ArrayVariable:
    """An array, indexed from 0."""

    items: tuple[Symbol, ...]


@dataclass(frozen=True, slots=True)
class Struct:
    """A struct."""

    fields: dict[str, Symbol]


Symbol: TypeAlias = UppaalVariable | ParameterValue | UppaalChannel | ArrayVariable | Struct | TypeShape | Routine

KINDS: dict[type, str] = {
    UppaalVariable: "a variable",
    ParameterValue: "a constant",
    UppaalChannel: "a channel",
    ArrayVariable: "an array",
    Struct: "a struct",
    TypeShape: "a type",
    Routine: "a function",
}
"""What each kind of symbol is called in messages."""

Given: TypeAlias = "bool | int | float | tuple[Given, ...] | None"
"""An initial value, worked out; None where the declaration gives none."""


class Cells:
    """All variables of one system, counted, with what translations ask for."""

    def __init__(self) -> None:
        self.kinds: dict[str, str] = {}
        self.naturals: set[str] = set()
        self.cells: dict[str, UppaalVariable] = {}
        self.known: dict[str, Expression] = {}
        self.count = self.work = self.calls = self.depth = 0
        self._most = MAX_WORK

    def allow(self, processes: int) -> None:
        """Let the processes of the system add what each may."""
        self._most = MAX_WORK + WORK_OF_PROCESS * processes

    def spend(self, where: str, more: int = 1) -> None:
        """Count instances that are written out. Raises BadModel beyond MAX_WORK."""
        self.work += more
        if self.work > self._most:
            rule = f"a system is written out to at most {self._most} instances, but this one goes beyond"
            raise BadModel(where, rule, "make its ranges smaller", slug="expansion-size")

    def make(self, id: str, shape: TypeShape, given: Given, line: int, where: str, *, is_global: bool) -> Symbol:
        """Return what a declaration makes."""
        parts: list[tuple[str, TypeShape]] = []
        if shape.lengths:
            inner = replace(shape, lengths=shape.lengths[1:])
            self._count(shape.lengths[0], where)
            parts = [(str(at), inner) for at in range(shape.lengths[0])]
        elif shape.kind == "struct":
            parts = [(name, replace(each, prefixes=each.prefixes | shape.prefixes)) for name, each in shape.fields]
        if shape.lengths or shape.kind == "struct":
            if given is not None and not (isinstance(given, tuple) and len(given) == len(parts)):
                rule = f"{id!r} must have {len(parts)} initial values, but has others"
                raise BadModel(where, rule, "write {a, b, ...}", slug="initial")
            values = given if isinstance(given, tuple) else (None,) * len(parts)
            made = {
                name: self.make(f"{id}_{name}", each, value, line, where, is_global=is_global)
                for (name, each), value in zip(parts, values, strict=True)
            }
            return ArrayVariable(tuple(made.values())) if shape.lengths else Struct(made)
        self._count(1, where)
        if isinstance(given, tuple):
            raise BadModel(where, f"{id!r} must have one initial value, but has several", slug="initial")
        if shape.kind == "chan":
            return UppaalChannel(id, "urgent" in shape.prefixes, "broadcast" in shape.prefixes, line)
        start = _start(shape, given)
        if "const" in shape.prefixes:
            return ParameterValue(((TRUE, literal(start)),))
        cell = self.cells[id] = UppaalVariable(id, shape.kind, start, shape.low, shape.high, is_global, line)
        self.kinds[id] = shape.kind
        if shape.low is not None and shape.low >= 0:
            self.naturals.add(id)
        return cell

    def make_local(self, name: str, shape: TypeShape, line: int, where: str) -> tuple[Symbol, list[UppaalVariable]]:
        """Return a variable of a function, with the cells it consists of: they last for one call."""
        # No name of a file has an apostrophe, so that a local variable never meets another.
        self.calls += 1
        before = set(self.cells)
        made = self.make(f"{name}'{self.calls}", shape, None, line, where, is_global=False)
        return made, [self.cells.pop(id) for id in list(self.cells) if id not in before]

    def _count(self, more: int, where: str) -> None:
        self.count += more
        if self.count > MAX_CELLS:
            rule = f"a system has at most {MAX_CELLS} variables, channels and array elements, but this one has more"
            raise BadModel(where, rule, "make its arrays smaller", slug="expansion-size")


def _start(shape: TypeShape, given: bool | int | float | None) -> bool | int | float:
    match shape.kind:
        case "bool":
            return bool(given)
        case "int" if given is None:
            return shape.low if shape.low is not None and not shape.low <= 0 <= (shape.high or 0) else 0
        case "int":
            return int(given or 0)
        case _:
            return float(given or 0)

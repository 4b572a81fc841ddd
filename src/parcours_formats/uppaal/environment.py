"""The names that a part of a UPPAAL system sees, and the places, values and types that its texts mean by them."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterable
from dataclasses import replace
from typing import Self, TypeVar

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Unary
from parcours_formats.guard_languages import Scope, Translation, refusal, values
from parcours_formats.guard_languages.values import FALSE, TRUE, Cases, always, conjunction
from parcours_formats.uppaal.declarations import Declared, Initial, Routine, TypeTree
from parcours_formats.uppaal.symbols import (
    KINDS,
    MAX_CELLS,
    ArrayVariable,
    Cells,
    Given,
    ParameterValue,
    Struct,
    Symbol,
    TypeShape,
    UppaalChannel,
    UppaalVariable,
)

_S = TypeVar("_S", UppaalVariable, UppaalChannel)
_PLAIN = {"int": "int", "bool": "bool", "clock": "clock", "chan": "chan", "double": "real", "void": "void"}


class Environment(Scope):
    """The names of one scope, then those of the scopes around it."""

    def __init__(self, cells: Cells, prefix: str = "", around: Environment | None = None) -> None:
        super().__init__("uppaal", cells.kinds, cells.naturals)
        self.cells, self.prefix, self.around = cells, prefix, around
        self.names: ChainMap[str, Symbol] = around.names.new_child() if around is not None else ChainMap()

    def inner(self, prefix: str = "") -> Self:
        """Return a scope inside this one."""
        return type(self)(self.cells, prefix or self.prefix, self)

    def find(self, name: str, where: str) -> Symbol:
        """Return what a name means. Raises BadModel if nothing."""
        try:
            return self.names[name]
        except KeyError:
            rule = f"a name must be declared, but {name!r} is not"
            raise BadModel(where, rule, "declare it", slug="unknown-name") from None

    def home(self, symbol: Symbol) -> Environment:
        """Return the scope in which a symbol was declared."""
        here = self
        while here.around is not None and not any(each is symbol for each in here.names.maps[0].values()):
            here = here.around
        return here

    def hold(self, name: str, value: bool | int | float) -> None:
        """Let a name mean a constant."""
        self.names[name] = ParameterValue(((TRUE, values.literal(value)),))

    def declare(self, declared: Declared | Routine, where: str) -> None:
        """Add a name and what it means. Raises BadModel if its type or initial value cannot be worked out."""
        if isinstance(declared, Routine):
            self.names[declared.name] = declared
            return
        shape = self.shape(declared.type, where, declared.lengths)
        if declared.is_type:
            self.names[declared.name] = shape
            return
        given = self._given(declared.initial, where)
        id = f"{self.prefix}{declared.name}"
        self.names[declared.name] = self.cells.make(id, shape, given, declared.line, where, is_global=not self.prefix)

    def locate(self, tree: Expression, where: str) -> list[tuple[Expression, Symbol]]:
        """Return the symbols that a place stands for, each with the condition for it: an index may vary."""
        match tree:
            case Name(name):
                return [(TRUE, self.find(name, where))]
            case FieldAccess(of, name):
                found: list[tuple[Expression, Symbol]] = []
                for case, symbol in self.locate(of, where):
                    if not isinstance(symbol, Struct) or name not in symbol.fields:
                        raise refusal(where, f"the field {name!r} of {KINDS[type(symbol)]}")
                    found.append((case, symbol.fields[name]))
                return found
            case Apply("[]", (of, index)):
                return self._elements(self.locate(of, where), Translation(self, where).number(index), where)
            case _:
                raise refusal(where, "a value where a variable or channel must stand")

    def place(self, argument: Expression, where: str) -> Symbol:
        """Return the only symbol that an argument stands for."""
        places = self.locate(argument, where)
        if len(places) != 1:
            raise refusal(where, "an index that varies in an argument")
        return places[0][1]

    def _elements(
        self, places: list[tuple[Expression, Symbol]], indices: Cases, where: str
    ) -> list[tuple[Expression, Symbol]]:
        found: list[tuple[Expression, Symbol]] = []
        for case, symbol in places:
            if not isinstance(symbol, ArrayVariable):
                raise refusal(where, f"an element of {KINDS[type(symbol)]}")
            for condition, index in indices:
                for at, item in self._candidates(symbol, index, where):
                    both = conjunction((case, condition, at))
                    if both != FALSE:
                        found.append((both, item))
                    if len(found) > values.MAX_CASES:
                        rule = f"an element of an array has at most {values.MAX_CASES} cases, but this one has more"
                        raise BadModel(where, rule, "use constants as indices", slug="expansion-size")
        if not found and not self.cells.depth:  # inside a function, a way on which an index is outside ends there
            raise BadModel(where, "an index must lie inside its array, but this one does not", slug="out-of-range")
        return found

    def _candidates(self, row: ArrayVariable, index: Expression, where: str) -> Iterable[tuple[Expression, Symbol]]:
        match index:
            case Literal(int() as at) if not isinstance(at, bool):
                return [(TRUE, row.items[at])] if at < len(row.items) else []
            case Unary("-", Literal()):
                return []
        #   a[i]  with three elements is  a_0 if i == 0,  a_1 if i == 1,  a_2 if i == 2
        self.spend(len(row.items) // 16, where)
        return ((Binary("==", index, Literal(at)), item) for at, item in enumerate(row.items))

    def spend(self, count: int, where: str) -> None:
        """Count cases of the whole system. Raises BadModel beyond MAX_WORK."""
        self.cells.spend(where, count)

    def read(self, tree: Expression, where: str) -> Cases:
        """Return what a place holds."""
        found: Cases = []
        for case, symbol in self.locate(tree, where):
            match symbol:
                case UppaalVariable():
                    found.append((case, self.cells.known.get(symbol.id, Name(symbol.id))))
                case ParameterValue(cases):
                    found += values.joined(where, lambda _, value: value, [(case, TRUE)], list(cases))
                case _:
                    raise refusal(where, f"{KINDS[type(symbol)]} as a value")
        return found

    def target(self, tree: Expression, where: str) -> list[tuple[Expression, Name]]:
        """Return the variables that an assignment may change, each with its condition."""
        return [(case, Name(cell.id)) for case, cell in self._among(tree, UppaalVariable, "an assignment to", where)]

    def links(self, tree: Expression, where: str) -> list[tuple[Expression, UppaalChannel]]:
        """Return the channels that a synchronisation may mean, each with its condition."""
        return self._among(tree, UppaalChannel, "a synchronisation on", where)

    def _among(self, tree: Expression, kind: type[_S], use: str, where: str) -> list[tuple[Expression, _S]]:
        found = []
        for case, symbol in self.locate(tree, where):
            if not isinstance(symbol, kind):
                raise refusal(where, f"{use} {KINDS[type(symbol)]}")
            found.append((case, symbol))
        return found

    def quantified(self, tree: Apply, where: str) -> Cases:
        """Return the value of forall, exists or sum, written out."""
        name, *ends, body = tree.arguments
        type_ = TypeTree("int", low=ends[0], high=ends[1]) if len(ends) == 2 else TypeTree(str(ends[0]))
        inner, parts, is_sum = self.inner(), list[Cases](), tree.function == "sum:"
        chosen = tuple(self.shape(type_, where).values(where))
        self.cells.spend(where, len(chosen))
        for value in chosen:
            inner.hold(str(name), value)
            translation = Translation(inner, where)
            parts.append(translation.number(body) if is_sum else always(translation.truth(body)))
        if is_sum:
            total = always(Literal(0))
            for part in parts:
                total = values.joined(where, lambda one, other: values.folded(Binary("+", one, other)), total, part)
            return total
        join = conjunction if tree.function == "forall:" else values.disjunction
        return always(join(value for ((_, value),) in parts))

    def constant(self, tree: Expression, where: str) -> bool | int | float:
        """Return the value of an expression that must be constant. Raises BadModel if it is not."""
        cases = Translation(self, where).value(tree)
        if len(cases) == 1 and cases[0][0] == TRUE:
            value = cases[0][1]
            inner = value.operand if isinstance(value, Unary) else value
            if isinstance(inner, Literal) and not isinstance(inner.value, str):
                return -inner.value if isinstance(value, Unary) else inner.value
        raise BadModel(where, "a constant must stand here, but it depends on variables", slug="foreign-construct")

    def shape(self, type_: TypeTree, where: str, lengths: tuple[Expression | TypeTree, ...] = ()) -> TypeShape:
        """Return a type, worked out. Raises BadModel if it is unknown or too large."""
        own = tuple(self._length(each, where) for each in lengths)
        if type_.base == "struct":
            fields = tuple((each.name, self.shape(each.type, where, each.lengths)) for each in type_.fields)
            return TypeShape("struct", prefixes=type_.prefixes, fields=fields, lengths=own)
        if "hybrid" in type_.prefixes or type_.base == "string":
            raise refusal(where, "a hybrid clock" if "hybrid" in type_.prefixes else "a string")
        if type_.base in ("int", "scalar") and type_.low is not None:
            low, high = 0, int(self.constant(type_.low, where)) - 1
            if type_.high is not None:
                low, high = high + 1, int(self.constant(type_.high, where))
            if low > high:
                raise BadModel(where, f"a range must have values, but [{low}, {high}] has none", slug="value")
            return TypeShape("int", low, high, type_.prefixes, lengths=own)
        if type_.base in _PLAIN:
            return TypeShape(_PLAIN[type_.base], prefixes=type_.prefixes, lengths=own)
        named = self.find(type_.base, where)
        if not isinstance(named, TypeShape):
            raise refusal(where, f"{KINDS[type(named)]} {type_.base!r} as a type")
        return replace(named, prefixes=named.prefixes | type_.prefixes, lengths=own + named.lengths)

    def _length(self, length: Expression | TypeTree, where: str) -> int:
        if isinstance(length, Name) and isinstance(self.find(length.id, where), TypeShape):
            length = TypeTree(length.id)
        if isinstance(length, TypeTree):
            shape = self.shape(length, where)
            count = shape.high + 1 if shape.low == 0 and shape.high is not None else 0
        else:
            count = int(self.constant(length, where))
        if not 0 < count <= MAX_CELLS:
            rule = f"an array has 1 to {MAX_CELLS} elements, indexed from 0, but this one has {count}"
            raise BadModel(where, rule, "make it smaller", slug="expansion-size")
        return count

    def _given(self, initial: Initial | None, where: str) -> Given:
        if isinstance(initial, tuple):
            return tuple(self._given(each, where) for each in initial)
        return None if initial is None else self.constant(initial, where)

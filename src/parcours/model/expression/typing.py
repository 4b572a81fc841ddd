"""Checks the types of expressions.

A type is a base type, an enumeration with its values, a message class, or a list of one of these. An integer
may stand where a real is expected; nothing else converts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NoReturn

from parcours.errors import BadModel, one_of
from parcours.model.expression.evaluation import FORMULA_FUNCTIONS
from parcours.model.expression.syntax import (
    Apply,
    Binary,
    Each,
    Expression,
    FieldAccess,
    Item,
    Literal,
    Name,
    Unary,
    render,
)


@dataclass(frozen=True, slots=True)
class Type:
    """A base type or message class by name, the values of an enumeration, the number of list dimensions.

    A clock is a real that is never negative.
    """

    name: str
    values: tuple[str, ...] = ()
    rank: int = 0
    is_clock: bool = field(default=False, compare=False)

    def __str__(self) -> str:
        return "list of " * self.rank + self.name + (f" {{{', '.join(self.values)}}}" if self.values else "")


BOOL, INT, REAL, TEXT = Type("bool"), Type("int"), Type("real"), Type("text")
TIME = Type("real", is_clock=True)
_NO_CLASSES: Mapping[str, Mapping[str, Type]] = MappingProxyType({})


def type_of(
    expression: Expression,
    types: Mapping[str, Type],
    classes: Mapping[str, Mapping[str, Type]] = _NO_CLASSES,
    where: str = "expression",
) -> Type:
    """Return the type of an expression.

    Args:
        types: the type of each name.
        classes: the fields of each message class, with their types.
        where: what the expression belongs to, for the error message.

    Raises:
        BadModel: a name or field is unknown, or an operator or function gets what it cannot work on. A caret
            marks the culprit in the canonical text.
    """
    return _Typing(expression, types, classes, where).of(expression)


def accepts(target: Type, value: Type) -> bool:
    """Return whether a value of one type may be stored where another is declared."""
    if target.rank != value.rank:
        return False
    if target.name == "enum" and value.values:
        return not target.values or set(value.values) <= set(target.values)
    if target.name == "text" and value.name == "enum":
        return True
    return target.name == value.name or (target.name, value.name) == ("real", "int")


class _Typing:
    def __init__(
        self, root: Expression, types: Mapping[str, Type], classes: Mapping[str, Mapping[str, Type]], where: str
    ) -> None:
        self.root, self.types, self.classes, self.where = root, types, classes, where

    def of(self, node: Expression) -> Type:
        match node:
            case Literal(value):
                # A constant text carries its value, so that it may be compared with an enumeration.
                return Type("text", (value,)) if isinstance(value, str) else _CONSTANTS[type(value)]
            case Name(id):
                if id not in self.types:
                    rule = f"a name must be declared, but {id!r} is not"
                    self.fail(node, rule, self.known(id, sorted(self.types)), "unknown-name")
                return self.types[id]
            case FieldAccess(of, name):
                return self.field(node, self.of(of), name)
            case Unary(operator, operand):
                return self.only(operand, operator, "bool" if operator == "!" else "number")
            case Binary("&&" | "||" as operator, left, right):
                self.only(left, operator, "bool")
                return self.only(right, operator, "bool")
            case Binary("==" | "!=" as operator, left, right):
                self.comparable(node, operator, self.of(left), self.of(right))
                return BOOL
            case Binary(operator, left, right):
                kinds = {self.only(left, operator, "number"), self.only(right, operator, "number")}
                if operator in ("<", "<=", ">", ">="):
                    return BOOL
                return REAL if operator == "/" or REAL in kinds else INT
            case Item(of, index):
                listed = self.of(of)
                if not listed.rank:
                    self.fail(of, f"only a list has items, but got {listed} at the caret", "", "type")
                self.whole(index)
                return replace(listed, rank=listed.rank - 1)
            case Each():
                return self.each(node)
            case Apply(function, arguments):
                return self.function(node, function, arguments)

    def each(self, node: Each) -> Type:
        over = self.of(node.first)
        if node.last is not None:
            self.whole(node.first)
            self.whole(node.last)
            bound = INT
        elif over.rank:
            bound = replace(over, rank=over.rank - 1)
        else:
            rule = f"{node.kind} goes through a list or from one integer to another, but got {over} at the caret"
            self.fail(node.first, rule, "", "type")
        inner = _Typing(self.root, {**self.types, node.name: bound}, self.classes, self.where)
        return inner.only(node.body, node.kind, "number" if node.kind == "sum" else "bool")

    def whole(self, node: Expression) -> None:
        if (given := self.of(node)) != INT:
            self.fail(node, f"an index is an integer, but got {given} at the caret", "", "type")

    def field(self, node: Expression, record: Type, name: str) -> Type:
        fields = self.classes.get(record.name)
        if fields is None or record.rank:
            self.fail(node, f"only a message has fields, but {record} has none", "", "type")
        if name not in fields:
            rule = f"a field must be declared, but {record.name} has no {name!r}"
            self.fail(node, rule, self.known(name, list(fields)), "unknown-field")
        return fields[name]

    def function(self, node: Expression, function: str, arguments: tuple[Expression, ...]) -> Type:
        _, fewest, most = FORMULA_FUNCTIONS[function]
        if not fewest <= len(arguments) <= most:
            wanted = str(fewest) if fewest == most else f"{fewest} to {most}"
            self.fail(node, f"{function} takes {wanted} arguments, but got {len(arguments)}", "", "arity")
        if function == "size":
            given = self.of(arguments[0])
            if not given.rank:
                self.fail(arguments[0], f"size works on a list, but got {given} at the caret", "", "type")
            return INT
        kinds = [self.only(argument, function, "number") for argument in arguments]
        if function == "near":
            return BOOL
        if function in ("abs", "min", "max"):
            return REAL if REAL in kinds else INT
        return INT if function == "floor" else REAL

    def only(self, node: Expression, operator: str, wanted: str) -> Type:
        given = self.of(node)
        allowed = (BOOL,) if wanted == "bool" else (INT, REAL)
        if given not in allowed:
            self.fail(node, f"{operator} works on {wanted}, but got {given} at the caret", "", "type")
        return given

    def comparable(self, node: Expression, operator: str, left: Type, right: Type) -> None:
        words = {left.name, right.name} <= {"text", "enum"}
        alike = words or left.name == right.name or {left, right} == {INT, REAL}
        if left.rank or right.rank or not alike or left.name not in ("bool", "int", "real", "text", "enum"):
            self.fail(node, f"{operator} compares like base types, but got {left} and {right}", "", "type")
        enums = [side for side in (left, right) if side.name == "enum" and side.values]
        # A comparison that can never hold is a slip of the pen more often than a wish.
        others = set(left.values) & set(right.values)
        if enums and left.values and right.values and not others:
            word = next((side.values[0] for side in (left, right) if side.name == "text"), "")
            remedy = one_of(word, enums[0].values) if word else ""
            self.fail(
                node, f"{operator} must be able to hold, but {left} and {right} share no value", remedy, "enum-value"
            )

    def known(self, given: str, names: list[str]) -> str:
        # Finding the nearest of very many names would take long.
        return one_of(given, names) if 0 < len(names) <= 100 else ""

    def fail(self, node: Expression, rule: str, remedy: str, slug: str) -> NoReturn:
        raise BadModel(self.where, f'{rule} in "{render(self.root, marked=node)}"', remedy, slug=slug)


_CONSTANTS = {bool: BOOL, int: INT, float: REAL}

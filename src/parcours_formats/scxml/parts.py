"""Objects and lists of SCXML's data to variables, one for each part: our language has neither.

    <data id="x" expr="{a: 1, b: [2, 'k']}"/>        x_a = 1, x_b_0 = 2, x_b_1 = 'k'
    <assign location="x.b[0]" expr="x.a + 1"/>       x_b_0 := x_a + 1

This is exact as long as each keeps the shape it starts with and is never shared by two names. Whatever would change its
shape, or depends on it as a whole, is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from parcours.errors import BadModel
from parcours_formats.guard_languages import foreign_syntax as syntax

MAX_PARTS = 1_000
"""Most fields of one object, and most elements of one list."""

_RESIZING = ("copyWithin", "fill", "pop", "push", "reverse", "shift", "sort", "splice", "unshift")


@dataclass(frozen=True, slots=True)
class Whole:
    """An object or a list: its name in the document, and its parts by field name, or by place from '0'."""

    name: str
    parts: dict[str, Part]
    is_list: bool


Part: TypeAlias = str | Whole


class ChartParser(syntax.Parser):
    """Reads JavaScript with objects and lists written out.

    >>> from parcours_formats.guard_languages import Tokens
    >>> ChartParser(Tokens("{a: 1, 'b': [x, 2]}", "javascript", "here")).condition().fields[0]
    ('a', Constant(value=1))
    """

    def operand(self) -> syntax.Tree:
        """Return an operand; it may be an object or a list."""
        if self.tokens.accept("{"):
            return self._record()
        if self.tokens.accept("["):
            return self._series()
        return super().operand()

    def called(self, call: syntax.Applied) -> tuple[syntax.Statement, ...]:
        """Refuse a call for its effect."""
        list_, _, method = call.function.rpartition(".")
        if list_ and method in _RESIZING:
            remedy = "give it all its elements at first, and assign to them one by one"
            self.tokens.refuse(f"{method!r}, which changes the list {list_!r} as a whole,", remedy)
        return super().called(call)

    def _record(self) -> syntax.Record:
        tokens, fields = self.tokens, dict[str, syntax.Tree]()
        while not self._ends("}", len(fields)):
            token = tokens.token
            if token.kind not in ("name", "text", "int"):
                tokens.fail("a field name")
            key = token.text if token.kind == "name" else str(tokens.value(token))
            tokens.position += 1
            if not tokens.accept(":"):
                tokens.refuse(f"the field {key!r} without a value", f"write {key}: value")
            if key in fields or key == "__proto__":
                tokens.refuse(f"the field {key!r}, twice or special", "write each field once")
            fields[key] = self.condition()
        return syntax.Record(tuple(fields.items()))

    def _series(self) -> syntax.Series:
        items: list[syntax.Tree] = []
        while not self._ends("]", len(items)):
            items.append(self.condition())
        return syntax.Series(tuple(items))

    def _ends(self, closing: str, count: int) -> bool:
        """Take the closing sign if it is next, or the comma before the next part."""
        tokens = self.tokens
        if count > MAX_PARTS:
            tokens.refuse(f"an object or a list of more than {MAX_PARTS} parts", "split it")
        if tokens.accept(closing):
            return True
        if count:
            tokens.expect(",")
            return tokens.accept(closing)
        return False


def refused(where: str, what: str, remedy: str) -> BadModel:
    """Return the refusal of something that an object or a list is, and variables for its parts are not."""
    rule = f"an object or a list is read as variables, one for each part of a fixed shape, but here is {what}"
    return BadModel(where, rule, remedy, slug="foreign-construct")


def part_at(tree: syntax.Tree, wholes: Mapping[str, Whole], where: str) -> Part | int | None:
    """Return what a place means: a variable, a whole, or the length of a list.

    >>> x = Whole("x", {"a": "x_a", "b": Whole("x.b", {"0": "x_b_0"}, True)}, False)
    >>> at_b = Member(Identifier("x"), "b")
    >>> part_at(Index(at_b, Constant(0)), {"x": x}, "here"), part_at(Member(at_b, "length"), {"x": x}, "here")
    ('x_b_0', 1)
    """
    match tree:
        case syntax.Identifier(name):
            return wholes.get(name)
        case syntax.Member(of, key):
            whole = part_at(of, wholes, where)
        case syntax.Index(of, syntax.Constant(constant)) if isinstance(constant, int | str) and not isinstance(
            constant, bool
        ):
            whole, key = part_at(of, wholes, where), str(constant)
        case syntax.Index(of, _):
            whole, key = part_at(of, wholes, where), ""
            if isinstance(whole, Whole):
                remedy = f"write a choice: i == 0 ? {whole.name}[0] : ..., or the number"
                raise refused(where, f"an index of {whole.name!r} that is no constant name or number", remedy)
        case _:
            return None
    if whole is None:
        return None
    if not isinstance(whole, Whole):
        raise refused(where, f"the part {key!r} of a single value", "use the value itself")
    if whole.is_list and key == "length":
        return len(whole.parts)
    if key not in whole.parts:
        known = ", ".join(list(whole.parts)[:20]) or "none"
        raise refused(where, f"the part {key!r} of {whole.name!r}, whose parts are {known}", "declare it in <data>")
    return whole.parts[key]


def spread(
    statements: tuple[syntax.Statement, ...], wholes: Mapping[str, Whole], where: str
) -> Iterator[syntax.Statement]:
    """Yield statements in which each assignment of an object or a list is one to each of its parts."""
    for statement in statements:
        match statement:
            case syntax.When(condition, yes, no):
                yield syntax.When(condition, tuple(spread(yes, wholes, where)), tuple(spread(no, wholes, where)))
            case syntax.Set(place, syntax.Choice(condition, yes_value, no_value)) if isinstance(
                part_at(place, wholes, where), Whole
            ):
                inner = ((syntax.Set(place, yes_value),), (syntax.Set(place, no_value),))
                yield syntax.When(condition, *(tuple(spread(each, wholes, where)) for each in inner))
            case syntax.Set(place, value):
                yield from _assigned(place, value, wholes, where)
            case _:
                yield statement


def _assigned(
    place: syntax.Tree, value: syntax.Tree, wholes: Mapping[str, Whole], where: str
) -> Iterator[syntax.Statement]:
    part = part_at(place, wholes, where)
    if isinstance(part, int):
        raise refused(where, "an assignment to the length of a list", "give it all its elements at first")
    if not isinstance(part, Whole):
        if isinstance(value, syntax.Record | syntax.Series):
            raise refused(
                where, "one assigned to a place that starts as a single value", "let <data> start with that shape"
            )
        yield syntax.Set(place, value)
        return
    # All values are those before the assignment, so a part goes before another only if that does not read it.
    left = [(part_at(each.place, wholes, where), each, _read(each.value, wholes, where))
            for each in _leaves(place, part, value, where)]  # fmt: skip
    while left:
        free = [at for at, (name, _, _) in enumerate(left)
                if not any(name in read for other, (_, _, read) in enumerate(left) if other != at)]  # fmt: skip
        if not free:
            raise refused(where, f"parts of {part.name!r} that exchange their values", "keep one in another variable")
        yield left.pop(free[0])[1]


def _leaves(place: syntax.Tree, whole: Whole, value: syntax.Tree, where: str) -> Iterator[syntax.Set]:
    match value:
        case syntax.Record(fields) if not whole.is_list:
            given = dict(fields)
        case syntax.Series(items) if whole.is_list:
            given = {str(at): item for at, item in enumerate(items)}
        case _:
            remedy = "assign part by part: a copy of an object or a list shares its parts with the original there"
            kind = "a list" if whole.is_list else "an object"
            raise refused(where, f"{whole.name!r} assigned what is not written out as {kind}", remedy)
    if given.keys() != whole.parts.keys():
        has, wants = (", ".join(list(keys)[:20]) or "none" for keys in (given, whole.parts))
        what = f"{whole.name!r} assigned the parts {has}, though it starts with {wants}"
        raise refused(where, what, "let <data> start with all parts")
    for key, part in whole.parts.items():
        inner: syntax.Tree = (
            syntax.Index(place, syntax.Constant(int(key)))
            if whole.is_list
            else syntax.Index(place, syntax.Constant(key))
        )
        if isinstance(part, Whole):
            yield from _leaves(inner, part, given[key], where)
        elif isinstance(given[key], syntax.Record | syntax.Series):
            raise refused(where, f"one as the part {key!r} of {whole.name!r}, a single value", "let <data> start so")
        else:
            yield syntax.Set(inner, given[key])


def _read(tree: syntax.Tree, wholes: Mapping[str, Whole], where: str) -> set[str]:
    """Return the variables of parts that a value reads."""
    match tree:
        case syntax.Member() | syntax.Index():
            part = part_at(tree, wholes, where)
            return {part} if isinstance(part, str) else set()
        case syntax.Prefix(_, operand):
            inner: tuple[syntax.Tree, ...] = (operand,)
        case syntax.Infix(_, left, right):
            inner = (left, right)
        case syntax.Choice(condition, yes, no):
            inner = (condition, yes, no)
        case syntax.Applied(_, arguments):
            inner = arguments
        case _:
            return set()
    return set().union(*(_read(each, wholes, where) for each in inner))

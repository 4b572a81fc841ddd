"""Turns the data of an SCXML document, objects and lists among them, into variables with initial values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Unary
from parcours.model.expression.syntax import parts as parts_of
from parcours_formats.guard_languages import ForeignTokens, Scope, Translation, refusal
from parcours_formats.guard_languages import foreign_syntax as syntax
from parcours_formats.guard_languages.values import is_constant, kind_of
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames
from parcours_formats.xml_lines import Element

MAX_DATA = 2_000
"""Most data of one document."""

_ABSENT = ("", "undefined", "null")
_STARTS: dict[str, bool | int | float | str] = {"bool": False, "int": 0, "real": 0.0, "text": ""}


class DataModel:
    """What data a document declares."""

    def __init__(self, root: Element, origin: str) -> None:
        self.origin = origin
        self.initial: dict[str, Expression] = {}
        self.lines: dict[str, int] = {}
        self.kinds: dict[str, str] = {}
        self.wholes: dict[str, Whole] = {}
        self.parts: set[str] = set()
        self.missing: dict[str, BadModel] = {}
        self.losses = Losses()
        self._assigned = list(_assigned(root))
        declared = [element for element in root.walk() if element.tag == "data"]
        if len(declared) > MAX_DATA:
            rule = f"a document declares at most {MAX_DATA} data, but this one has {len(declared)}"
            raise BadModel(f"{origin}:{declared[0].line}", rule, "split the document", slug="expansion-size")
        # Names of data stay as they are; those of parts are made around them.
        scripted = [each.place.id for each in self._assigned if isinstance(each.place, Name)]
        self._names = UniqueNames([*(element.get("id") for element in declared), *scripted])
        for element in declared:
            self._declare(element.get("id"), element)
        for script in root.all("script"):
            self._run(script)

    def _declare(self, name: str, element: Element) -> None:
        where = f"{self.origin}:{element.line}: <data>"
        text = (element.get("expr") or element.text).strip()
        self.lines[name] = element.line
        try:
            if element.get("src") or element.children:
                raise refusal(where, "data that are not an expression")
            if text in _ABSENT:
                kind = self._guessed(name)
                self._start(name, Literal(_STARTS[kind]))
                rule = f'has no value at first; here it starts as "{Literal(_STARTS[kind])}"'
                self.losses.add(f"data {name!r}", element.line, rule)
            else:
                self._begin(name, parsed(text, where), where)
        except BadModel as error:
            self.missing[name] = error

    def _run(self, script: Element) -> None:
        # A script of the document itself runs once, before the first configuration.
        where = f"{self.origin}:{script.line}: <script>"
        if script.get("src"):
            self.losses.add("<script>", script.line, "a script in another file is left out")
            return
        for statement in ChartParser(ForeignTokens(script.text, "javascript", where)).statements():
            if not isinstance(statement, syntax.Set):
                raise refusal(where, "a choice in a script of the document")
            if isinstance(part := part_at(statement.place, self.wholes, where), str):
                self._start(part, self._constant(statement.value, where))
            elif not isinstance(statement.place, Name):
                raise refusal(where, "an assignment to a part of what is not declared in a script of the document")
            else:
                self.lines.setdefault(statement.place.id, script.line)
                self._begin(statement.place.id, statement.value, where)

    def _begin(self, name: str, tree: Expression, where: str) -> None:
        """Let data start with a value; an object or a list becomes variables."""
        is_whole = _written(tree) is not None
        if name in self.wholes or (is_whole and name in self.initial):
            raise refused(where, f"a second initial value of {name!r}", "keep one")
        if not is_whole:
            self._start(name, self._constant(tree, where))
            return
        values: dict[str, Expression] = {}
        whole = self._part(name, name, tree, where, values)
        if isinstance(whole, Whole):
            self.wholes[name] = whole
        for part, value in values.items():
            self.parts.add(part)
            self.lines[part] = self.lines[name]
            self._start(part, value)
        shown = ", ".join(list(values)[:9]) + (", ..." if len(values) > 9 else "")
        rule = f"its parts are variables here: {shown}" if values else "it is empty, and is no variable here"
        self.losses.add(f"data {name!r}", self.lines[name], rule)

    def _part(self, name: str, variable: str, tree: Expression, where: str, values: dict[str, Expression]) -> Part:
        written = _written(tree)
        if written is None:
            given = self._names.identifier(variable)
            values[given] = self._constant(tree, where)
            return given
        if len(self.initial) + len(values) > MAX_DATA:
            raise refused(where, f"more than {MAX_DATA} parts", "split the document")
        parts, is_list = written
        whole = Whole(name, {}, is_list)
        for key, value in parts.items():
            inner = f"{name}[{key}]" if is_list else f"{name}.{key}"
            whole.parts[key] = self._part(inner, f"{variable}_{key}", value, where, values)
        return whole

    def _start(self, name: str, value: Expression) -> None:
        self.initial[name] = value
        self.kinds[name] = kind_of(value, {})

    def _constant(self, tree: Expression, where: str) -> Expression:
        cases = Translation(_Initial(self.initial, self.wholes), where).value(tree)
        if len(cases) != 1 or not is_constant(cases[0][1]):
            raise refusal(where, "an initial value that is not constant")
        return cases[0][1]

    def _guessed(self, name: str) -> str:
        for statement in self._assigned:
            if statement.place == Name(name) and (kind := _kind(statement.value, self.kinds)):
                return kind
        raise refusal(f"{self.origin}:{self.lines[name]}", f"{name!r} without a value")


class _Initial(Scope):
    """Data that have their initial values."""

    def __init__(self, values: Mapping[str, Expression], wholes: Mapping[str, Whole]) -> None:
        super().__init__("javascript")
        self._values, self._wholes = values, wholes

    def read(self, tree: Expression, where: str) -> list[tuple[Expression, Expression]]:
        """Return the value of a name, or of a part."""
        part = part_at(tree, self._wholes, where)
        if isinstance(part, int | str):
            return [(Literal(True), self._values[part] if isinstance(part, str) else Literal(part))]
        if isinstance(tree, Name) and tree.id in self._values:
            return [(Literal(True), self._values[tree.id])]
        return super().read(tree, where)


def _assigned(root: Element) -> Iterable[syntax.Set]:
    for element in root.walk():
        try:
            if element.tag == "assign":
                yield syntax.Set(parsed(element.get("location"), ""), parsed(element.get("expr") or element.text, ""))
            elif element.tag == "script":
                yield from _sets(ChartParser(ForeignTokens(element.text, "javascript", "")).statements())
        except BadModel:
            continue  # complained about where it is used


def _sets(statements: Iterable[syntax.Statement]) -> Iterable[syntax.Set]:
    for statement in statements:
        if isinstance(statement, syntax.When):
            yield from _sets((*statement.yes, *statement.no))
        elif isinstance(statement, syntax.Set):
            yield statement


def parsed(text: str, where: str) -> Expression:
    """Return the syntax tree of an expression."""
    tokens = ForeignTokens(text, "javascript", where)
    tree = ChartParser(tokens).condition()
    if tokens.token.kind != "end":
        tokens.fail("an operator or the end")
    return tree


def _kind(tree: Expression, kinds: dict[str, str]) -> str:
    match tree:
        case FieldAccess(Name("_event"), "name"):
            return "text"
        case Unary("-", operand):
            return _kind(operand, kinds)
        case Binary("+" | "-" | "*" | "%" as operator, left, right):
            among = _kind(left, kinds), _kind(right, kinds)
            return "text" if operator == "+" and "text" in among else "real" if "real" in among else "int"
        case Apply("?:", (_, yes, _)):
            return _kind(yes, kinds)
        case Apply():
            return ""
        case _:
            return kind_of(tree, kinds)


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

    >>> from parcours_formats.guard_languages import ForeignTokens
    >>> ChartParser(ForeignTokens("{a: 1, 'b': [x, 2]}", "javascript", "here")).condition().arguments[:2]
    (Name(id='a'), Literal(value=1, unit=''))
    """

    def operand(self) -> Expression:
        """Return an operand; it may be an object or a list."""
        if self.tokens.accept("{"):
            return self._object()
        if self.tokens.accept("["):
            items: list[Expression] = []
            while not self._ends("]", len(items)):
                items.append(self.condition())
            return Apply("[,]", tuple(items))
        return super().operand()

    def called(self, call: Apply) -> tuple[syntax.Statement, ...]:
        """Refuse a call for its effect."""
        list_, _, method = call.function.rpartition(".")
        if list_ and method in _RESIZING:
            remedy = "give it all its elements at first, and assign to them one by one"
            self.tokens.refuse(f"{method!r}, which changes the list {list_!r} as a whole,", remedy)
        return super().called(call)

    def _object(self) -> Expression:
        tokens, fields = self.tokens, dict[str, Expression]()
        while not self._ends("}", len(fields)):
            token = tokens.token
            if token.kind not in ("name", "text", "int"):
                tokens.fail("a field name")
            key = token.text if token.kind == "name" else str(tokens.value(token))
            tokens.position += 1
            if not tokens.accept(":"):
                tokens.refuse(f"the field {key!r} without a value", f"write {key}: value")
            # `__proto__: x` sets what the object inherits from; it makes no field.
            if key in fields or key == "__proto__":
                tokens.refuse(f"the field {key!r}, twice or special", "write each field once")
            fields[key] = self.condition()
        return Apply("{}", tuple(part for key, value in fields.items() for part in (Name(key), value)))

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


def _written(tree: Expression) -> tuple[dict[str, Expression], bool] | None:
    """Return the parts of an object or a list that is written out, and whether it is a list."""
    match tree:
        case Apply("{}", given):
            return {str(key): value for key, value in zip(given[::2], given[1::2], strict=True)}, False
        case Apply("[,]", items):
            return {str(at): item for at, item in enumerate(items)}, True
    return None


def refused(where: str, what: str, remedy: str) -> BadModel:
    """Return the refusal of something that an object or a list is, and variables for its parts are not."""
    rule = f"an object or a list is read as variables, one for each part of a fixed shape, but here is {what}"
    return BadModel(where, rule, remedy, slug="foreign-construct")


def part_at(tree: Expression, wholes: Mapping[str, Whole], where: str) -> Part | int | None:
    """Return what a place means: a variable, a whole, or the length of a list.

    >>> x = Whole("x", {"a": "x_a", "b": Whole("x.b", {"0": "x_b_0"}, True)}, False)
    >>> at_b = FieldAccess(Name("x"), "b")
    >>> [part_at(of, {"x": x}, "") for of in (Apply("[]", (at_b, Literal(0))), FieldAccess(at_b, "length"))]
    ['x_b_0', 1]
    """
    match tree:
        case Name(name):
            return wholes.get(name)
        case FieldAccess(of, key):
            whole = part_at(of, wholes, where)
        case Apply("[]", (of, Literal(int() | str() as constant))) if not isinstance(constant, bool):
            whole, key = part_at(of, wholes, where), str(constant)
        case Apply("[]", (of, _)):
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
            case syntax.Set(place, value):
                match value:
                    case Apply("?:", (choice, *options)) if isinstance(part_at(place, wholes, where), Whole):
                        yes, no = (tuple(spread((syntax.Set(place, each),), wholes, where)) for each in options)
                        yield syntax.When(choice, yes, no)
                    case _:
                        yield from _by_parts(place, value, wholes, where)
            case _:
                yield statement


def _by_parts(
    place: Expression, value: Expression, wholes: Mapping[str, Whole], where: str
) -> Iterator[syntax.Statement]:
    part = part_at(place, wholes, where)
    if isinstance(part, int):
        raise refused(where, "an assignment to the length of a list", "give it all its elements at first")
    if not isinstance(part, Whole):
        if _written(value) is not None:
            what = "one assigned to a place that starts as a single value"
            raise refused(where, what, "let <data> start with that shape")
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


def _leaves(place: Expression, whole: Whole, value: Expression, where: str) -> Iterator[syntax.Set]:
    given, is_list = _written(value) or ({}, None)
    if is_list is not whole.is_list:
        remedy = "assign part by part: a copy of an object or a list shares its parts with the original there"
        kind = "a list" if whole.is_list else "an object"
        raise refused(where, f"{whole.name!r} assigned what is not written out as {kind}", remedy)
    if given.keys() != whole.parts.keys():
        has, wants = (", ".join(list(keys)[:20]) or "none" for keys in (given, whole.parts))
        what = f"{whole.name!r} assigned the parts {has}, though it starts with {wants}"
        raise refused(where, what, "let <data> start with all parts")
    for key, part in whole.parts.items():
        inner = Apply("[]", (place, Literal(int(key) if whole.is_list else key)))
        if isinstance(part, Whole):
            yield from _leaves(inner, part, given[key], where)
        elif _written(given[key]) is not None:
            raise refused(where, f"one as the part {key!r} of {whole.name!r}, a single value", "let <data> start so")
        else:
            yield syntax.Set(inner, given[key])


def _read(tree: Expression, wholes: Mapping[str, Whole], where: str) -> set[str]:
    """Return the variables of parts that a value reads."""
    if isinstance(tree, FieldAccess) or (isinstance(tree, Apply) and tree.function == "[]"):
        part = part_at(tree, wholes, where)
        return {part} if isinstance(part, str) else set()
    return set().union(*(_read(each, wholes, where) for each in parts_of(tree)))

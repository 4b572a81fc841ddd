"""The data of an SCXML document to variables with initial values, as far as our language has such values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from parcours.errors import BadModel
from parcours.model.expression import Expression, Literal
from parcours_formats.guard_languages import Scope, Tokens, Translation, refusal
from parcours_formats.guard_languages import foreign_syntax as syntax
from parcours_formats.guard_languages.values import is_constant, kind_of
from parcours_formats.losses import Losses
from parcours_formats.naming import Names
from parcours_formats.scxml.parts import ChartParser, Part, Whole, part_at, refused
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
        scripted = [each.place.name for each in self._assigned if isinstance(each.place, syntax.Identifier)]
        self._names = Names([*(element.get("id") for element in declared), *scripted])
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
                self._begin(name, _parsed(text, where), where)
        except BadModel as error:
            self.missing[name] = error

    def _run(self, script: Element) -> None:
        # A script of the document itself runs once, before the first configuration.
        where = f"{self.origin}:{script.line}: <script>"
        if script.get("src"):
            self.losses.add("<script>", script.line, "a script in another file is left out")
            return
        for statement in ChartParser(Tokens(script.text, "javascript", where)).statements():
            if not isinstance(statement, syntax.Set):
                raise refusal(where, "a choice in a script of the document")
            if isinstance(part := part_at(statement.place, self.wholes, where), str):
                self._start(part, self._constant(statement.value, where))
            elif not isinstance(statement.place, syntax.Identifier):
                raise refusal(where, "an assignment to a part of what is not declared in a script of the document")
            else:
                self.lines.setdefault(statement.place.name, script.line)
                self._begin(statement.place.name, statement.value, where)

    def _begin(self, name: str, tree: syntax.Tree, where: str) -> None:
        """Let data start with a value; an object or a list becomes variables."""
        is_whole = isinstance(tree, syntax.Record | syntax.Series)
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

    def _part(self, name: str, variable: str, tree: syntax.Tree, where: str, values: dict[str, Expression]) -> Part:
        if not isinstance(tree, syntax.Record | syntax.Series):
            given = self._names.identifier(variable)
            values[given] = self._constant(tree, where)
            return given
        if len(self.initial) + len(values) > MAX_DATA:
            raise refused(where, f"more than {MAX_DATA} parts", "split the document")
        if isinstance(tree, syntax.Record):
            fields = {key: (f"{name}.{key}", value) for key, value in tree.fields}
        else:
            fields = {str(at): (f"{name}[{at}]", value) for at, value in enumerate(tree.items)}
        parts = {
            key: self._part(inner, f"{variable}_{key}", value, where, values) for key, (inner, value) in fields.items()
        }
        return Whole(name, parts, isinstance(tree, syntax.Series))

    def _start(self, name: str, value: Expression) -> None:
        self.initial[name] = value
        self.kinds[name] = kind_of(value, {})

    def _constant(self, tree: syntax.Tree, where: str) -> Expression:
        cases = Translation(_Initial(self.initial, self.wholes), where).value(tree)
        if len(cases) != 1 or not is_constant(cases[0][1]):
            raise refusal(where, "an initial value that is not constant")
        return cases[0][1]

    def _guessed(self, name: str) -> str:
        for statement in self._assigned:
            if statement.place == syntax.Identifier(name) and (kind := _kind(statement.value, self.kinds)):
                return kind
        raise refusal(f"{self.origin}:{self.lines[name]}", f"{name!r} without a value")


class _Initial(Scope):
    """Data that have their initial values."""

    def __init__(self, values: Mapping[str, Expression], wholes: Mapping[str, Whole]) -> None:
        super().__init__("javascript")
        self._values, self._wholes = values, wholes

    def read(self, tree: syntax.Tree, where: str) -> list[tuple[Expression, Expression]]:
        """Return the value of a name, or of a part."""
        part = part_at(tree, self._wholes, where)
        if isinstance(part, int | str):
            return [(Literal(True), self._values[part] if isinstance(part, str) else Literal(part))]
        if isinstance(tree, syntax.Identifier) and tree.name in self._values:
            return [(Literal(True), self._values[tree.name])]
        return super().read(tree, where)  # type: ignore[arg-type]


def _assigned(root: Element) -> Iterable[syntax.Set]:
    for element in root.walk():
        try:
            if element.tag == "assign":
                yield syntax.Set(_parsed(element.get("location"), ""), _parsed(element.get("expr") or element.text, ""))
            elif element.tag == "script":
                yield from _sets(ChartParser(Tokens(element.text, "javascript", "")).statements())
        except BadModel:
            continue  # complained about where it is used


def _sets(statements: Iterable[syntax.Statement]) -> Iterable[syntax.Set]:
    for statement in statements:
        if isinstance(statement, syntax.When):
            yield from _sets((*statement.yes, *statement.no))
        elif isinstance(statement, syntax.Set):
            yield statement


def _parsed(text: str, where: str) -> syntax.Tree:
    tokens = Tokens(text, "javascript", where)
    tree = ChartParser(tokens).condition()
    if tokens.token.kind != "end":
        tokens.fail("an operator or the end")
    return tree


def _kind(tree: syntax.Tree, kinds: dict[str, str]) -> str:
    match tree:
        case syntax.Member(syntax.Identifier("_event"), "name"):
            return "text"
        case syntax.Constant(value):
            return kind_of(Literal(value), {})
        case syntax.Identifier(name):
            return kinds.get(name, "")
        case syntax.Prefix("!", _) | syntax.Infix("&&" | "||" | "==" | "!=" | "<" | "<=" | ">" | ">=", _, _):
            return "bool"
        case syntax.Prefix(_, operand):
            return _kind(operand, kinds)
        case syntax.Infix("/", _, _):
            return "real"
        case syntax.Infix(operator, left, right):
            among = _kind(left, kinds), _kind(right, kinds)
            return "text" if operator == "+" and "text" in among else "real" if "real" in among else "int"
        case syntax.Choice(_, yes, _):
            return _kind(yes, kinds)
        case _:
            return ""

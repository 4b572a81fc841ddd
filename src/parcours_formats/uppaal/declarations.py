"""Parses UPPAAL's declarations and functions; nothing is looked up or worked out here.

The grammar is that of UPPAAL 4 and 5 (docs.uppaal.org/language-reference), with the old forms `const N 3;` and
`:=`. Bodies of functions are kept as tokens.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from parcours.model.expression import Apply, Binary, Expression, Literal
from parcours_formats.guard_languages import foreign_syntax as syntax
from parcours_formats.guard_languages.foreign_tokens import ForeignTokens

_PREFIXES = ("const", "meta", "urgent", "broadcast", "hybrid")
_SKIPPED = ("progress", "gantt", "query", "state", "priority")
_REFUSED = ("before_update", "after_update", "import", "dynamic", "process")


def parse_declarations(text: str, origin: str, line: int) -> list[Declaration]:
    """Return what a text declares, in order.

    >>> [n, go] = parse_declarations("const int N = 6;\\nurgent chan go[N];", "gate.xml", 4)
    >>> n.name, n.initial, go.line, sorted(go.type.prefixes), go.lengths
    ('N', Literal(value=6, unit=''), 5, ['urgent'], (Name(id='N'),))
    """
    return DeclarationReader(ForeignTokens(text, "uppaal", origin, line)).all()


def parse_parameters(text: str, origin: str, line: int) -> tuple[Declared, ...]:
    """Return the parameters of a template, e.g. `const id_t id, clock &x`."""
    return DeclarationReader(ForeignTokens(text, "uppaal", origin, line)).parameters()


def parse_selections(text: str, origin: str, line: int) -> tuple[Declared, ...]:
    """Return the names of a `select` label with their types, e.g. `e : id_t, i : int[0,3]`."""
    reader = DeclarationReader(ForeignTokens(text, "uppaal", origin, line))
    return tuple(reader.tokens.listed(lambda: Declared(reader.bound_name(), reader.type(), line)))


class DeclarationReader(syntax.Parser):
    """Reads declarations from tokens."""

    structs = 0

    def all(self) -> list[Declaration]:
        """Return the declarations up to the end."""
        found: list[Declaration] = []
        while self.tokens.token.kind != "end":
            if not self.tokens.accept(";"):
                found += self._one()
        return found

    def _one(self) -> list[Declaration]:
        tokens = self.tokens
        word, after, line = tokens.token.text, tokens.ahead(1).text, tokens.line_at(tokens.token.at)
        if word in _REFUSED:
            tokens.refuse(repr(word))
        if word == "typedef":
            tokens.position += 1
            return [Declared(each.name, each.type, line, each.lengths, is_type=True) for each in self.plain()]
        if word == "system":
            tokens.position += 1
            return [self._system(line)]
        # `chan priority` orders channels; it declares none.
        if word in _SKIPPED or (word, after) == ("chan", "priority"):
            self._skip()
            return [Aside("priorities of channels" if word == "chan" else repr(word), line)]
        if after == "=" or (after == "(" and word not in _PREFIXES) or after == ":=":
            return [self._instance(line)]
        return list(self._declarators())

    def _declarators(self) -> list[Declared | Routine]:
        tokens = self.tokens
        type_, found = self.type(), list[Declared | Routine]()
        while True:
            line = tokens.line_at(tokens.token.at)
            is_reference = tokens.accept("&")
            name = tokens.name("a name")
            if tokens.accept("("):
                return [self._routine(name, type_, line)]
            lengths, initial = self._lengths(), None
            if tokens.accept("=") or tokens.accept(":="):
                initial = self._initial()
            elif "const" in type_.prefixes and tokens.token.kind in ("int", "real"):
                initial = self.condition()
            found.append(Declared(name, type_, line, lengths, initial, is_reference))
            if not tokens.accept(","):
                tokens.expect(";")
                return found

    def plain(self) -> list[Declared]:
        """Return the variables of one declaration."""
        found = self._declarators()
        return [each if isinstance(each, Declared) else self.tokens.refuse("a function") for each in found]

    def type(self) -> TypeTree:
        """Return the type that starts here."""
        tokens = self.tokens
        prefixes = set()
        while tokens.token.text in _PREFIXES:
            prefixes.add(tokens.name("a type"))
        marks = frozenset(prefixes)
        if "const" in marks and tokens.ahead(1).kind in ("int", "real"):
            return TypeTree("int", marks)  # the old form: const N 3
        base = tokens.name("a type")
        if base == "struct":
            tokens.expect("{")
            self.structs += 1
            if self.structs > 10:
                tokens.too_deep()
            fields: list[Declared] = []
            while not tokens.accept("}"):
                fields += self.plain()
            self.structs -= 1
            return TypeTree(base, marks, fields=tuple(fields))
        if base in ("int", "scalar") and tokens.accept("["):
            low = self.condition()
            high = self.condition() if tokens.accept(",") else None
            tokens.expect("]")
            return TypeTree(base, marks, low, high)
        return TypeTree(base, marks)

    def _lengths(self) -> tuple[Expression | TypeTree, ...]:
        tokens, found = self.tokens, list[Expression | TypeTree]()
        while tokens.accept("["):
            is_type = tokens.token.text in ("int", "scalar") and tokens.ahead(1).text == "["
            found.append(self.type() if is_type else self.condition())
            tokens.expect("]")
        return tuple(found)

    def _initial(self, depth: int = 0) -> Initial:
        tokens = self.tokens
        if not tokens.accept("{"):
            return self.condition()
        if depth > 10:
            tokens.too_deep()

        def part() -> Initial:
            if tokens.ahead(1).text == ":" and tokens.token.kind == "name":
                tokens.position += 2
            return self._initial(depth + 1)

        return tuple(tokens.listed(part, "}"))

    def _routine(self, name: str, result: TypeTree, line: int) -> Routine:
        parameters = self.parameters(")")
        if self.tokens.token.text != "{":
            self.tokens.refuse("a function without a body")
        body = self.tokens.position
        self._skip()
        return Routine(name, result, parameters, self.tokens, body, line)

    def parameters(self, closing: str = "") -> tuple[Declared, ...]:
        """Return parameters up to a closing sign, or the end."""
        return tuple(self.tokens.listed(self._parameter, closing))

    def _parameter(self) -> Declared:
        tokens, type_ = self.tokens, self.type()
        is_reference = tokens.accept("&")
        line = tokens.line_at(tokens.token.at)
        return Declared(tokens.name("a name"), type_, line, self._lengths(), None, is_reference)

    def bound_name(self) -> str:
        """Return the name in `name : type`."""
        name = self.tokens.name("a name")
        self.tokens.expect(":")
        return name

    def _instance(self, line: int) -> InstanceLine:
        tokens = self.tokens
        name = tokens.name("a name")
        parameters = self.parameters(")") if tokens.accept("(") else ()
        if not tokens.accept(":="):
            tokens.expect("=")
        template = tokens.name("a template")
        tokens.expect("(")
        arguments = tuple(tokens.listed(self.condition, ")"))
        tokens.expect(";")
        return InstanceLine(name, parameters, template, arguments, line)

    def _system(self, line: int) -> SystemLine:
        tokens = self.tokens
        names, is_ranked = [tokens.name("a process")], False
        while not tokens.accept(";"):
            if tokens.accept("<"):
                is_ranked = True
            else:
                tokens.expect(",")
            names.append(tokens.name("a process"))
        return SystemLine(tuple(names), is_ranked, line)

    def _skip(self) -> None:
        # To the end of the block that starts before the next semicolon, or to that semicolon.
        tokens, depth = self.tokens, 0
        while tokens.token.kind != "end":
            text = tokens.token.text if tokens.token.kind == "sign" else ""
            tokens.position += 1
            depth += (text == "{") - (text == "}")
            if depth <= 0 and text in ("}", ";"):
                return
        tokens.fail("'}'")


@dataclass(frozen=True, slots=True)
class TypeTree:
    """A type as written: int, bool, clock, chan, double, struct or the name of another, with its bounds or fields."""

    base: str
    prefixes: frozenset[str] = frozenset()
    low: Expression | None = None
    high: Expression | None = None
    fields: tuple[Declared, ...] = ()


Initial: TypeAlias = "Expression | tuple[Initial, ...]"


@dataclass(frozen=True, slots=True)
class Declared:
    """A variable, constant, channel, clock, parameter or (`is_type`) the name of a type."""

    name: str
    type: TypeTree
    line: int
    lengths: tuple[Expression | TypeTree, ...] = ()
    initial: Initial | None = None
    is_reference: bool = False
    is_type: bool = False


@dataclass(frozen=True, slots=True)
class Routine:
    """A function: the position of its body among the tokens of its text."""

    name: str
    result: TypeTree
    parameters: tuple[Declared, ...]
    tokens: ForeignTokens
    body: int
    line: int


@dataclass(frozen=True, slots=True)
class InstanceLine:
    """`name(parameters) = template(arguments);`."""

    name: str
    parameters: tuple[Declared, ...]
    template: str
    arguments: tuple[Expression, ...]
    line: int


@dataclass(frozen=True, slots=True)
class SystemLine:
    """`system A, B < C;`; `is_ranked` tells that processes have priorities."""

    names: tuple[str, ...]
    is_ranked: bool
    line: int


@dataclass(frozen=True, slots=True)
class Aside:
    """Something that has no counterpart and does not matter to what can happen, by its name."""

    what: str
    line: int


Declaration: TypeAlias = Declared | Routine | InstanceLine | SystemLine | Aside


_TYPES = ("int", "bool", "const", "double", "struct")


@dataclass(frozen=True, slots=True)
class Perform(syntax.Statement):
    """A function called for its effect."""

    call: Apply


@dataclass(frozen=True, slots=True)
class Loop(syntax.Statement):
    """`while (condition) body`; a `for` is one behind its first statement."""

    condition: Expression
    body: tuple[syntax.Statement, ...]


@dataclass(frozen=True, slots=True)
class Iteration(syntax.Statement):
    """`for (name : range) body`."""

    name: str
    type: TypeTree
    body: tuple[syntax.Statement, ...]


@dataclass(frozen=True, slots=True)
class Return(syntax.Statement):
    """`return value;`."""

    value: Expression | None


@dataclass(frozen=True, slots=True)
class Local(syntax.Statement):
    """A variable of a function, declared."""

    declared: Declared


class BodyParser(syntax.Parser):
    """Reads statements of UPPAAL's C.

    >>> [loop] = BodyParser(ForeignTokens("for (i = 0; i < 3; i++) a[n++] = i;", "uppaal", "here")).statements()[1:]
    >>> len(loop.body), loop.body[1] == loop.body[2]
    (3, False)
    """

    def __init__(self, tokens: ForeignTokens) -> None:
        super().__init__(tokens)
        self.trailing: list[syntax.Statement] = []

    def operand(self) -> Expression:
        """Return an operand; `x++` is x, and the increment follows the statement."""
        found = super().operand()
        if step := self.step():
            self.trailing.append(syntax.Set(found, Binary(step, found, Literal(1))))
        return found

    def called(self, call: Apply) -> tuple[syntax.Statement, ...]:
        """Return the statement of a call."""
        return (Perform(call),)

    def statement(self) -> tuple[syntax.Statement, ...]:
        """Return the statement that starts here, with what follows it."""
        # Increments are collected while the statement is read; statements inside it keep theirs to themselves.
        kept, self.trailing = self.trailing, []
        found = self._statement()
        found, self.trailing = (*found, *self.trailing), kept
        return found

    def _statement(self) -> tuple[syntax.Statement, ...]:
        tokens = self.tokens
        if tokens.accept(";"):
            return ()
        if tokens.accept("return"):
            return (Return(None if tokens.token.text == ";" else self.condition()),)
        if tokens.accept("while"):
            condition = self._braced()
            return (Loop(condition, self.inner()),)
        if tokens.accept("for"):
            return self._for()
        if tokens.token.text in _TYPES or (tokens.token.kind == tokens.ahead(1).kind == "name"):
            declared = DeclarationReader(tokens).plain()
            tokens.position -= 1  # the semicolon ends the statement
            return tuple(map(Local, declared))
        return super().statement()

    def _braced(self) -> Expression:
        condition = self.braced()
        if self.trailing:
            self.tokens.refuse("an increment inside a condition")
        return condition

    def _for(self) -> tuple[syntax.Statement, ...]:
        tokens = self.tokens
        tokens.expect("(")
        if tokens.ahead(1).text == ":":
            reader = DeclarationReader(tokens)
            name, type_ = reader.bound_name(), reader.type()
            tokens.expect(")")
            return (Iteration(name, type_, self.inner()),)
        first = () if tokens.token.text == ";" else self._statement()
        tokens.expect(";")
        condition = Literal(True) if tokens.token.text == ";" else self.condition()
        tokens.expect(";")
        following = () if tokens.token.text == ")" else super().statement()
        tokens.expect(")")
        return (*first, Loop(condition, (*self.inner(), *following)))

"""The text of a UPPAAL function or update to statements: also loops, calls, local variables and `x++` in a value."""

from __future__ import annotations

from dataclasses import dataclass

from parcours_formats.guard_languages.parsing import Parser
from parcours_formats.guard_languages.tokens import Tokens
from parcours_formats.guard_languages.tree import Applied, Constant, Infix, Other, Set, Statement, Tree
from parcours_formats.uppaal.declarations import DeclarationReader
from parcours_formats.uppaal.declared import Declared, TypeTree

_TYPES = ("int", "bool", "const", "double", "struct")


@dataclass(frozen=True, slots=True)
class Perform(Other):
    """A function called for its effect."""

    call: Applied


@dataclass(frozen=True, slots=True)
class Loop(Other):
    """`while (condition) body`; a `for` is one behind its first statement."""

    condition: Tree
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Each(Other):
    """`for (name : range) body`."""

    name: str
    type: TypeTree
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Return(Other):
    """`return value;`."""

    value: Tree | None


@dataclass(frozen=True, slots=True)
class Local(Other):
    """A variable of a function, declared."""

    declared: Declared


class BodyParser(Parser):
    """Reads statements of UPPAAL's C.

    >>> [loop] = BodyParser(Tokens("for (i = 0; i < 3; i++) a[n++] = i;", "uppaal", "here")).statements()[1:]
    >>> len(loop.body), loop.body[1] == loop.body[2]
    (3, False)
    """

    def __init__(self, tokens: Tokens) -> None:
        super().__init__(tokens)
        self.trailing: list[Statement] = []

    def operand(self) -> Tree:
        """Return an operand; `x++` is x, and the increment follows the statement."""
        found = super().operand()
        for sign in ("++", "--"):
            if self.tokens.accept(sign):
                self.trailing.append(Set(found, Infix(sign[0], found, Constant(1))))
        return found

    def called(self, call: Applied) -> tuple[Statement, ...]:
        """Return the statement of a call."""
        return (Perform(call),)

    def statement(self) -> tuple[Statement, ...]:
        """Return the statement that starts here, with what follows it."""
        kept, self.trailing = self.trailing, []
        found = self._statement()
        found, self.trailing = (*found, *self.trailing), kept
        return found

    def _statement(self) -> tuple[Statement, ...]:
        tokens = self.tokens
        if tokens.accept(";"):
            return ()
        if tokens.accept_word("return"):
            return (Return(None if tokens.token.text == ";" else self.condition()),)
        if tokens.accept_word("while"):
            condition = self._braced()
            return (Loop(condition, self.inner()),)
        if tokens.accept_word("for"):
            return self._for()
        if tokens.token.text in _TYPES or (tokens.token.kind == tokens.ahead(1).kind == "name"):
            declared = DeclarationReader(tokens).plain()
            tokens.position -= 1  # the semicolon ends the statement
            return tuple(map(Local, declared))
        return super().statement()

    def _braced(self) -> Tree:
        self.tokens.expect("(")
        condition = self.condition()
        self.tokens.expect(")")
        if self.trailing:
            self.tokens.refuse("an increment inside a condition")
        return condition

    def _for(self) -> tuple[Statement, ...]:
        tokens = self.tokens
        tokens.expect("(")
        if tokens.ahead(1).text == ":":
            name = tokens.name("a name")
            tokens.expect(":")
            type_ = DeclarationReader(tokens).type()
            tokens.expect(")")
            return (Each(name, type_, self.inner()),)
        first = () if tokens.token.text == ";" else self._statement()
        tokens.expect(";")
        condition = Constant(True) if tokens.token.text == ";" else self.condition()
        tokens.expect(";")
        following = () if tokens.token.text == ")" else super().statement()
        tokens.expect(")")
        return (*first, Loop(condition, (*self.inner(), *following)))

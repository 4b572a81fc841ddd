"""Parses the part of JavaScript and of UPPAAL's C that can be translated.

    condition  := operand (operator operand)* ['?' condition ':' condition]      precedence in LEVELS
    operand    := ('!' | '-' | '+') operand | atom ('[' condition ']' | '.' name | '(' conditions ')')*
    statements := statement ((';' | ',' | end of line) statement)*
    statement  := place ('=' | ':=' | '+=' ...) condition | place '++' | '++' place | '{' statements '}'
                | 'if' '(' condition ')' statement ['else' statement]

Everything else is refused by its name. Nothing is evaluated; length and depth are bounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from parcours_formats.guard_languages.foreign_tokens import MAX_DEPTH, Tokens

LEVELS: dict[str, int] = {
    **dict.fromkeys(("imply", "||"), 1),
    "&&": 2,
    **dict.fromkeys(("==", "!="), 3),
    **dict.fromkeys(("<", "<=", ">", ">="), 4),
    **dict.fromkeys(("<?", ">?"), 5),
    **dict.fromkeys(("+", "-"), 6),
    **dict.fromkeys(("*", "/", "%"), 7),
}
"""How tightly each binary operator binds; all group to the left."""

_SPELLING = {"===": "==", "!==": "!=", "and": "&&", "or": "||", "not": "!"}
_ASSIGNING = {"=": "", ":=": "", "+=": "+", "-=": "-", "*=": "*", "/=": "/", "%=": "%"}
_DECLARING = ("var", "let", "const")


class Parser:
    """Recursive descent over tokens, for conditions and for statements."""

    def __init__(self, tokens: Tokens) -> None:
        self.tokens = tokens
        self.nesting = 0

    def condition(self) -> Tree:
        """Return the condition or value that starts here."""
        self._enter()
        tokens = self.tokens
        found = self._infix(1)
        if tokens.accept("?"):
            yes = self.condition()
            tokens.expect(":")
            found = Choice(found, yes, self.condition())
        self.nesting -= 1
        return found

    def _infix(self, level: int) -> Tree:
        left = self._prefix()
        chain = 0
        while (operator := self._spelled()) in LEVELS and LEVELS[operator] >= level:
            self.tokens.position += 1
            self._enter()
            left = Infix(operator, left, self._infix(LEVELS[operator] + 1))
            self.nesting -= 1
            chain += 1
            if chain > MAX_DEPTH:
                self.tokens.too_deep()
        return left

    def _spelled(self) -> str:
        token = self.tokens.token
        return "" if token.kind == "text" else _SPELLING.get(token.text, token.text)

    def _prefix(self) -> Tree:
        operator = self._spelled()
        if operator in ("!", "-", "+"):
            self.tokens.position += 1
            self._enter()
            operand = self._prefix()
            self.nesting -= 1
            # A plus makes a number of its operand, as the difference to 0 does; a text is not one here.
            return Infix("-", operand, Constant(0)) if operator == "+" else Prefix(operator, operand)
        return self.operand()

    def operand(self) -> Tree:
        """Return the operand that starts here, without what stands before it."""
        return self.place()

    def place(self) -> Tree:
        """Return the atom that starts here, with what follows it: an index, a field, arguments."""
        tokens = self.tokens
        found = self._atom()
        for _ in range(MAX_DEPTH):
            if tokens.accept("["):
                found = Index(found, self.condition())
                tokens.expect("]")
            elif tokens.accept("."):
                found = Member(found, tokens.name("a field name"))
            elif tokens.accept("("):
                found = Applied(_path(found), tuple(tokens.listed(self.condition, ")")))
            else:
                return found
        return tokens.too_deep()

    def _atom(self) -> Tree:
        tokens = self.tokens
        token = tokens.token
        if token.kind == "sign" and token.text == "(":
            return self.braced()
        if token.kind in ("int", "real", "text"):
            tokens.position += 1
            return Constant(tokens.value(token))
        if token.text in ("forall", "exists", "sum") and tokens.language == "uppaal":
            return self._quantified()
        if token.kind == "name" and token.text in ("true", "false"):
            tokens.position += 1
            return Constant(token.text == "true")
        return Identifier(tokens.name("a value"))

    def _quantified(self) -> Tree:
        tokens = self.tokens
        quantifier = tokens.name("a quantifier")
        tokens.expect("(")
        name = tokens.name("a name")
        tokens.expect(":")
        low, high = self.range()
        tokens.expect(")")
        return Quantified(quantifier, name, low, high, self.condition())

    def range(self) -> tuple[Tree, Tree | None]:
        """Return the ends of `int[low, high]`, or the name of a type and None."""
        tokens = self.tokens
        tokens.accept_word("const")
        if not tokens.accept_word("int"):
            return Identifier(tokens.name("a type")), None
        tokens.expect("[")
        low = self.condition()
        tokens.expect(",")
        high = self.condition()
        tokens.expect("]")
        return low, high

    def statements(self, closing: str = "") -> tuple[Statement, ...]:
        """Return the statements up to a closing sign, or the end."""
        tokens = self.tokens
        self._enter()
        found: list[Statement] = []
        while not (tokens.accept(closing) if closing else tokens.token.kind == "end"):
            if tokens.accept(";") or tokens.accept(","):
                continue
            found += self.statement()
            if tokens.token.text not in (";", ",", closing) and tokens.token.kind != "end" and not tokens.is_at_start():
                tokens.fail("';'")
        self.nesting -= 1
        return tuple(found)

    def statement(self) -> tuple[Statement, ...]:
        """Return the statement that starts here; a block is several."""
        tokens = self.tokens
        if tokens.accept("{"):
            return self.statements("}")
        if tokens.accept_word("if"):
            condition = self.braced()
            yes = self.inner()
            tokens.accept(";")
            no = self.inner() if tokens.accept_word("else") else ()
            return (When(condition, yes, no),)
        if tokens.language == "javascript" and tokens.token.text in _DECLARING:
            tokens.position += 1
        step = self._step()
        place = self.place()
        if step := step or self._step():
            return (Set(place, Infix(step, place, Constant(1))),)
        if isinstance(place, Applied):
            return self.called(place)
        sign = tokens.token.text
        if tokens.token.kind != "sign" or sign not in _ASSIGNING:
            tokens.fail("an assignment")
        tokens.position += 1
        value = self.condition()
        if tokens.token.text in _ASSIGNING and tokens.token.kind == "sign":
            tokens.refuse("an assignment inside an expression")
        return (Set(place, Infix(_ASSIGNING[sign], place, value) if _ASSIGNING[sign] else value),)

    def braced(self) -> Tree:
        """Return a condition in parentheses."""
        self.tokens.expect("(")
        condition = self.condition()
        self.tokens.expect(")")
        return condition

    def _step(self) -> str:
        """Take `++` or `--` if it is next; return its operator."""
        return "+" if self.tokens.accept("++") else "-" if self.tokens.accept("--") else ""

    def called(self, call: Applied) -> tuple[Statement, ...]:
        """Return what a call for its effect means; here it is refused."""
        self.tokens.refuse(f"a call of the function {call.function!r}")

    def inner(self) -> tuple[Statement, ...]:
        """Return a statement inside another."""
        self._enter()
        found = self.statement()
        self.nesting -= 1
        return found

    def _enter(self) -> None:
        self.nesting += 1
        if self.nesting > MAX_DEPTH:
            self.tokens.too_deep()


def _path(tree: Tree) -> str:
    match tree:
        case Identifier(name):
            return name
        case Member(of, name):
            return f"{_path(of)}.{name}"
        case _:
            return "(an expression)"


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

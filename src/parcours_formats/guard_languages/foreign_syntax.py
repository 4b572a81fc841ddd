"""Parses the part of JavaScript and of UPPAAL's C that can be translated.

    condition  := operand (operator operand)* ['?' condition ':' condition]      precedence in LEVELS
    operand    := ('!' | '-' | '+') operand | atom ('[' condition ']' | '.' name | '(' conditions ')')*
    statements := statement ((';' | ',' | end of line) statement)*
    statement  := place ('=' | ':=' | '+=' ...) condition | place '++' | '++' place | '{' statements '}'
                | 'if' '(' condition ')' statement ['else' statement]

Everything else is refused by its name. Nothing is evaluated; length and depth are bounded.

A foreign tree is made of the nodes of our own language. What ours lacks is an `Apply` of a sign that no function
can be called: `a[i]` is Apply("[]", (a, i)), `c ? y : n` is Apply("?:", (c, y, n)), `{k: v}` is Apply("{}", (k, v)),
`[v, w]` is Apply("[,]", (v, w)), and `forall (i : int[1, n]) c` is Apply("forall:", (i, 1, n, c)).
"""

from __future__ import annotations

from dataclasses import dataclass

from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Unary
from parcours_formats.guard_languages.foreign_tokens import MAX_DEPTH, ForeignTokens

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


class Statement:
    """A statement; UPPAAL's C has kinds of its own."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Set(Statement):
    """`place = value`; `a += b` is the same as `a = a + b`."""

    place: Expression
    value: Expression


@dataclass(frozen=True, slots=True)
class When(Statement):
    """`if (condition) yes else no`."""

    condition: Expression
    yes: tuple[Statement, ...]
    no: tuple[Statement, ...]


class Parser:
    """Recursive descent over tokens, for conditions and for statements."""

    def __init__(self, tokens: ForeignTokens) -> None:
        self.tokens = tokens
        self.nesting = 0

    def condition(self) -> Expression:
        """Return the condition or value that starts here."""
        self._enter()
        found = self._infix(1)
        if self.tokens.accept("?"):
            yes = self.condition()
            self.tokens.expect(":")
            found = Apply("?:", (found, yes, self.condition()))
        self.nesting -= 1
        return found

    def _infix(self, level: int) -> Expression:
        # Precedence climbing: the right operand takes only what binds more tightly than this operator.
        left, chain = self._prefix(), 0
        while (operator := self._spelled()) in LEVELS and LEVELS[operator] >= level:
            self.tokens.position += 1
            self._enter()
            left = Binary(operator, left, self._infix(LEVELS[operator] + 1))
            self.nesting -= 1
            chain += 1
            if chain > MAX_DEPTH:  # a + b + c ... is a tree as deep as it is long
                self.tokens.too_deep()
        return left

    def _spelled(self) -> str:
        token = self.tokens.token
        return "" if token.kind == "text" else _SPELLING.get(token.text, token.text)

    def _prefix(self) -> Expression:
        operator = self._spelled()
        if operator not in ("!", "-", "+"):
            return self.operand()
        self.tokens.position += 1
        self._enter()
        operand = self._prefix()
        self.nesting -= 1
        # A plus makes a number of its operand, as the difference to 0 does; a text is not one here.
        return Binary("-", operand, Literal(0)) if operator == "+" else Unary(operator, operand)

    def operand(self) -> Expression:
        """Return the operand that starts here, without what stands before it."""
        return self.place()

    def place(self) -> Expression:
        """Return the atom that starts here, with what follows it: an index, a field, arguments."""
        tokens, found = self.tokens, self._atom()
        for _ in range(MAX_DEPTH):
            if tokens.accept("["):
                found = Apply("[]", (found, self.condition()))
                tokens.expect("]")
            elif tokens.accept("."):
                found = FieldAccess(found, tokens.name("a field name"))
            elif tokens.accept("("):
                found = Apply(_path(found), tuple(tokens.listed(self.condition, ")")))
            else:
                return found
        return tokens.too_deep()

    def _atom(self) -> Expression:
        tokens, token = self.tokens, self.tokens.token
        if token.text == "(":
            return self.braced()
        if token.kind in ("int", "real", "text"):
            tokens.position += 1
            return Literal(tokens.value(token))
        if token.text in ("forall", "exists", "sum") and tokens.language == "uppaal":
            return self._quantified()
        if token.text in ("true", "false"):
            tokens.position += 1
            return Literal(token.text == "true")
        return Name(tokens.name("a value"))

    def _quantified(self) -> Expression:
        tokens = self.tokens
        quantifier = tokens.name("a quantifier")
        tokens.expect("(")
        name = Name(tokens.name("a name"))
        tokens.expect(":")
        tokens.accept("const")
        if tokens.accept("int"):
            tokens.expect("[")
            low = self.condition()
            tokens.expect(",")
            ends: tuple[Expression, ...] = (low, self.condition())
            tokens.expect("]")
        else:
            ends = (Name(tokens.name("a type")),)
        tokens.expect(")")
        return Apply(f"{quantifier}:", (name, *ends, self.condition()))

    def statements(self, closing: str = "") -> tuple[Statement, ...]:
        """Return the statements up to a closing sign, or the end."""
        tokens, found = self.tokens, list[Statement]()
        self._enter()
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
        if tokens.accept("if"):
            condition = self.braced()
            yes = self.inner()
            tokens.accept(";")
            return (When(condition, yes, self.inner() if tokens.accept("else") else ()),)
        if tokens.language == "javascript" and tokens.token.text in _DECLARING:
            tokens.position += 1
        step = self.step()
        place = self.place()
        if step := step or self.step():
            return (Set(place, Binary(step, place, Literal(1))),)
        if isinstance(place, Apply) and place.function[-1] not in ":]}":
            return self.called(place)
        sign = tokens.token.text
        if sign not in _ASSIGNING:
            tokens.fail("an assignment")
        tokens.position += 1
        value = self.condition()
        if tokens.token.text in _ASSIGNING:
            tokens.refuse("an assignment inside an expression")
        return (Set(place, Binary(_ASSIGNING[sign], place, value) if _ASSIGNING[sign] else value),)

    def braced(self) -> Expression:
        """Return a condition in parentheses."""
        self.tokens.expect("(")
        condition = self.condition()
        self.tokens.expect(")")
        return condition

    def step(self) -> str:
        """Take `++` or `--` if it is next; return its operator."""
        return "+" if self.tokens.accept("++") else "-" if self.tokens.accept("--") else ""

    def called(self, call: Apply) -> tuple[Statement, ...]:
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


def _path(tree: Expression) -> str:
    match tree:
        case Name(name):
            return name
        case FieldAccess(of, name):
            return f"{_path(of)}.{name}"
        case _:
            return "(an expression)"

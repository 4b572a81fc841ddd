"""Splits the text of a formula into tokens, and shows by a caret where one is wrong."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NoReturn

from parcours.errors import BadRequest
from parcours.model.expression.parsing import MAX_LENGTH

MAX_DEPTH = 40
"""Deepest formula, so that every walk over it may recurse."""

_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\n]+)
      | (?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
      | (?P<name>[A-Za-z_][A-Za-z0-9_]*)
      | (?P<sign>->|<=|>=|[-+*/<>()\[\],^])""",
    re.VERBOSE,
)
_HINTS = {
    "=": "numbers that are measured are hardly ever equal: write abs(a - b) <= tolerance",
    "&": "write and",
    "|": "write or",
    "!": "write not",
    ":": "part the ends of an interval by a comma",
}


@dataclass(frozen=True, slots=True)
class Token:
    """A word, number or sign, and where it stands."""

    kind: str
    text: str
    at: int


class Tokens:
    """The tokens of one text, read one after the other; `token` is the next one.

    Raises BadRequest: the text is too long, or has a sign that the language does not have.
    """

    def __init__(self, text: str, where: str) -> None:
        self.text, self.where = text, where
        if len(text) > MAX_LENGTH:
            rule = f"a formula has at most {MAX_LENGTH} characters, but this one has {len(text)}"
            raise BadRequest(where, rule, "split it at its `and`s", slug="require-size")
        self.tokens = self._split()
        self.position = self.nesting = 0

    @property
    def token(self) -> Token:
        """The next one."""
        return self.tokens[self.position]

    def accept(self, sign: str) -> bool:
        """Go past a sign if it stands next; return whether it did."""
        if self.token.kind == "sign" and self.token.text == sign:
            self.position += 1
            return True
        return False

    def expect(self, sign: str) -> None:
        """Go past a sign, or fail."""
        if not self.accept(sign):
            self.fail(f"{sign!r} must stand")

    def fail(self, wanted: str, remedy: str = "", slug: str = "require-syntax") -> NoReturn:
        """Raise BadRequest: something else than what is wanted stands next."""
        token = self.token
        found = "the end" if token.kind == "end" else repr(token.text)
        self.fail_at(token.at, f"{wanted} at the caret, but found {found}", remedy, slug)

    def fail_at(self, at: int, rule: str, remedy: str, slug: str) -> NoReturn:
        """Raise BadRequest, with a caret at a place of the text."""
        before, after = self.text[:at], self.text[at:]
        before = before if len(before) <= 40 else "..." + before[-37:]
        after = after if len(after) <= 40 else after[:37] + "..."
        shown = " ".join(f"{before}^{after}".split())
        raise BadRequest(self.where, f'{rule} in "{shown}"', remedy, slug=slug)

    def enter(self) -> None:
        """Note that the text nests one deeper."""
        self.nesting += 1
        if self.nesting > MAX_DEPTH:
            self.too_deep()

    def too_deep(self) -> NoReturn:
        """Raise BadRequest: the formula nests too deep."""
        rule = f"a formula nests at most {MAX_DEPTH} deep, but this one is deeper at the caret,"
        self.fail_at(self.token.at, rule, "split it at its `and`s", "require-size")

    def _split(self) -> list[Token]:
        tokens, at = [], 0
        while at < len(self.text):
            match = _TOKEN.match(self.text, at)
            if match is None:
                bad = self.text[at]
                rule = f"a sign of the language must stand at the caret, but found {bad!r}"
                self.fail_at(at, rule, _HINTS.get(bad, ""), "require-syntax")
            if match.lastgroup != "blank":
                tokens.append(Token(str(match.lastgroup), match.group(), at))
            at = match.end()
        tokens.append(Token("end", "", len(self.text)))
        return tokens

"""Splits a text into the tokens of a small language, and shows by a caret where one is wrong."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NoReturn

from parcours.errors import BadModel, ParcoursError


@dataclass(frozen=True, slots=True)
class Token:
    """A word, number or sign, and where it stands."""

    kind: str
    text: str
    at: int


def pointed_at(text: str, at: int) -> str:
    """Return what stands around a place of a text, in quotes, with a caret at it.

    >>> pointed_at("speed =  2 m/s", 6)
    '"speed ^= 2 m/s"'
    """
    before, after = text[max(0, at - 40) : at], text[at : at + 40]  # no more, of a text that may be very long
    before = before if at <= 40 else "..." + before[3:]
    after = after if len(text) - at <= 40 else after[:37] + "..."
    return f'"{" ".join(f"{before}^{after}".split())}"'


class Tokens:
    """The tokens of one text, read one after the other; `token` is the next one, of kind `end` behind the last.

    A language gives the pattern whose groups are its kinds of tokens, what to write instead of a sign that it does not
    have, and what messages say. Raises `refusal`: the text is too long, or has a sign that the language does not have.
    """

    pattern: ClassVar[re.Pattern[str]]
    hints: ClassVar[Mapping[str, str]]
    noun: ClassVar[str]  # what messages call the text
    most: ClassVar[tuple[int, int]]  # characters, levels of nesting: every walk over its tree may recurse
    shorten: ClassVar[tuple[str, str]]  # what to do about a text that is too long, and one that nests too deep
    slugs: ClassVar[tuple[str, str]]  # of what stands at a wrong place, and of what is too large
    refusal: ClassVar[type[ParcoursError]] = BadModel

    def __init__(self, text: str, where: str) -> None:
        self.text, self.where = text, where
        if len(text) > self.most[0]:
            rule = f"{self.noun} has at most {self.most[0]} characters, but this one has {len(text)}"
            raise self.refusal(where, rule, self.shorten[0], slug=self.slugs[1])
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

    def fail(self, wanted: str, remedy: str = "", slug: str = "") -> NoReturn:
        """Refuse what stands next: it is not what is wanted."""
        token = self.token
        found = "the end" if token.kind == "end" else repr(token.text)
        self.fail_at(token.at, f"{wanted} at the caret, but found {found}", remedy, slug)

    def fail_at(self, at: int, rule: str, remedy: str = "", slug: str = "") -> NoReturn:
        """Refuse the text, with a caret at a place of it."""
        raise self.refusal(self.where, f"{rule} in {pointed_at(self.text, at)}", remedy, slug=slug or self.slugs[0])

    def enter(self) -> None:
        """Note that the text nests one deeper."""
        self.nesting += 1
        if self.nesting > self.most[1]:
            self.too_deep()

    def too_deep(self) -> NoReturn:
        """Refuse the text: it nests too deep."""
        rule = f"{self.noun} nests at most {self.most[1]} deep, but this one is deeper at the caret,"
        self.fail_at(self.token.at, rule, self.shorten[1], self.slugs[1])

    def _split(self) -> list[Token]:
        tokens, at = [], 0
        while at < len(self.text):
            match = self.pattern.match(self.text, at)
            if match is None:
                bad = self.text[at]
                rule = f"a sign of the language must stand at the caret, but found {bad!r}"
                self.fail_at(at, rule, self.hints.get(bad, ""))
            if match.lastgroup != "blank":
                tokens.append(Token(str(match.lastgroup), match.group(), at))
            at = match.end()
        tokens.append(Token("end", "", len(self.text)))
        return tokens

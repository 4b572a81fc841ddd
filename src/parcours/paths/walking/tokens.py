"""The words, numbers and signs of a text in one of the languages of walks, read one after the other."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import NoReturn

from parcours.errors import BadRequest

MAX_TEXT = 4096
"""Longest text [characters]."""

_WORD = r"(?:\d+-)?[^\W\d][\w.:-]*"
_NUMBER = r"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_TOKEN = re.compile(
    rf"\s*(?:(?P<word>{_WORD})|(?P<number>{_NUMBER})|(?P<quoted>\"[^\"]*\"|'[^']*')|(?P<sign>>=|&&|\|\||\S))"
)


@dataclass(frozen=True, slots=True)
class ConditionToken:
    """A word, quoted text, number or sign, and the column where it begins, from 1."""

    kind: str
    text: str
    column: int


class TokenReader:
    """The words, numbers and signs of a text, one after the other."""

    def __init__(self, text: str, where: str, example: str) -> None:
        self.text, self.where, self.example = text, where, example
        if len(text) > MAX_TEXT:
            rule = f"must have at most {MAX_TEXT} characters, but has {len(text)}"
            raise BadRequest(where, rule, "shorten it", slug="walk-syntax")
        self._tokens: list[ConditionToken] = []
        for match in _TOKEN.finditer(text.rstrip()):
            self._tokens += [
                ConditionToken(k, v, match.start(k) + 1) for k, v in match.groupdict().items() if v is not None
            ]
        self._at = 0

    @property
    def here(self) -> ConditionToken | None:
        """The token to read next, or None at the end."""
        return self._tokens[self._at] if self._at < len(self._tokens) else None

    def take(self, *wanted: str) -> str:
        """Read the next token if it is one of these words or signs, in any case; else return ''."""
        token = self.here
        if token is None or token.kind not in ("word", "sign") or token.text.lower() not in wanted:
            return ""
        self._at += 1
        return token.text.lower()

    def need(self, sign: str, what: str) -> None:
        """Read a sign that must stand here. Raises BadRequest."""
        if not self.take(sign):
            self.fail(f"{what} must be followed by '{sign}'")

    def kind(self, *kinds: str) -> str:
        """Read the next token if it is of one of these kinds; else return ''."""
        token = self.here
        if token is None or token.kind not in kinds:
            return ""
        self._at += 1
        return token.text[1:-1] if token.kind == "quoted" else token.text

    def argument(self, what: str) -> str:
        """Read a name in parentheses, and return it. Raises BadRequest."""
        self.need("(", f"'{what}'")
        name = self.kind("word", "quoted", "number")
        if not name:
            self.fail(f"'{what}' must name something in its parentheses")
        self.need(")", "the name")
        return name

    def number(self) -> float:
        """Read a number, and return it. Raises BadRequest."""
        token = self.here
        if token is None or token.kind != "number":
            self.fail("a number must stand here")
        value = float(token.text)
        if not math.isfinite(value):
            self.fail("a number must be at most 1.8e308, and this one is too large")
        self._at += 1
        return value

    def percent(self, amount: float) -> float:
        """Return a share [%]. Raises BadRequest if it is more than all."""
        if amount > 100:
            self.fail(f"a share must be at most 100%, not {amount:g}%")
        return amount

    def fail(self, rule: str) -> NoReturn:
        """Raise BadRequest: what must stand here, and what does."""
        token = self.here
        found = f"column {token.column} has {token.text[:40]!r}" if token else "it ends there"
        remedy = f"write it as in {self.example}"
        raise BadRequest(f"{self.where} {self.text[:80]!r}", f"{rule}, but {found}", remedy, slug="walk-syntax")


def quoted(name: str) -> str:
    """Return a name as these languages write it: plain if it is a word, else in quotes."""
    if re.fullmatch(_WORD, name):
        return name
    return f'"{name}"' if "'" in name else f"'{name}'"

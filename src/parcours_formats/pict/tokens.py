"""The constraints of a PICT model to words, each with its line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from parcours.errors import BadDomain

_TOKEN = re.compile(
    r"""(?P<blank>\s+)
      | (?P<parameter>\[[^\[\]\n]{1,200}\])
      | (?P<text>"(?:[^"\\\n]|\\.)*")
      | (?P<number>[-+]?(?:[0-9]{1,19}(?:\.[0-9]{0,19})?|\.[0-9]{1,19})(?:[eE][-+]?[0-9]{1,3})?)
      | (?P<relation><>|<=|>=|=|<|>)
      | (?P<word>[A-Za-z]{1,20})
      | (?P<sign>[(){},;])""",
    re.VERBOSE,
)


@dataclass(frozen=True, slots=True)
class Token:
    """A word: its kind (parameter, text, number, relation, word, sign or end), its text, and its line."""

    kind: str
    text: str
    line: int


def tokens_of(text: str, line: int, origin: str) -> Iterator[Token]:
    """Yield the words of a text that begins at a line, and at last one of kind `end`.

    >>> [token.text for token in tokens_of('[A] <> "x";', 1, "here")]
    ['[A]', '<>', '"x"', ';', 'the end']
    """
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise BadDomain(f"{origin}:{line}", f"a constraint cannot go on with {text[at]!r}", slug="pict-syntax")
        if match.lastgroup != "blank":
            yield Token(str(match.lastgroup), match.group(), line)
        line += match.group().count("\n")
        at = match.end()
    yield Token("end", "the end", line)

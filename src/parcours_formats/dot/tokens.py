"""Text in Graphviz' DOT language to tokens that know their lines."""

from __future__ import annotations

import re
from typing import NoReturn

from parcours.errors import BadModel

_TOKEN = re.compile(
    r"""(?P<blank>[\s\ufeff]+ | //[^\n]* | /\*[^*]*\*+(?:[^/*][^*]*\*+)* / | \#[^\n]*)
      | (?P<id>[A-Za-z_\u0080-\U0010ffff][A-Za-z0-9_\u0080-\U0010ffff]* | -?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?))
      | (?P<text>"[^"\\]*(?:\\.[^"\\]*)*")
      | (?P<markup><)
      | (?P<sign>->|--|[\[\]{}=;,:+])""",
    re.VERBOSE | re.DOTALL,
)
_ANGLE = re.compile(r"[<>]")


class Markup(str):
    """A text that stood in <>, with these: a label of HTML."""

    __slots__ = ()


class Tokens:
    """The tokens of one file, read one after the other; `kind` and `token` are those of the next one.

    Args:
        text: the file.
        origin: its name, for messages.
    """

    def __init__(self, text: str, origin: str) -> None:
        self.text, self.origin = text, origin
        self.at, self.line, self._newlines = 0, 1, 0
        self.kind, self.token = "", ""
        self.advance()

    def quoted(self) -> str:
        """Return the text in quotes that stands here, with what `+` adds to it, and step behind it."""
        parts = []
        while True:
            parts.append(self.token[1:-1].replace('\\"', '"').replace("\\\r\n", "").replace("\\\n", ""))
            self.advance()
            if not self.accept("+"):
                return "".join(parts)
            if self.kind != "text":
                self.fail_at_token("a text in quotes must stand behind '+', but")

    def word(self) -> str:
        """Return the next token in lower case if it has no quotes, else an empty text."""
        return self.token.lower() if self.kind == "id" else ""

    def accept_word(self, word: str) -> bool:
        """Step behind the word if it is next; tell whether it was."""
        if self.word() == word:
            self.advance()
            return True
        return False

    def accept(self, sign: str) -> bool:
        """Step behind the sign if it is next; tell whether it was."""
        if self.kind == "sign" and self.token == sign:
            self.advance()
            return True
        return False

    def expect(self, sign: str) -> None:
        """Step behind the sign, which must be next."""
        if not self.accept(sign):
            self.fail_at_token(f"{sign!r} must stand here, but")

    def advance(self) -> None:
        """Step to the next token that is no blank and no comment."""
        self.line += self._newlines
        self._newlines = 0
        while (match := _TOKEN.match(self.text, self.at)) is not None:
            self.kind, self.token = str(match.lastgroup), match.group()
            self.at = match.end() if self.kind != "markup" else self._closing(match.start())
            if self.kind == "blank":
                self.line += self.token.count("\n")
                continue
            if self.kind == "markup":
                self.token = self.text[match.start() : self.at]
            self._newlines = self.token.count("\n")
            return
        self.kind, self.token = "end" if self.at == len(self.text) else "strange", ""

    def _closing(self, start: int) -> int:
        depth = 0
        for match in _ANGLE.finditer(self.text, start):
            depth += 1 if match.group() == "<" else -1
            if not depth:
                return match.end()
        return self.fail("a text in <> must end with >, but the one that starts here does not")

    def fail_at_token(self, rule: str) -> NoReturn:
        """Refuse the next token: `rule` says what must stand in its place."""
        if self.kind == "end":
            self.fail(f"{rule} here is the end of the file")
        start = self.at - len(self.token)
        shown = self.text[start : start + 20].partition("\n")[0]
        if self.kind == "strange" and shown[:1] == '"':
            self.fail("a text must end with a quote, but the one that starts here does not")
        if self.kind == "strange" and shown[:2] == "/*":
            self.fail("a comment must end with */, but the one that starts here does not")
        self.fail(f"{rule} here is {shown!r}")

    def fail(self, rule: str, remedy: str = "") -> NoReturn:
        """Refuse what stands in this line."""
        raise BadModel(f"{self.origin}:{self.line}", rule, remedy, slug="dot-graph")

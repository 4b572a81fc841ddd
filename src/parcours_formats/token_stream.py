"""The tokenizer that the readers of DOT, JSON and PICT's constraints share; each token knows its line."""

from __future__ import annotations

import re
from typing import ClassVar, NoReturn

from parcours.errors import BadModel, ParcoursError


class TokenStream:
    """The tokens of one text, read one after the other; `kind` and `token` are those of the next one.

    `kind` is the name of a group of `pattern`, `end`, or `strange` where nothing matches; blanks are skipped.
    """

    pattern: ClassVar[re.Pattern[str]]
    slug: ClassVar[str]
    quoted_kind: ClassVar[str] = "text"
    error: ClassVar[type[ParcoursError]] = BadModel

    def __init__(self, text: str, origin: str, line: int = 1) -> None:
        self.text, self.origin, self.line = text, origin, line
        self.at, self.kind, self.token = 0, "", ""
        self.advance()

    def advance(self) -> None:
        """Step to the next token."""
        self.line += self.token.count("\n")
        while (match := self.pattern.match(self.text, self.at)) is not None:
            self.at, self.kind, self.token = match.end(), str(match.lastgroup), match.group()
            if self.kind != "blank":
                return
            self.line += self.token.count("\n")
        self.kind, self.token = "end" if self.at == len(self.text) else "strange", ""

    def accept(self, sign: str) -> bool:
        """Step behind the sign if it is next; return whether it was."""
        if self.kind == "sign" and self.token == sign:
            self.advance()
            return True
        return False

    def expect(self, sign: str) -> None:
        """Step behind the sign, which must be next."""
        if not self.accept(sign):
            self.fail_at_token(f"{sign!r} must stand here, but")

    def fail_at_token(self, rule: str) -> NoReturn:
        """Refuse the next token: `rule` says what must stand in its place."""
        if self.kind == "end":
            self.fail(f"{rule} here is the end of the file")
        start = self.at - len(self.token)
        shown = self.text[start : start + 20].partition("\n")[0]
        if self.kind == "strange" and shown[:1] == '"':
            self.fail(f"a {self.quoted_kind} must end with a quote, but the one that starts here does not")
        if self.kind == "strange" and shown[:2] == "/*":
            self.fail("a comment must end with */, but the one that starts here does not")
        self.fail(f"{rule} here is {shown!r}")

    def fail(self, rule: str, remedy: str = "", slug: str = "") -> NoReturn:
        """Refuse what stands in this line."""
        raise self.error(f"{self.origin}:{self.line}", rule, remedy, slug=slug or self.slug)

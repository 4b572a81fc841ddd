"""The tokenizer of JavaScript and UPPAAL's C; it says what cannot be translated, and where that stands."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal, NoReturn, TypeAlias, TypeVar

from parcours.errors import BadModel
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.expression.tokens import pointed_at

Language: TypeAlias = Literal["javascript", "uppaal"]
_T = TypeVar("_T")

MAX_LENGTH = 2_000_000
"""Longest text of declarations, a script or a label [characters]."""

MAX_DEPTH = 60
"""Deepest nesting of a foreign expression."""

_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\n\f\v\u00a0\ufeff]+|//[^\n]*|/\*.*?\*/)
      | (?P<open>/\*)
      | (?P<real>(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[0-9]+[eE][+-]?[0-9]+)
      | (?P<int>0[xX][0-9a-fA-F]+|[0-9]+)
      | (?P<name>[A-Za-z_$][A-Za-z0-9_$]*)
      | (?P<text>'(?:[^'\\\n]|\\.)*'|"(?:[^"\\\n]|\\.)*")
      | (?P<sign>>>>=|===|!==|>>>|<<=|>>=|\*\*=|&&=|\|\|=|\?\?=|\.\.\.|:=|==|!=|<=|>=|&&|\|\||\+\+|--|\+=|-=|\*=|/=
          |%=|&=|\|=|\^=|<<|>>|<\?|>\?|->|=>|\*\*|\?\?|\?\.|[-+*/%<>!().,;:?=&|^~{}\[\]@#'`])""",
    re.VERBOSE | re.DOTALL,
)
_ESCAPE = re.compile(r"\\(?:u(?P<unit>[0-9a-fA-F]{4})|(?P<sign>.))", re.DOTALL)
_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "\\": "\\", "'": "'", '"': '"', "/": "/"}

_SIGNS = {
    **dict.fromkeys(
        ("&", "|", "^", "~", "&=", "|=", "^=", "<<", ">>", ">>>", "<<=", ">>=", ">>>="), "the bit operator {}"
    ),
    **dict.fromkeys(("**", "**=", "??", "??=", "?.", "...", "&&=", "||=", "->"), "the operator {}"),
    **dict.fromkeys(("++", "--"), "{} inside an expression"),
    **dict.fromkeys(("=", ":="), "an assignment inside an expression"),
    "=>": "a function",
    "{": "an object",
    "[": "a list",
    "'": "a derivative (rate of a clock)",
    "`": "a text template",
}
_LOOPS = dict.fromkeys(("for", "while", "do"), "the loop {}")
_JAVASCRIPT_WORDS = (
    "function return class async await yield switch try throw new typeof instanceof delete void in this with"
)
_WORDS = {
    "javascript": {
        **_LOOPS,
        **dict.fromkeys(_JAVASCRIPT_WORDS.split(), "{}"),
        **dict.fromkeys(("null", "undefined", "NaN", "Infinity"), "the value {}"),
    },
    # `switch`, `deadlock` and `numOf` are names inside a system.
    "uppaal": {**_LOOPS, **dict.fromkeys(("return", "spawn", "exit", "xor"), "{}")},
}


@dataclass(frozen=True, slots=True)
class ForeignToken:
    """One token: its kind, its text and the offset where it starts. `fresh` tells that a line ended before it."""

    kind: str
    text: str
    at: int
    fresh: bool = False


class ForeignTokens:
    """The tokens of one text, read one after the other."""

    def __init__(self, text: str, language: Language, where: str, line: int = 0) -> None:
        self.text, self.language, self.origin, self.line = text, language, where, line
        self.position = 0
        self._words = _WORDS[language]
        self._breaks: list[int] = []
        self._all = [ForeignToken("end", "", len(text))]
        if len(text) > MAX_LENGTH:
            rule = f"a foreign text has at most {MAX_LENGTH} characters, but this one has {len(text)}"
            raise BadModel(self.where(), rule, "split it", slug="expression-size")
        self._all = [*self._split(), *self._all]

    @property
    def token(self) -> ForeignToken:
        """The next token; its kind is `end` behind the last one."""
        return self._all[self.position]

    def ahead(self, steps: int) -> ForeignToken:
        """Return the token that many steps behind the next one."""
        return self._all[min(self.position + steps, len(self._all) - 1)]

    def where(self, token: ForeignToken | None = None) -> str:
        """Return the place of a token, or of the next one, for a message."""
        at = (token or self.token).at
        return f"{self.origin}:{self.line_at(at)}" if self.line else self.origin

    def line_at(self, at: int) -> int:
        """Return the line of an offset."""
        if not self._breaks:
            self._breaks = [match.start() for match in re.finditer("\n", self.text)] or [len(self.text)]
        return self.line + bisect_left(self._breaks, at)

    def is_at_start(self) -> bool:
        """Return whether a line ended before the next token, or a block or statement did."""
        return self.token.fresh or self._all[self.position - 1].text in ("}", ";")

    def accept(self, sign: str) -> bool:
        """Take the next token if it is the sign or word; return whether it was."""
        if self.token.text == sign:
            self.position += 1
            return True
        return False

    def expect(self, sign: str) -> None:
        """Take the next token, which must be the sign."""
        if not self.accept(sign):
            self.fail(repr(sign))

    def listed(self, part: Callable[[], _T], closing: str = "") -> list[_T]:
        """Take parts with commas between them, up to a closing sign or the end."""
        found: list[_T] = []
        while not (self.accept(closing) if closing else self.token.kind == "end"):
            if found:
                self.expect(",")
            found.append(part())
        return found

    def name(self, wanted: str) -> str:
        """Take the next token, which must be a name, and return it."""
        token = self.token
        if token.kind != "name" or token.text in self._words:
            self.fail(wanted)
        self.position += 1
        return token.text

    def value(self, token: ForeignToken) -> int | float | str:
        """Return the constant that a token stands for."""
        if token.kind == "text":
            return self._unquoted(token)
        # Digits are counted first: converting a very long one costs quadratic time.
        if token.kind == "int" and len(token.text.lstrip("0")) <= 19:
            number = int(token.text, 16 if token.text[:2] in ("0x", "0X") else 10)
            if number <= INTEGER_LIMIT:
                return number
        elif token.kind == "real" and isfinite(float(token.text)):
            return float(token.text)
        return self._fail_at(token, f"a number must fit 64 bits, but {token.text[:24]} does not,", "overflow")

    def _unquoted(self, token: ForeignToken) -> str:
        def plain(match: re.Match[str]) -> str:
            if match["unit"] is not None:
                return chr(int(match["unit"], 16))
            return _ESCAPES.get(match["sign"]) or self.refuse(f"the escape {match[0]!r}")

        text = _ESCAPE.sub(plain, token.text[1:-1])
        try:
            return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le")  # \\ud83d\\ude00 is one sign
        except UnicodeDecodeError:
            return self._fail_at(token, "a text must have whole characters, but this one has halves", "encoding")

    def refuse(self, what: str, remedy: str = "") -> NoReturn:
        """Raise the refusal of something that cannot be translated, at the next token."""
        rule = f"only arithmetic, comparisons and assignments are translated, but here is {what} at the caret"
        self._fail_at(self.token, rule, "foreign-construct", remedy)

    def fail(self, wanted: str) -> NoReturn:
        """Raise the complaint that something else was expected, or the refusal of what stands there."""
        token = self.token
        if what := (_SIGNS if token.kind == "sign" else self._words if token.kind == "name" else {}).get(token.text):
            self.refuse(what.format(repr(token.text)))
        found = "the end" if token.kind == "end" else repr(token.text[:40])
        self._fail_at(token, f"{wanted} must stand at the caret, but found {found}", "foreign-syntax")

    def too_deep(self) -> NoReturn:
        """Raise the complaint that the text nests too deep."""
        rule = f"a foreign expression nests at most {MAX_DEPTH} deep, but this one goes deeper at the caret,"
        self._fail_at(self.token, rule, "expression-size")

    def _fail_at(self, token: ForeignToken, rule: str, slug: str, remedy: str = "") -> NoReturn:
        raise BadModel(self.where(token), f"{rule} in {pointed_at(self.text, token.at)}", remedy, slug=slug)

    def _split(self) -> list[ForeignToken]:
        found, at, fresh = [], 0, False
        while at < len(self.text):
            match = _TOKEN.match(self.text, at)
            if match is None or match.lastgroup == "open":
                rule = f"a sign of the language must stand at the caret, but found {self.text[at]!r}"
                self._fail_at(ForeignToken("sign", self.text[at], at), rule, "foreign-syntax")
            if match.lastgroup == "blank":
                fresh = fresh or "\n" in match.group()
            else:
                found.append(ForeignToken(str(match.lastgroup), match.group(), at, fresh))
                fresh = False
            at = match.end()
        return found

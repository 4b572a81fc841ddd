"""JSON text to a tree of nodes that know their lines, for files that may be hostile.

As GraphWalker's own reader, it takes `//` and `/* */` for comments and lets strings run over lines. Doubled keys,
NaN and what is too large or too deep are refused. The nodes are those of `documents`; a scalar that is not `plain` is
a string.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import NoReturn

from parcours.errors import BadModel
from parcours.model.conversion import MAX_BYTES
from parcours.model.documents import Mapping, Node, Scalar, Sequence

MAX_DEPTH = 50
"""Deepest nesting of lists and objects."""

_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\n\ufeff]+ | //[^\n]* | /\*[^*]*\*+(?:[^/*][^*]*\*+)*/)
      | (?P<string>"[^"\\]*(?:\\.[^"\\]*)*")
      | (?P<plain>-?[0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?(?![A-Za-z0-9_.]) | (?:true|false|null)\b)
      | (?P<sign>[\[\]{},:])""",
    re.VERBOSE | re.DOTALL,
)


@dataclass(slots=True)
class _Open:
    """A list or object whose end was not met yet."""

    line: int
    keys: dict[str, Scalar] | None
    values: list[Node]

    def closed(self) -> Node:
        if self.keys is None:
            return Sequence(tuple(self.values), self.line)
        return Mapping(tuple(zip(self.keys.values(), self.values, strict=True)), self.line)


def parse_json(text: str, origin: str) -> Node:
    """Return the only value of a JSON text.

    Args:
        text: JSON with comments; at most MAX_BYTES characters.
        origin: the file's name, for messages.

    Raises:
        BadModel: the text is no JSON, nests deeper than MAX_DEPTH, or has a key twice in one object.

    Example:
    >>> node = parse_json('/* head */ {"a": [1, "x // y"]}', "here")
    >>> [(key.text, [item.text for item in value.items]) for key, value in node.items]
    [('a', ['1', 'x // y'])]
    >>> parse_json('{"a": NaN}', "here")
    Traceback (most recent call last):
    parcours.errors.BadModel: here:1: a value must stand in JSON, but here is 'NaN}' [json-syntax]
    """
    if len(text) > MAX_BYTES:
        rule = f"a file of this format has at most {MAX_BYTES} characters, but this one has {len(text)}"
        raise BadModel(origin, rule, "split the model", slug="file-size")
    return _Parser(text, origin).value()


class _Parser:
    def __init__(self, text: str, origin: str) -> None:
        self.text, self.origin = text, origin
        self.at, self.line, self.kind, self.token = 0, 1, "", ""

    def value(self) -> Node:
        """Walks over the text without recursion; `path` holds what is open."""
        path: list[_Open] = []
        self.advance()
        while True:
            node: Node | None = None
            if self.kind == "sign" and self.token in "[{":
                path.append(_Open(self.line, {} if self.token == "{" else None, []))
                if len(path) > MAX_DEPTH:
                    self.fail(f"JSON nests at most {MAX_DEPTH} deep here, but goes deeper", "json-size")
                self.advance()
                if not self.closing(path[-1]):
                    self.key(path[-1])
                    continue
            elif self.kind in ("plain", "string"):
                node = self.scalar()
                self.advance()
            else:
                self.fail_at_token("a value must stand in JSON, but")
            # What ended here may end what holds it.
            while True:
                if node is None:
                    node = path.pop().closed()
                    self.advance()
                if not path:
                    if self.kind != "end":
                        self.fail_at_token("a file holds one value, but behind it")
                    return node
                path[-1].values.append(node)
                if self.closing(path[-1]):
                    node = None
                    continue
                if self.token != "," or self.kind != "sign":
                    self.fail_at_token("a comma or the end of the list or object must stand in JSON, but")
                self.advance()
                self.key(path[-1])
                break

    def closing(self, holder: _Open) -> bool:
        return self.kind == "sign" and self.token == ("]" if holder.keys is None else "}")

    def key(self, holder: _Open) -> None:
        if holder.keys is None:
            return
        if self.kind != "string":
            self.fail_at_token("a key in quotes must stand in JSON, but")
        key = self.scalar()
        if key.text in holder.keys:
            first = holder.keys[key.text].line
            self.fail(f"an object has each key once, but {key.text[:60]!r} was used in line {first}", "duplicate-key")
        holder.keys[key.text] = key
        self.advance()
        if self.kind != "sign" or self.token != ":":
            self.fail_at_token("a colon must stand behind a key in JSON, but")
        self.advance()

    def scalar(self) -> Scalar:
        if self.kind == "plain":
            return Scalar(self.token, True, self.line)
        if "\\" not in self.token:
            return Scalar(self.token[1:-1], False, self.line)
        try:
            text = json.loads(self.token, strict=False)
            text.encode()
        except ValueError:
            self.fail("a string must have known escapes and whole characters, but this one has not")
        return Scalar(text, False, self.line)

    def advance(self) -> None:
        """Step to the next token that is no blank and no comment."""
        self.line += self.token.count("\n")
        while (match := _TOKEN.match(self.text, self.at)) is not None:
            self.at, self.kind, self.token = match.end(), str(match.lastgroup), match.group()
            if self.kind != "blank":
                return
            self.line += self.token.count("\n")
        self.kind, self.token = "end" if self.at == len(self.text) else "strange", ""

    def fail_at_token(self, rule: str) -> NoReturn:
        if self.kind == "end":
            self.fail(f"{rule} here is the end of the file")
        start = self.at - len(self.token)
        shown = self.text[start : start + 20].partition("\n")[0]
        if shown[:1] == '"' and self.kind == "strange":
            self.fail("a string must end with a quote, but the one that starts here does not")
        if shown[:2] == "/*":
            self.fail("a comment must end with */, but the one that starts here does not")
        self.fail(f"{rule} here is {shown!r}")

    def fail(self, rule: str, slug: str = "json-syntax") -> NoReturn:
        raise BadModel(f"{self.origin}:{self.line}", rule, slug=slug)

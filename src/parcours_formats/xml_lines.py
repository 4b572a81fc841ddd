"""Parses XML that may be hostile into a tree of elements that know their lines.

No entity is declared or fetched, nothing outside the text is read, and size, depth and count are bounded. A
document type may be named, as UPPAAL's files do, but it is not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat

from parcours.errors import BadModel

MAX_DEPTH = 100
"""Deepest nesting of elements, so that every later walk over the tree may recurse."""

MAX_ELEMENTS = 500_000
"""Most elements of one file."""


@dataclass(slots=True)
class Element:
    """One element: its local name, prefix, attributes by local name, own text, children and line.

    `text` is the text before, between and after the children, joined; `text_line` is the line where it starts.
    """

    tag: str
    prefix: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    text_line: int = 0
    children: list[Element] = field(default_factory=list)

    def get(self, name: str, absent: str = "") -> str:
        """Return an attribute, or `absent`."""
        return self.attributes.get(name, absent)

    def all(self, *tags: str) -> Iterator[Element]:
        """Yield the children with one of the tags, in the order of the file."""
        return (child for child in self.children if child.tag in tags)

    def first(self, *tags: str) -> Element | None:
        """Return the first child with one of the tags, or None."""
        return next(self.all(*tags), None)

    def walk(self) -> Iterator[Element]:
        """Yield the element and all below it, outermost first, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()


def parse_xml(text: str, origin: str) -> Element:
    """Return the root element of an XML text.

    >>> root = parse_xml("<a>\\n <b x='1'>t &lt; 2</b>\\n</a>", "here")
    >>> [(child.tag, child.line, child.get("x"), child.text) for child in root.children]
    [('b', 2, '1', 't < 2')]
    >>> parse_xml("<!DOCTYPE a [<!ENTITY b 'c'>]>\\n<a>&b;</a>", "here")
    Traceback (most recent call last):
    parcours.errors.BadModel: here:1: an XML file declares no entities, but here is 'b'; write it out [xml-entity]
    """
    return _Builder(text, origin).root


class _Builder:
    def __init__(self, text: str, origin: str) -> None:
        self.origin, self.count = origin, 0
        self.path: list[Element] = []
        self.texts: list[list[str]] = []
        self.parser = parser = expat.ParserCreate("utf-8")
        parser.StartElementHandler = self.start
        parser.EndElementHandler = self.end
        parser.CharacterDataHandler = self.characters
        # Entities are how XML grows without bounds or reads other files: none is accepted, wherever it comes from.
        parser.EntityDeclHandler = lambda name, *_: self.entity(name)
        parser.SkippedEntityHandler = lambda name, _: self.entity(name)
        parser.ExternalEntityRefHandler = lambda context, *_: self.entity(context)
        self.roots: list[Element] = []
        try:
            parser.Parse(text.encode(), True)
        except expat.ExpatError as error:
            said = expat.ErrorString(error.code)
            raise BadModel(f"{origin}:{error.lineno}", f"must be XML, but: {said}", slug="xml-syntax") from None
        except UnicodeEncodeError:
            raise BadModel(origin, "must be text, but has half characters", slug="encoding") from None
        (self.root,) = self.roots  # expat refuses a document with no root or with two

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self.count += 1
        line = self.parser.CurrentLineNumber
        if len(self.path) >= MAX_DEPTH:
            self.refuse(f"an XML file nests at most {MAX_DEPTH} deep, but here it goes deeper", "xml-size")
        if self.count > MAX_ELEMENTS:
            self.refuse(f"an XML file has at most {MAX_ELEMENTS} elements, but here are more", "xml-size")
        prefix, _, tag = name.rpartition(":")
        element = Element(tag, prefix, {key.rpartition(":")[2]: value for key, value in attributes.items()}, line)
        if self.path:
            self.path[-1].children.append(element)
        else:
            self.roots.append(element)
        self.path.append(element)
        self.texts.append([])

    def end(self, _: str) -> None:
        self.path.pop().text = "".join(self.texts.pop())

    def characters(self, text: str) -> None:
        # A text comes in pieces, to be joined at the end of the element; the first one tells where it starts.
        if not self.texts[-1]:
            self.path[-1].text_line = self.parser.CurrentLineNumber
        self.texts[-1].append(text)

    def entity(self, name: str | None) -> NoReturn:
        rule = f"an XML file declares no entities, but here is {(name or '')[:40]!r}"
        self.refuse(rule, "xml-entity", "write it out")

    def refuse(self, rule: str, slug: str, remedy: str = "") -> NoReturn:
        raise BadModel(f"{self.origin}:{self.parser.CurrentLineNumber}", rule, remedy, slug=slug)

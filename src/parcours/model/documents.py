"""Parses YAML, which may be hostile, into a tree of nodes that know their lines.

Only plain data passes: no anchors, aliases or tags, no duplicate keys, bounded size and nesting. Scalars stay
text; who reads a node says what kind of value it wants there, so that a state may be called `on` or `1`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NoReturn

import yaml

from parcours.model.finding import Finding

MAX_BYTES = 1_000_000
"""Largest model file [bytes]."""

MAX_NESTING = 32
"""Deepest nesting of lists and mappings."""


@dataclass(frozen=True, slots=True)
class Scalar:
    """A single value, as its text. `plain` tells that it stood without quotes."""

    text: str
    plain: bool
    line: int


@dataclass(frozen=True, slots=True)
class Sequence:
    """A list of nodes."""

    items: tuple[Node, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Mapping:
    """Keys with their nodes, in the order of the file."""

    items: tuple[tuple[Scalar, Node], ...]
    line: int


_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml is 25 times as fast, where PyYAML has it

Node = Scalar | Sequence | Mapping


class _RefusalError(Exception):
    """Ends reading early; `finding` says why."""

    def __init__(self, finding: Finding) -> None:
        self.finding = finding
        super().__init__(str(finding))


def read_document(text: str, origin: str, noun: str = "a model") -> tuple[Node | None, list[Finding]]:
    """Return the document as a tree, or None if it cannot be one, and what is wrong with it as YAML.

    Args:
        text: YAML, one document.
        origin: the file's name, for messages.
        noun: what messages call the document.
    """
    builder = _Builder(origin, noun)
    try:
        return builder.document(yaml.parse(_sized(text, origin, noun), Loader=_LOADER)), builder.findings
    except _RefusalError as refusal:
        return None, [refusal.finding]
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        said = " ".join(part for part in (error.context, error.problem) if part)
        line = mark.line + 1 if mark else 0
    except (yaml.YAMLError, ValueError) as error:
        said, line = str(error).partition("\n")[0], 0
    rule = f"{noun} must be YAML, but this is not: {said}"
    return None, [Finding(origin, line, "error", "yaml-syntax", rule)]


def _sized(text: str, origin: str, noun: str) -> str:
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        raise _refusal(origin, 0, "encoding", f"{noun} must be text, but this has half characters") from None
    if size > MAX_BYTES:
        rule = f"{noun} file has at most {MAX_BYTES} bytes, but this one has {size}"
        raise _refusal(origin, 0, "file-size", rule, "split the model")
    return text


def _refusal(origin: str, line: int, slug: str, rule: str, remedy: str = "") -> _RefusalError:
    return _RefusalError(Finding(origin, line, "error", slug, rule, remedy))


def _line(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 0


class _Builder:
    """Parser events to nodes, without recursion into aliases: there are none."""

    def __init__(self, origin: str, noun: str) -> None:
        self.origin, self.noun = origin, noun
        self.findings: list[Finding] = []

    def document(self, events: Iterator[yaml.Event]) -> Node:
        root: Node | None = None
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent) and root is not None:
                self.refuse(event, "several-documents", "a file holds one document, but here a second starts")
            if isinstance(event, yaml.NodeEvent):
                root = self.node(event, events, 1)
        if root is None:
            raise _refusal(self.origin, 0, "empty", f"{self.noun} must have content, but the file is empty")
        return root

    # Events, not yaml.load: an alias bomb is refused at its first alias, and a duplicate key is seen before it is lost.
    def node(self, event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Node:
        line = _line(event)
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            name = getattr(event, "anchor", "")
            self.refuse(
                event, "yaml-alias", f"{self.noun} has no anchors or aliases, but here is {name!r}", "write it out"
            )
        tag = getattr(event, "tag", None)
        if tag is not None:
            self.refuse(event, "yaml-tag", f"{self.noun} has no tags, but here is {tag!r}", "delete the tag")
        if depth > MAX_NESTING:
            self.refuse(event, "yaml-nesting", f"{self.noun} nests at most {MAX_NESTING} deep, but here it goes deeper")
        if isinstance(event, yaml.ScalarEvent):
            return Scalar(event.value, event.style in (None, ""), line)
        if isinstance(event, yaml.SequenceStartEvent):
            items = []
            while not isinstance(inner := next(events), yaml.SequenceEndEvent):
                items.append(self.node(inner, events, depth + 1))
            return Sequence(tuple(items), line)
        return self.mapping(events, line, depth)

    def mapping(self, events: Iterator[yaml.Event], line: int, depth: int) -> Mapping:
        pairs: dict[str, tuple[Scalar, Node]] = {}
        while not isinstance(inner := next(events), yaml.MappingEndEvent):
            key = self.node(inner, events, depth + 1)
            if not isinstance(key, Scalar):
                self.refuse(inner, "yaml-key", "a key must be a word, but here is a list or mapping")
            value = self.node(next(events), events, depth + 1)
            if key.text in pairs:
                rule = f"a key must be unique, but {key.text!r} stands in line {pairs[key.text][0].line} already"
                self.findings.append(Finding(self.origin, key.line, "error", "duplicate-key", rule, "rename one"))
            else:
                pairs[key.text] = (key, value)
        return Mapping(tuple(pairs.values()), line)

    def refuse(self, event: yaml.Event, slug: str, rule: str, remedy: str = "") -> NoReturn:
        raise _refusal(self.origin, _line(event), slug, rule, remedy)

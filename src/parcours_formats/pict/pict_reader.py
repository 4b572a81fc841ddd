"""Reads a PICT model as an input model: parameters, sub-models, constraints (after PICT's user guide).

    PLATFORM: x86, arm64 (5), ~mips        ~ marks values of negative tests; weights in brackets are not kept
    BITS, 32, 64                           the same with a comma; where the line has a colon, that one counts
    SIZE: 10, 100, <OTHER>                 numbers only: a parameter of numbers; <OTHER>: the values of that parameter
    { PLATFORM, SIZE } @ 2                 a strength of their own
    IF [PLATFORM] = "x86" THEN [SIZE] < 100 ELSE [SIZE] > 10;

Texts compare without regard to case. A file may be hostile: its size, columns, values and terms are limited, it is
read in one pass, and the first error is reported with its line.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from parcours.data.blocks import Block, point
from parcours.data.domains import Domain
from parcours.data.formats import DataReading
from parcours.data.inputs import Group, InputModel
from parcours.data.schema import MAX_COLUMNS, MAX_STRENGTH
from parcours.errors import BadDomain, BadModel, one_of
from parcours.model.conversion import text_of
from parcours.model.nodes import brief, is_identifier, is_label
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames
from parcours_formats.pict.constraints import PictParameter, constraints_in

MAX_BYTES = 1_000_000
"""Largest PICT file [bytes]."""

MAX_VALUES = 10_000
"""Most values of all parameters of a file together."""

_WEIGHT = re.compile(r"\(\s*[0-9]{1,9}\s*\)$")
_NUMBER = re.compile(r"[-+]?(?:[0-9]{1,19}(?:\.[0-9]{0,19})?|\.[0-9]{1,19})(?:[eE][-+]?[0-9]{1,3})?", re.ASCII)
_ORDER = re.compile(r"([^@]*)@\s*([0-9]{1,9})")
_GROUP = re.compile(r"\{([^{}]*)\}(?:\s*@\s*([0-9]{1,9}))?")
_CONSTRAINT = re.compile(r"(?:IF|NOT|IsNegative|IsPositive)\b(?!\s*[:,@])|[\[(]", re.IGNORECASE)

CROSSED = "PICT crosses whole rows of a sub-model with other values; here it is a group of mixed strength"
"""How a sub-model of PICT differs from a group, in both directions."""


def read_pict(path: Path | str) -> DataReading:
    """Return the input model of a PICT file. Raises BadDomain if the file cannot be read, and as `parse_pict`."""
    try:
        text = text_of(Path(path), MAX_BYTES)
    except BadModel as error:
        raise BadDomain(error.where, error.rule, error.remedy, slug=error.slug) from None
    return parse_pict(text, str(path))


def parse_pict(text: str, origin: str) -> DataReading:
    """Return the input model of a PICT text. Raises BadDomain, with the line, if it is not one.

    >>> reading = parse_pict('''
    ... TYPE: single, span, ~broken
    ... SIZE: 10, 100
    ... IF [TYPE] = "Span" THEN [SIZE] >= 100;
    ... ''', "disk.pict")
    >>> reading.model.names, reading.model.sizes, [str(rule) for rule in reading.model.constraints]
    (('TYPE', 'SIZE'), (2, 2), ["line_4: !(TYPE == 'span') || SIZE >= 100"])
    """
    if len(text.encode("utf-8", "replace")) > MAX_BYTES:
        raise BadDomain(origin, f"a PICT model has at most {MAX_BYTES} bytes, but this one has more", slug="file-size")
    return _Reader(text, origin).reading()


class _Reader:
    """One reading; `fail` ends it."""

    def __init__(self, text: str, origin: str) -> None:
        self.lines = text.lstrip("\ufeff").splitlines()
        self.origin = origin
        self.parameters: dict[str, PictParameter] = {}  # by folded PICT name
        self.groups: list[Group] = []
        self.losses, self.names = Losses(), UniqueNames(("pi",))
        self.line = 0
        self.n_values = 0

    def reading(self) -> DataReading:
        rest = len(self.lines)
        for index, raw in enumerate(self.lines):
            self.line, line = index + 1, raw.strip()
            if not line or line.startswith("#"):
                continue
            if _CONSTRAINT.match(line):
                rest = index
                break
            if line.startswith("{"):
                self.group(line)
            else:
                self.parameter(line)
        if not self.parameters:
            self.fail("a PICT model must have a parameter, but has none", slug="parameters-none")
        domains = tuple(parameter.domain for parameter in self.parameters.values())
        text = "\n".join("" if line.lstrip().startswith("#") else line for line in self.lines[rest:])
        constraints = constraints_in(text, rest + 1, self.origin, self.parameters)
        name = re.sub(r"\.\w+$", "", Path(self.origin).name) or "pict"
        model = InputModel(name, domains, tuple(constraints), self.origin, groups=tuple(self.groups))
        titles = tuple(parameter.title for parameter in self.parameters.values())
        return DataReading(model, tuple(self.losses), titles)

    def parameter(self, line: str) -> None:
        title, _, listed = line.partition(":" if ":" in line else ",")
        title = title.strip()
        if order := _ORDER.fullmatch(title):
            title = order[1].strip()
            self.losses.add(f"parameter {title[:60]!r}", self.line, f"its own order {order[2]} is not kept")
        if not title or not listed.strip():
            rule = f"a parameter must be written NAME: value, value or NAME, value, value, but this is {brief(line)}"
            self.fail(rule, slug="pict-syntax")
        if title.casefold() in self.parameters:
            self.fail(f"a parameter must be named once, but {brief(title)} is twice", slug="duplicate-name")
        if len(self.parameters) >= MAX_COLUMNS:
            self.fail(f"a model has at most {MAX_COLUMNS} parameters, but this one has more", slug="columns")
        if title.startswith("$"):
            what = "a result parameter is combined like any other here"
            self.losses.add(f"parameter {title[:60]!r}", self.line, what)
        valid, invalid = self.values(title, listed)
        name = self.name(title)
        words = valid + invalid
        is_number = all(_NUMBER.fullmatch(word) and math.isfinite(float(word)) for word in words)
        try:
            domain = _numbers(name, valid, invalid) if is_number else _words(name, valid, invalid)
        except BadDomain as error:
            self.fail(f"{error.where}: {error.rule}", error.remedy, slug=error.slug)
        self.parameters[title.casefold()] = PictParameter(title, domain, is_number)

    def values(self, title: str, listed: str) -> tuple[list[str], list[str]]:
        """Return valid and invalid values of a parameter, each once."""
        valid: dict[str, str] = {}
        invalid: dict[str, str] = {}
        for item in listed.split(","):
            item = item.strip()
            if item.startswith("<") and item.endswith(">"):
                found = self.of(item[1:-1].strip())
            else:
                found = [self.value(title, item)]
            for word, is_negative in found:
                self.n_values += 1
                if self.n_values > MAX_VALUES:
                    self.fail(f"a model has at most {MAX_VALUES} values, but this one has more", slug="values-many")
                if word.casefold() in valid or word.casefold() in invalid:
                    self.fail(f"a value of {title!r} must be listed once, but {word!r} is twice", slug="values-double")
                (invalid if is_negative else valid)[word.casefold()] = word
        if not valid:
            self.fail(f"{title!r} must have a value that is not negative, but has none", slug="blocks-none")
        return list(valid.values()), list(invalid.values())

    def value(self, title: str, item: str) -> tuple[str, bool]:
        """Return a value without marks, and whether it is for negative tests; note what is left out."""
        where = f"parameter {title!r}"
        is_negative = item.startswith("~")
        word = item[1:].strip() if is_negative else item
        if _WEIGHT.search(word):
            word = _WEIGHT.sub("", word).strip()
            self.losses.add(where, self.line, f"the weight of {word!r} is not kept")
        word, *others = [part.strip() for part in word.split("|")]
        if others:
            self.losses.add(where, self.line, f"of the aliases of {word!r} only that one is kept")
        if not is_label(word):
            self.fail(f"a value must be 1 to 200 printable characters, but one is {brief(word)}", slug="name")
        return word, is_negative

    def of(self, title: str) -> list[tuple[str, bool]]:
        """Return the values of a parameter that another one takes over, and whether each is for negative tests."""
        found = self.parameters.get(title.casefold())
        if found is None:
            known = one_of(title[:60], [each.title for each in self.parameters.values()][:20])
            self.fail(f"<{title[:60]}> must name a parameter above it, but names none", known, slug="unknown-name")
        return [(label, place >= len(found.domain.blocks)) for place, label in enumerate(found.domain.labels)]

    def name(self, title: str) -> str:
        """Return a name that rules can say, different from all others."""
        name = title if is_identifier(title) else re.sub(r"[^A-Za-z0-9_]+", "_", title).strip("_")[:60]
        name = name if is_identifier(name) else f"p_{name}"
        unique = self.names.label(name)
        if unique != title:
            self.losses.add(f"parameter {title[:60]!r}", self.line, f"it is called {unique} here")
        return unique

    def group(self, line: str) -> None:
        parts = _GROUP.fullmatch(line)
        if not parts:
            self.fail(f"a sub-model must be written {{ A, B }} @ 2, but this is {brief(line)}", slug="pict-syntax")
        titles = [title.strip() for title in parts[1].split(",")]
        known = [self.parameters.get(title.casefold()) for title in titles]
        names = tuple(parameter.domain.name for parameter in known if parameter)
        if len(names) < len(titles) or len(set(names)) < len(names):
            self.fail(f"a sub-model must name parameters, each once, but this is {brief(line)}", slug="group")
        strength = int(parts[2] or min(2, len(names)))
        if not 1 <= strength <= min(len(names), MAX_STRENGTH):
            most = min(len(names), MAX_STRENGTH)
            self.fail(f"the order of this sub-model must be 1 to {most}, but is {strength}", slug="group")
        if len(names) > 1:
            self.losses.add(f"sub-model of {len(names)} parameters", self.line, CROSSED)
        self.groups.append(Group(names, strength))

    def fail(self, rule: str, remedy: str = "", *, slug: str) -> NoReturn:
        raise BadDomain(f"{self.origin}:{self.line}", rule, remedy, slug=slug)


def _numbers(name: str, valid: list[str], invalid: list[str]) -> Domain:
    """Return a parameter of numbers, ascending; base choice starts from the one that the file lists first."""
    blocks = tuple(point(value) for value in sorted(float(word) for word in valid))
    is_whole = all(float(word).is_integer() for word in valid + invalid)
    base = next(index for index, block in enumerate(blocks) if block.low == float(valid[0]))
    negative = tuple(point(float(word)) for word in invalid)
    return Domain(name, "1", blocks, "integer" if is_whole else "real", invalid=negative, bases=(base,))


def _words(name: str, valid: list[str], invalid: list[str]) -> Domain:
    blocks = [Block(place, place, name=word) for place, word in enumerate(valid + invalid)]
    n = len(valid)
    whole = Domain(name, "1", tuple(blocks[:n]), "enumeration", values=tuple(valid))
    return replace(whole, values=tuple(valid + invalid), invalid=tuple(blocks[n:])) if invalid else whole

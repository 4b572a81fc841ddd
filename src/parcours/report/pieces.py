"""The pieces of a report page: plain data, the same for paper, screen and terminal.

A study composes these; the rest of report/ turns them into HTML (page), text (terminal) and pictures (still).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest

Tone: TypeAlias = Literal["good", "fair", "neutral", "poor", "bad", "worst"]
"""How welcome a value is: one scale, each step with a colour, for cells, findings and slices of charts."""

Side: TypeAlias = Literal["left", "right", "center"]

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Marked:
    """A cell to look at: a value with a tone, and optionally why (shown when pointed at), and where on the page to."""

    value: str | int | float | None
    tone: Tone = "poor"
    why: str = ""
    link: str = ""


Cell: TypeAlias = str | int | float | Marked | None
"""A value in a table; None and NaN stand for what is not known and print as a dash."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        name: its heading.
        format: how its numbers are written, as after the colon of an f-string: ".1%", ".3f", ",d".
        align: auto puts numbers to the right and text to the left.
        group: a heading shared with the neighbours that have the same one.
        unit: of its numbers, shown with the heading.
        code: whether its cells are identifiers, set in a monospace face.
    """

    name: str
    format: str = ""
    align: Side | Literal["auto"] = "auto"
    group: str = ""
    unit: str = ""
    code: bool = False

    @property
    def heading(self) -> str:
        """The name with its unit in brackets.

        >>> Column("clearance", unit="m").heading
        'clearance [m]'
        """
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of values under headings.

    Attributes:
        title: what the table shows.
        columns: its columns.
        rows: one tuple of cells a row, as many as there are columns.
        note: small print below it: source, what is reconstructed; may use the marks of Text.
        folded: whether a page shows only its title until it is opened.
        anchors: of its rows, by which links find them; empty if none does.

    Raises:
        BadRequest: a row has more or fewer cells than there are columns.

    >>> Table("Paths", (Column("path"), Column("length")), (("tp11", 3), ("tp12", 6))).rows[1]
    ('tp12', 6)
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    folded: bool = False
    anchors: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, 1):
            if len(row) != len(self.columns):
                rule = f"it must have one cell a column, {len(self.columns)}, but has {len(row)}"
                raise BadRequest(
                    f"table {self.title!r}, row {number}", rule, "use None for what is not known", slug="table-width"
                )


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing: `svg` is an <svg> element of our own making, so trusted; `alt` says it in words.

    What draws it may be given instead, and is called when it is shown on a page: a terminal shows the words alone.
    """

    title: str
    drawing: str | Callable[[], str]
    alt: str
    note: str = ""

    @property
    def svg(self) -> str:
        """The <svg> element."""
        return self.drawing if isinstance(self.drawing, str) else self.drawing()


@dataclass(frozen=True, slots=True)
class Text:
    """Paragraphs separated by blank lines, with the marks that prose.py knows; all else is shown as it is."""

    body: str


@dataclass(frozen=True, slots=True)
class Code:
    """Lines kept as they are, in a monospace face: a model, a test path, a command."""

    body: str
    title: str = ""
    folded: bool = False


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """One number a reader should take home, what it counts, and what to compare it with."""

    value: str
    label: str
    note: str = ""
    tone: Tone = "neutral"


@dataclass(frozen=True, slots=True)
class Findings:
    """The numbers to take home, side by side."""

    items: tuple[KeyFigure, ...]


@dataclass(frozen=True, slots=True)
class Animation:
    """A recording that a script plays on the page; those that follow each other stand side by side.

    Attributes:
        title: what is shown.
        subtitle: what became of it, in words.
        still: an <svg> element of our own making, so trusted: for paper and for readers without scripts.
        data: what the script plays, as JSON.
        script: JavaScript of our own making, once on the page; it finds `data` in each `figure.replay`.
        note: small print below it.
        anchor: by which a link finds it; empty if none does.
        exports: what writes it for other tools, by the end of a file's name.
        together: whether it plays at the time of those beside it.
    """

    title: str
    subtitle: str
    still: str
    data: str
    script: str
    note: str = ""
    anchor: str = ""
    exports: Mapping[str, Callable[[Path], None]] = field(default_factory=dict, compare=False)
    together: bool = False


@dataclass(frozen=True, slots=True)
class Failing:
    """A case that did not pass, as a row: what happened, and how to see it again.

    Attributes:
        id: of the case.
        verdict: fail, error or inconclusive.
        why: the reason, a sentence.
        values: a figure for each column of the table it stands in; None where it has none.
        commands: that run it again, most useful first.
        replay: anchor of a replay on the page; empty if there is none.
    """

    id: str
    verdict: Cell
    why: str
    values: tuple[Cell, ...] = ()
    commands: tuple[str, ...] = ()
    replay: str = ""


@dataclass(frozen=True, slots=True)
class Cause:
    """Cases that did not pass for the same reason: the reason, how many they are, and those that are listed."""

    words: str
    count: int
    cases: tuple[Failing, ...]


@dataclass(frozen=True, slots=True)
class Failures:
    """Cases that did not pass, by cause: a table that readers filter and sort, each row with a link of its own.

    Attributes:
        title: what the table shows.
        causes: commonest first.
        columns: of the figures that each case has.
        note: small print below it.
        what: the head of the first column.
    """

    title: str
    causes: tuple[Cause, ...]
    columns: tuple[Column, ...] = ()
    note: str = ""
    what: str = "case"


@dataclass(frozen=True, slots=True)
class Summary:
    """The first paragraph of a report, in words anybody understands; each text may use the marks of `Text`.

    Attributes:
        tested: what was tested.
        verdict: what came of it, a sentence.
        tone: how welcome that is.
        facts: what matters most, at most three sentences.
        advice: what to do next.
    """

    tested: str
    verdict: str
    tone: Tone
    facts: tuple[str, ...]
    advice: str


Piece: TypeAlias = Table | Figure | Text | Code | Findings | Animation | Failures


@dataclass(frozen=True, slots=True)
class Section:
    """A titled part of a page: a lead in plain words, then pieces; an empty anchor is made from the title.

    Sections of one `part` follow each other under its name in the list of contents.
    """

    title: str
    lead: str
    pieces: tuple[Piece, ...]
    anchor: str = ""
    part: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """A whole report: `facts` are what it stands on, key and value (seed, cases, version); the summary comes first."""

    title: str
    subtitle: str
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]
    summary: Summary | None = None


def anchors(page: Page) -> tuple[str, ...]:
    """Return one anchor a section: what it asked for or its title in plain letters, made unique by a number."""
    return unique(plain_anchor(section.anchor or section.title) for section in page.sections)


def plain_anchor(text: str) -> str:
    """Return a text in letters that an anchor may have.

    >>> plain_anchor("lift/ITP1-tp11/0")
    'lift-itp1-tp11-0'
    """
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "section"


def unique(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names, each that was there before with a number.

    >>> unique(["a", "b", "a"])
    ('a', 'b', 'a-2')
    """
    last: dict[str, int] = {}
    taken: dict[str, None] = {}
    for plain in names:
        name, number = plain, last.get(plain, 1)
        while name in taken:
            number += 1
            name = f"{plain}-{number}"
        last[plain] = number
        taken[name] = None
    return tuple(taken)

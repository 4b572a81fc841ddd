"""What a report page is made of: pieces of plain data, whoever draws them later on paper, screen or terminal.

A study composes these; the rest of report/ turns them into HTML (page), text (terminal) and pictures (still).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest

Tone: TypeAlias = Literal["good", "fair", "neutral", "poor", "bad", "worst"]
"""How welcome a value is: one scale, each step with a colour, for cells, findings and slices of charts."""

Align: TypeAlias = Literal["auto", "left", "right", "center"]

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Marked:
    """A cell to look at: a value with a tone, and optionally why (shown when pointed at)."""

    value: str | int | float | None
    tone: Tone = "poor"
    why: str = ""


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
    align: Align = "auto"
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

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, 1):
            if len(row) != len(self.columns):
                raise BadRequest(
                    f"table {self.title!r}, row {number}",
                    f"it must have one cell a column, {len(self.columns)}, but has {len(row)}",
                    "use None for what is not known",
                    slug="table-width",
                )


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing: `svg` is an <svg> element of our own making, so trusted; `alt` says it in words."""

    title: str
    svg: str
    alt: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Text:
    """Paragraphs parted by blank lines, with the marks that prose.py knows; all else is shown as it is."""

    body: str


@dataclass(frozen=True, slots=True)
class Code:
    """Lines kept as they are, in a monospace face: a model, a test path, a command."""

    body: str
    title: str = ""
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Finding:
    """One number a reader should take home, what it counts, and what to compare it with."""

    value: str
    label: str
    note: str = ""
    tone: Tone = "neutral"


@dataclass(frozen=True, slots=True)
class Findings:
    """The numbers to take home, side by side."""

    items: tuple[Finding, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """One recorded run of a disc robot among disc obstacles.

    Attributes:
        title: the case, e.g. its id.
        subtitle: what became of it, in words.
        times: strictly increasing [s], shape (n_times,).
        x, y: robot centre [m], shape (n_times,).
        heading: counter-clockwise from x [rad], shape (n_times,).
        halted: whether the robot was held for imminent collision, shape (n_times,).
        obstacle_x, obstacle_y: obstacle centres [m], shape (n_times, n_obstacles).
        robot_radius: [m].
        obstacle_radii: [m], shape (n_obstacles,).
        arena: width and height of the area, which starts at the origin [m].
        goal: x and y [m].
        goal_tolerance: distance to the goal that counts as reached [m].
        note: small print below it.

    Raises:
        BadRequest: there is no sample, the shapes disagree, a number is not finite, a size is not positive,
            or the times do not increase.
    """

    title: str
    subtitle: str
    times: Floats
    x: Floats
    y: Floats
    heading: Floats
    halted: NDArray[np.bool_]
    obstacle_x: Floats
    obstacle_y: Floats
    robot_radius: float
    obstacle_radii: tuple[float, ...]
    arena: tuple[float, float]
    goal: tuple[float, float]
    goal_tolerance: float
    note: str = ""

    def __post_init__(self) -> None:
        n, m = len(self.times), len(self.obstacle_radii)
        self._require(n > 0, "it must have at least one sample, but has none", "replay-shape")
        for name in ("times", "x", "y", "heading", "halted", "obstacle_x", "obstacle_y"):
            values = getattr(self, name)
            due = (n, m) if name.startswith("obstacle") else (n,)
            self._require(values.shape == due, f"{name} must have shape {due}, but has {values.shape}", "replay-shape")
            self._require(
                bool(np.isfinite(values).all()), f"{name} must be finite, but is not everywhere", "replay-values"
            )
        self._require(bool((np.diff(self.times) > 0.0).all()), "times must increase, but do not", "replay-values")
        for size in (self.robot_radius, self.goal_tolerance, *self.obstacle_radii, *self.arena):
            self._require(
                bool(np.isfinite(size)) and size > 0.0,
                f"sizes must be finite and above 0 m, but {size:g} given",
                "replay-values",
            )
        self._require(
            bool(np.isfinite(self.goal).all()), f"the goal must be finite, but is {self.goal}", "replay-values"
        )

    def _require(self, holds: bool, rule: str, slug: str) -> None:
        if not holds:
            raise BadRequest(f"replay {self.title!r}", rule, "check what was recorded", slug=slug)

    def clearance(self) -> Floats:
        """Return the least gap to an obstacle at each time [m], shape (n_times,); infinite without any."""
        if not self.obstacle_radii:
            return np.full(len(self.times), np.inf)
        gap = np.hypot(self.obstacle_x - self.x[:, None], self.obstacle_y - self.y[:, None])
        least: Floats = (gap - self.robot_radius - np.asarray(self.obstacle_radii)).min(axis=1)
        return least


Piece: TypeAlias = Table | Figure | Text | Code | Findings | Replay


@dataclass(frozen=True, slots=True)
class Section:
    """A titled part of a page: a lead in plain words, then pieces; an empty anchor is made from the title."""

    title: str
    lead: str
    pieces: tuple[Piece, ...]
    anchor: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """A whole report: `facts` are what it stands on, key and value (seed, cases, version)."""

    title: str
    subtitle: str
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]


def anchors(page: Page) -> tuple[str, ...]:
    """Return one anchor a section: what it asked for or its title in plain letters, made unique by a number.

    >>> sections = (Section("Who is stuck?", "", ()), Section("Who is stuck?", "", ()), Section("…", "", ()))
    >>> anchors(Page("Report", "", (), sections))
    ('who-is-stuck', 'who-is-stuck-2', 'section')
    """
    taken: list[str] = []
    for section in page.sections:
        plain = re.sub(r"[^a-z0-9]+", "-", (section.anchor or section.title).lower()).strip("-") or "section"
        name, number = plain, 1
        while name in taken:
            number += 1
            name = f"{plain}-{number}"
        taken.append(name)
    return tuple(taken)

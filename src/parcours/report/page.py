"""Renders a page as one HTML file with style, scripts, charts and data inside; it loads nothing.

The same page gives the same bytes. The template escapes all text from outside, and a Content-Security-Policy
lets only our own script run, whatever a title may hold.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import math
import re
from collections.abc import Iterator
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from markupsafe import Markup

from parcours.report import prose
from parcours.report.cells import group_spans, shown, sides
from parcours.report.pieces import (
    Animation,
    Cause,
    Cell,
    Column,
    Failing,
    Failures,
    Figure,
    Marked,
    Page,
    Piece,
    anchors,
    plain_anchor,
    unique,
)

if TYPE_CHECKING:
    from jinja2 import Template


READABLE = 11.0
"""The smallest text of a drawing on a page; a drawing that would need less is scrolled in its frame [CSS px]."""


def to_html(page: Page) -> str:
    """Return the page as one HTML document that needs no network.

    Raises:
        BadRequest: a column's format does not fit its numbers.
    """
    # All scripts are one, so that one hash in the Content-Security-Policy admits ours and nothing else.
    animations = (p for section in page.sections for p in section.pieces if isinstance(p, Animation))
    script = "".join([_file("page.js"), *dict.fromkeys(animation.script for animation in animations)])
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    numbers = itertools.count(1)
    failures = [p for section in page.sections for p in section.pieces if isinstance(p, Failures)]
    cases = iter(unique(f"case_{plain_anchor(one.id)}" for p in failures for cause in p.causes for one in cause.cases))
    causes = itertools.count(1)
    return _template().render(
        page=page,
        sections=list(zip(anchors(page), page.sections, (blocks(s.pieces) for s in page.sections), strict=True)),
        style=Markup(_file("page.css")),
        script=Markup(script),
        script_hash=digest,
        drawn=lambda figure: _adopted(figure, next(numbers)),
        listed=lambda piece: _listed(piece, causes, cases),
    )


def blocks(pieces: tuple[Piece, ...]) -> Iterator[tuple[str, list[Piece]]]:
    """Return runs of pieces as the template lays them out: animations that follow each other share a grid."""
    for kind, run in itertools.groupby(pieces, lambda piece: type(piece).__name__):
        if kind == "Animation":
            yield kind, list(run)
        else:
            yield from ((kind, [piece]) for piece in run)


@cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(
        prose=prose.html,
        inline=prose.inline_html,
        cells=_cells,
        spans=group_spans,
        unbroken=lambda text: max(map(len, text.split()), default=0),
        sides=sides,
        json=lambda data: Markup(data.replace("<", "\\u003c")),  # so that no text can end the element
        still=lambda svg: Markup(_bare(svg)),
    )
    return environment.from_string(_file("page.html"))


def _cells(row: tuple[Cell, ...], columns: tuple[Column, ...]) -> list[tuple[str, str, str, str]]:
    """Return text, tone, reason and link of each cell of a row."""
    return [
        (shown(cell, column), *((cell.tone, cell.why, cell.link) if isinstance(cell, Marked) else ("", "", "")))
        for cell, column in zip(row, columns, strict=True)
    ]


def _listed(
    piece: Failures, numbers: Iterator[int], anchors: Iterator[str]
) -> Iterator[tuple[str, Cause, list[tuple[str, Failing, list[tuple[str, str, str, str]]]]]]:
    """Yield each cause with its anchor and its cases, each with an anchor and its cells: the verdict, then figures."""
    columns = (Column("verdict"), *piece.columns)
    for cause in piece.causes:
        rows = [(next(anchors), one, _cells((one.verdict, *one.values), columns)) for one in cause.cases]
        yield f"cause_{next(numbers)}", cause, rows


def _adopted(figure: Figure, number: int) -> Markup:
    """Return a figure's drawing with ids that no other on the page has."""
    svg = _bare(figure.svg)
    prefix = f"f{number}-"
    svg = re.sub(r'(?<=\sid=")', prefix, svg)
    svg = re.sub(r'(?<=url\(#)|(?<=href="#)(?!taken_)', prefix, svg)
    if least := _least_width(svg):
        svg = svg.replace("<svg ", f'<svg style="min-width: {least}px" ', 1)
    return Markup(svg)


def _least_width(svg: str) -> int:
    """Return how wide a drawing must be for its smallest text to be READABLE [CSS px]; 0 if that is not known."""
    box = re.match(r'<svg [^>]*?\bviewBox="\S+ \S+ ([\d.]+) ', svg)
    sizes = re.findall(r'\bfont(?:-size)?[:=]"?\s*(?:[\w-]+\s+)?([\d.]+)(?:px)?\b', svg)
    if box is None or not sizes:
        return 0
    return math.ceil(READABLE * float(box[1]) / min(map(float, sizes)))


def _bare(svg: str) -> str:
    """Return the drawing without its namespaces: HTML needs none, and no address is left on the page."""
    return re.sub(r'\s(?:xmlns(?::\w+)?)="[^"]*"', "", svg)


@cache
def _file(name: str) -> str:
    return resources.files("parcours.report").joinpath(name).read_text(encoding="utf-8")

"""Prints tables and pages: coloured on a terminal, plain elsewhere, and as Markdown.

Colour is left out when the NO_COLOR environment variable is set (no-color.org) or the output is no terminal.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

from parcours.report.cells import group_spans, shown, sides, text_rows
from parcours.report.pieces import (
    Animation,
    Code,
    Failures,
    Figure,
    Findings,
    KeyFigure,
    Marked,
    Page,
    Table,
    Text,
    Tone,
)
from parcours.report.prose import plain

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

_STYLE: dict[Tone, str] = {
    "good": "bold green", "fair": "green", "neutral": "bold", "poor": "yellow", "bad": "bold red",
    "worst": "bold magenta",
}  # fmt: skip

_PAD = {"left": "<", "right": ">", "center": "^"}


def print_table(table: Table, to: TextIO | None = None) -> None:
    """Print a table: drawn and coloured on a terminal, otherwise as `to_text` writes it."""
    console = _console(to)
    if console.is_terminal:
        console.print(_drawn(table))
        if table.note:
            console.print(plain(table.note), style="dim", markup=False, highlight=False)
    else:
        _raw(console, to_text(table))


def print_page(page: Page, to: TextIO | None = None) -> None:
    """Print what a page says in words and tables; charts, animations and folded tables by their titles."""
    console = _console(to)
    _raw(console, f"{page.title}\n{plain(page.subtitle)}".strip())
    if page.summary is not None:
        one = page.summary
        parts = [f"{one.tested} {one.verdict}", *(f"- {fact}" for fact in one.facts), one.advice]
        console.print("\n".join(plain(text) for text in parts if text), markup=False, highlight=False, soft_wrap=True)
    _raw(console, "  ".join(f"{key}: {value}" for key, value in page.facts))
    for section in page.sections:
        _raw(console, "")
        console.print(section.title, style="bold underline", markup=False, highlight=False, soft_wrap=True)
        if section.lead:
            console.print(plain(section.lead), markup=False, highlight=False)
        for piece in section.pieces:
            if isinstance(piece, Table) and not piece.folded:
                _raw(console, "")
                print_table(piece, to)
            else:
                said = _said(piece)
                console.print(said, markup=False, highlight=False, soft_wrap=isinstance(piece, Code))


def to_text(table: Table) -> str:
    """Return a table as plain lines, columns two spaces apart."""
    body = [tuple(_one_line(text) for text in row) for row in text_rows(table)]
    heads = tuple(_one_line(_full_heading(table, at)) for at in range(len(table.columns)))
    widths = [max(map(len, column)) for column in zip(heads, *body, strict=True)]
    pads = [_PAD[side] for side in sides(table)]
    lines = [heads, tuple("-" * width for width in widths), *body]
    text = [
        "  ".join(f"{cell:{pad}{width}}" for cell, pad, width in zip(line, pads, widths, strict=True)).rstrip()
        for line in lines
    ]
    note = [plain(table.note)] if table.note else []
    return "\n".join([_one_line(table.title), *text, *note])


def to_markdown(table: Table) -> str:
    """Return a table in GitHub's Markdown."""
    rule = {"left": ":---", "right": "---:", "center": ":---:"}
    heads = [_full_heading(table, at) for at in range(len(table.columns))]
    lines = [heads, [rule[side] for side in sides(table)], *text_rows(table)]
    return "\n".join("| " + " | ".join(_one_line(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)


def _said(piece: object) -> str:
    """Return in words what is not a table."""
    if isinstance(piece, Text):
        return plain(piece.body)
    if isinstance(piece, Code):
        return f"{piece.title}: (folded)" if piece.folded else piece.body
    if isinstance(piece, Findings):
        return "\n".join(map(_finding, piece.items))
    if isinstance(piece, Figure):
        return f"chart: {piece.title}"
    if isinstance(piece, Animation):
        return f"replay {piece.title}: {plain(piece.subtitle)}"
    if isinstance(piece, Failures):
        said = [f"  {cause.words} ({cause.count:,d})" for cause in piece.causes]
        return "\n".join([f"{piece.title}:", *map(_one_line, said)])
    if isinstance(piece, Table):
        return f"{piece.title}: {len(piece.rows)} rows"
    raise TypeError(f"not a piece of a page: {piece!r}")


def _finding(finding: KeyFigure) -> str:
    return f"{finding.value}  {finding.label}" + (f" ({finding.note})" if finding.note else "")


def _drawn(table: Table) -> RichTable:
    """Return the table as rich draws it."""
    from rich import box
    from rich.table import Table as RichTable
    from rich.text import Text as RichText

    drawn = RichTable(title=RichText(table.title), title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for at, side in enumerate(sides(table)):
        drawn.add_column(RichText(_full_heading(table, at)), justify=side, overflow="fold")
    for row in table.rows:
        drawn.add_row(
            *(
                RichText(shown(cell, column), style=_STYLE[cell.tone] if isinstance(cell, Marked) else "")
                for cell, column in zip(row, table.columns, strict=True)
            )
        )
    return drawn


def _full_heading(table: Table, at: int) -> str:
    """Return a column's heading after the one it shares, if any."""
    column = table.columns[at]
    return f"{column.group} {column.heading}" if group_spans(table) and column.group else column.heading


def _one_line(text: str) -> str:
    """Return the text on one line and without control characters, which could steer a terminal."""
    return "".join(c if c.isprintable() else " " for c in text)


def _console(to: TextIO | None) -> Console:
    from rich.console import Console

    return Console(file=to)


def _raw(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)

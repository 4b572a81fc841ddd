"""The text of a table's cells, the same on every medium."""

from __future__ import annotations

import math

from parcours.errors import BadRequest
from parcours.report.pieces import Cell, Column, Marked, Side, Table

UNKNOWN = "–"
"""What stands for a value that is not known."""


def value_of(cell: Cell) -> str | int | float | None:
    """Return a cell's value without its mark."""
    return cell.value if isinstance(cell, Marked) else cell


def shown(cell: Cell, column: Column) -> str:
    """Return the text of a cell."""
    value = value_of(cell)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    try:
        return format(value, column.format).replace("-", "\N{MINUS SIGN}")
    except (ValueError, TypeError) as error:
        rule = f"its format must fit its numbers, but {column.format!r} does not fit {value!r}: {error}"
        raise BadRequest(
            f"column {column.name!r}", rule, "give a format such as '.1%' or ',d'", slug="column-format"
        ) from error


def sides(table: Table) -> tuple[Side, ...]:
    """Return the side each column's cells keep to: left, right or center."""
    return tuple(
        column.align if column.align != "auto" else ("right" if _numeric(table, at) else "left")
        for at, column in enumerate(table.columns)
    )


def _numeric(table: Table, at: int) -> bool:
    """Return whether a column holds numbers only, as far as anything is known in it."""
    known = [value for value in (value_of(row[at]) for row in table.rows) if value is not None]
    return bool(known) and all(isinstance(value, int | float) for value in known)


def text_rows(table: Table) -> tuple[tuple[str, ...], ...]:
    """Return the text of every cell, row by row."""
    return tuple(
        tuple(shown(cell, column) for cell, column in zip(row, table.columns, strict=True)) for row in table.rows
    )


def group_spans(table: Table) -> tuple[tuple[str, int], ...]:
    """Return the shared headings from left to right, and how many columns each spans; empty without any."""
    spans: list[tuple[str, int]] = []
    for column in table.columns:
        if spans and column.group and spans[-1][0] == column.group:
            spans[-1] = (column.group, spans[-1][1] + 1)
        else:
            spans.append((column.group, 1))
    return tuple(spans) if any(name for name, _ in spans) else ()

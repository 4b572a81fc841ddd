"""Reads a file of rows (CSV, JSON Lines or JSON) as a table of values in the columns of an input model.

The file may come from anywhere: columns are found by name, further ones are left aside, and a cell that is no value of
its input becomes NaN, which lies in no block. Numbers are read as numbers, names of an enumeration as their places.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from parcours.data.domains import Domain
from parcours.data.inputs import InputModel
from parcours.errors import BadRequest
from parcours.model.conversion import text_of

MAX_TABLE_BYTES = 200_000_000
"""Largest file [bytes]."""

MAX_CELL = 400
"""Longest text of a number [characters]."""


def read_table(path: Path | str, model: InputModel, titles: Sequence[str] = ()) -> NDArray[np.float64]:
    """Return the values of a file, shape (n_rows, n_inputs).

    Args:
        path: `.json` (an object with `names` and `rows`, as `parcours data draw --json` prints), `.jsonl` (one object
            per line, its values by name, by themselves or under `values`, as in a suite), else CSV with a header whose
            cells are separated by tabs, semicolons or commas.
        model: whose inputs the columns are.
        titles: names of the inputs as PICT prints them; then names match whatever their case, and `~` is no part of
            a value.

    Raises:
        BadRequest: the file cannot be read, is not of its kind, or lacks an input.
    """
    path = Path(path)
    if path.exists() and not path.is_file():  # a device or a pipe may never end
        rule = "a table must be a readable file, but this is no regular file"
        raise BadRequest(str(path), rule, "check the path", slug="unreadable-file")
    text = text_of(path, MAX_TABLE_BYTES, "a table", BadRequest)
    readers = {".json": _json, ".jsonl": _lines}
    reader = readers.get(path.suffix.lower())
    rows = list(reader(path, text, model.names) if reader else _csv(path, text, model.names, titles))
    if titles and not reader:
        known = [{value.casefold(): value for value in domain.values} for domain in model.domains]
        rows = [[_unmarked(str(cell), words) for cell, words in zip(row, known, strict=True)] for row in rows]
    table = np.array([[_value(d, cell) for d, cell in zip(model.domains, row, strict=True)] for row in rows])
    return table.astype(np.float64).reshape(len(rows), len(model.domains))


def _value(domain: Domain, cell: object) -> float:
    if isinstance(cell, str) and domain.kind == "enumeration":
        return float(domain.values.index(cell.strip())) if cell.strip() in domain.values else math.nan
    if domain.kind == "enumeration" and (isinstance(cell, bool) or not isinstance(cell, int | float)):
        return math.nan
    try:
        if isinstance(cell, bool) or not isinstance(cell, int | float | str) or len(str(cell)) > MAX_CELL:
            return math.nan
        return float(cell)
    except (ValueError, OverflowError):
        return math.nan


def _unmarked(cell: str, words: Mapping[str, str]) -> str:
    """Return a cell that PICT printed without the mark of negative tests, a name as the model has it."""
    plain = cell.strip().removeprefix("~").strip()
    return words.get(plain.casefold(), plain)


def _csv(path: Path, text: str, names: Sequence[str], titles: Sequence[str]) -> Iterator[list[object]]:
    lines = text.splitlines()
    # PICT separates by tabs and some spreadsheets by semicolons; a header of names holds neither otherwise.
    delimiter = next((sign for sign in "\t;" if lines and sign in lines[0]), ",")
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    try:
        header = [name.strip() for name in next(reader, [])]
        if titles:
            header = [name.casefold() for name in header]
            pairs = [(title.casefold(), name.casefold()) for title, name in zip(titles, names, strict=True)]
            names = [title if title in header else name for title, name in pairs]
        places = _places(path, header, names)
        for row in reader:
            if not row:
                continue
            if len(row) != len(header):
                _bad(path, reader.line_num, f"a row has the {len(header)} cells of the header, but here are {len(row)}")
            yield [row[place] for place in places]
    except csv.Error as error:
        _bad(path, reader.line_num, f"a row must be CSV, but: {error}")


def _lines(path: Path, text: str, names: Sequence[str]) -> Iterator[list[object]]:
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        record = _parsed(path, number, line)
        if isinstance(record, dict) and ("parcours" in record or record.keys() == {"cases"}):
            continue  # the first and the last line of a suite
        values = record.get("values", record) if isinstance(record, dict) else None
        if not isinstance(values, dict):
            _bad(path, number, "a line must be an object with the values by name, but is not one")
        _places(path, list(values), names, number)
        yield [values[name] for name in names]


def _json(path: Path, text: str, names: Sequence[str]) -> Iterator[list[object]]:
    record = _parsed(path, 0, text)
    header, rows = (record.get(key) if isinstance(record, dict) else None for key in ("names", "rows"))
    if not isinstance(header, list) or not isinstance(rows, list):
        _bad(path, 0, "a table in JSON must be an object with names and rows, but is not one")
    places = _places(path, header, names)
    for number, row in enumerate(rows, start=1):
        if not isinstance(row, list) or len(row) != len(header):
            _bad(path, 0, f"a row has a cell for each of the {len(header)} names, but row {number} has not")
        yield [row[place] for place in places]


def _parsed(path: Path, line: int, text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        _bad(path, line, "this must be JSON, but is not")


def _places(path: Path, header: Sequence[object], names: Sequence[str], line: int = 1) -> list[int]:
    missing = [name for name in names if name not in header]
    if missing:
        _bad(path, line, f"every input must have a column, but {', '.join(missing[:8])} have none")
    return [header.index(name) for name in names]


def _bad(path: Path, line: int, rule: str) -> NoReturn:
    raise BadRequest(f"{path}:{line}" if line else str(path), rule, slug="table")

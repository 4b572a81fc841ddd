"""Recorded tracks: a CSV file with a row for each agent and moment, checked, as arrays."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from parcours.errors import BadRequest
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.ground.pictures import read_bytes
from parcours_navigation.protocol import Floats

COLUMNS = ("agent", "t", "x", "y")
"""Columns that the file must have, in any order; further ones are not read."""

MOST_BYTES = 64_000_000
"""Largest file of tracks [bytes]."""

FARTHEST = 1e6
"""No time or place is beyond it [s, m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Tracks of some agents.

    Raises BadRequest if a track is empty, or a number is not finite or beyond FARTHEST, or times do not increase.
    """

    names: tuple[str, ...]
    rows: tuple[Floats, ...]  # for each agent t, x, y [s, m, m], times increasing, shape (n_rows, 3)
    source: str = "tracks"  # what errors call them

    def __post_init__(self) -> None:
        for name, rows in zip(self.names, self.rows, strict=True):
            where = f"{self.source}, agent {name!r}"
            if rows.ndim != 2 or rows.shape[1] != 3 or not len(rows):
                rule = f"a track must have rows of t, x, y, but has the shape {rows.shape}"
                raise BadRequest(where, rule, "give at least one row", slug="others-track")
            if not (np.abs(rows) <= FARTHEST).all():
                rule = f"every number must be finite and at most {FARTHEST:g}"
                raise BadRequest(where, rule, "take such rows out", slug="others-track")
            steps = np.diff(rows[:, 0])
            if (steps <= 0.0).any():
                k = int(np.argmax(steps <= 0.0))
                rule = f"times must increase, but {rows[k + 1, 0]:g} s follows {rows[k, 0]:g} s"
                raise BadRequest(where, rule, "sort the rows, and take repeated ones out", slug="others-track")

    @property
    def fastest(self) -> float:
        """The greatest speed between two rows [m/s]."""
        return max((_fastest(rows) for rows in self.rows), default=0.0)


def _fastest(rows: Floats) -> float:
    if len(rows) < 2:
        return 0.0
    steps = np.diff(rows, axis=0)
    return float((np.sqrt(steps[:, 1] * steps[:, 1] + steps[:, 2] * steps[:, 2]) / steps[:, 0]).max())


def read_tracks(path: Path) -> Tracks:
    """Return the tracks of a CSV file with the columns agent, t [s], x [m], y [m]; agents in the order they appear.

    Raises:
        BadRequest: the file cannot be read as UTF-8 text, a column is missing, a number is bad, or times of an agent
            do not increase; with the line.
    """
    remedy = f"give a CSV file with the columns {', '.join(COLUMNS)}"
    try:
        text = read_bytes(path, "others-track", MOST_BYTES).decode("utf-8-sig")
    except BadGround as error:
        raise BadRequest(
            str(path), f"a file of tracks must be readable: {error.rule}", remedy, slug="others-track"
        ) from None
    except UnicodeDecodeError as error:
        rule = f"a file of tracks must be UTF-8 text, but byte {error.start} is not"
        raise BadRequest(str(path), rule, remedy, slug="others-track") from None
    lines = csv.reader(text.splitlines(), strict=True)
    try:
        return _tracks(lines, path)
    except csv.Error as error:
        raise BadRequest(f"{path}:{lines.line_num}", f"it must be CSV, but: {error}", remedy,
                         slug="others-track") from None  # fmt: skip


def _tracks(lines: csv._reader, path: Path) -> Tracks:  # type: ignore[name-defined]
    header = [name.strip() for name in next(lines, [])]
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        rule = f"columns must be {', '.join(COLUMNS)}, but {', '.join(missing)} is missing from the first line"
        raise BadRequest(f"{path}:1", rule, "name them in the first line", slug="others-track")
    where = [header.index(name) for name in COLUMNS]
    found: dict[str, list[tuple[float, float, float]]] = {}
    for row in lines:
        line = f"{path}:{lines.line_num}"
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            rule = f"a row must have {len(header)} columns like the first line, but has {len(row)}"
            raise BadRequest(line, rule, "fill in what is missing, or take the row out", slug="others-track")
        name, t, x, y = row[where[0]].strip(), *(_number(row[k], line, header[k]) for k in where[1:])
        track = found.setdefault(name, [])
        if track and t <= track[-1][0]:
            rule = f"times of an agent must increase, but {t:g} s of {name!r} follows {track[-1][0]:g} s"
            raise BadRequest(line, rule, "sort the rows, and take repeated ones out", slug="others-track")
        track.append((t, x, y))
    if not found:
        raise BadRequest(str(path), "a file of tracks must have a row, but has none", remedy="add one",
                         slug="others-track")  # fmt: skip
    return Tracks(tuple(found), tuple(np.array(track) for track in found.values()), str(path))


def _number(text: str, line: str, column: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= FARTHEST:
        rule = f"{column} must be a number from {-FARTHEST:g} to {FARTHEST:g}, but is {text.strip()!r}"
        raise BadRequest(line, rule, "correct it, or take the row out", slug="others-track")
    return value

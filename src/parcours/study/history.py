"""Keeps a history: a JSON Lines file with one line per run, to which CI appends; and reads it back."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from parcours.errors import BadResults
from parcours.run.atomic import unwritable
from parcours.study.finding import study_of
from parcours.verdict.statistics import Rate, wilson

FORMAT = "history/1"


@dataclass(frozen=True, slots=True)
class HistoryEntry:
    """A run as the history keeps it."""

    date: str  # when it was appended, ISO 8601 with its zone
    commit: str  # of the system under test, empty if not known
    machine: str
    study: str
    label: str  # what ran: a planner, a schedule
    folder: str
    cases: int
    planned: int
    rates: dict[str, tuple[int, int]]  # name -> how often, of how many cases

    def rate(self, name: str) -> Rate | None:
        """Return a rate with its Wilson interval; None if the run has none of that name."""
        return wilson(*self.rates[name]) if name in self.rates else None


def entry_of(folder: Path, now: datetime, commit: str | None = None, study: str = "") -> HistoryEntry:
    """Return the line on the results in a folder.

    Args:
        now: when it is appended, with its zone.
        commit: of the system under test; None: that of the current folder's repository.
        study: where the study is, if not where it was.
    """
    found = study_of(folder, study)
    results = found.read(folder)
    rates = {}
    for name, measure in results.measures().items():
        if measure.kind == "rate":
            known = measure.values[~np.isnan(measure.values)]
            rates[name] = (int(known.sum()), len(known))
    n = max((of for _, of in rates.values()), default=0)
    machine = f"{platform.node()}, {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    return HistoryEntry(now.isoformat(timespec="seconds"), _commit() if commit is None else commit, machine, found.name,
                 results.label, str(folder), n, results.planned, rates)  # fmt: skip


def append(file: Path, entry: HistoryEntry) -> None:
    """Append a line to a history, in one write. Raises BadRequest: the file cannot be written."""
    line = json.dumps({"parcours": FORMAT, **asdict(entry)}, ensure_ascii=False) + "\n"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            os.write(handle, line.encode())
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        raise unwritable(file, error) from error


def read_history(file: Path) -> list[HistoryEntry]:
    """Return the lines of a history. Raises BadResults: there is none, or a line is damaged."""
    found = []
    try:
        lines = file.read_bytes().splitlines()
    except OSError as error:
        rule = f"must be a readable history, but: {error.strerror}"
        raise BadResults(str(file), rule, "append a run to it first", slug="history-line") from error
    for number, line in enumerate(lines, start=1):
        try:
            document = json.loads(line)
            if document.pop("parcours") != FORMAT:
                raise ValueError(f"it is not of {FORMAT}")
            rates = {str(name): (int(count), int(n)) for name, (count, n) in document.pop("rates").items()}
            if not all(0 <= count <= n for count, n in rates.values()):
                raise ValueError("a count is above its number of cases")
            found.append(HistoryEntry(**document, rates=rates))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise BadResults(f"{file}:{number}", f"each line holds a run, but: {error}", "delete the line",
                             slug="history-line") from error  # fmt: skip
    return found


def _commit() -> str:
    try:
        done = subprocess.run(
            ["git", "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True, timeout=10, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""

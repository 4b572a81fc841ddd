"""Writes and reads suites: JSON Lines with a version in the first line and the number of cases in the last.

Both ways are streams, so a suite may be larger than memory. A file is written beside its place and renamed
into it when it is whole; one that was cut short is noticed by its missing last line.
"""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, NoReturn

from parcours.errors import BadSuite
from parcours.suite.cases import Case

FORMAT = "suite/1"
"""The value of `parcours` in the first line of a file of this format."""

MAX_LINE = 1_000_000
"""Longest line [bytes]."""

_KEYS = ("id", "study", "number", "abstract", "row", "values", "time_budget", "seed")


def write_suite(path: Path | str, cases: Iterable[Case]) -> int:
    """Write the cases to a file, whole or not at all, and return how many they are.

    Args:
        path: the file; one that is there is replaced.
        cases: in the order of their numbers.

    Raises:
        BadSuite: the folder is not there or cannot be written to, or the numbers of the cases do not ascend.

    >>> case = Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_suite(Path(folder, "suite.jsonl"), [case])
    ...     list(read_suite(Path(folder, "suite.jsonl"))) == [case]
    1
    True
    """
    path = Path(path)
    partial: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
        partial = Path(name)
        with os.fdopen(handle, "wb") as file:
            n = _write(file, cases)
            file.flush()
            os.fsync(file.fileno())
        partial.chmod(0o644)
        partial.replace(path)
    except OSError as error:
        rule = f"a suite must be writable there, but: {error.strerror or error}"
        raise BadSuite(str(path), rule, "name another place, or make the folder", slug="suite-unwritable") from None
    finally:
        if partial is not None:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
    return n


def _write(file: BinaryIO, cases: Iterable[Case]) -> int:
    file.write(_line({"parcours": FORMAT}))
    n, last = 0, -1
    for case in cases:
        if case.number <= last:
            rule = f"numbers of cases must ascend, but it follows {last}"
            raise BadSuite(f"case {case.number}", rule, "sort the cases", slug="suite-order")
        values = dict(zip(case.names, case.values, strict=True))
        file.write(_line({key: values if key == "values" else getattr(case, key) for key in _KEYS}))
        n, last = n + 1, case.number
    file.write(_line({"cases": n}))
    return n


def _line(record: dict[str, object]) -> bytes:
    return json.dumps(record, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def read_suite(path: Path | str) -> Iterator[Case]:
    """Yield the cases of a file, in the order of their numbers; memory stays flat.

    Args:
        path: a file that `write_suite` has written.

    Raises:
        BadSuite: at once if the file cannot be opened or is no suite of this version; when the line is reached, if a
            line is not a case, or the file was cut short or continues after its end.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            header = _record(path, 1, file.readline(MAX_LINE + 1))
    except OSError as error:
        raise unreadable(path, error) from None
    if header.get("parcours") != FORMAT or len(header) != 1:
        rule = f"a suite must begin with its format, {FORMAT}, but this begins otherwise"
        raise BadSuite(f"{path}:1", rule, "write it with this version of Parcours", slug="suite-format")
    return _cases(path)


def unreadable(path: Path | str, error: OSError) -> BadSuite:
    """Return the complaint about a file that cannot be read."""
    rule = f"a suite must be a readable file, but: {error.strerror or error}"
    return BadSuite(str(path), rule, "check the path", slug="unreadable-file")


def _cases(path: Path) -> Iterator[Case]:
    with path.open("rb") as file:
        file.readline(MAX_LINE)
        n, last, line = 0, -1, 1
        while raw := file.readline(MAX_LINE + 1):
            line += 1
            record = _record(path, line, raw)
            if "cases" in record:
                if record != {"cases": n} or isinstance(record["cases"], bool):
                    _bad(path, line, f"the last line must count the cases before it, which are {n}", "suite-cut")
                if file.read(1):
                    _bad(path, line + 1, "nothing may follow the line that counts the cases", "suite-cut")
                return
            case = _case(path, line, record)
            if case.number <= last:
                _bad(path, line, f"numbers of cases must ascend, but {case.number} follows {last}", "suite-order")
            n, last = n + 1, case.number
            yield case
        _bad(path, line, f"a suite must end with the number of its cases, but this one stops after {n}", "suite-cut")


def _record(path: Path, line: int, raw: bytes) -> dict[str, object]:
    """Return the JSON object of one line: no duplicate keys, no NaN, bounded size and depth."""
    if len(raw) > MAX_LINE:
        _bad(path, line, f"a line has at most {MAX_LINE} bytes, but this one is longer", "suite-line")
    try:
        record = json.loads(raw.decode(), object_pairs_hook=_without_doubles, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        _bad(
            path, line, f"a line must be a JSON object, but: {(str(error) or type(error).__name__)[:120]}", "suite-line"
        )
    if not isinstance(record, dict):
        _bad(path, line, "a line must be a JSON object, but this one is not", "suite-line")
    return record


def _without_doubles(pairs: list[tuple[str, object]]) -> dict[str, object]:
    record = dict(pairs)
    if len(record) != len(pairs):
        raise ValueError("a key stands twice")
    return record


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _case(path: Path, line: int, record: dict[str, object]) -> Case:
    if tuple(sorted(record)) != tuple(sorted(_KEYS)):
        _bad(path, line, f"a case must have exactly the keys {', '.join(_KEYS)}", "suite-case")
    values = record["values"]
    if not isinstance(values, dict):
        _bad(path, line, "the values of a case must be an object", "suite-case")
    try:
        numbers = tuple(_real(values, name) for name in values)
        number, row, seed = (_whole(record, key) for key in ("number", "row", "seed"))
        study, abstract = _text(record, "study"), _text(record, "abstract")
        case = Case(study, number, abstract, row, tuple(values), numbers, _real(record, "time_budget"), seed)
    except BadSuite as error:
        raise BadSuite(f"{path}:{line}", f"{error.where}: {error.rule}", error.remedy, slug=error.slug) from None
    if record["id"] != case.id:
        _bad(path, line, f"the id of this case must be {case.id!r}", "suite-case")
    return case


def _text(record: dict[str, object], key: str) -> str:
    value = record[key]
    if not isinstance(value, str):
        raise BadSuite(f"key {key!r}", "a text must stand here", slug="suite-case")
    return value


def _whole(record: dict[str, object], key: str) -> int:
    value = record[key]
    if isinstance(value, bool) or not isinstance(value, int):
        raise BadSuite(f"key {key!r}", "a whole number must stand here", slug="suite-case")
    return value


def _real(record: dict[str, object], key: str) -> float:
    value = record[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e300:
        raise BadSuite(f"key {key[:60]!r}", "a number within 1e300 must stand here", slug="suite-case")
    return float(value)


def _bad(path: Path, line: int, rule: str, slug: str) -> NoReturn:
    raise BadSuite(f"{path}:{line}", rule, "write the suite again", slug=slug)

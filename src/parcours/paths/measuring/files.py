"""Reads sequences of recorded transitions from a file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from parcours.errors import BadResults

LARGEST = 1 << 28
"""The largest file that is read [bytes]."""


def read_sequences(path: Path) -> list[list[str]]:
    """Return the sequences of transitions, or of moves such as `p24+p16`, that a file records.

    A line is a sequence: words between blanks, or a JSON array of texts. The files that `parcours walk --out` and runs
    write are read too: there a line is one step, and a sequence ends where the walk starts again.

    Args:
        path: the file, UTF-8, of at most LARGEST bytes.

    Raises BadResults: the file cannot be read, or a line is something else.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "runs.txt").write_text('t1 t2\\n["t1", "t3"]\\n')
    ...     read_sequences(Path(folder, "runs.txt"))
    [['t1', 't2'], ['t1', 't3']]
    """
    try:
        if path.stat().st_size > LARGEST:
            rule = f"a file of sequences has at most {LARGEST} bytes, but this one has {path.stat().st_size}"
            raise BadResults(str(path), rule, "measure it in parts", slug="sequences-size")
        with path.open(encoding="utf-8") as file:
            return [sequence for sequence in _sequences(path, file) if sequence]
    except (OSError, UnicodeDecodeError) as error:
        rule = f"it must be a text file of sequences, but: {error}"
        raise BadResults(str(path), rule, "name the file that records the runs", slug="sequences-unreadable") from error


def _sequences(path: Path, lines: Iterator[str]) -> Iterator[list[str]]:
    current: list[str] = []
    for number, line in enumerate(lines, start=1):
        if not line.lstrip().startswith(("[", "{")):
            yield line.split()
            continue
        match _parsed(path, number, line):
            case [int(), str(kind), str(), str(transition), *_]:  # one event of a run
                current += [transition] if kind == "take" else []
            case list(steps) if all(isinstance(step, str) for step in steps):
                yield steps
            case {"transition": str(transition), **rest}:  # one step of a walk
                if rest.get("restart"):
                    yield current
                    current = []
                partner = rest.get("partner")
                current.append(f"{transition}+{partner}" if partner else transition)
            case dict():  # the first or the last line of such a file
                yield current
                current = []
            case _:
                raise _malformed(path, number, line)
    yield current


def _parsed(path: Path, number: int, line: str) -> object:
    try:
        return json.loads(line)
    except (ValueError, RecursionError) as error:
        raise _malformed(path, number, line) from error


def _malformed(path: Path, number: int, line: str) -> BadResults:
    rule = f"a line must be a sequence of transitions, or one step of a run, but this one is {line[:60]!r}"
    return BadResults(f"{path}:{number}", rule, 'write it as: t1 t2, or ["t1", "t2"]', slug="sequence-line")

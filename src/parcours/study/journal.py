"""Keeps a run in a folder: what was asked (run.json), and each finished case as a line (cases.jsonl).

A line is written as soon as its case is finished, so that whatever ends a run, finished work survives. A last line that
was cut short is dropped when the run is resumed. A run that asks something else is refused with the keys that differ.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from parcours.errors import BadResults
from parcours.run.atomic import require_writable, unwritable, write_atomically
from parcours.run.claiming import claimed
from parcours.run.manifest import differences
from parcours.study.provenance import provenance

RUN = "run.json"
CASES = "cases.jsonl"
_FORMAT = "run/1"


def write_question(folder: Path, study: str, where: str, question: Mapping[str, object]) -> None:
    """Note what a run asks, or check that it asks what the folder was begun with.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: it holds the results of another question.
    """
    require_writable(folder)
    path = folder / RUN
    ours = json.loads(json.dumps({"study": study, **question}, allow_nan=False))
    if path.exists():
        theirs = read_question(folder)["question"]
        if found := differences(ours, theirs):
            rule = f"holds another run: {'; '.join(found[:5])}"
            remedy = "name another folder, or give --fresh to discard its results and start again"
            raise BadResults(str(folder), rule, remedy, slug="results-other")
        return
    tested = Path(where.partition(":")[0])
    made = provenance(tested if tested.exists() else None)
    document = {"parcours": _FORMAT, "study": study, "where": where, "question": ours, "made": made}
    write_atomically(path, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())


def read_question(folder: Path) -> dict[str, object]:
    """Return the document that `write_question` wrote: study, where, question; made, by what and when.

    Raises BadResults: there is none, or it is damaged.
    """
    path = folder / RUN
    try:
        document = json.loads(path.read_bytes())
        if document["parcours"] != _FORMAT or not isinstance(document["question"], dict):
            raise ValueError(f"its format is {document['parcours']!r}, not {_FORMAT!r}")
        if not isinstance(document["study"], str) or not isinstance(document["where"], str):
            raise ValueError("it does not name its study")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        said = getattr(error, "strerror", None) or str(error)
        raise BadResults(str(path), f"must say what was run, but: {said}", "run the study again with --fresh",
                         slug="results-manifest") from error  # fmt: skip
    return dict(document)


class Journal:
    """The finished cases of a run, by key; more are added while it is open.

    Raises BadResults: a line within the file is damaged, or another run writes in the folder.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / CASES
        self.done: dict[str, dict[str, object]] = {}
        whole = 0
        with contextlib.ExitStack() as opened:
            opened.enter_context(claimed(folder))
            for key, entry, end in _entries(self._path):
                self.done[key] = entry
                whole = end
            try:
                self._file = opened.enter_context(self._path.open("ab"))
                self._file.truncate(whole)
            except OSError as error:
                raise unwritable(folder, error) from error
            self._closing = opened.pop_all()

    def add(self, key: str, entry: Mapping[str, object]) -> None:
        """Keep the result of a case: it is on the disk when this returns."""
        record = json.loads(json.dumps({"key": key, **entry}, allow_nan=False))
        self._file.write(json.dumps(record).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        del record["key"]
        self.done[key] = record

    def close(self) -> None:
        """Close the file; again: do nothing."""
        self._closing.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def read_journal(folder: Path) -> dict[str, dict[str, object]]:
    """Return the finished cases of a folder, by key. Raises BadResults if a line within the file is damaged."""
    return {key: entry for key, entry, _ in _entries(folder / CASES)}


def _entries(path: Path) -> Iterator[tuple[str, dict[str, object], int]]:
    """Yield key, entry and where its line ends; a last line without an end is dropped."""
    content = b""
    with contextlib.suppress(FileNotFoundError):
        content = path.read_bytes()
    end = 0
    for number, line in enumerate(content.split(b"\n")[:-1], start=1):
        end += len(line) + 1
        try:
            entry = json.loads(line)
            key = entry.pop("key")
            if not isinstance(key, str):
                raise TypeError("its key is no text")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            rule = f"each line holds a finished case, but: {error}"
            raise BadResults(f"{path}:{number}", rule, "run the study again with --fresh",
                             slug="results-journal") from error  # fmt: skip
        yield key, entry, end


def discard(folder: Path, known: tuple[str, ...]) -> None:
    """Remove what an earlier run of a study left in a folder: what `known` patterns match, and nothing else.

    Raises:
        BadRequest: the folder cannot be written to.
        BadResults: another run is writing there.
    """
    if not folder.is_dir():
        return
    try:
        with claimed(folder):
            for path in (path for pattern in known for path in sorted(folder.glob(pattern))):
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
                else:
                    path.unlink(missing_ok=True)
    except OSError as error:
        raise unwritable(folder, error) from error

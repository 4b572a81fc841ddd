"""What reading or writing a foreign format gives: a model or a text, with what the other side cannot say."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from parcours.errors import BadModel, ParcoursError
from parcours.model.checking import errors
from parcours.model.finding import complaint
from parcours.model.structure import Cefsm

MAX_FOREIGN_BYTES = 10_000_000
"""Largest file of a foreign format [bytes], unless the format allows more."""

_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_DECLARED = re.compile(rb"""<\?xml[^>]{0,80}\bencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_ENCODINGS = {"us-ascii": "ascii", "iso-8859-1": "latin-1", "windows-1252": "cp1252", "utf-8": "utf-8"}


@dataclass(frozen=True, slots=True, order=True)
class Loss:
    """One thing that a conversion leaves out or changes.

    Args:
        where: the element, e.g. `transition 'p1'`.
        line: line of the file it was read from [1 ..], 0 if unknown.
        what: one sentence: what the other side cannot say, and what stands there instead.
        alters: whether runs may differ for it, so that what is found in the model need not be true of the file.

    >>> print(Loss("location 'Cross'", 12, "urgent locations are not known; time may pass here"))
    line 12: location 'Cross': urgent locations are not known; time may pass here
    """

    where: str
    line: int
    what: str
    alters: bool = False

    def __str__(self) -> str:
        return f"{f'line {self.line}: ' if self.line else ''}{self.where}: {self.what}"


@dataclass(frozen=True, slots=True)
class ForeignModel:
    """A model read from a foreign file, without errors, and what of the file it does not hold."""

    cefsm: Cefsm
    losses: tuple[Loss, ...] = ()


@dataclass(frozen=True, slots=True)
class Writing:
    """The text of a foreign file, and what of the model it does not hold."""

    text: str
    losses: tuple[Loss, ...] = ()


def accepted(cefsm: Cefsm, losses: Iterable[Loss] = ()) -> ForeignModel:
    """Return the reading of a model, each loss once, in the order of the lines.

    Raises:
        BadModel: the model has errors; the message says all of them, one per line.
    """
    # Doubtful choices, which take long to find, are not looked for: `parcours model check` does that.
    if found := errors(cefsm):
        raise complaint(tuple(found))
    return ForeignModel(cefsm, tuple(sorted(set(losses), key=lambda loss: (loss.line, loss.where, loss.what))))


def text_of(
    path: Path, most: int = MAX_FOREIGN_BYTES, what: str = "a model file", refusal: type[ParcoursError] = BadModel
) -> str:
    """Return the text of a file: UTF-8, or what its byte order mark or XML declaration says.

    Args:
        path: the file.
        most: its largest size [bytes].
        what: what messages call the file.
        refusal: the class of the error.

    Raises:
        ParcoursError: the file cannot be read, is too large, or is no text.
    """
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)  # a pipe or a file that grows has no size to trust
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or str(error)
        rule = f"{what} must be readable, but this is not: {said}"
        raise refusal(str(path), rule, "check the path", slug="unreadable-file") from None
    if len(data) > most:
        rule = f"{what} has at most {most} bytes, but this one has more"
        raise refusal(str(path), rule, "split it", slug="file-size")
    try:
        return data.decode(_encoding(data))
    except UnicodeDecodeError as error:
        rule = f"{what} must be {error.encoding.upper()} text, but byte {error.start} is not"
        raise refusal(str(path), rule, "save it as UTF-8", slug="encoding") from None


def _encoding(data: bytes) -> str:
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return encoding
    declared = _DECLARED.match(data[:200].lstrip())
    return _ENCODINGS.get(declared[1].decode().lower(), "utf-8") if declared else "utf-8"

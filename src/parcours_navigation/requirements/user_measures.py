"""Measures of the user's own in Python: a function of one finished case that returns a number."""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, ParcoursError
from parcours.run.exception_text import Overdue, place, said
from parcours.study.loading import load

Floats = NDArray[np.float64]

_NUMBERS = (bool, np.bool_, int, float, np.integer, np.floating)


class BadMeasure(ParcoursError):
    """A measure of the user's own raised, or returned no number."""


@dataclass(frozen=True, slots=True, eq=False)
class CaseRun:
    """What a measure is given of a case, up to its end."""

    number: int  # of the case
    track: NDArray[np.void]  # array of facts.TRACK, one entry every 50 ms, shape (n,)
    places: Floats  # of the others at the same entries [m], shape (n, n_others, 2)
    radii: Floats  # of the others [m], shape (n_others,)
    ground_gaps: Floats  # between robot and ground [m], inf without any, shape (n,)
    robot_radius: float  # [m]
    goals: tuple[tuple[float, float], ...]  # x, y of each, in turn [m]
    facts: np.void  # a record of facts.FACTS, with its `measures`


def file_of_measure(text: str) -> Path | None:
    """Return the file of a measure that is Python, `file.py:name`; None of a formula.

    >>> file_of_measure("mine.py:crowding"), file_of_measure("time_at_rest / time")
    (PosixPath('mine.py'), None)
    """
    where, colon, name = text.rpartition(":")
    return Path(where) if colon and where.endswith(".py") and name.strip().isidentifier() else None


def digest_of(name: str, text: str) -> str:
    """Return a digest of a measure's file. Raises BadRequest if it cannot be read."""
    path = file_of_measure(text)
    assert path is not None
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    except OSError as error:
        rule = f"its file must be readable, but: {error.strerror or error}"
        raise BadRequest(f"measure {name!r}", rule, f"check {path}", slug="measure-file") from None


@functools.lru_cache(maxsize=64)
def _loaded(name: str, text: str) -> Callable[[CaseRun], object]:
    found = load(text, Path())
    if not callable(found):
        rule = f"it must be a function of a case, but is {type(found).__name__}"
        raise BadMeasure(f"measure {name!r}", rule, "write def measure(run): ...", slug="measure-raised")
    return found


def own_value(name: str, text: str, run: CaseRun) -> float:
    """Return what a measure in Python says of a case; NaN where it has none. It is loaded in this process.

    Raises:
        BadMeasure: it raised, or returned what is no number.
        Overdue: it takes too long.
    """
    where = f"measure {name!r} of case {run.number}"
    try:
        found = _loaded(name, text)(run)
        value = math.nan if found is None else float(found) if isinstance(found, _NUMBERS) else None
        rule = "" if value is not None else f"returned {found!r:.100}"
    except Overdue:
        raise
    except ParcoursError as error:  # of its file
        raise BadMeasure(f"measure {name!r}", f"{error.where}: {error.rule}", error.remedy, slug=error.slug) from None
    except BaseException as error:  # SystemExit, too
        value, rule = None, f"raised {said(error):.200} ({place(error)[1]})"
    if value is None:
        raise BadMeasure(where, f"it must return a number, or None where a case has none, but {rule}",
                         "return a float", slug="measure-raised")  # fmt: skip
    return value

"""Measures of the user's own in Python: a function of one finished case that returns a number."""

from __future__ import annotations

import functools
import hashlib
import math
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, ParcoursError
from parcours.study.loading import load

Floats = NDArray[np.float64]


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

    Raises BadMeasure if it raises, or returns what is no number.
    """
    where = f"measure {name!r} of case {run.number}"
    try:
        found = _loaded(name, text)(run)
    except ParcoursError:
        raise
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        rule = f"it must return a number, but raised {type(error).__name__}: {error!s:.200}"
        at = f"{Path(place.filename).name}:{place.lineno}"
        raise BadMeasure(where, f"{rule} ({at})", "correct it", slug="measure-raised") from None
    if isinstance(found, bool | np.bool_ | int | float | np.integer | np.floating):
        return float(found)
    if found is None:
        return math.nan
    rule = f"it must return a number, or None where a case has none, but returned {found!r:.100}"
    raise BadMeasure(where, rule, "return a float", slug="measure-raised")

"""Reads what a planner answered: two finite speeds, or a trajectory's points; says what is wrong with anything else."""

from __future__ import annotations

import math
import numbers
import reprlib

import numpy as np
from numpy.typing import NDArray

from parcours.run.exception_text import without_addresses
from parcours_navigation.protocol import Command, Trajectory
from parcours_navigation.stage.tracking import FARTHEST, SHORTEST_STEP, is_trajectory

Floats = NDArray[np.float64]

_LEGAL = "an answer is a pair (v, w), a Command, a Trajectory or None"
_LEGAL_HOLONOMIC = "an answer is a pair (v, w), a Command, a triple (vx, vy, w), a Velocity, a Trajectory or None"


class BadAnswer(Exception):
    """The planner's answer is neither a command nor a trajectory, or not finite; the message says what it was."""

    def __init__(self, what: str, *, finite: bool = True) -> None:
        super().__init__(what)
        self.finite = finite


def read_answer(answer: object, *, is_holonomic: bool = False) -> tuple[float, float, Floats | None, float]:
    """Return forward speed [m/s], yaw rate [rad/s], None, speed to the left [m/s]; or 0, 0, a trajectory's points, 0.

    A list or an array of two numbers is taken for a pair; holonomic robots are given triples, too. Raises BadAnswer if
    it is not what `Answer` allows, or a number in it is not finite.

    >>> read_answer(np.array([0.2, 0.0]))
    (0.2, 0.0, None, 0.0)
    >>> read_answer((0.2, float("nan")))
    Traceback (most recent call last):
    parcours_navigation.guests.answers.BadAnswer: returned (0.2, nan), but speeds are finite numbers
    """
    if isinstance(answer, Trajectory):
        return 0.0, 0.0, _points(answer.points), 0.0
    lengths, legal = ((2, 3), _LEGAL_HOLONOMIC) if is_holonomic else ((2,), _LEGAL)
    given: list[object]
    if isinstance(answer, np.ndarray):
        if answer.ndim != 1 or len(answer) not in lengths or answer.dtype.kind not in "fiu":
            raise BadAnswer(f"returned an array of shape {answer.shape} of {answer.dtype}, but {legal}")
        given = answer.tolist()
    elif isinstance(answer, tuple | list):
        if len(answer) not in lengths:
            raise BadAnswer(f"returned {_shown(answer)} of length {len(answer)}, but {legal}")
        given = list(answer)
        if not all(map(_is_number, given)):
            raise BadAnswer(f"returned {_shown(answer)}, but speeds are numbers")
    else:
        raise BadAnswer(f"returned {_shown(answer)} of type {type(answer).__name__}, but {legal}")
    try:
        speeds = [float(one) for one in given]  # type: ignore[arg-type]
    except (OverflowError, ValueError, TypeError) as error:
        raise BadAnswer(f"returned {_shown(answer)}, but speeds are finite numbers", finite=False) from error
    if not all(map(math.isfinite, speeds)):
        shown = f"{'Command' if isinstance(answer, Command) else ''}({', '.join(map(str, speeds))})"
        raise BadAnswer(f"returned {shown}, but speeds are finite numbers", finite=False)
    return speeds[0], speeds[-1], None, speeds[1] if len(speeds) == 3 else 0.0


def _is_number(value: object) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)


def _points(given: object) -> Floats:
    """Return a copy of a trajectory's points, once they are found in order."""
    if not isinstance(given, np.ndarray | list | tuple):
        raise BadAnswer(f"returned a Trajectory whose points are {_shown(given)}, not an array of shape (n, 4)")
    try:
        array = np.asarray(given)
        if array.dtype.kind not in "fiu" or array.ndim != 2 or array.shape[1] != 4 or len(array) == 0:
            what = f"of shape {array.shape} of {array.dtype}"
            raise BadAnswer(f"returned a Trajectory of points {what}, but they are numbers of shape (n, 4), n > 0")
        points = np.array(array, np.float64, order="C")
    except ValueError as error:
        raise BadAnswer("returned a Trajectory of points that make no array of shape (n, 4)") from error
    if not is_trajectory(points):
        for i, row in enumerate(points.tolist()):
            if not all(abs(value) <= FARTHEST for value in row):
                rule = f"no number may exceed {FARTHEST:g}"
                raise BadAnswer(f"returned a Trajectory whose point {i} is {_shown(tuple(row))}: {rule}", finite=False)
        raise BadAnswer(f"returned a Trajectory whose times do not increase by at least {SHORTEST_STEP:g} s")
    return points


def _shown(value: object) -> str:
    """Return a short form of a value that cannot fail."""
    try:
        return _SHORT.repr(value)
    except Exception:
        return "something"


class _Short(reprlib.Repr):
    """Short forms that are the same in every run."""

    def repr_instance(self, value: object, level: int) -> str:
        """Return the short form of an object, without its address."""
        text, most = without_addresses(repr(value)), self.maxother
        return text if len(text) <= most else f"{text[: most // 2]}...{text[-(most // 2) :]}"


_SHORT = _Short()
_SHORT.maxother = 40

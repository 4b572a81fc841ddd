"""Columns of scores over many runs, and two of the scores: SPL and SCT.

SPL: Anderson et al., On Evaluation of Embodied Navigation Agents, 2018. SCT: Yokoyama, Ha and Batra, Success Weighted
by Completion Time, IROS 2021.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.errors import BadRequest
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import GOAL_TOLERANCE

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Runs:
    """What the scores of many runs are computed from, one entry a run.

    Raises BadRequest if the arrays do not have the same length.
    """

    facts: NDArray[np.void]  # array of FACTS, shape (n,)
    measures: NDArray[np.void]  # array of MEASURES, shape (n,)
    # array of PUBLISHED, shape (n,), needed by the modes that reproduce published code
    published: NDArray[np.void] | None = None
    shortest: Values | None = None  # length of the shortest way to the goal [m], shape (n,)
    fastest: Values | None = None  # least time to the goal within the robot's limits [s], shape (n,)
    planning_time: Values | None = None  # mean computing time of a planning cycle [s], shape (n,)
    top_speed: float = 2.0  # BARN's optimal time is the shortest way at this speed [m/s]
    goal_tolerance: float = GOAL_TOLERANCE  # [m]

    def __post_init__(self) -> None:
        for name in ("measures", "published", "shortest", "fastest", "planning_time"):
            array = getattr(self, name)
            if array is not None and array.shape != self.facts.shape:
                rule = f"{name} must have one entry a run, shape {self.facts.shape}, but its shape is {array.shape}"
                raise BadRequest("runs", rule, slug="runs-shape")

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Whether the goal was reached before the end, whatever was touched, without an error, shape (n,)."""
        return np.asarray((self.facts["t_goal"] != NEVER) & (self.facts["error"] == 0))

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Whether robot and obstacle ever were in contact, no matter which caused it, shape (n,)."""
        return np.asarray(self.facts["t_contact"] != NEVER)

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether the goal was reached without any contact, shape (n,)."""
        return self.arrived & ~self.touched

    @property
    def time_to_goal(self) -> Values:
        """Time at which the goal was reached [s], NaN if never, shape (n,)."""
        return np.where(self.arrived, self.facts["t_goal"] * 1e-9, np.nan)

    def needed(self, name: str) -> NDArray[np.void]:
        """Return the optional array `name`. Raises BadRequest if it was not given."""
        array: NDArray[np.void] | None = getattr(self, name)
        if array is None:
            rule = f"this score needs {name}, but none was given"
            raise BadRequest("runs", rule, f"give Runs(..., {name}=...)", slug="runs-missing")
        return array


@dataclass(frozen=True, slots=True)
class ScoreColumn:
    """One score of every run."""

    name: str  # what it is called
    unit: str  # "1" for shares and counts
    values: Values  # shape (n,); NaN where it is not defined for a run

    @property
    def mean(self) -> float:
        """The mean over the runs for which it is defined; NaN if there is none."""
        known = self.values[~np.isnan(self.values)]
        return float(known.mean()) if known.size else math.nan


@dataclass(frozen=True, slots=True)
class Benchmark:
    """A published benchmark's scores."""

    score: Callable[[Runs, str], dict[str, NDArray[Any]]]  # turns runs and the name of a mode into columns
    # what each mode does; the first is the default. Those that reproduce published code name its defects.
    modes: Mapping[str, str]
    source: str  # where it is defined


def spl(success: ArrayLike, shortest: ArrayLike, travelled: ArrayLike) -> Values:
    """Return success weighted by path length of each run, S l / max(p, l), shape (n,).

    S is the success, l the shortest way [m], p the way travelled [m], shape (n,) each. Raises BadRequest if a shortest
    way is not positive, or the shapes differ.

    >>> spl([True, True, False], [2.0, 2.0, 2.0], [2.5, 2.0, 9.0]).tolist()
    [0.8, 1.0, 0.0]
    """
    return _weighted("SPL", success, shortest, travelled)


def sct(success: ArrayLike, fastest: ArrayLike, taken: ArrayLike) -> Values:
    """Return success weighted by completion time of each run, S T / max(C, T), shape (n,).

    S is the success, T the least time to the goal within the robot's limits [s], C the time taken [s], anything where
    it failed, shape (n,) each. Raises BadRequest if a fastest time is not positive, or the shapes differ.

    >>> sct([True, False], [4.0, 4.0], [8.0, float("nan")]).tolist()
    [0.5, 0.0]
    """
    return _weighted("SCT", success, fastest, taken)


def _weighted(where: str, success: ArrayLike, best: ArrayLike, actual: ArrayLike) -> Values:
    """Return best / max(actual, best) where successful, else 0; NaN where best is NaN."""
    s, b, a = np.asarray(success, bool), np.asarray(best, np.float64), np.asarray(actual, np.float64)
    if not s.shape == b.shape == a.shape:
        shapes = f"{s.shape}, {b.shape} and {a.shape}"
        raise BadRequest(where, f"all must have one value a run, but their shapes are {shapes}", slug="runs-shape")
    require_positive(where, b)
    share = b / np.maximum(a, b)
    return np.where(np.isnan(b), np.nan, np.where(s, share, 0.0))


def require_positive(where: str, values: Values) -> None:
    """Raise BadRequest if a best length or time is 0 or less; NaN passes, as unknown."""
    if np.any(values <= 0.0):
        worst = float(np.nanmin(values))
        rule = f"the best length or time must be positive, but {worst:g} given"
        raise BadRequest(where, rule, "leave such cases out, or give NaN", slug="best-not-positive")

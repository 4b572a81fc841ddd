"""One recorded run of a disc robot among disc obstacles, and the compact JSON from which replay.js plays it.

The JSON holds whole millimetres, each as the step from the last: replay.js sums them up again without any loss.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.report.pieces import Floats

PER_METRE = 1000
"""Resolution of lengths: 1 mm."""

PER_SECOND = 1000
"""Resolution of times: 1 ms."""

PER_RADIAN = 1000
"""Resolution of headings: 1 mrad."""


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """One recorded run of a disc robot among disc obstacles.

    Attributes:
        title: the case, e.g. its id.
        subtitle: what became of it, in words.
        times: strictly increasing [s], shape (n_times,).
        x, y: robot centre [m], shape (n_times,).
        heading: counter-clockwise from x [rad], shape (n_times,).
        halted: whether the robot was held for imminent collision, shape (n_times,).
        obstacle_x, obstacle_y: obstacle centres [m], shape (n_times, n_obstacles).
        robot_radius: [m].
        obstacle_radii: [m], shape (n_obstacles,).
        arena: width and height of the area, which starts at the origin [m].
        goal: x and y [m].
        goal_tolerance: distance to the goal that counts as reached [m].
        note: small print below it.

    Raises:
        BadRequest: there is no sample, the shapes disagree, a number is not finite, a size is not positive,
            or the times do not increase.
    """

    title: str
    subtitle: str
    times: Floats
    x: Floats
    y: Floats
    heading: Floats
    halted: NDArray[np.bool_]
    obstacle_x: Floats
    obstacle_y: Floats
    robot_radius: float
    obstacle_radii: tuple[float, ...]
    arena: tuple[float, float]
    goal: tuple[float, float]
    goal_tolerance: float
    note: str = ""

    def __post_init__(self) -> None:
        n, m = len(self.times), len(self.obstacle_radii)
        self._require(n > 0, "it must have at least one sample, but has none", "replay-shape")
        for name in ("times", "x", "y", "heading", "halted", "obstacle_x", "obstacle_y"):
            values = getattr(self, name)
            due = (n, m) if name.startswith("obstacle") else (n,)
            self._require(values.shape == due, f"{name} must have shape {due}, but has {values.shape}", "replay-shape")
            self._require(
                bool(np.isfinite(values).all()), f"{name} must be finite, but is not everywhere", "replay-values"
            )
        self._require(bool((np.diff(self.times) > 0.0).all()), "times must increase, but do not", "replay-values")
        for size in (self.robot_radius, self.goal_tolerance, *self.obstacle_radii, *self.arena):
            self._require(
                bool(np.isfinite(size)) and size > 0.0,
                f"sizes must be finite and above 0 m, but {size:g} given",
                "replay-values",
            )
        self._require(
            bool(np.isfinite(self.goal).all()), f"the goal must be finite, but is {self.goal}", "replay-values"
        )

    def _require(self, holds: bool, rule: str, slug: str) -> None:
        if not holds:
            raise BadRequest(f"replay {self.title!r}", rule, "check what was recorded", slug=slug)

    def clearance(self) -> Floats:
        """Return the least gap to an obstacle at each time [m], shape (n_times,); infinite without any."""
        if not self.obstacle_radii:
            return np.full(len(self.times), np.inf)
        gap = np.hypot(self.obstacle_x - self.x[:, None], self.obstacle_y - self.y[:, None])
        least: Floats = (gap - self.robot_radius - np.asarray(self.obstacle_radii)).min(axis=1)
        return least


def embedded(replay: Replay) -> str:
    """Return the replay as JSON.

    Keys: t, x, y, h (time, position, heading) and ox, oy (one list an obstacle) hold steps; halts holds the
    samples where `halted` changes, starting from not halted; r, or, size, goal, tol are plain values [m]; least is
    the sample of least clearance and that clearance.

    >>> at = np.array([0.0, 0.5])
    >>> run = Replay("t", "", at, at, at, at, at > 0, at[:, None], at[:, None] + 1.0, 0.125, (0.1,),
    ...              (2.0, 2.0), (2.0, 2.0), 0.2)
    >>> embedded(run)[:61]
    '{"t":[0,500],"x":[0,500],"y":[0,500],"h":[0,500],"halts":[1],'
    >>> print(embedded(run)[61:])
    "ox":[[0,500]],"oy":[[1000,500]],"r":0.125,"or":[0.1],"size":[2.0,2.0],"goal":[2.0,2.0],"tol":0.2,"least":[0,0.775]}
    """
    halted = np.asarray(replay.halted, dtype=np.int8)
    record = {
        "t": steps(replay.times, PER_SECOND),
        "x": steps(replay.x, PER_METRE),
        "y": steps(replay.y, PER_METRE),
        "h": steps(replay.heading, PER_RADIAN),
        "halts": np.flatnonzero(np.diff(halted, prepend=0)).tolist(),
        "ox": [steps(column, PER_METRE) for column in replay.obstacle_x.T],
        "oy": [steps(column, PER_METRE) for column in replay.obstacle_y.T],
        "r": float(replay.robot_radius),
        "or": [float(radius) for radius in replay.obstacle_radii],
        "size": [float(side) for side in replay.arena],
        "goal": [float(place) for place in replay.goal],
        "tol": float(replay.goal_tolerance),
        "least": _least(replay),
    }
    return json.dumps(record, separators=(",", ":"), allow_nan=False)


def _least(replay: Replay) -> list[float] | None:
    """Return the sample of least clearance and that clearance [m], before rounding; None without obstacles."""
    if not replay.obstacle_radii:
        return None
    clearance = replay.clearance()
    at = int(clearance.argmin())
    return [at, round(float(clearance[at]), 4)]


def steps(values: Floats, per_unit: int) -> list[int]:
    """Return the values in whole parts of a unit: the first as it is, each other as the step from the last.

    Args:
        values: any unit, shape (n,).
        per_unit: parts of a unit.

    >>> steps(np.array([1.0, 1.2504, 1.2]), 1000)
    [1000, 250, -50]
    """
    whole = np.round(values * per_unit).astype(np.int64)
    stepped: list[int] = np.diff(whole, prepend=0).tolist()
    return stepped

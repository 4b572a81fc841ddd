"""One recorded run of a disc robot among disc obstacles, and the compact JSON from which replay.js plays it.

The JSON holds whole millimetres, each as the step from the last: replay.js sums them up again without any loss.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.report.pieces import Floats
from parcours_navigation.facts import FACTS
from parcours_navigation.outcomes import explain
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements
from parcours_navigation.study.margins import Margins, margins

_FARTHEST_GAP = 100.0
"""Gaps to the ground are drawn up to this [m]."""

PARTS = 1000
"""Resolution: parts of a metre, a second, a radian."""


@dataclass(frozen=True, slots=True, eq=False)
class StandingThings:
    """What stands for good in a recorded run, and the robot's shape."""

    walls: Floats  # ends x0, y0, x1, y1 of each [m], shape (n, 4)
    discs: Floats  # x, y, radius of each [m], shape (m, 3)
    gaps: Floats  # from the robot to the nearest of them at each time [m], shape (n_times,)
    corners: Floats  # of the robot's footprint in its own frame [m], shape (k, 2); a disc has none
    # goals before the last one, x, y [m], shape (g, 2); and the way that the planner is shown, shape (p, 2)
    goals: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    path: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    scan: tuple[int, float, float, float] = (0, 0.0, 0.0, 0.0)  # beams, first direction and step [rad], reach [m]

    def moved(self, x: float, y: float, n: int) -> StandingThings:
        """Return the same with another origin [m], for the first n times."""
        return replace(self, walls=self.walls - [x, y, x, y], discs=self.discs - [x, y, 0.0], gaps=self.gaps[:n],
                       goals=self.goals - [x, y], path=self.path - [x, y])  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """One recorded run of a disc robot among disc obstacles.

    Raises BadRequest if there is no sample, the shapes disagree, a number is not finite, a size is not positive, or the
    times do not increase.
    """

    title: str  # the case, e.g. its id.
    subtitle: str  # what became of it, in words
    times: Floats  # strictly increasing [s], shape (n_times,)
    x: Floats  # robot centre [m], shape (n_times,)
    y: Floats
    heading: Floats  # counter-clockwise from x [rad], shape (n_times,)
    halted: NDArray[np.bool_]  # whether the robot was held for imminent collision, shape (n_times,)
    obstacle_x: Floats  # obstacle centres [m], shape (n_times, n_obstacles)
    obstacle_y: Floats
    robot_radius: float  # [m]
    obstacle_radii: tuple[float, ...]  # [m], shape (n_obstacles,)
    arena: tuple[float, float]  # width and height of the area, which starts at the origin [m]
    goal: tuple[float, float]  # x and y [m]
    goal_tolerance: float  # distance to the goal that counts as reached [m]
    note: str = ""  # small print below it
    ground: StandingThings | None = None  # what stands there for good
    required: tuple[Margins, ...] = ()  # requirements over time

    def __post_init__(self) -> None:
        n, m = len(self.times), len(self.obstacle_radii)
        self._require(n > 0, "it must have at least one sample, but has none", "replay-shape")
        for name in ("times", "x", "y", "heading", "halted", "obstacle_x", "obstacle_y"):
            values = getattr(self, name)
            due = (n, m) if name.startswith("obstacle") else (n,)
            self._require(values.shape == due, f"{name} must have shape {due}, but has {values.shape}", "replay-shape")
            self._require(np.isfinite(values).all(), f"{name} must be finite, but is not everywhere")
        self._require((np.diff(self.times) > 0.0).all(), "times must increase, but do not")
        for size in (self.robot_radius, self.goal_tolerance, *self.obstacle_radii, *self.arena):
            self._require(0.0 < size < np.inf, f"sizes must be finite and above 0 m, but {size:g} given")
        self._require(np.isfinite(self.goal).all(), f"the goal must be finite, but is {self.goal}")

    def _require(self, holds: object, rule: str, slug: str = "replay-values") -> None:
        if not holds:
            raise BadRequest(f"replay {self.title!r}", rule, "check what was recorded", slug=slug)

    def clearance(self) -> Floats:
        """Return the least gap to an obstacle or the ground at each time [m], shape (n_times,); infinite without any.

        A footprint counts as the disc around it, but to the ground.
        """
        least = np.full(len(self.times), np.inf) if self.ground is None else self.ground.gaps
        if not self.obstacle_radii:
            return least
        gap = np.hypot(self.obstacle_x - self.x[:, None], self.obstacle_y - self.y[:, None])
        nearest: Floats = (gap - self.robot_radius - np.asarray(self.obstacle_radii)).min(axis=1)
        return np.minimum(nearest, least)


def replayed(
    id: str,
    label: str,
    ran: tuple[NDArray[np.void], NDArray[np.void], Floats],
    kept: NDArray[np.void],
    remedy: str,
    *,
    robot_radius: float,
    obstacle_radius: float,
    arena: float,
    goal: tuple[float, float],
    tolerance: float,
    title: str = "",
    beyond: int | None = None,
    obstacle_radii: tuple[float, ...] | None = None,
    box: tuple[float, float, float, float] | None = None,
    standing: StandingThings | None = None,
    requirements: Requirements = NO_REQUIREMENTS,
) -> Replay:
    """Return the replay of a case that was run again, shown up to `beyond` [ns] after its end.

    What is shown of a world other than the paper's arena is `box`, x_low, y_low, x_high, y_high [m], and `standing`.

    `ran` is facts, track and places of the new run, `kept` the facts that its campaign kept. Raises BadResults, with
    the remedy, if their judge's facts differ.
    """
    facts, track, places = ran
    judged = list(FACTS.names or ())
    if [row[judged].tolist() for row in kept] != [facts[0][judged].tolist()]:
        rule = "a replay must give the facts that were kept, but gives others"
        raise BadResults(id, rule, remedy, slug="replay-differs")
    radii = obstacle_radii if obstacle_radii is not None else (obstacle_radius,) * places.shape[1]
    gaps = None if standing is None else standing.gaps
    required = margins(requirements, kept[0], track, places, gaps, np.array(radii, np.float64), robot_radius, goal)
    if beyond is not None:
        n_shown = int(np.searchsorted(track["time"], int(facts[0]["t_end"]) + beyond, "right"))
        track, places = track[:n_shown], places[:n_shown]
    x0, y0, x1, y1 = box or (0.0, 0.0, arena, arena)
    return Replay(
        title or f"{id}, {label}", f"{id}: {explain(facts[0])}", track["time"] * 1e-9, track["x"] - x0, track["y"] - y0,
        track["heading"], track["halted"] == 1, places[:, :, 0] - x0, places[:, :, 1] - y0, robot_radius, radii,
        (x1 - x0, y1 - y0), (goal[0] - x0, goal[1] - y0), tolerance, "",
        None if standing is None else standing.moved(x0, y0, len(track)), required,
    )  # fmt: skip


def embedded(replay: Replay) -> str:
    """Return the replay as JSON.

    Keys: t, x, y, h (time, position, heading) and ox, oy (one list an obstacle) hold steps; halts holds the
    samples where `halted` changes, starting from not halted; r, or, size, goal, tol are plain values [m]; least is
    the sample of least clearance and that clearance; req, if anything is required: name, when violated [s], unit, and
    its robustness over the times in `at` [s], null where infinite.

    >>> at = np.array([0.0, 0.5])
    >>> run = Replay("t", "", at, at, at, at, at > 0, at[:, None], at[:, None] + 1.0, 0.125, (0.1,),
    ...              (2.0, 2.0), (2.0, 2.0), 0.2)
    >>> embedded(run)[:61]
    '{"t":[0,500],"x":[0,500],"y":[0,500],"h":[0,500],"halts":[1],'
    >>> print(embedded(run)[61:])
    "ox":[[0,500]],"oy":[[1000,500]],"r":0.125,"or":[0.1],"size":[2.0,2.0],"goal":[2.0,2.0],"tol":0.2,"least":[0,0.775]}
    """
    halted = np.asarray(replay.halted, dtype=np.int8)
    clearance = replay.clearance()
    at = int(clearance.argmin())
    least = [at, round(float(clearance[at]), 4)] if np.isfinite(clearance[at]) else None
    record = {
        "t": steps(replay.times, PARTS),
        "x": steps(replay.x, PARTS),
        "y": steps(replay.y, PARTS),
        "h": steps(replay.heading, PARTS),
        "halts": np.flatnonzero(np.diff(halted, prepend=0)).tolist(),
        "ox": [steps(column, PARTS) for column in replay.obstacle_x.T],
        "oy": [steps(column, PARTS) for column in replay.obstacle_y.T],
        "r": float(replay.robot_radius),
        "or": [float(radius) for radius in replay.obstacle_radii],
        "size": [float(side) for side in replay.arena],
        "goal": [float(place) for place in replay.goal],
        "tol": float(replay.goal_tolerance),
        "least": least,
    }
    if replay.ground is not None:
        standing = replay.ground
        far = np.minimum(standing.gaps, _FARTHEST_GAP)
        record |= {"walls": np.round(standing.walls, 3).tolist(), "discs": np.round(standing.discs, 3).tolist(),
                   "gaps": steps(far, PARTS), "body": np.round(standing.corners, 3).tolist(),
                   "goals": np.round(standing.goals, 3).tolist(), "path": np.round(standing.path, 3).tolist(),
                   "scan": [*standing.scan]}  # fmt: skip
    if replay.required:
        record["at"] = np.round(replay.required[0].times, 3).tolist()
        record["req"] = [
            [one.name, one.violated_at, "" if one.unit == "1" else one.unit,
             [round(value, 4) if np.isfinite(value) else None for value in one.values.tolist()]]
            for one in replay.required
        ]  # fmt: skip
    return json.dumps(record, separators=(",", ":"), allow_nan=False)


def steps(values: Floats, per_unit: int) -> list[int]:
    """Return the values in whole parts of a unit: the first as it is, each other as the step from the last.

    >>> steps(np.array([1.0, 1.2504, 1.2]), 1000)
    [1000, 250, -50]
    """
    whole = np.round(values * per_unit).astype(np.int64)
    stepped: list[int] = np.diff(whole, prepend=0).tolist()
    return stepped

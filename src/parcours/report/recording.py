"""A replay -> the compact JSON that the page's player reads: whole millimetres, as steps from the last.

replay.js sums the steps up again; whole numbers, so nothing is lost on the way.
"""

from __future__ import annotations

import json

import numpy as np

from parcours.report.pieces import Floats, Replay

PER_METRE = 1000
"""Resolution of lengths: 1 mm."""

PER_SECOND = 1000
"""Resolution of times: 1 ms."""

PER_RADIAN = 1000
"""Resolution of headings: 1 mrad."""


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

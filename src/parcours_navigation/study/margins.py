"""How far each requirement is from being violated while a case goes on: the robustness of what has passed so far.

Had the case ended at a moment, this is the robustness that its requirements would have had: of `always` the least
margin so far, of `eventually` the best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.report.pieces import Floats
from parcours_navigation.requirements.requirement import Monitor, Requirements

_MOMENTS = 200  # at most, evenly over the case


@dataclass(frozen=True, slots=True, eq=False)
class Margins:
    """One requirement over a case."""

    name: str
    unit: str  # "1": comparisons in several units, or in none
    violated_at: float | None  # [s]
    times: Floats  # [s], shape (n,)
    values: Floats  # robustness of what has passed until then, shape (n,); the last one is that of the case


def margins(
    requirements: Requirements, record: np.void, track: NDArray[np.void], places: Floats, gaps: Floats | None,
    radii: Floats, robot_radius: float, goal: tuple[float, float],
) -> tuple[Margins, ...]:  # fmt: skip
    """Return the margins of each requirement over a case.

    Args:
        requirements: of the study.
        record: what its campaign kept of the case.
        track, places: array of TRACK, shape (n,), and obstacles [m], shape (n, n_obstacles, 2).
        gaps: between robot and ground [m], shape (n,), if there is ground.
        radii, robot_radius, goal: [m].
    """
    until = int(np.searchsorted(track["time"], record["t_end"], "right"))
    if not requirements.formulas or record["error"] or not until:
        return ()
    columns = [track[name][:until].astype(np.float64) for name in track.dtype.names or ()]
    columns += [] if gaps is None else [gaps[:until]]
    entries = np.ascontiguousarray(np.column_stack([*columns, places[:until].reshape(until, -1)]))
    monitor = Monitor(requirements, until + 1)
    ends = np.unique(np.linspace(1, until, min(until, _MOMENTS)).astype(np.int64))
    values = np.empty((len(ends) + 1, len(requirements.formulas)))
    for k, end in enumerate(ends.tolist()):
        values[k] = monitor.judge(entries[:end], entries[end - 1], radii, robot_radius, goal)[0]
    values[-1] = record["robustness"]  # with where the robot was at the very end, between two samples
    times = np.append(track["time"][ends - 1], record["t_end"]) * 1e-9
    return tuple(
        Margins(
            one.name, one.unit, float(record["violated_at"][k]) if values[-1, k] < 0.0 else None, times, values[:, k]
        )
        for k, one in enumerate(requirements.formulas)
    )

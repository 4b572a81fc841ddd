"""What a case in memory comes to at its end: facts, measures, requirements; its track."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.facts import NEVER, TRACK
from parcours_navigation.measures.kernel import measure
from parcours_navigation.measures.one_case import SAFE_DISTANCE
from parcours_navigation.requirements.own import CaseRun
from parcours_navigation.requirements.requirement import Monitor
from parcours_navigation.stage import moving
from parcours_navigation.stage.memory import ROW, Staged, recorded
from parcours_navigation.stage.ticking import ground_gap

Floats = NDArray[np.float64]


def track_of(memory: Floats) -> tuple[NDArray[np.void], Floats]:
    """Return the track of a case, array of TRACK of shape (n,), and the bodies' places, (n, k, 2) [m]."""
    rows, n = recorded(memory)
    track = np.zeros(len(rows), TRACK)
    for k, name in enumerate(TRACK.names or ()):
        track[name] = rows[:, k]
    return track, rows[:, ROW:].reshape(len(rows), n, 2).copy()


def gaps_of(memory: Floats) -> Floats:
    """Return the gap between robot and ground at each entry of a case's track [m], shape (n,)."""
    return recorded(memory)[0][:, ROW - 1].copy()


def conclude(memory: Floats, staged: Staged, monitor: Monitor | None, facts: NDArray[np.void]) -> CaseRun | None:
    """Write down in the facts, shape (1,), how a case stands at its end, and judge its requirements if it has any.

    Returns what the user's own measures read of the case; None if there are no such measures.
    """
    moving.freeze(memory, facts[0])
    track, places = track_of(memory)
    scene, task = staged.scene, (staged.task, *staged.goals)[-1]
    x, y = task.goal
    measure(
        track, places, np.ascontiguousarray(scene.obstacles["radius"]), task.robot_radius, x, y,
        task.goal_tolerance, int(facts["t_goal"][0]), SAFE_DISTANCE, gaps_of(memory), facts[0]["measures"],
    )  # fmt: skip
    return None if monitor is None else _judge(memory, monitor, staged, facts)


def conclude_later(memory: Floats, facts: NDArray[np.void]) -> None:
    """Add to the facts, shape (1,), what became of an unfinished case while it was watched on."""
    facts["t_goal_after"] = moving.goal_time(memory)
    moving.touched_later(memory, facts[0])
    soon = int(facts["t_end"][0]) + 1_000_000_000
    facts["moved_after"] = facts["t_goal_after"] != NEVER or moving.moved_since(memory, soon)


def _judge(memory: Floats, monitor: Monitor, staged: Staged, facts: NDArray[np.void]) -> CaseRun | None:
    """Judge requirements over the way up to now; return what the user's own measures read, None if there are none."""
    rows = recorded(memory)[0]
    moving.present(memory, last := np.zeros(rows.shape[1]))
    if not staged.scene.plain:
        last[ROW - 1] = ground_gap(memory)
    radii = np.ascontiguousarray(staged.scene.obstacles["radius"])
    goals, size = tuple(one.goal for one in (staged.task, *staged.goals)), staged.task.robot_radius
    if monitor.program.roots.size:
        monitor.judge(staged.number, rows, last, radii, size, goals[-1])
    if not monitor.measures:
        return None
    return CaseRun(staged.number, *track_of(memory), radii, gaps_of(memory), size, goals, facts[0].copy())

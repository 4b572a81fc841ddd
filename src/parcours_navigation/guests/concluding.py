"""What cases in memory come to at their end: facts, measures, requirements; their tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours_navigation.facts import NEVER, TRACK
from parcours_navigation.measures.kernel import measure
from parcours_navigation.measures.one_case import SAFE_DISTANCE
from parcours_navigation.requirements.requirement import Monitor
from parcours_navigation.requirements.user_measures import CaseRun
from parcours_navigation.stage import moving
from parcours_navigation.stage.memory import AT_STAGE, AT_WORLD, ROW, STAGE, Ints, Staged, recorded
from parcours_navigation.stage.moving import freeze, goal_time, moved_since, obstacles_of, touched_later
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


def conclude(
    memories: Floats, staged: Sequence[Staged], monitor: Monitor | None, facts: NDArray[np.void]
) -> tuple[CaseRun, ...]:
    """Write down how cases of one scene and task stand at their end, and judge their requirements if they have any.

    Args:
        memories: one case a row, shape (n, n_words).
        staged: these cases.
        monitor: keeps the results of requirements.
        facts: receives FACTS, shape (n,).

    Returns what the user's own measures read of each case; nothing if there are no such measures.
    """
    stage, one = memories[0, AT_STAGE:AT_WORLD].view(STAGE)[0], staged[0]
    bodies, most = int(stage["n"]), int(stage["most_track"])
    last = (one.task, *one.goals)[-1]
    x, y = last.goal
    sum_up(
        memories, float(last.robot_radius), float(x), float(y), float(last.goal_tolerance), np.empty(most, TRACK),
        np.empty((most, bodies, 2)), np.empty(most), np.empty(bodies), facts,
    )  # fmt: skip
    if monitor is None:
        return ()
    if monitor.program.roots.size:
        for memory, each in zip(memories, staged, strict=True):
            monitor.results[each.number] = _judge(memory, monitor, float(last.robot_radius), (float(x), float(y)))
    if not monitor.measures:
        return ()
    goals = tuple(each.goal for each in (one.task, *one.goals))
    return tuple(
        CaseRun(each.number, *track_of(memory), np.ascontiguousarray(each.scene.obstacles["radius"]), gaps_of(memory),
                each.task.robot_radius, goals, facts[k].copy())
        for k, (memory, each) in enumerate(zip(memories, staged, strict=True))
    )  # fmt: skip


def _judge(memory: Floats, monitor: Monitor, robot_radius: float, goal: tuple[float, float]) -> Floats:
    """Return what `Monitor.judge` finds in a case up to now."""
    entries, bodies = recorded(memory)
    last, radii = np.empty(ROW + 2 * bodies), np.empty(bodies)
    moving.present(memory, last, radii)
    if not memory[AT_STAGE:AT_WORLD].view(STAGE)[0]["plain"]:
        last[ROW - 1] = ground_gap(memory)
    return monitor.judge(entries, last, radii, robot_radius, goal)


@kernel
def sum_up(
    memories: Floats, robot_radius: float, x: float, y: float, tolerance: float, track: Record, places: Floats,
    gaps: Floats, radii: Floats, facts: Record,
) -> None:  # fmt: skip
    """Fill FACTS, shape (n,), with how each case stands, and with the measures of its way up to now.

    The goal lies at (x, y) [m]. `track`, `places`, `gaps` and `radii` have room for the longest track.
    """
    for k in range(len(memories)):
        memory = memories[k]
        freeze(memory, facts[k])
        stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
        n, at = stage.n_track, stage.at_track
        for i in range(n):
            entry = track[i]
            entry.time, entry.x, entry.y, entry.heading = (
                int(memory[at]),
                memory[at + 1],
                memory[at + 2],
                memory[at + 3],
            )
            entry.v, entry.w, entry.halted = memory[at + 4], memory[at + 5], int(memory[at + 6])
            gaps[i] = memory[at + ROW - 1]
            for j in range(stage.n):
                places[i, j, 0], places[i, j, 1] = memory[at + ROW + 2 * j], memory[at + ROW + 2 * j + 1]
            at += ROW + 2 * stage.n
        obstacles = obstacles_of(memory, stage)
        for j in range(stage.n):
            radii[j] = obstacles[j].radius
        measure(
            track[:n], places[:n], radii, robot_radius, x, y, tolerance, facts[k].t_goal, SAFE_DISTANCE, gaps[:n],
            facts[k].measures,
        )  # fmt: skip


@kernel
def sum_up_later(memories: Floats, rows: Ints, facts: Record) -> None:
    """Add to FACTS, shape (n,), what became of the unfinished cases in some rows while they were observed further."""
    for row in rows:
        memory, found = memories[row], facts[row]
        found.t_goal_after = goal_time(memory)
        touched_later(memory, found)
        found.moved_after = found.t_goal_after != NEVER or moved_since(memory, found.t_end + 1_000_000_000)

"""RAMP's cases, run compiled and judged by requirements over the track that each has left."""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_navigation.requirements.kernel import judge
from parcours_navigation.requirements.signals import Floats, Ints
from parcours_ramp.system.closed_loop import run_case


@kernel
def _entries(track: Record, places: Floats, n_track: int, until: int, entries: Floats) -> int:
    """Lay a track out for `signals.take`, up to `until` [ns]; return how many entries there are."""
    n = 0
    while n < n_track and track[n].time <= until:
        entry = track[n]
        entries[n, 0], entries[n, 1], entries[n, 2], entries[n, 3] = float(entry.time), entry.x, entry.y, entry.heading
        entries[n, 4], entries[n, 5], entries[n, 6] = entry.v, entry.w, float(entry.halted)
        for k in range(places.shape[1]):
            entries[n, 7 + 2 * k], entries[n, 8 + 2 * k] = places[n, k, 0], places[n, k, 1]
        n += 1
    return n


@kernel
def run_and_judge(
    numbers: Record, obstacles: Record, setting: Record, parameters: Record, latencies: Record, work: Record,
    seen: Record, predictions: Record, guarded: Record, facts: Record, track: Record, places: Floats, radii: Floats,
    entries: Floats, code: Ints, roots: Ints, wanted: Ints, memory: Floats, absent: Ints, results: Floats,
) -> None:  # fmt: skip
    """Run the cases one after the other, and judge each.

    Args as of `run_case` with the cases as leading axis, and of `judge`; entries: working memory, shape (length of the
    track + 1, 7 + 2 n_obstacles); results: receives robustness and when it is decided [s], shape (n_cases, 2, n).
    """
    for k in range(len(numbers)):
        run_case(
            numbers[k], obstacles[k], setting, parameters, latencies, work, seen, predictions, guarded, facts[k], track,
            places, radii,
        )  # fmt: skip
        n = _entries(track, places, facts[k].n_track, facts[k].t_end, entries)
        # The world stands as it did at the end, unless it was observed further: then the track has an entry there.
        last, robot = entries[n], work.world.robot
        last[0], last[1], last[2], last[3] = float(facts[k].t_end), robot.x, robot.y, robot.heading
        last[4], last[5], last[6] = robot.v, robot.w, float(work.control.halt)
        for i in range(len(radii)):
            last[7 + 2 * i], last[8 + 2 * i] = obstacles[k][i].x, obstacles[k][i].y
        judge(
            entries[:n], last, radii, robot.radius, setting.goal_x, setting.goal_y, code, roots, wanted, memory, absent,
            results[k, 0], results[k, 1],
        )  # fmt: skip

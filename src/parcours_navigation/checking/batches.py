"""Checks that a planner which is asked for many cases at once answers each as if it were asked for that case alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parcours_navigation.checking.remark import Remark, error, warning
from parcours_navigation.checking.scenes import moved, script
from parcours_navigation.checking.subject import Subject, replayed
from parcours_navigation.guests.planners import batch_of

_CASES = 6


def answers_batches_as_alone(subject: Subject) -> Iterator[Remark]:
    """In a batch, from which cases drop out one after the other, each is answered as it is alone."""
    batch = batch_of(subject.name or "that is checked", subject.make())
    if batch is None:
        return
    way = script(subject.task())
    ways = [[moved(seen, 0.4 * k, (0.1 * k, 0.0), (1.0, 1.0)) for seen in way] for k in range(min(_CASES, batch.size))]
    tasks = [one[0].task for one in ways]
    alone = [np.array(replayed(subject, task, way)) for task, way in zip(tasks, ways, strict=True)]
    given, worst, same = batch.begin(tasks), 0.0, True
    for k, seen in enumerate(zip(*ways, strict=True)):
        left = np.arange(len(tasks))[k * len(tasks) // len(ways[0]) :]
        robots, obstacles = (np.array([getattr(seen[row], name) for row in left]) for name in ("robot", "obstacles"))
        expected = np.array([alone[row][k] for row in left])
        found = batch.ask(seen[0].time, robots, obstacles, left.copy(), given)
        worst = max(
            worst, float(np.abs((found - expected) / [subject.body.limits.speed, subject.body.limits.yaw_rate]).max())
        )
        same = same and found.tobytes() == expected.tobytes()
    if worst > 1e-3:
        seen_far = f"some answers to a batch and to its cases alone differ by {100 * worst:.2g} % of the limits"
        yield error("batch-differs", seen_far, "let each row of a batch depend on its own case only")
    elif not same:
        seen_near = f"answers to a batch and to its cases alone differ in bits, at most by {worst:.1g} of the limits"
        remedy = "products of matrices round by their size: set batch_is_fixed = True, or replays may differ"
        yield warning("batch-bits", seen_near, remedy)

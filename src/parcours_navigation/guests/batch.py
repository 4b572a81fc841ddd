"""Asks a planner for many cases at once: what it is shown, and what its answer must be.

A planner has `observe_batch` and, if it remembers anything, `reset_batch`; a case alone is a batch of one for a planner
that has no `observe`. Arrays are NumPy's, which other libraries take by DLPack (`torch.from_dlpack`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.guests.answers import BadAnswer
from parcours_navigation.protocol import Observation, Observations, Task

Floats = NDArray[np.float64]

BATCH_SIZE, LARGEST = 512, 4096
"""Cases that are asked for at once where the planner does not say, and the most it may say."""


@dataclass(frozen=True, slots=True)
class BatchPlugin:
    """What a planner has for batches.

    Attributes:
        observe: called with the observations of all cases that go on.
        reset: called with the tasks of a batch, before its first observations; None if the planner has none.
        size: the most cases of a batch.
        fixed: whether all batches have that size: what is left over is filled up with copies of the first case.
    """

    observe: Callable[[Observations], object]
    reset: Callable[[Sequence[Task]], object] | None
    size: int
    fixed: bool

    def begin(self, tasks: Sequence[Task]) -> tuple[Task, ...]:
        """Begin a batch; return the tasks, as many as the planner was given."""
        given = (*tasks, *[tasks[0]] * (self.size - len(tasks) if self.fixed else 0))
        if self.reset is not None:
            self.reset(given)
        return given

    def ask(self, time: float, robots: Floats, obstacles: Floats, cases: Any, tasks: tuple[Task, ...]) -> Floats:
        """Return a speed [m/s] and a yaw rate [rad/s] for each case, shape (n, 2). Raises BadAnswer."""
        n = len(robots)
        if self.fixed and n < self.size:
            padding = [0] * (self.size - n)
            robots = np.concatenate([robots, robots[padding]])
            obstacles, cases = np.concatenate([obstacles, obstacles[padding]]), np.concatenate([cases, cases[padding]])
        return _speeds(self.observe(Observations(time, robots, obstacles, cases, tasks)), len(robots))[:n]


def _speeds(answer: object, n: int) -> Floats:
    """Return a batch's answer as an array of shape (n, 2). Raises BadAnswer."""
    legal = f"an answer to {n} observations is an array of {n} pairs (v, w)"
    try:
        is_foreign = hasattr(answer, "__dlpack__") and not hasattr(answer, "__array__")
        speeds = np.from_dlpack(answer) if is_foreign else np.asarray(answer)  # type: ignore[arg-type]
    except (ValueError, TypeError, BufferError) as error:
        raise BadAnswer(f"returned a {type(answer).__name__} that makes no array, but {legal}") from error
    if speeds.shape != (n, 2) or speeds.dtype.kind not in "fiu":
        raise BadAnswer(f"returned an array of shape {speeds.shape} of {speeds.dtype}, but {legal}")
    own: Floats = np.array(speeds, np.float64, order="C")
    if not np.isfinite(own).all():
        row = int(np.argmin(np.isfinite(own).all(axis=1)))
        shown = ", ".join(map(str, own[row].tolist()))
        raise BadAnswer(f"returned ({shown}) for case {row} of {n}, but speeds are finite numbers", finite=False)
    return own


class Alone:
    """A planner for batches that is asked for one case at a time."""

    def __init__(self, batch: BatchPlugin) -> None:
        self._batch = batch
        self._tasks: tuple[Task, ...] = ()

    def reset(self, task: Task) -> None:
        """Begin a batch of one case."""
        self._tasks = self._batch.begin([task])

    def observe(self, observation: Observation) -> tuple[float, float]:
        """Return the answer to the one observation."""
        one = np.zeros(1, np.int64)
        robots, obstacles = observation.robot[np.newaxis].copy(), observation.obstacles[np.newaxis].copy()
        v, w = self._batch.ask(observation.time, robots, obstacles, one, self._tasks)[0].tolist()
        return v, w

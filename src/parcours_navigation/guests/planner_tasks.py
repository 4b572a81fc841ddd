"""Tasks as planners are given them: nobody else has them, and each has its case's seed."""

from __future__ import annotations

import numpy as np

from parcours.streams import start
from parcours_navigation.protocol import Limits, Task

_PURPOSE = np.uint64(17)
"""Of the random stream from which planners get their seeds."""


def planner_seed(campaign_seed: int, number: int) -> int:
    """Return the seed that a planner is given in a case, in 0 .. 2**63 - 1.

    >>> planner_seed(1, 0) != planner_seed(1, 1) != planner_seed(2, 0)
    True
    """
    stream = np.zeros(1, np.uint64)
    start(stream, np.uint64(campaign_seed), np.uint64(number), _PURPOSE)
    return int(stream[0]) >> 1


def handed_out(task: Task, seed: int) -> Task:
    """Return a task that nobody else has, with a case's seed; `dataclasses.replace` takes three times as long."""
    one = task.limits
    limits = Limits(one.speed, one.yaw_rate, one.acceleration, one.yaw_acceleration)
    return Task(task.goal, task.goal_tolerance, task.robot_radius, limits, task.period, task.arena, seed, task.robot,
                task.goal_heading, task.heading_tolerance)  # fmt: skip

"""A policy learnt elsewhere as a planner: what it sees and says are those of `features`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from parcours_navigation.adapters.features import features, speeds
from parcours_navigation.protocol import Command, Observation, Task


class PolicyPlanner:
    """A function of a vector, or an object with `predict` as Stable-Baselines3 has it, asked once a period.

    `predict(vector, deterministic=True)` returns an action, or a pair of an action and the policy's state, which is
    given back to it as `state` if it takes one (recurrent policies).

    Args:
        policy: the function or object.
        n_obstacles: obstacles that a vector shows; as in the environment it was trained in.
        recurrent: whether `predict` takes `state` and `episode_start`.

    >>> ahead = PolicyPlanner(lambda vector: (1.0, 0.0))
    >>> ahead.observe.__name__
    'observe'
    """

    def __init__(self, policy: Any, n_obstacles: int = 3, recurrent: bool = False) -> None:
        self._predict: Callable[..., Any] | None = getattr(policy, "predict", None)
        self._policy, self._n, self._recurrent = policy, n_obstacles, recurrent
        self._state: Any = None
        self._first = True

    def reset(self, task: Task) -> None:
        """Begin a case: forget the policy's state, and reset the policy if it has `reset`."""
        self._state, self._first = None, True
        reset = getattr(self._policy, "reset", None)
        if callable(reset):
            reset()

    def observe(self, observation: Observation) -> Command:
        """Return the speeds of the policy's action."""
        seen = features(observation, self._n)
        if self._predict is None:
            return speeds(self._policy(seen), observation.task.limits)
        if self._recurrent:
            said = self._predict(seen, state=self._state, episode_start=[self._first], deterministic=True)
        else:
            said = self._predict(seen, deterministic=True)
        self._first = False
        action = said
        if isinstance(said, tuple) and len(said) == 2 and not _is_number(said[0]):
            action, self._state = said
        return speeds(action, observation.task.limits)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number)

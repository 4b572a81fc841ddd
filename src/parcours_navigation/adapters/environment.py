"""Our world as a Gymnasium environment: seeds are case numbers, rewards are open."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from parcours_navigation.adapters.features import BOUND, Vector, features, speeds
from parcours_navigation.adapters.stepping import Stepped
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.guests.staging import Cases
from parcours_navigation.protocol import Observation, X, Y

_CASES = 1_000_000


@dataclass(frozen=True, slots=True)
class Reward:
    """What a step is worth: the sum of these, each times its weight."""

    progress: float = 1.0  # for each metre nearer to the goal
    arrival: float = 10.0  # when the goal is reached
    contact: float = -10.0  # for each contact that the robot caused, alone or together with the obstacle
    touched: float = 0.0  # for each contact that the obstacle alone caused
    time: float = -0.05  # for each second


class CaseEnv(gymnasium.Env[Vector, NDArray[np.float32]]):
    """System cases as episodes. `reset(seed=k)` begins case k; without a seed, a case drawn by the last one.

    Observations are those of `features`, actions shares of the limits (`features.speeds`). An episode terminates at the
    goal or, if `until_contact`, at the first contact that the robot caused; it is truncated at the time limit. `info`
    has `case`, `time`, `reached`, `contacts`, and `robot` and `obstacles` as planners see them.

    Args:
        cases: the family, of the paper's arena or of a world; by default that of seed 1.
        scenario: robot, start, goal, limits and clock.
        reward: its weights.
        n_obstacles: obstacles that an observation shows.
        until_contact: whether a contact ends an episode.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium declares it as an attribute of instances

    def __init__(
        self,
        cases: Cases | None = None,
        scenario: Scenario | None = None,
        reward: Reward | None = None,
        n_obstacles: int = 3,
        until_contact: bool = True,
    ) -> None:
        self._stepped = Stepped(cases or SystemCases(seed=1), scenario)
        self.reward, self._n, self._until_contact = reward or Reward(), n_obstacles, until_contact
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._case, self._contacts, self._touches, self._left = 0, 0, 0, 0.0
        self._seen = self._stepped.begin(0)
        shape = features(self._seen, n_obstacles).shape
        self.observation_space = gymnasium.spaces.Box(-BOUND, BOUND, shape, np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Vector, dict[str, Any]]:
        """Begin a case: that of `options["case"]`, else of the seed, else one drawn; return what is seen, and info."""
        super().reset(seed=seed)
        asked = (options or {}).get("case", seed)
        self._case = int(self.np_random.integers(_CASES)) if asked is None else int(asked)
        self._seen = self._stepped.begin(self._case)
        self._contacts = self._touches = 0
        self._left = _distance(self._seen)
        return features(self._seen, self._n), self._info(False)

    def step(self, action: NDArray[np.float32]) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Hold the speeds of an action for a period; return observation, reward, terminated, truncated and info."""
        before = self._seen.time
        arrived = self._stepped.hold(*speeds(action, self._seen.task.limits))
        facts, left = self._stepped.facts(), _distance(self._seen)
        contacts = int(facts["n_robot_contacts"]) + int(facts["n_shared_contacts"])
        touches = int(facts["n_obstacle_contacts"])
        worth = self.reward
        reward = worth.progress * (self._left - left) + worth.time * (self._seen.time - before)
        reward += worth.contact * (contacts - self._contacts) + worth.touched * (touches - self._touches)
        reward += worth.arrival if arrived else 0.0
        self._contacts, self._touches, self._left = contacts, touches, left
        ended = arrived or (self._until_contact and contacts > 0)
        truncated = not ended and self._stepped.is_over
        return features(self._seen, self._n), float(reward), ended, truncated, self._info(arrived)

    def _info(self, reached: bool) -> dict[str, Any]:
        seen = self._seen
        return {
            "case": self._case,
            "time": seen.time,
            "reached": reached,
            "contacts": self._contacts,
            "robot": seen.robot.copy(),
            "obstacles": seen.obstacles.copy(),
        }


def _distance(seen: Observation) -> float:
    return math.dist((float(seen.robot[X]), float(seen.robot[Y])), seen.task.goal)

"""What runs numbered cases, whatever planner and whatever loop it is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from parcours.run.store import Campaign
from parcours_navigation.cases.family import SystemCases

Track = tuple[NDArray[np.void], NDArray[np.void], NDArray[np.float64]]
"""Of one case: facts, array of FACTS of shape (1,); track, array of TRACK, shape (n,); places, shape (n, k, 2) [m]."""


class CaseStudy(Protocol):
    """A planner on one family of cases, whatever loop runs it; callable as a campaign's `simulate`."""

    @property
    def cases(self) -> SystemCases:
        """The family of cases."""

    @property
    def answers(self) -> str:
        """In words how long the planner's work takes in the simulated world; empty: as the scenario says."""

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent; 0 for code that is trusted to end."""

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return the facts of cases first .. first + count - 1."""

    def run(self, numbers: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the facts of the cases."""

    def track(self, number: int) -> Track:
        """Return facts, track and the obstacles' places of one case run again."""

    def prepare(self) -> bool:
        """Compile what every case needs; return whether anything was."""

    def campaign(self, n_cases: int, shard_size: int | None = None) -> Campaign:
        """Return the campaign of cases 0 .. n_cases - 1."""

"""What runs numbered cases, whatever planner and whatever loop it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from parcours.data import InputModel
from parcours.run.store import Campaign
from parcours.suite import Case
from parcours_navigation.requirements.requirement import Requirements

Track = tuple[NDArray[np.void], NDArray[np.void], NDArray[np.float64]]
"""Of one case: facts, array of FACTS of shape (1,); track, array of TRACK, shape (n,); places, shape (n, k, 2) [m]."""


class Family(Protocol):
    """A numbered, endless family of cases."""

    @property
    def seed(self) -> int:
        """The campaign's."""

    @property
    def protocol(self) -> str:
        """How obstacles move, in a word."""

    @property
    def inputs(self) -> InputModel:
        """What is drawn for each case."""

    def id(self, number: int) -> str:
        """Return the stable id of a case."""

    def number(self, id: str) -> int | None:
        """Return the number of a case by its id."""

    def vector(self, number: int) -> tuple[int, ...]:
        """Return the start vector of a case."""

    def values(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the drawn values of the cases, shape (n, n_inputs)."""

    @property
    def period(self) -> int:
        """By how much numbers differ of cases that differ in nothing but what is drawn beside the values."""

    def settled(
        self, values: NDArray[np.float64], numbers: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return what these cases make of drawn values, shape (n, n_inputs), and whether they take them, shape (n,)."""

    def suite(self, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases."""

    def end(self, time_limit: float) -> float:
        """Return when a test of that length ends [s]."""


class CaseStudy(Protocol):
    """A planner on one family of cases, whatever loop runs it; callable as a campaign's `simulate`."""

    @property
    def cases(self) -> Family:
        """The family of cases."""

    @property
    def answers(self) -> str:
        """In words how long the planner's work takes in the simulated world; empty: as the scenario says."""

    @property
    def requirements(self) -> Requirements:
        """What is required of every case beside the sound outcome."""

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

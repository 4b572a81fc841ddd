"""Runs cases again for what published benchmark code computes of their tracks, as a campaign of its own.

What is measured correctly is measured while a case runs; the defects of published code are only of interest beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from parcours.run.heartbeat import LostCase
from parcours.run.store import Campaign
from parcours_navigation.cases.running import CaseStudy
from parcours_navigation.measures.one_case import measures_as_published
from parcours_navigation.measures.table import PUBLISHED
from parcours_navigation.study.distribution import GOAL

REPRODUCED = np.dtype([("number", "i8"), *PUBLISHED.descr])
"""What published code computes of one case; all NaN where the planner's own error ended it."""


@dataclass(frozen=True, slots=True)
class Reproducing:
    """A study's cases, as published code measures them; callable as a campaign's `simulate`.

    Args:
        study: whose cases.
        failed: cases that are not to be run, because the planner's own error ended them.
        lost: cases that are not to be run, because the planner hangs there or takes its process down.
    """

    study: CaseStudy
    failed: frozenset[int] = frozenset()
    lost: tuple[LostCase, ...] = ()

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent."""
        return self.study.heartbeat_words

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the same, which does not run the lost cases."""
        return replace(self, lost=lost)

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return what is computed of cases first .. first + count - 1, array of REPRODUCED of shape (count,)."""
        rows = np.zeros(count, REPRODUCED)
        skipped = self.failed | {case.number for case in self.lost}
        for row, number in zip(rows, range(first, first + count), strict=True):
            found = None if number in skipped else self._measured(number)
            row["number"] = number
            for name in PUBLISHED.names or ():
                row[name] = np.nan if found is None else found[name]
        return rows

    def _measured(self, number: int) -> np.void | None:
        facts, track, places = self.study.track(number)
        if facts[0]["error"]:
            return None
        cases = self.study.cases
        radii, until = np.full(places.shape[1], cases.obstacle_radius), int(facts[0]["t_end"])
        return measures_as_published(track, places, radii, robot_radius=cases.robot_radius, goal=GOAL, until=until)

    def campaign(self, campaign: Campaign, n_cases: int) -> Campaign:
        """Return the campaign that runs the first cases of a campaign again."""
        name = f"{campaign.study}/as-published"
        return replace(campaign, study=name, n_cases=n_cases, dtype=REPRODUCED, shard_size=64)

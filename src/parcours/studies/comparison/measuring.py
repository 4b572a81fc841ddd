"""Cases run again with their tracks -> measures of the ways driven, as a campaign of its own."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from parcours.run.pulse import LostCase
from parcours.run.store import Campaign
from parcours.studies.comparison.results import GOAL
from parcours.studies.navigation.study import NavigationStudy
from parcours.studies.ramp_system.study import SystemStudy
from parcours.verdict.measures.one_case import measures_of
from parcours.verdict.measures.table import MEASURES

MEASURED = np.dtype([("number", "i8"), *MEASURES.descr])
"""Measures of one case; all NaN where the planner's own error ended it."""


@dataclass(frozen=True, slots=True)
class Measuring:
    """A study's cases, measured; callable as a campaign's `simulate`.

    Args:
        study: whose cases.
        lost: cases that are not to be run, because the planner hangs there or takes its process down.
    """

    study: NavigationStudy | SystemStudy
    lost: tuple[LostCase, ...] = ()

    @property
    def pulse_words(self) -> int:
        """How many words a worker shares with its parent; 0 for RAMP, which is no stranger."""
        return self.study.pulse_words if isinstance(self.study, NavigationStudy) else 0

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the same, which does not run the lost cases."""
        return replace(self, lost=lost)

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return the measures of cases first .. first + count - 1, array of MEASURED of shape (count,)."""
        rows = np.zeros(count, MEASURED)
        skipped = {case.number for case in self.lost}
        cases = self.study.cases
        radii = np.full(3, cases.obstacle_radius)
        for row, number in zip(rows, range(first, first + count), strict=True):
            row["number"] = number
            for name in MEASURES.names or ():
                row[name] = np.nan
            if number in skipped:
                continue
            facts, track, places = self.study.track(number)
            if facts[0]["error"]:
                continue
            found = measures_of(
                track,
                places,
                radii,
                robot_radius=cases.robot_radius,
                goal=GOAL,
                until=int(facts[0]["t_end"]),
            )
            for name in MEASURES.names or ():
                row[name] = found[name]
        return rows

    def campaign(self, campaign: Campaign, n_cases: int) -> Campaign:
        """Return the campaign that measures the first cases of a campaign."""
        parameters = {**campaign.parameters, "measures": measures_digest()}
        return replace(
            campaign,
            study=f"{campaign.study}/measures",
            n_cases=n_cases,
            dtype=MEASURED,
            parameters=parameters,
            shard_size=16,
        )


def measures_digest() -> str:
    """Return a digest of the code that measures."""
    from pathlib import Path

    import parcours.verdict.measures as room

    digest = hashlib.sha256()
    for path in sorted(Path(next(iter(room.__path__))).glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]

"""The authors' 905 system tests: what was run and what came of it, by result folder of their public repository."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PublishedRuns:
    """One folder of the published raw results."""

    folder: int  # its number (system_level/simpar2016)
    delays: tuple[float, float, float]  # how long each obstacle stood after the static second [s]
    vector: tuple[int, int, int]  # the start vector these delays give for motions of about 5 s; derived
    n: int  # tests
    reached: int  # tests that ended within 0.2 m of the goal
    feasible: int  # tests whose last trajectory was feasible
    halted: int  # tests with imminent collision at any time
    stuck: int  # tests with imminent collision at the end


PUBLISHED = (
    PublishedRuns(1, (0, 0, 0), (0, 0, 0), 114, 18, 98, 18, 8),
    PublishedRuns(2, (0, 0, 0), (0, 0, 0), 137, 81, 112, 41, 9),
    PublishedRuns(3, (0, 0, 0), (0, 0, 0), 238, 143, 198, 65, 23),
    PublishedRuns(4, (0, 0, 0), (0, 0, 0), 17, 10, 15, 6, 2),
    PublishedRuns(5, (0, 2, 5), (0, 1, 2), 100, 55, 81, 37, 10),
    PublishedRuns(6, (2, 4, 10), (0, 1, 3), 99, 40, 78, 49, 7),
    PublishedRuns(7, (0, 5, 6), (0, 2, 3), 100, 49, 87, 41, 5),
    PublishedRuns(8, (0, 10, 10), (0, 2, 2), 100, 42, 86, 22, 6),
)
"""The 905 tests (xlsx column "Obstacle delays" and the four result columns)."""

TIME_LEFT_QUANTILES = ((0.10, 1.0), (0.25, 1.4), (0.50, 4.8), (0.75, 11.5), (0.90, 16.8))
"""Published time left on feasible trajectories: (share of the 755 tests, at most [s]); the largest is 50.8 s."""


def total(field: str) -> int:
    """Return the sum of a count over all folders.

    >>> total("n"), total("reached"), total("feasible"), total("halted"), total("stuck")
    (905, 438, 755, 279, 70)
    """
    return sum(int(getattr(runs, field)) for runs in PUBLISHED)


def folder_of(number: int) -> PublishedRuns:
    """Return the folder in which test `number` (0 .. 904, then again from the start) would lie.

    >>> folder_of(0).folder, folder_of(904).folder, folder_of(905).folder
    (1, 8, 1)
    """
    number %= total("n")
    for runs in PUBLISHED:
        if number < runs.n:
            return runs
        number -= runs.n
    return PUBLISHED[-1]

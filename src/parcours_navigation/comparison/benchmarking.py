"""Scores that published benchmarks would give the planners of a comparison, corrected and as their code has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from parcours_navigation.arena.solvability import shortest_way
from parcours_navigation.comparison.results import Contender, Results
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.measures.benchmarks import BENCHMARKS, score
from parcours_navigation.measures.scores import Column, Runs
from parcours_navigation.outcomes import GOAL_TOLERANCE
from parcours_navigation.study.distribution import GOAL, START

REPRODUCING = ("mrpb-2021", "arena-evaluation", "hunav-evaluator", "socnavbench-code")
"""Modes that need what published code computes of a track: known of the cases that were run again for it."""


@dataclass(frozen=True, slots=True)
class Score:
    """One score of every planner.

    Attributes:
        benchmark, mode: as in `BENCHMARKS`.
        score, unit: its name and unit.
        cases: how many it is the mean over, before those are left out for which it is not defined.
        means: one a planner, in their order, NaN where it is defined for no case.
    """

    benchmark: str
    mode: str
    score: str
    unit: str
    cases: int
    means: tuple[float, ...]


def benchmark_scores(results: Results) -> tuple[Score, ...]:
    """Return every score of every mode; modes of REPRODUCING over the cases that were run again, the rest over all.

    Empty if the cases were not measured.
    """
    if any(c.measures is None for c in results.contenders):
        return ()
    found: list[Score] = []
    for benchmark, known in BENCHMARKS.items():
        for mode in known.modes:
            columns = [_columns(results, c, benchmark, mode) for c in results.contenders]
            for of_one_name in zip(*columns, strict=True):
                first = of_one_name[0]
                means = tuple(column.mean for column in of_one_name)
                found.append(Score(benchmark, mode, first.name, first.unit, len(first.values), means))
    return tuple(found)


def _columns(results: Results, contender: Contender, benchmark: str, mode: str) -> tuple[Column, ...]:
    """Return the columns of one planner; none where the mode needs tracks and no case was run again."""
    published = contender.published if mode in REPRODUCING else None
    if mode in REPRODUCING and published is None:
        return ()
    n = results.n_cases if published is None else len(published)
    assert contender.measures is not None
    earliest = results.earliest
    runs = Runs(
        contender.facts[:n], contender.measures[:n], published=published,
        shortest=np.full(n, shortest_way(START, GOAL, GOAL_TOLERANCE)),
        fastest=None if earliest is None else np.where(np.isfinite(earliest), earliest, np.nan)[:n],
        top_speed=Scenario().limits.speed,
    )  # fmt: skip
    return score(runs, benchmark, mode)

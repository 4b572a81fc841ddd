"""Results of a comparison -> the scores of published benchmarks, corrected and as their code computes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from parcours.report.pieces import Cell, Piece, Table
from parcours.report.pieces import Column as Head
from parcours_navigation.arena.solvability import shortest_way
from parcours_navigation.comparison.results import Contender, Results
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.measures.benchmarks import BENCHMARKS
from parcours_navigation.measures.benchmarks import score as score_of
from parcours_navigation.measures.scores import Column, Runs
from parcours_navigation.outcomes import GOAL_TOLERANCE
from parcours_navigation.study.distribution import GOAL, START

REPRODUCING = ("mrpb-2021", "arena-evaluation", "hunav-evaluator", "socnavbench-code")
"""Modes that need what published code computes of a track: known of the cases that were run again for it."""

HEADLINE = (
    ("spl", "corrected", "SPL"),
    ("spl", "corrected", "SCT"),
    ("barn", "present", "score"),
    ("barn", "2022", "score"),
    ("barn", "dynabarn-2022", "score"),
    ("mrpb", "corrected", "safety"),
    ("mrpb", "mrpb-2021", "safety"),
    ("mrpb", "corrected", "smoothness"),
    ("arena", "corrected", "goal reached"),
    ("arena", "arena-evaluation", "goal reached"),
    ("arena", "corrected", "jerk"),
    ("arena", "arena-evaluation", "jerk"),
    ("hunavsim", "corrected", "completed"),
    ("hunavsim", "hunav-evaluator", "completed"),
    ("hunavsim", "corrected", "collisions"),
    ("hunavsim", "hunav-evaluator", "collisions"),
    ("socnavbench", "corrected", "path irregularity"),
    ("socnavbench", "socnavbench-code", "path irregularity"),
    ("bench-mr", "corrected", "least clearance"),
    ("bench-mr", "corrected", "clearing"),
)
"""Benchmark, mode and score of the short table; the whole is folded on the page, and in the JSON."""

BENCHMARK_LEAD = (
    "What published benchmarks would say of the same runs. Their code has defects, so a score stands here corrected "
    "and, under the name of its mode, as the code computes it."
)


@dataclass(frozen=True, slots=True)
class Score:
    """One score of every planner.

    Attributes:
        benchmark, mode: as in `BENCHMARKS`.
        name, unit: of the score.
        cases: how many it is the mean over, before those are left out for which it is not defined.
        means: one a planner, in their order, NaN where it is defined for no case.
    """

    benchmark: str
    mode: str
    name: str
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
    if mode in REPRODUCING and contender.published is None:
        return ()
    n = len(contender.published) if mode in REPRODUCING and contender.published is not None else results.n_cases
    assert contender.measures is not None
    earliest = results.earliest
    fastest = None if earliest is None else np.where(np.isfinite(earliest), earliest, np.nan)[:n]
    runs = Runs(
        contender.facts[:n],
        contender.measures[:n],
        published=contender.published if mode in REPRODUCING else None,
        shortest=np.full(n, shortest_way(START, GOAL, GOAL_TOLERANCE)),
        fastest=fastest,
        top_speed=Scenario().limits.speed,
    )
    return score_of(runs, benchmark, mode)


def benchmark_tables(results: Results) -> tuple[Piece, ...] | None:
    """Return the short table and the whole one, folded; None if the cases were not measured."""
    scores = benchmark_scores(results)
    if not scores:
        return None
    short = tuple(s for key in HEADLINE for s in scores if (s.benchmark, s.mode, s.name) == key)
    note = (
        "Means over the cases for which a score is defined. BARN's optimal time is the straight line at top speed. "
        "SPL and SCT here count only goals reached without any contact, also of an obstacle that ran into the robot. "
        "What each mode does, defects included: docs/metrics.md."
    )
    return (_table(results, "Scores", short, note), _table(results, "All scores of all modes", scores, "", folded=True))


def _table(results: Results, title: str, scores: tuple[Score, ...], note: str, *, folded: bool = False) -> Table:
    rows: list[tuple[Cell, ...]] = [(s.benchmark, s.mode, s.name, s.unit, s.cases, *s.means) for s in scores]
    heads = (
        Head("benchmark"), Head("mode", code=True), Head("score"), Head("unit"), Head("cases", ",d"),
        *(Head(c.name, ".3g") for c in results.contenders),
    )  # fmt: skip
    return Table(title, heads, tuple(rows), note, folded=folded)

"""Measures of system cases: what is shown of them, summed up over the cases, in one table and in one document.

Beside the measures of `parcours_navigation.measures` stand what the world counted itself, the scores SPL and SCT, and
how hard the cases are (`parcours_navigation.arena.survivability`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.report.pieces import Cell, Column, Table
from parcours.verdict.statistics import quantiles
from parcours_navigation.arena.solvability import SOLVABILITY, shortest_way, solve
from parcours_navigation.arena.survivability import survivability
from parcours_navigation.cases.family import TIME_LIMIT, SystemCases
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.measures.scores import sct, spl
from parcours_navigation.outcomes import GOAL_TOLERANCE, Outcome, outcomes
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.solving import solve_worlds
from parcours_navigation.worlds.survivability import survived_worlds

Facts = NDArray[np.void]
Values = NDArray[np.float64]

START, GOAL = (0.0, 0.0), (2.0, 2.0)
"""Where the robot starts and is to go in a system case [m]."""

_AT_ONCE = 4096
"""Cases that are handed to the oracle together."""


@dataclass(frozen=True, slots=True)
class MeasureStyle:
    """How one measure is shown."""

    words: str  # what it is
    unit: str  # SI; "1" for a share or a count, "%" for a share in per cent
    taken: bool = False  # whether it is a field of MEASURES; otherwise it comes from the facts or the cases
    mean: bool = False  # whether its mean over all cases is shown, as for a score


SHOWN: dict[str, MeasureStyle] = {
    "time_to_goal": MeasureStyle("time to goal", "s"),
    "path_length": MeasureStyle("path length", "m"),
    "spl": MeasureStyle("SPL (mean)", "1", mean=True),
    "sct": MeasureStyle("SCT (mean)", "1", mean=True),
    "min_clearance": MeasureStyle("least clearance", "m"),
    "mean_clearance": MeasureStyle("mean clearance", "m", taken=True),
    "time_unsafe": MeasureStyle("time below 0.1 m of clearance", "s", taken=True),
    "least_time_to_collision": MeasureStyle("least time to collision", "s", taken=True),
    "time_halted": MeasureStyle("time in imminent collision", "s", taken=True),
    "longest_halt": MeasureStyle("longest halt", "s", taken=True),
    "stop_distance": MeasureStyle("stopping distance", "m", taken=True),
    "time_at_rest": MeasureStyle("time at rest", "s", taken=True),
    "switches": MeasureStyle("plan switches", "1"),
    "late_cycles": MeasureStyle("planning cycles longer than their period", "%"),
    "heading_change": MeasureStyle("heading change", "rad", taken=True),
    "mean_curvature": MeasureStyle("mean curvature", "1/m", taken=True),
    "squared_acceleration": MeasureStyle("squared acceleration", "m^2/s^3", taken=True),
    "squared_jerk": MeasureStyle("squared jerk", "m^2/s^5", taken=True),
    "mean_jerk": MeasureStyle("mean jerk", "m/s^3", taken=True),
    "survivability": MeasureStyle("survivability of the case", "1"),
}
"""What is shown, in this order."""

NOTE = (
    "Median and, in brackets, the points below which 5 % and 95 % of the cases lie; of SPL and SCT the mean. A measure "
    "that a case does not have is left out of its row: time to goal where it was not reached in time, curvature where "
    "the robot did not move, time to collision where the discs would never have met."
)


def reached(facts: Facts) -> NDArray[np.bool_]:
    """Return in which cases the goal was reached in time, without a collision caused by the robot."""
    return np.asarray(outcomes(facts) == int(Outcome.REACHED))


def time_to_goal(facts: Facts) -> Values:
    """Return when the goal was reached [s] in cases that count as reached, else NaN; shape (n_cases,)."""
    known = reached(facts) & (facts["t_goal"] != NEVER)
    return np.where(known, facts["t_goal"] * 1e-9, np.nan)


def spl_of(facts: Facts, straight: Values | None = None) -> Values:
    """Return success weighted by path length of each case, shape (n_cases,).

    Success is `reached`; the shortest way is the straight line to the goal's tolerance, which no way undercuts: that of
    the paper's arena, or one per case [m].
    """
    if straight is None:
        straight = np.full(len(facts), shortest_way(START, GOAL, GOAL_TOLERANCE))
    return spl(reached(facts), straight, facts["travelled"])


def sct_of(facts: Facts, earliest: Values) -> Values:
    """Return success weighted by the earliest conceivable arrival [s] over the time taken, shape (n_cases,).

    NaN where `earliest` is not finite: no robot could have arrived, or no oracle was asked.
    """
    return sct(reached(facts), np.where(np.isfinite(earliest), earliest, np.nan), time_to_goal(facts))


def oracle(
    cases: SystemCases | WorldCases,
    numbers: NDArray[np.int64],
    progress: Callable[[int, int], None] = lambda done, total: None,
    inner: bool = True,
) -> NDArray[np.void]:
    """Return what a disc that knows the future could reach in the cases, array of SOLVABILITY, shape (n,).

    Without `inner`, only `earliest_outer` is to be read: what a score needs.
    """
    if isinstance(cases, WorldCases):
        return solve_worlds(cases, numbers, progress)
    found = np.zeros(len(numbers), SOLVABILITY)
    for first in range(0, len(numbers), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        found[part] = solve(
            cases.obstacles(numbers[part]), start=START, goal=GOAL, tolerance=GOAL_TOLERANCE,
            limit=cases.end(TIME_LIMIT), v_max=Scenario().limits.speed, robot_radius=cases.robot_radius,
            inner=inner,
        )  # fmt: skip
        progress(min(first + _AT_ONCE, len(numbers)), len(numbers))
    return found


def survived(cases: SystemCases | WorldCases, numbers: NDArray[np.int64]) -> Values:
    """Return the survivability of the cases, in [0, 1], 1 the easiest; shape (n,)."""
    if isinstance(cases, WorldCases):
        return survived_worlds(cases, numbers)
    found = np.zeros(len(numbers))
    for first in range(0, len(numbers), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        found[part] = survivability(cases.obstacles(numbers[part]), robot_radius=cases.robot_radius)["survived"]
    return found


def straight_ways(cases: SystemCases | WorldCases, numbers: NDArray[np.int64], measures: Facts) -> Values | None:
    """Return the straight way to the goal of each case of a world [m]; None: that of the paper's arena.

    NaN where a case starts at its goal. Cases without measures, which reach no goal, have any way.
    """
    if isinstance(cases, SystemCases):
        return None
    tolerance = np.array([cases.plan(int(number)).task.tolerance for number in numbers])
    straight: Values = np.where(np.isnan(measures["displacement"]), 1.0, measures["displacement"] - tolerance)
    return np.where(straight > 0.0, straight, np.nan)


def measured(
    facts: Facts, measures: Facts | None = None, *, earliest: Values | None = None, survival: Values | None = None,
    straight: Values | None = None,
) -> dict[str, Values]:  # fmt: skip
    """Return what is known of the cases by the names of SHOWN, NaN where a case has none; shape (n_cases,) each.

    `facts` are FACTS, `measures` MEASURES; `earliest` is the earliest conceivable arrival [s], `survival` how long a
    standing robot survives, as a share; None where it is not known. `straight` is that of `spl_of`.
    """
    cycles = facts["n_planning_cycles"]
    late = np.divide(100.0 * facts["n_late_cycles"], cycles, out=np.full(len(facts), np.nan), where=cycles > 0)
    found: dict[str, Values | None] = {
        "time_to_goal": time_to_goal(facts),
        "path_length": facts["travelled"],
        "spl": spl_of(facts, straight),
        "sct": None if earliest is None else sct_of(facts, earliest),
        "min_clearance": facts["min_clearance"],
        "switches": facts["n_switches"].astype(np.float64),
        "late_cycles": late,
        "survivability": survival,
    }
    if measures is not None:
        found |= {name: measures[name] for name, shown in SHOWN.items() if shown.taken}
    kept = {name: values for name in SHOWN if (values := found.get(name)) is not None}
    return {name: np.where(np.isfinite(values), values, np.nan) for name, values in kept.items()}


@dataclass(frozen=True, slots=True)
class MeasureSummary:
    """One measure over the `n` cases that have it: its mean and quantiles, None without any case."""

    unit: str
    n: int
    mean: float | None = None
    median: float | None = None
    p05: float | None = None
    p95: float | None = None


def summarised(known: Mapping[str, Values], units: Mapping[str, str] | None = None) -> dict[str, MeasureSummary]:
    """Return the summary of each measure, by the names of SHOWN; `known` is what `measured` returns.

    `units` are those of measures that are not among SHOWN.
    """
    found: dict[str, MeasureSummary] = {}
    for name, values in known.items():
        values = np.where(np.isfinite(values), values, np.nan)
        n = int((~np.isnan(values)).sum())
        points = (float(np.nanmean(values)), *quantiles(values, (0.5, 0.05, 0.95))) if n else ()
        found[name] = MeasureSummary(SHOWN[name].unit if units is None else units[name], n, *points)
    return found


def distribution_table(title: str, known: Mapping[str, Mapping[str, MeasureSummary]], note: str = "") -> Table:
    """Return one row a measure, one column a campaign or planner; `note` is what else must be said below."""
    every = {name: one.unit for summaries in known.values() for name, one in summaries.items()}
    names = [*(name for name in SHOWN if name in every), *(name for name in every if name not in SHOWN)]
    rows: list[tuple[Cell, ...]] = [
        (
            SHOWN[name].words if name in SHOWN else name,
            every[name],
            *(_cell(name, summaries.get(name)) for summaries in known.values()),
        )
        for name in names
    ]
    columns = (Column("measure"), Column("unit"), *(Column(name) for name in known))
    return Table(title, columns, tuple(rows), f"{NOTE} {note}".strip())


def _cell(name: str, found: MeasureSummary | None) -> Cell:
    if found is None or found.mean is None or found.median is None or found.p05 is None or found.p95 is None:
        return None
    if name in SHOWN and SHOWN[name].mean:
        return f"{found.mean:.3f}"
    middle, low, high = (_short(value) for value in (found.median, found.p05, found.p95))
    return f"{middle}\N{NO-BREAK SPACE}[{low},\N{NO-BREAK SPACE}{high}]"


def _short(value: float) -> str:
    """Return a number in three digits, without an exponent where it is of ordinary size.

    >>> _short(12.345), _short(0.01234), _short(-0.5), _short(1234.5), _short(0.0)
    ('12.3', '0.0123', '−0.5', '1234', '0')
    """
    if abs(value) < 1e-9:  # what rounding has left
        return "0"
    text = f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
    return text.replace("-", "\N{MINUS SIGN}")

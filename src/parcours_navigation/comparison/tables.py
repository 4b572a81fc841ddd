"""Results of a comparison -> its tables, the same on the terminal and on the page."""

from __future__ import annotations

import math

import numpy as np

from parcours.report.pieces import Cell, Column, Marked, Table
from parcours.verdict.statistics import Rate, quantiles, wilson
from parcours_navigation.comparison.results import (
    QUESTIONS,
    Results,
    weighted_by_time,
    weighted_by_way,
)
from parcours_navigation.outcomes import VERDICT_OF, Outcome
from parcours_navigation.study.distribution import distribution_table, reached, time_to_goal

OUTCOME_WORDS = {
    "COLLIDED": "the moving robot touched an obstacle",
    "REACHED": "goal reached in time",
    "UNDER_WAY": "goal reached later",
    "BLOCKED": "an obstacle rests on the goal",
    "STUCK": "halted, and stood for ever",
    "ASTRAY": "never arrived, without a halt",
    "ERROR": "the planner's own error",
}
"""Outcomes, by name, as a reader of tables meets them."""

DIFFERENT_ANSWERS = (
    "RAMP runs with the durations of work that were published with it; the others answer at once, which no real "
    "machine does, unless a command delay is given. So a difference to RAMP is one of planner and machine together."
)
"""What must be said wherever RAMP stands beside planners that answer at once."""


def outcome_table(results: Results) -> Table:
    """Return how the cases ended: each case has one outcome, so a column adds up to 100 %."""
    rows: list[tuple[Cell, ...]] = []
    for outcome in Outcome:
        counts = [int((c.outcomes == int(outcome)).sum()) for c in results.contenders]
        rows.append(
            (
                OUTCOME_WORDS.get(outcome.name, outcome.name.lower()),
                str(VERDICT_OF[outcome]),
                *(interval(wilson(count, results.n_cases)) for count in counts),
            )
        )
    rows.append(("answers", "", *(c.answers for c in results.contenders)))
    return Table(
        "Outcomes: one a case",
        (Column("outcome"), Column("verdict"), *_names(results)),
        tuple(rows),
        f"{results.n_cases} cases, the same for all; Wilson 95 % intervals. {speaks_of_answers(results)}".strip(),
    )


def question_table(results: Results) -> Table:
    """Return how many cases say yes to each question; a case may say yes to several."""
    rows: list[tuple[Cell, ...]] = []
    for words, ask in QUESTIONS.items():
        counts = [int(ask(c.facts).sum()) for c in results.contenders]
        rows.append((words, *(interval(wilson(count, results.n_cases)) for count in counts)))
    if (can := results.solvable) is not None:
        cells = [interval(wilson(int((reached(c.facts) & can).sum()), int(can.sum()))) for c in results.contenders]
        rows.append((f"of the {int(can.sum())} cases that are solvable: goal reached", *cells))
    return Table(
        "Questions: yes in how many cases",
        (Column("question"), *_names(results)),
        tuple(rows),
        "Wilson 95 % intervals. Obstacles do not avoid the robot, so some contacts that an obstacle closes nobody "
        "can prevent.",
    )


def time_table(results: Results) -> Table:
    """Return time to the goal in quartiles, over a planner's own cases and over those that all reach."""
    both = np.all([reached(c.facts) for c in results.contenders], axis=0)
    rows: list[tuple[Cell, ...]] = []
    for contender in results.contenders:
        times = time_to_goal(contender.facts)
        rows.append((contender.name, *quantiles(times, _QUARTERS), *quantiles(times[both], _QUARTERS)))
    groups = ("own cases", f"the {int(both.sum())} cases that all reach")
    heads = [Column(q, ".2f", group=group, unit="s") for group in groups for q in ("q25", "median", "q75")]
    return Table(
        "Time to the goal",
        (Column("planner", code=True), *heads),
        tuple(rows),
        "From the beginning of the case, in which obstacles stand for 1 s. Only times over cases that all reach "
        "compare planners: a planner's own cases may be the easy ones.",
    )


_QUARTERS = (0.25, 0.5, 0.75)


def clearance_table(results: Results) -> Table:
    """Return quantiles of the least clearance of a case."""
    rows: list[tuple[Cell, ...]] = []
    for contender in results.contenders:
        gaps = contender.facts["min_clearance"]
        rows.append((contender.name, *quantiles(gaps[np.isfinite(gaps)], (0.05, *_QUARTERS))))
    heads = [Column(q, ".3f", unit="m") for q in ("5 %", "q25", "median", "q75")]
    return Table(
        "Least clearance in a case",
        (Column("planner", code=True), *heads),
        tuple(rows),
        "Negative: overlap, whoever closed the gap.",
    )


def score_table(results: Results) -> Table:
    """Return SPL and SCT, means over all cases."""
    rows: list[tuple[Cell, ...]] = [("SPL", *(float(weighted_by_way(c).mean()) for c in results.contenders))]
    times = [weighted_by_time(results, c) for c in results.contenders]
    known = [values for values in times if values is not None]
    if known:
        rows.append(("SCT", *(float(np.nanmean(values)) if np.isfinite(values).any() else None for values in known)))
    return Table(
        "Success weighted by length and by time",
        (Column("score"), *(Column(c.name, ".3f", code=True) for c in results.contenders)),
        tuple(rows),
        "1 would be: always there, on the shortest way, as early as possible. Shortest is the straight line, earliest "
        "what a disc of the same speed that knows the future and turns at once could do; so both are on the low side.",
    )


def vector_table(results: Results) -> Table:
    """Return the share of goals reached and of contacts for each start vector."""
    rows: list[tuple[Cell, ...]] = []
    vectors = np.asarray(results.vectors)
    for vector in sorted(set(results.vectors)):
        here = vectors == vector
        rates = [wilson(int(reached(c.facts)[here].sum()), int(here.sum())) for c in results.contenders]
        rows.append((vector, int(here.sum()), *(interval(rate) for rate in rates)))
    return Table(
        "Goal reached in time, by start vector of the obstacles",
        (Column("start vector", code=True), Column("cases", ",d"), *_names(results)),
        tuple(rows),
        "Numbers that are equal: the obstacles set out together; larger by 1: while the one before moves; larger by 2: "
        "after it has stopped.",
    )


def error_table(results: Results) -> Table | None:
    """Return why planners failed in themselves, commonest first, three reasons each; None if none did."""
    rows: list[tuple[Cell, ...]] = []
    for contender in results.contenders:
        found = contender.errors()
        total = sum(count for _, count in found)
        rows += [(contender.name, Marked(count, "bad"), reason) for reason, count in found[:3]]
        if (rest := total - sum(count for _, count in found[:3])) > 0:
            rows.append((contender.name, Marked(rest, "bad"), "other reasons"))
    if not rows:
        return None
    return Table(
        "Errors of planners",
        (Column("planner", code=True), Column("cases", ",d"), Column("what it did")),
        tuple(rows),
        "Such cases count as not reached: they are never left out.",
    )


def decision_table(results: Results) -> Table:
    """Return how long planners took to decide."""
    rows: list[tuple[Cell, ...]] = []
    for c in results.contenders:
        taken = c.decisions
        rows.append((c.name, *((taken.n, taken.median, taken.p99, taken.largest) if taken else (None,) * 4)))
    heads = [Column(q, ",.0f", unit="us") for q in ("median", "p99", "largest")]
    untimed = "".join(f" {c.name}: {c.untimed}." for c in results.contenders if c.untimed)
    return Table(
        "Wall time of one decision",
        (Column("planner", code=True), Column("decisions", ",d"), *heads),
        tuple(rows),
        "Measured apart from the comparison, case after case in one process of this machine: wall time differs from "
        "run to run, so it is no part of the results. RAMP's compiled loop has no call to measure: its published "
        f"durations are simulated instead.{untimed}",
    )


def measure_table(results: Results) -> Table:
    """Return what was measured along the robots' ways, over all cases."""
    return distribution_table(
        "Measures over all cases",
        {c.name: results.measured(c) for c in results.contenders},
        "Measures of planners that reach more cases are of more, and harder, cases: compare rates first.",
    )


def beats(results: Results) -> np.ndarray:
    """Return in what share of cases the one of the row reaches the goal and the one of the column does not."""
    flags = [reached(c.facts) for c in results.contenders]
    return np.array([[float((a & ~b).mean()) for b in flags] for a in flags])


def speaks_of_answers(results: Results) -> str:
    """Return the caution on unequal machines, empty where all answer alike."""
    return DIFFERENT_ANSWERS if len({c.answers for c in results.contenders}) > 1 else ""


def interval(rate: Rate) -> str:
    """Return a rate with its interval in percent, in one unbroken word; with more decimals from 10 000 cases on.

    >>> interval(wilson(70, 905)).replace("\\xa0", " ")
    '7.7 % [6.2, 9.7]'
    >>> interval(wilson(8, 10_000)).replace("\\xa0", " ")
    '0.08 % [0.04, 0.16]'
    >>> interval(wilson(0, 100_000)).replace("\\xa0", " ")
    '0.000 % [0.000, 0.004]'
    """
    if not rate.n:
        return "–"
    decimals = max(round(math.log10(rate.n)) - 2, 1)
    share, low, high = (f"{100 * value:.{decimals}f}" for value in (rate.share, rate.low, rate.high))
    return f"{share} % [{low}, {high}]".replace(" ", _UNBROKEN)


_UNBROKEN = "\N{NO-BREAK SPACE}"


def _names(results: Results) -> tuple[Column, ...]:
    return tuple(Column(c.name) for c in results.contenders)

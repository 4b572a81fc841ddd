"""Requirements of planners on the same cases: how often violated, how robustly met, tested against the first planner.

Violations are compared by McNemar's exact test, robustness by Wilcoxon's signed-rank test (`pairing`), and all tests of
the table are corrected together by Holm's method. An infinite robustness counts as `judging.FAR`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from parcours.report.pieces import Cell, Column, Marked, Table
from parcours.verdict.statistics import RateDifference, holm, rate_difference
from parcours_navigation.comparison.pairing import TimeDifference, time_difference
from parcours_navigation.comparison.results import ComparisonResults, Contender
from parcours_navigation.requirements.judging import FAR, holds
from parcours_navigation.requirements.tables import requirement_table


@dataclass(frozen=True, slots=True)
class RequirementTest:
    """One requirement, or one pass rule, of a planner against the first one on the cases in which both were judged."""

    first: str
    second: str
    name: str  # of the requirement; `fail: ...` for a pass rule
    unit: str  # of its robustness
    violated: RateDifference
    robustness: TimeDifference | None  # None for a pass rule
    p_violated: float  # by Holm's method over the whole table
    p_robustness: float | None


def requirement_tests(results: ComparisonResults) -> tuple[RequirementTest, ...]:
    """Return the tests of each planner against the first, requirement by requirement."""
    requirements = results.requirements
    raw: list[tuple[str, str, str, str, RateDifference, TimeDifference | None]] = []
    first, *others = results.contenders
    for other in others:
        for k, one in enumerate(requirements.formulas):
            values = [_robustness(c, k) for c in (first, other)]
            judged = ~np.isnan(values[0]) & ~np.isnan(values[1])
            violated = rate_difference(values[0][judged] < 0.0, values[1][judged] < 0.0)
            raw.append((first.name, other.name, one.name, one.unit, violated, time_difference(*values)))
        for rule in requirements.rules:
            failed = rate_difference(*(holds(rule.formula, _facts(c)) for c in (first, other)))
            raw.append((first.name, other.name, f"fail: {rule.text}", "1", failed, None))
    every = [gap.pairs.p_value for *_, gap, _ in raw] + [gap.p_value for *_, gap in raw if gap is not None]
    corrected = holm(every)
    rest = iter(corrected[len(raw) :])
    return tuple(
        RequirementTest(*row, p, None if row[-1] is None else next(rest))
        for row, p in zip(raw, corrected[: len(raw)], strict=True)
    )


def _robustness(contender: Contender, k: int) -> np.ndarray:
    assert contender.robustness is not None
    return np.clip(contender.robustness[:, k], -FAR, FAR)


def _facts(contender: Contender) -> np.ndarray:
    """Return facts and measures together, as a pass rule reads them."""
    assert contender.measures is not None
    own = [("own", [(name, "f8") for name in contender.own])] if contender.own else []
    found = np.zeros(len(contender.facts), [*contender.facts.dtype.descr, ("measures", contender.measures.dtype), *own])
    for name, values in contender.own.items():
        found["own"][name] = values
    for name in contender.facts.dtype.names or ():
        found[name] = contender.facts[name]
    found["measures"] = contender.measures
    return found


def requirement_tables(results: ComparisonResults) -> tuple[Table, ...]:
    """Return what became of the requirements, and the tests; nothing if nothing is required."""
    counted = requirement_table({one.name: one.required for one in results.contenders})
    found = () if counted is None else (counted, tests_table(results)) if len(results.contenders) > 1 else (counted,)
    return (*found, own_table(results)) if results.requirements.measures else found


@dataclass(frozen=True, slots=True)
class OwnMeasured:
    """One of the user's own measures of one planner, against the first one."""

    planner: str
    name: str
    unit: str
    n: int  # cases that have it
    median: float  # NaN without any
    against_first: TimeDifference | None  # the first minus this one; None for the first
    p_value: float | None  # by Holm's method over all own measures


def own_measured(results: ComparisonResults) -> tuple[OwnMeasured, ...]:
    """Return the user's own measures of each planner, on the pairs of cases in which both have one."""
    first, rows = results.contenders[0], []
    for one in results.requirements.measures:
        for contender in results.contenders:
            values = np.asarray(contender.own[one.name], np.float64)
            known = values[~np.isnan(values)]
            gap = None if contender is first else time_difference(first.own[one.name], values)
            median = float(np.median(known)) if len(known) else math.nan
            rows.append((contender.name, one.name, one.unit, len(known), median, gap))
    corrected = iter(holm([gap.p_value for *_, gap in rows if gap is not None]))
    return tuple(OwnMeasured(*row, None if row[-1] is None else next(corrected)) for row in rows)


def own_table(results: ComparisonResults) -> Table:
    """Return the user's own measures, planner by planner."""
    rows: list[tuple[Cell, ...]] = []
    for one in own_measured(results):
        unit, gap = "" if one.unit == "1" else f" {one.unit}", one.against_first
        apart = None if gap is None or not gap.n else f"{0.0 - gap.median:+.4g}{unit}"
        middle = None if math.isnan(one.median) else f"{one.median:.4g}{unit}"
        p_value = None if one.p_value is None else _p(one.p_value)
        rows.append((one.name, one.planner, one.n, middle, apart, p_value))
    heads = ("measure", "planner", "cases", "median", "against the first", "p (Holm)")
    note = (
        "Medians over the cases that have a value; against the first planner the median of the differences case by "
        "case, by Wilcoxon's signed-rank test; marked where below 0.05."
    )
    return Table("Own measures", tuple(map(Column, heads)), tuple(rows), note)


def tests_table(results: ComparisonResults) -> Table:
    """Return the tests against the first planner."""
    rows: list[tuple[Cell, ...]] = []
    for one in requirement_tests(results):
        pairs, gap = one.violated.pairs, one.robustness
        unit = "" if one.unit == "1" else f" {one.unit}"
        median = None if gap is None or not gap.n else f"{0.0 - gap.median:+.4g}{unit}"
        last = None if one.p_robustness is None else _p(one.p_robustness)
        pair = f"{one.second} against {one.first}"
        counts = pairs.n, pairs.second_only, pairs.first_only
        rows.append((pair, one.name, *counts, _p(one.p_violated), median, last))
    heads = (
        "pair",
        "requirement",
        "cases",
        "only it violates",
        "only the first",
        "p (Holm)",
        "robustness",
        "p (Holm) ",
    )
    note = (
        "Violations by McNemar's exact test on the cases that only one of the two violates; robustness by Wilcoxon's "
        "signed-rank test, median difference, the planner's minus the first's. Holm corrects for all tests here; "
        "marked where below 0.05."
    )
    title = f"Requirements on the same cases against {results.contenders[0].name}"
    return Table(title, tuple(map(Column, heads)), tuple(rows), note)


def _p(p_value: float) -> Cell:
    text = "<0.0001" if p_value < 0.0001 else f"{p_value:.4f}"
    return Marked(text, "neutral") if p_value < 0.05 else text


def requirement_document(results: ComparisonResults) -> dict[str, object]:
    """Return it all as JSON values."""
    return {
        "of_planners": {one.name: [each.document() for each in one.required] for one in results.contenders},
        "tests_against_first": [asdict(one) for one in requirement_tests(results)],
        "measures": [asdict(one) for one in own_measured(results)],
    }

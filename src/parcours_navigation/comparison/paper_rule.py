"""Results of a comparison -> the paper's results, contacts and times of each planner, with paired tests, in one table.

This is the table by which a repair is judged: the same cases, every rate with its interval, every difference tested.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from parcours.report.pieces import Cell, Column, Marked, Table
from parcours.report.terminal import to_markdown
from parcours.verdict.statistics import Rate, compare_pairs, holm, quantiles, wilson
from parcours_navigation.comparison.pairing import time_difference
from parcours_navigation.comparison.results import Contender, Facts, Flags, Results, contact, struck
from parcours_navigation.comparison.rivalry import p_text
from parcours_navigation.comparison.tables import interval, measure_table, outcome_table
from parcours_navigation.outcomes import Outcome, outcomes, published
from parcours_navigation.study.distribution import time_to_goal

RULES: dict[str, Callable[[Facts], Flags]] = {
    "goal reached": lambda f: published(f).reached,
    "under way on a feasible trajectory": lambda f: published(f).feasible & ~published(f).reached,
    "under way on an infeasible trajectory": lambda f: ~published(f).feasible & ~published(f).reached,
    "imminent collision at any time": lambda f: published(f).halted_once,
    "paused, then moved again": lambda f: published(f).halted_once & ~published(f).stuck,
    "stuck in imminent collision": lambda f: published(f).stuck,
    "halted, and stood for ever": lambda f: np.asarray(outcomes(f) == int(Outcome.STUCK)),
    "contact that the moving robot closed": contact,
    "contact that the obstacle closed alone": struck,
}
"""What is asked: first the paper's results by its own rule, then what the world says."""

STUCK = "stuck in imminent collision"

_NOTE = (
    "The first six by the paper's rule, which reads flags at the end of the test; a stuck robot also counts by "
    "where it is: at the goal, or under way. Only RAMP signals imminent collision: of others these rows say "
    "nothing. Halted and stood for ever: by the sound rule, never moved again until 40 s later. A contact that "
    "the obstacle closed alone found the robot at rest or moving away. Wilson 95 % intervals. More, fewer: cases "
    "that say yes for this planner only, and for the first only; p: McNemar's exact test on those, for quantities "
    "Wilcoxon's signed-rank test on the cases that have both; uncorrected, marked where Holm's correction over "
    "this table leaves them below 0.05. Quantities: median and, in brackets, 5 % and 95 % points."
)


def stuck_of_solvable(results: Results, contender: Contender) -> tuple[Rate, Rate] | None:
    """Return the share of stuck cases among those that are solvable, and among those not proved unsolvable.

    The two are equal where no case is undecided; the truth lies between what they count. None if no oracle was asked.
    """
    can, cannot = results.solvable, results.unsolvable
    if can is None or cannot is None:
        return None
    stuck = RULES[STUCK](contender.facts)
    sure, likely = ((stuck & among, among) for among in (can, ~cannot))
    return wilson(int(sure[0].sum()), int(sure[1].sum())), wilson(int(likely[0].sum()), int(likely[1].sum()))


def paper_table(results: Results) -> Table:
    """Return a row a question or quantity, a column a planner, and what the others differ from the first by."""
    others = results.contenders[1:]
    asked: list[tuple[str, tuple[Flags, ...]]] = [
        (words, tuple(ask(c.facts) for c in results.contenders)) for words, ask in RULES.items()
    ]
    rows: list[list[Cell]] = []
    tests: list[tuple[int, int, float]] = []
    for words, flags in asked:
        row: list[Cell] = [words, *(interval(wilson(int(yes.sum()), results.n_cases)) for yes in flags)]
        for yes in flags[1:]:
            pairs = compare_pairs(flags[0], yes)
            tests.append((len(rows), len(row) + 2, pairs.p_value))
            row += [pairs.second_only, pairs.first_only, None]
        rows.append(row)
    note = _NOTE
    if (among := _among_solvable(results)) is not None:
        rows.append([*among, *(None for _ in range(3 * len(others)))])
        note = f"{_solvable_words(results)} {note}"
    for words, values in _quantities(results):
        row = [words, *(_spread(of_one) for of_one in values)]
        for of_one in values[1:]:
            tests.append((len(rows), len(row) + 2, time_difference(values[0], of_one).p_value))
            row += [None, None, None]
        rows.append(row)
    _mark(rows, tests)
    heads = [Column("result"), *(Column(c.name) for c in results.contenders)]
    for other in others:
        heads += [Column(word, ",d", group=other.name) for word in ("more", "fewer")]
        heads += [Column("p", group=other.name)]
    title = f"The paper's results, contacts and times of {results.n_cases} cases"
    return Table(title, tuple(heads), tuple(tuple(row) for row in rows), note)


def to_markdown_page(results: Results) -> str:
    """Return the table, the outcomes and the measures in Markdown, ready for a document."""
    tables = (paper_table(results), outcome_table(results), measure_table(results))
    made = f"Seed {results.seed}, protocol {results.protocol}, {results.n_cases} cases, the same for all."
    return "\n\n".join([made, *(f"**{t.title}**\n\n{to_markdown(t)}\n\n{t.note}" for t in tables)])


def _quantities(results: Results) -> tuple[tuple[str, tuple[NDArray[np.float64], ...]], ...]:
    gaps = tuple(
        np.where(np.isfinite(c.facts["min_clearance"]), c.facts["min_clearance"], np.nan) for c in results.contenders
    )
    return (
        ("least clearance [m]", gaps),
        ("time to goal [s]", tuple(time_to_goal(c.facts) for c in results.contenders)),
    )


def _among_solvable(results: Results) -> list[Cell] | None:
    """Return the row of stuck cases among the solvable ones; both ends of the bracket where they differ."""
    found = [stuck_of_solvable(results, c) for c in results.contenders]
    cells: list[Cell] = []
    for both in found:
        if both is None:
            return None
        sure, likely = (interval(rate) for rate in both)
        cells.append(sure if sure == likely else f"{sure} to {likely}")
    return [f"{STUCK}, of the solvable cases", *cells]


def _solvable_words(results: Results) -> str:
    assert results.solvable is not None and results.unsolvable is not None
    can, cannot = int(results.solvable.sum()), int(results.unsolvable.sum())
    return (
        f"Of {results.n_cases} cases {can} are solvable by a disc that knows the future, {cannot} by nobody, and "
        f"{results.n_cases - can - cannot} are undecided (docs/solvability.md)."
    )


def _mark(rows: list[list[Cell]], tests: list[tuple[int, int, float]]) -> None:
    """Write the p-values where they belong, marked where Holm's correction leaves them below 0.05."""
    for (row, column, p_value), corrected in zip(tests, holm([p for *_, p in tests]), strict=True):
        rows[row][column] = Marked(p_text(p_value), "neutral") if corrected < 0.05 else p_text(p_value)


def _spread(values: NDArray[np.float64]) -> Cell:
    if np.isnan(values).all():
        return None
    middle, low, high = quantiles(values, (0.5, 0.05, 0.95))
    return f"{middle:.3f}\N{NO-BREAK SPACE}[{low:.3f},\N{NO-BREAK SPACE}{high:.3f}]"

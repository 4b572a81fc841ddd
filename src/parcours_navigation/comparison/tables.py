"""The tables of a comparison, the same on the terminal, on the page and in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from parcours.report.pieces import Cell, Column, Marked, Table
from parcours.report.terminal import to_markdown
from parcours.verdict.statistics import Rate, RateDifference, quantiles
from parcours_navigation.comparison.analysis import Analysis, PairTest, Score, finite
from parcours_navigation.comparison.requiring import requirement_tables
from parcours_navigation.comparison.results import QUESTIONS, RULES, STUCK, Floats
from parcours_navigation.outcomes import VERDICT_OF, Outcome
from parcours_navigation.study.distribution import distribution_table
from parcours_navigation.study.outcome_tables import OUTCOME_WORDS

_QUARTERS = (0.25, 0.5, 0.75)
_UNBROKEN = "\N{NO-BREAK SPACE}"

_PAPER_NOTE = (
    "The first six by the paper's rule, which reads flags at the end of the test; a stuck robot also counts by "
    "where it is: at the goal, or under way. They say nothing of planners that do not signal imminent collision. "
    "Halted for good: by the sound rule, never moved again until 40 s later. A contact that "
    "the obstacle alone caused found the robot at rest or moving away. Wilson 95 % intervals. More, fewer: cases "
    "that say yes for this planner only, and for the first only; p: McNemar's exact test on those, for quantities "
    "Wilcoxon's signed-rank test on the cases that have both; uncorrected, marked where Holm's correction over "
    "this table leaves them below 0.05. Quantities: median and, in brackets, 5 % and 95 % points."
)

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


def _table(title: str, heads: Iterable[Column], rows: Iterable[tuple[Cell, ...]], note: str) -> Table:
    return Table(title, tuple(heads), tuple(rows), note)


def outcome_table(found: Analysis) -> Table:
    """Return how the cases ended: each case has one outcome, so a column adds up to 100 %."""
    words = OUTCOME_WORDS | {Outcome.ERROR: "the planner itself failed"}
    rows: list[tuple[Cell, ...]] = [
        (words[o], str(VERDICT_OF[o]), *(interval(one.outcomes[o]) for one in found.standings)) for o in Outcome
    ]
    rows.append(("answers", "", *(one.of.answers for one in found.standings)))
    note = f"{found.results.n_cases} cases, the same for all; Wilson 95 % intervals. {found.caution}".strip()
    return _table("Outcomes: one per case", (Column("outcome"), Column("verdict"), *_names(found)), rows, note)


def question_table(found: Analysis) -> Table:
    """Return how many cases say yes to each question; a case may say yes to several."""
    rows: list[tuple[Cell, ...]] = [
        (words, *(interval(one.questions[words]) for one in found.standings)) for words in QUESTIONS
    ]
    if found.solvable is not None:
        of_solvable = [one.reached_of_solvable for one in found.standings]
        words = f"of the {found.solvable} cases that are solvable: goal reached"
        rows.append((words, *(interval(rate) for rate in of_solvable if rate is not None)))
    note = "Wilson 95 % intervals."
    if found.has_order:
        note += " Obstacles do not avoid the robot, so some contacts that an obstacle closes nobody can prevent."
    return _table("Questions: yes in how many cases", (Column("question"), *_names(found)), rows, note)


def time_table(found: Analysis) -> Table:
    """Return time to the goal in quartiles, over a planner's own cases and over those that all reach."""
    rows: list[tuple[Cell, ...]] = [
        (one.name, *quantiles(one.times, _QUARTERS), *quantiles(one.shared_times, _QUARTERS)) for one in found.standings
    ]
    groups = ("own cases", f"the {found.n_shared} cases that all reach")
    heads = [Column(q, ".2f", group=group, unit="s") for group in groups for q in ("q25", "median", "q75")]
    still = ", in which obstacles stand for 1 s" * found.has_order
    note = (
        f"From the beginning of the case{still}. Only times over cases that all reach compare planners: a planner's "
        "own cases may be the easy ones."
    )
    return _table("Time to the goal", (Column("planner", code=True), *heads), rows, note)


def clearance_table(found: Analysis) -> Table:
    """Return quantiles of the least clearance of a case."""
    gaps = {one.name: one.clearances[np.isfinite(one.clearances)] for one in found.standings}
    rows: list[tuple[Cell, ...]] = [(name, *quantiles(values, (0.05, *_QUARTERS))) for name, values in gaps.items()]
    heads = [Column(q, ".3f", unit="m") for q in ("5 %", "q25", "median", "q75")]
    note = "Negative: overlap, no matter who caused it."
    return _table("Least clearance in a case", (Column("planner", code=True), *heads), rows, note)


def score_table(found: Analysis) -> Table:
    """Return SPL and SCT, means over all cases."""
    rows: list[tuple[Cell, ...]] = [("SPL", *(one.spl for one in found.standings))]
    if found.solvable is not None:
        rows.append(("SCT", *(one.sct for one in found.standings)))
    note = (
        "1 would be: always there, on the shortest way, as early as possible. Shortest is the straight line, earliest "
        "what a disc of the same speed that knows the future and turns at once could do; so both are on the low side."
    )
    heads = (Column("score"), *(Column(name, ".3f", code=True) for name in found.names))
    return _table("Success weighted by length and by time", heads, rows, note)


def vector_table(found: Analysis) -> Table:
    """Return the share of goals reached for each start vector."""
    rows: list[tuple[Cell, ...]] = [
        (vector, n, *(interval(one.reached_by_vector[vector]) for one in found.standings))
        for vector, n in found.vectors.items()
    ]
    heads = (Column("start vector", code=True), Column("cases", ",d"), *_names(found))
    note = (
        "Numbers that are equal: the obstacles set out together; larger by 1: while the one before moves; larger by 2: "
        "after it has stopped."
    )
    return _table("Goal reached in time, by start vector of the obstacles", heads, rows, note)


def error_table(found: Analysis) -> Table | None:
    """Return why planners failed in themselves, commonest first, three reasons each; None if none did."""
    rows: list[tuple[Cell, ...]] = []
    for one in found.standings:
        rows += [(one.name, Marked(count, "bad"), reason) for reason, count in one.errors[:3]]
        if rest := sum(count for _, count in one.errors[3:]):
            rows.append((one.name, Marked(rest, "bad"), "other reasons"))
    if not rows:
        return None
    heads = (Column("planner", code=True), Column("cases", ",d"), Column("what it did"))
    return _table("Errors of planners", heads, rows, "Such cases count as not reached: they are never left out.")


def decision_table(found: Analysis) -> Table:
    """Return how long planners took to decide."""
    taken = [(one.name, one.decisions) for one in found.standings]
    rows: list[tuple[Cell, ...]] = [
        (name, *((t.n, t.median, t.p99, t.largest) if t else (None,) * 4)) for name, t in taken
    ]
    heads = [Column(q, ",.0f", unit="us") for q in ("median", "p99", "largest")]
    untimed = "".join(f" {one.name}: {one.of.untimed}." for one in found.standings if one.of.untimed)
    note = (
        "Measured apart from the comparison, case after case in one process of this machine: wall time differs from "
        "run to run, so it is no part of the results. A planner that runs in a compiled loop of its own has no call to "
        f"measure: its published durations are simulated instead.{untimed}"
    )
    planner = (Column("planner", code=True), Column("decisions", ",d"))
    return _table("Wall time of one decision", (*planner, *heads), rows, note)


def measure_table(found: Analysis) -> Table:
    """Return what was measured along the robots' ways, over all cases."""
    note = "Measures of planners that reach more cases are of more, and harder, cases: compare rates first."
    return distribution_table("Measures over all cases", {one.name: one.measures for one in found.standings}, note)


def paper_table(found: Analysis) -> Table:
    """Return a row a question or quantity, a column a planner, and what the others differ from the first by.

    A repair is judged by this table: the same cases, every rate with its interval, every difference tested.
    """
    others, n_cases = found.names[1:], found.results.n_cases
    rows: list[tuple[Cell, ...]] = [
        (words, *(interval(one.rules[words]) for one in found.standings), *_tested(found, words)) for words in RULES
    ]
    note = _PAPER_NOTE
    if found.solvable is not None and found.unsolvable is not None:
        brackets = [tuple(interval(rate) for rate in one.stuck_of_solvable or ()) for one in found.standings]
        cells = [sure if sure == likely else f"{sure} to {likely}" for sure, likely in brackets]
        rows.append((f"{STUCK}, of the solvable cases", *cells, *(None for _ in range(3 * len(others)))))
        note = (
            f"Of {n_cases} cases {found.solvable} are solvable by a disc that knows the future, {found.unsolvable} by "
            f"nobody, and {n_cases - found.solvable - found.unsolvable} are undecided (docs/solvability.md). {note}"
        )
    for words, what in (("least clearance [m]", "clearances"), ("time to goal [s]", "times")):
        spreads = (_spread(finite(getattr(one, what))) for one in found.standings)
        rows.append((words, *spreads, *_tested(found, what)))
    heads = [Column("result"), *_names(found)]
    for other in others:
        heads += [*(Column(word, ",d", group=other) for word in ("more", "fewer")), Column("p", group=other)]
    return _table(f"The paper's results, contacts and times of {n_cases} cases", heads, rows, note)


def _tested(found: Analysis, what: str) -> list[Cell]:
    """Return cases more and fewer, and p, of each planner against the first."""
    cells: list[Cell] = []
    for test in found.rule_tests:
        if test.question == what:
            pairs = test.found.pairs if isinstance(test.found, RateDifference) else None
            counts = (pairs.second_only, pairs.first_only) if pairs else (None, None)
            cells += [*counts, _p_cell(test.p_value, test)]
    return cells


def _spread(values: Floats) -> Cell:
    if np.isnan(values).all():
        return None
    middle, low, high = quantiles(values, (0.5, 0.05, 0.95))
    return f"{middle:.3f}{_UNBROKEN}[{low:.3f},{_UNBROKEN}{high:.3f}]"


def to_markdown_page(found: Analysis) -> str:
    """Return the paper's results, the outcomes and the measures in Markdown, ready for a document."""
    made = found.results
    tables = (paper_table(found), outcome_table(found), *requirement_tables(made), measure_table(found))
    head = f"Seed {made.seed}, protocol {made.protocol}, {made.n_cases} cases, the same for all."
    return "\n\n".join([head, *(f"**{t.title}**\n\n{to_markdown(t)}\n\n{t.note}" for t in tables)])


def tests_table(found: Analysis) -> Table:
    """Return the tests of each planner against the first: who beats whom, by how much, and how sure that is."""
    what = {"reached": "goal reached", "contact": "collision", "time": "time to goal"}
    rows: list[tuple[Cell, ...]] = []
    for test in found.tests:
        p_cells = p_text(test.p_value), _p_cell(test.p_holm, test)
        rows.append((f"{test.second} against {test.first}", what[test.question], *_found(test), *p_cells))
    names = ("cases", "only it", "only the first", "difference", "effect", "p", "p (Holm)")
    heads = (Column("pair"), Column("what", code=False), *map(Column, names))
    note = (
        "Reached and contact: McNemar's exact test on the cases that only one of the two has; difference of the rates "
        "with Newcombe's 95 % interval; effect: odds ratio of those cases. Time: cases that both reach, Wilcoxon's "
        "signed-rank test (zeros by Pratt), median difference with its 95 % interval, effect: rank-biserial "
        f"correlation. Differences are the planner's minus the first's. Holm corrects for all {len(found.tests)} tests "
        "here; marked where below 0.05."
    )
    return _table(f"Tests on the same cases against {found.names[0]}", heads, rows, note)


def _found(test: PairTest) -> tuple[Cell, ...]:
    """Return cases, discordant counts, difference and effect, seen from the second planner."""
    found = test.found
    if isinstance(found, RateDifference):
        pairs = found.pairs
        if math.isnan(found.difference):
            return pairs.n, None, None, None, None
        words = f"{_signed(-found.difference, '.1%')} [{_signed(-found.high, '.1%')}, {_signed(-found.low, '.1%')}]"
        return pairs.n, pairs.second_only, pairs.first_only, words, _ratio(pairs.second_only, pairs.first_only)
    if not found.n:
        return 0, None, None, None, None
    words = f"{_signed(-found.median, '.2f')} s [{_signed(-found.high, '.2f')}, {_signed(-found.low, '.2f')}]"
    return found.n, None, None, words, _signed(-found.rank_biserial, ".2f")


def _ratio(more: int, fewer: int) -> str | None:
    """Return the odds ratio of two discordant counts.

    >>> _ratio(3, 6), _ratio(3, 0), _ratio(0, 0)
    ('0.50', '∞', None)
    """
    if not fewer:
        return "∞" if more else None
    return f"{more / fewer:.2f}"


def _signed(value: float, form: str) -> str:
    """Return a number with its sign; nothing that rounds to zero is called negative.

    >>> _signed(-0.0001, ".2f"), _signed(-0.25, ".1%")
    ('+0.00', '−25.0%')
    """
    text = format(value, f"+{form}")
    if not any(digit in text for digit in "123456789") and math.isfinite(value):
        text = text.replace("-", "+")
    return text.replace("-", "\N{MINUS SIGN}")


def p_text(p_value: float) -> str:
    """Return a p-value as readers expect it.

    >>> p_text(0.0123), p_text(1e-9), p_text(1.0)
    ('0.0123', '<0.0001', '1.0000')
    """
    return "<0.0001" if p_value < 0.0001 else f"{p_value:.4f}"


def _p_cell(p_value: float, test: PairTest) -> Cell:
    """Return a p-value, marked where Holm's correction leaves it below 0.05."""
    return Marked(p_text(p_value), "neutral") if test.p_holm < 0.05 else p_text(p_value)


def benchmark_tables(found: Analysis) -> tuple[Table, ...]:
    """Return the short table of scores and the whole one, folded; none if the cases were not measured."""
    if not found.scores:
        return ()
    short = tuple(s for key in HEADLINE for s in found.scores if (s.benchmark, s.mode, s.score) == key)
    note = (
        "Means over the cases for which a score is defined. BARN's optimal time is the straight line at top speed. "
        "SPL and SCT here count only goals reached without any contact, also of an obstacle that ran into the robot. "
        "What each mode does, defects included: docs/metrics.md."
    )
    heads = (
        Column("benchmark"), Column("mode", code=True), Column("score"), Column("unit"), Column("cases", ",d"),
        *(Column(name, ".3g") for name in found.names),
    )  # fmt: skip

    def rows(scores: tuple[Score, ...]) -> tuple[tuple[Cell, ...], ...]:
        return tuple((s.benchmark, s.mode, s.score, s.unit, s.cases, *s.means) for s in scores)

    whole = Table("All scores of all modes", heads, rows(found.scores), folded=True)
    return Table("Scores", heads, rows(short), note), whole


def interval(rate: Rate) -> str:
    """Return a rate with its interval in percent, in one unbroken word; with more decimals from 10 000 cases on.

    >>> from parcours.verdict.statistics import wilson
    >>> [interval(wilson(count, n)).replace("\\xa0", " ") for count, n in ((70, 905), (8, 10_000), (0, 100_000))]
    ['7.7 % [6.2, 9.7]', '0.08 % [0.04, 0.16]', '0.000 % [0.000, 0.004]']
    """
    if not rate.n:
        return "–"
    decimals = max(round(math.log10(rate.n)) - 2, 1)
    share, low, high = (f"{100 * value:.{decimals}f}" for value in (rate.share, rate.low, rate.high))
    return f"{share} % [{low}, {high}]".replace(" ", _UNBROKEN)


def _names(found: Analysis) -> tuple[Column, ...]:
    return tuple(Column(name) for name in found.names)

"""Results of a comparison -> one page: what to take home, outcomes, tests, times, start vectors, errors."""

from __future__ import annotations

from parcours import __version__
from parcours.report.pieces import Figure, Finding, Findings, Page, Piece, Section, Text, Tone
from parcours.report.rates import intervals, shares
from parcours.report.standings import arrivals, dominance
from parcours.verdict.statistics import wilson
from parcours_navigation.comparison.benchmarking import BENCHMARK_LEAD, benchmark_tables
from parcours_navigation.comparison.paper_rule import paper_table
from parcours_navigation.comparison.results import PairTest, Results, contact, pair_tests
from parcours_navigation.comparison.rivalry import tests_table
from parcours_navigation.comparison.tables import (
    beats,
    clearance_table,
    decision_table,
    error_table,
    measure_table,
    outcome_table,
    question_table,
    score_table,
    speaks_of_answers,
    time_table,
    vector_table,
)
from parcours_navigation.outcomes import Outcome
from parcours_navigation.study.distribution import reached, time_to_goal

SLICES: dict[str, tuple[tuple[str, ...], Tone]] = {
    "goal reached in time": (("REACHED",), "good"),
    "goal reached later": (("UNDER_WAY",), "fair"),
    "obstacle rests on goal": (("BLOCKED",), "neutral"),
    "never arrived": (("STUCK", "ASTRAY"), "poor"),
    "touched while moving": (("COLLIDED",), "bad"),
    "planner's error": (("ERROR",), "worst"),
}
"""Slices of the stacked bars -> the outcomes in them, and their tone."""

_READING = """\
All planners ran **the same cases**: the same obstacles set out at the same times. So they are compared case by case, \
and only cases in which two planners differ say anything about which is better.

A small p-value says that a difference is not chance; the interval says how large it is. With many cases a difference \
too small to matter has a small p-value too. Holm's correction is made over all tests of the table together."""


def compare_page(results: Results) -> Page:
    """Return the page of a comparison."""
    tests = pair_tests(results.contenders)
    facts = (
        ("cases", str(results.n_cases)),
        ("seed", str(results.seed)),
        ("protocol", results.protocol),
        ("command delay", f"{results.command_delay:g} s"),
        ("parcours", __version__),
    )
    sections = [
        Section("What to take home", "", (_findings(results), Text(_READING), *_caution(results)), "findings"),
        Section(
            "How the cases ended", "", (_stacked(results), outcome_table(results), question_table(results)), "outcomes"
        ),
        Section("The paper's results", "", (paper_table(results),), "paper"),
        Section("Who beats whom", "", _rivalry(results, tests), "tests"),
        Section("Times and clearances", "", _times(results), "times"),
        Section("The way driven", "", (measure_table(results),), "measures"),
        Section("Start vectors", "", (vector_table(results),), "vectors"),
    ]
    if (scored := benchmark_tables(results)) is not None:
        sections.append(Section("Scores of published benchmarks", BENCHMARK_LEAD, scored, "benchmarks"))
    if (errors := error_table(results)) is not None:
        sections.append(Section("Errors", "What planners did that ended a case.", (errors,), "errors"))
    sections.append(Section("Time to decide", "", (decision_table(results),), "decisions"))
    names = ", ".join(c.name for c in results.contenders)
    return Page("Planners on the same cases", names, facts, tuple(sections))


def _caution(results: Results) -> tuple[Piece, ...]:
    words = speaks_of_answers(results)
    return (Text(f"**Unequal machines.** {words}"),) if words else ()


def _findings(results: Results) -> Findings:
    items = []
    for contender in results.contenders:
        rate = wilson(int(reached(contender.facts).sum()), results.n_cases)
        touched = int(contact(contender.facts).sum())
        note = f"95 %: {100 * rate.low:.1f} to {100 * rate.high:.1f}; touched while moving: {touched}"
        items.append(Finding(f"{100 * rate.share:.1f} %", f"{contender.name}: goal reached in time", note))
    return Findings(tuple(items))


def _stacked(results: Results) -> Figure:
    known = {outcome.name: int(outcome) for outcome in Outcome}
    series = {}
    for contender in results.contenders:
        codes = contender.outcomes
        series[contender.name] = [
            float(sum((codes == known[name]).sum() for name in members if name in known))
            for members, _ in SLICES.values()
        ]
    return shares("How the cases ended", list(SLICES), series, [tone for _, tone in SLICES.values()])


def _rivalry(results: Results, tests: tuple[PairTest, ...]) -> tuple[Piece, ...]:
    names = [c.name for c in results.contenders]
    rates = {
        words: [wilson(int(ask(c.facts).sum()), results.n_cases) for c in results.contenders]
        for words, ask in (("goal reached in time", reached), ("touched while moving", contact))
    }
    pieces: list[Piece] = [intervals("Rates with Wilson 95 % intervals", names, rates, "share of cases")]
    if len(names) > 1:
        pieces.append(
            dominance(
                "Reached the goal where the other did not",
                names,
                beats(results),
                "Row over column, share of all cases. Both tiles of a pair large: the two are good at different cases.",
            )
        )
        pieces.append(tests_table(results, tests))
    return tuple(pieces)


def _times(results: Results) -> tuple[Piece, ...]:
    return (
        time_table(results),
        _arrivals(results),
        clearance_table(results),
        _clearance(results),
        score_table(results),
    )


def _arrivals(results: Results) -> Figure:
    return arrivals(
        "Time to the goal",
        {c.name: time_to_goal(c.facts) for c in results.contenders},
        "time since the case began [s]",
        "Share of all cases: a line ends at the share that is reached in time.",
    )


def _clearance(results: Results) -> Figure:
    return arrivals(
        "Least clearance in a case",
        {c.name: c.facts["min_clearance"] for c in results.contenders},
        "least gap to an obstacle before the end [m]",
        "Negative: overlap, whoever closed the gap.",
    )

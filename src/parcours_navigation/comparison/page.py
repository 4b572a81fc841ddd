"""The page of a comparison: what to take home, outcomes, tests, times, start vectors, errors."""

from __future__ import annotations

from parcours import __version__
from parcours.report.pieces import Figure, Findings, KeyFigure, Page, Piece, Section, Text, Tone
from parcours.report.rates import intervals, shares
from parcours.report.standings import arrivals, dominance
from parcours_navigation.comparison import tables
from parcours_navigation.comparison.analysis import Analysis
from parcours_navigation.comparison.requiring import requirement_tables
from parcours_navigation.outcomes import Outcome

SLICES: dict[str, tuple[tuple[Outcome, ...], Tone]] = {
    "goal reached in time": ((Outcome.REACHED,), "good"),
    "goal reached later": ((Outcome.UNDER_WAY,), "fair"),
    "obstacle rests on goal": ((Outcome.BLOCKED,), "neutral"),
    "goal not reached": ((Outcome.STUCK, Outcome.ASTRAY), "poor"),
    "touched while moving": ((Outcome.COLLIDED,), "bad"),
    "planner's error": ((Outcome.ERROR,), "worst"),
}
"""Slices of the stacked bars -> the outcomes in them, and their tone."""

_REACHED, _TOUCHED = "goal reached in time, no collision", "collision caused by the robot"

_READING = """\
All planners ran **the same cases**: the same obstacles set out at the same times. So they are compared case by case, \
and only cases in which two planners differ say anything about which is better.

A small p-value says that a difference is not chance; the interval says how large it is. With many cases a difference \
too small to matter has a small p-value too. Holm's correction is made over all tests of the table together."""

_BENCHMARK_LEAD = (
    "What published benchmarks would say of the same runs. Their code has defects, so a score stands here corrected "
    "and, under the name of its mode, as the code computes it."
)


def compare_page(found: Analysis) -> Page:
    """Return the page of a comparison."""
    made = found.results
    facts = (
        ("cases", str(made.n_cases)),
        ("seed", str(made.seed)),
        ("protocol", made.protocol),
        ("command delay", f"{made.command_delay:g} s"),
        ("parcours", __version__),
    )
    caution = (Text(f"**Unequal machines.** {found.caution}"),) if found.caution else ()
    ended = (_stacked(found), tables.outcome_table(found), tables.question_table(found))
    sections = [
        Section("What to take home", "", (_findings(found), Text(_READING), *caution), "findings"),
        Section("How the cases ended", "", ended, "outcomes"),
        Section("The paper's results", "", (tables.paper_table(found),), "paper"),
        Section("Who beats whom", "", _rivalry(found), "tests"),
        *(Section("Requirements", "", pieces, "requirements") for pieces in [requirement_tables(made)] if pieces),
        Section("Times and clearances", "", _times(found), "times"),
        Section("The way driven", "", (tables.measure_table(found),), "measures"),
        Section("Start vectors", "", (tables.vector_table(found),), "vectors"),
    ]
    if scored := tables.benchmark_tables(found):
        sections.append(Section("Scores of published benchmarks", _BENCHMARK_LEAD, scored, "benchmarks"))
    if (errors := tables.error_table(found)) is not None:
        sections.append(Section("Errors", "What planners did that ended a case.", (errors,), "errors"))
    sections.append(Section("Time to decide", "", (tables.decision_table(found),), "decisions"))
    return Page("Planners on the same cases", ", ".join(found.names), facts, tuple(sections))


def _findings(found: Analysis) -> Findings:
    items = []
    for one in found.standings:
        rate, touched = one.questions[_REACHED], one.questions[_TOUCHED].count
        note = f"95 %: {100 * rate.low:.1f} to {100 * rate.high:.1f}; touched while moving: {touched}"
        items.append(KeyFigure(f"{100 * rate.share:.1f} %", f"{one.name}: goal reached in time", note))
    return Findings(tuple(items))


def _stacked(found: Analysis) -> Figure:
    series = {
        one.name: [float(sum(one.outcomes[o].count for o in members)) for members, _ in SLICES.values()]
        for one in found.standings
    }
    return shares("How the cases ended", list(SLICES), series, [tone for _, tone in SLICES.values()])


def _rivalry(found: Analysis) -> tuple[Piece, ...]:
    asked = {"goal reached in time": _REACHED, "touched while moving": _TOUCHED}
    rates = {words: [one.questions[question] for one in found.standings] for words, question in asked.items()}
    chart = intervals("Rates with Wilson 95 % intervals", found.names, rates, "share of cases")
    if len(found.names) == 1:
        return (chart,)
    note = "Row over column, share of all cases. Both tiles of a pair large: the two are good at different cases."
    tiles = dominance("Reached the goal where the other did not", found.names, found.beats, note)
    return chart, tiles, tables.tests_table(found)


def _times(found: Analysis) -> tuple[Piece, ...]:
    times = {one.name: one.times for one in found.standings}
    gaps = {one.name: one.clearances for one in found.standings}
    note = "Share of all cases: a line ends at the share that is reached in time."
    arrived = arrivals("Time to the goal", times, "time since the case began [s]", note)
    note, axis = "Negative: overlap, no matter who caused it.", "least gap to an obstacle before the end [m]"
    least = arrivals("Least clearance in a case", gaps, axis, note)
    return tables.time_table(found), arrived, tables.clearance_table(found), least, tables.score_table(found)

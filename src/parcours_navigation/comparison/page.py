"""The page of a comparison: what to take home, outcomes, tests, times, start vectors, errors."""

from __future__ import annotations

import shlex

import numpy as np

from parcours.report.pieces import (
    Cause,
    Cell,
    Column,
    Failing,
    Failures,
    Figure,
    Findings,
    KeyFigure,
    Marked,
    Page,
    Piece,
    Section,
    Summary,
    Table,
    Text,
    Tone,
)
from parcours.report.rates import intervals, shares
from parcours.report.standings import arrivals, dominance
from parcours.study.provenance import provenance
from parcours.study.reporting import percent
from parcours.verdict.judgement import Verdict
from parcours_navigation.comparison import tables
from parcours_navigation.comparison.analysis import Analysis
from parcours_navigation.comparison.requiring import requirement_tables
from parcours_navigation.comparison.results import repeats_of
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain
from parcours_navigation.study.outcome_tables import OUTCOME_WORDS

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

_CLEAR, _GROUPS, _ROWS = 0.05, 30, 600  # a p-value; groups of cases, and rows, that are listed

_READING = """\
All planners ran **the same cases**: the same world, and the same bodies at the same places at first. So they are \
compared case by case, and only cases in which two planners differ say anything about which is better.

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
        *provenance().items(),
        ("cases", str(made.n_cases)),
        ("seed", str(made.seed)),
        ("protocol", made.protocol),
        ("command delay", f"{made.command_delay:g} s"),
        ("run again", repeats_of(made.contenders)),
    )
    caution = (Text(f"**Unequal machines.** {found.caution}"),) if found.caution else ()
    ended = (_stacked(found), tables.outcome_table(found), tables.question_table(found))
    failing = _failures(found)
    lead = "Grouped by planner and outcome, the least clearance first. Click the name of a case for its link."
    failed = Section("Cases that were not solved", lead, (failing,), "failures")
    sections = [
        *((failed,) if failing.causes else ()),
        Section("Main findings", "", (_findings(found), Text(_READING), *caution), "findings"),
        Section("How the cases ended", "", ended, "outcomes"),
        *(
            (Section("The paper's results", "", _parted(tables.paper_table(found), found.names[0]), "paper"),)
            if found.has_order
            else ()
        ),
        Section("Who beats whom", "", _rivalry(found), "tests"),
        *(Section("Requirements", "", pieces, "requirements") for pieces in [requirement_tables(made)] if pieces),
        Section("Times and clearances", "", _times(found), "times"),
        Section("The way driven", "", (tables.measure_table(found),), "measures"),
        *((Section("Start vectors", "", (tables.vector_table(found),), "vectors"),) if found.has_order else ()),
    ]
    if scored := tables.benchmark_tables(found):
        sections.append(Section("Scores of published benchmarks", _BENCHMARK_LEAD, scored, "benchmarks"))
    if (errors := tables.error_table(found)) is not None:
        sections.append(Section("Errors", "What planners did that ended a case.", (errors,), "errors"))
    sections.append(Section("Time to decide", "", (tables.decision_table(found),), "decisions"))
    return Page("Planners on the same cases", ", ".join(found.names), facts, tuple(sections), _summary(found, failing))


def _summary(found: Analysis, failing: Failures) -> Summary:
    best = max(found.standings, key=lambda one: one.questions[_REACHED].share)
    first = found.standings[0]
    rates = ", ".join(f"*{one.name}* {percent(one.questions[_REACHED].share)}" for one in found.standings)
    facts = [f"The goal was reached in time, without a collision: {rates}."]
    for test in found.tests:
        if test.question == "reached" and best.name in (test.first, test.second) and best is not first:
            clear = "is more than chance" if test.p_holm < _CLEAR else "may be chance"
            facts.append(f"The difference between *{first.name}* and *{best.name}* {clear} (p {test.p_holm:.2g}).")
    if failing.causes:
        worst = max(range(len(failing.causes)), key=lambda k: failing.causes[k].count)
        cause = failing.causes[worst]
        facts.append(f"The commonest failure: [{cause.words}](#cause_{worst + 1}), {cause.count:,d} cases.")
    for one in found.results.contenders:
        if one.repeated[0] < one.repeated[1]:
            n = one.repeated[1] - one.repeated[0]
            facts.insert(
                1, f"*{one.name}* is not reproducible: {n} of {one.repeated[1]} cases ended otherwise when run again."
            )
    verdict = (
        f"{best.name} solved most: {best.questions[_REACHED].count:,d}." if len(found.names) > 1
        else f"It solved {best.questions[_REACHED].count:,d}."
    )  # fmt: skip
    advice = "Open one of [the cases that were not solved](#failures), and replay it with two planners." * bool(
        facts[1:]
    )
    return Summary(
        f"{len(found.names)} planners ran the same {found.results.n_cases:,d} cases.", verdict, "neutral",
        tuple(facts[:3]), advice,
    )  # fmt: skip


def _failures(found: Analysis) -> Failures:
    """Return the cases that planners failed, by planner and outcome; the commonest first."""
    groups = [
        (one.of, outcome, np.flatnonzero(one.of.outcomes == int(outcome)))
        for one in found.standings
        for outcome in Outcome
        if VERDICT_OF[outcome] in (Verdict.FAIL, Verdict.ERROR)
    ]
    groups = sorted((each for each in groups if len(each[2])), key=lambda each: -len(each[2]))[:_GROUPS]
    causes = []
    for of, outcome, places in groups:
        facts = of.facts
        worst = places[np.argsort(facts["min_clearance"][places], kind="stable")][: _ROWS // len(groups)]
        words = OUTCOME_WORDS.get(outcome, "its own error")
        cases = tuple(
            Failing(
                f"{of.name}, case {facts['number'][k]}", Marked(str(VERDICT_OF[outcome]), "bad"), explain(facts[k]),
                (float(facts["min_clearance"][k]), float(facts["t_end"][k]) * 1e-9),
                (shlex.join(["parcours", "replay", of.folder, str(facts["number"][k])]),) if of.folder else (),
            )
            for k in worst
        )  # fmt: skip
        causes.append(Cause(f"{of.name}: {words}", len(places), cases))
    columns = Column("least clearance", ".3f", unit="m"), Column("ended at", ".1f", unit="s")
    return Failures("Cases", tuple(causes), columns)


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


def _parted(table: Table, first: str) -> tuple[Table, ...]:
    """Return what planners did and how they differ from the first as tables of their own: a page is not wide enough."""
    differing = [k for k, column in enumerate(table.columns) if column.group]
    parts = [(table.title, [k for k in range(len(table.columns)) if k not in differing], table.note)]
    parts += [(f"The same, against {first}", [0, *differing], "")] if differing else []
    found = []
    for title, places, note in parts:
        rows = tuple(tuple(_broken(row[k]) for k in places) for row in table.rows)
        found.append(Table(title, tuple(table.columns[k] for k in places), rows, note))
    return tuple(found)


def _broken(cell: Cell) -> Cell:
    """Return a rate that may break before its interval."""
    return cell.replace("\N{NO-BREAK SPACE}[", " [") if isinstance(cell, str) else cell


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

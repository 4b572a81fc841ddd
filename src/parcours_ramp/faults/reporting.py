"""Outcomes under faults -> a table fault x outcome for each schedule, a page, and a document."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from parcours.report.pieces import (
    Cause,
    Cell,
    Column,
    Failing,
    Failures,
    Findings,
    KeyFigure,
    Marked,
    Page,
    Section,
    Summary,
    Table,
    Tone,
)
from parcours.study.protocol import FaultReport, FaultRequest, Progress
from parcours.study.provenance import provenance
from parcours_navigation.facts import NEVER
from parcours_ramp.faults.catalogue import chosen
from parcours_ramp.faults.judging import UNWELCOME, RobotOutcome
from parcours_ramp.faults.running import WATCHED, FaultResults, FaultRow, run_faults
from parcours_ramp.system.study import SCHEDULES

_TONE: dict[RobotOutcome, Tone] = {
    RobotOutcome.NOT_STRUCK: "neutral",
    RobotOutcome.NO_EFFECT: "good",
    RobotOutcome.RECOVERS: "good",
    RobotOutcome.LATE: "fair",
    RobotOutcome.STOPS: "fair",
    RobotOutcome.STUCK: "poor",
    RobotOutcome.COASTS: "poor",
    RobotOutcome.RUNS_ON: "bad",
    RobotOutcome.CONTACT: "worst",
    RobotOutcome.ERROR: "bad",
}

_WORDS = {
    RobotOutcome.CONTACT: "the robot caused a collision", RobotOutcome.RUNS_ON: "it still moved at the end",
    RobotOutcome.ERROR: "an error ended the case",
    RobotOutcome.COASTS: "it reached the goal with a component dead or hung",
    RobotOutcome.STUCK: "it stood though the fault was over",
}  # fmt: skip

SHOWN = tuple(_TONE)  # all outcomes, from welcome to unwelcome

_GROUPS = {"topics": "Messages sent unasked", "services": "Questions and answers", "components": "Components"}

_NOTE = (
    "Cases per fault and outcome. *Not struck*: nothing was sent that the fault could hit. *No effect*: the goal "
    "within 1 s of when it is reached without the fault. *Recovers*: later, after the fault is over. *Late*: later, "
    "with it still in force. *Stops safely*: stands without contact while the fault is in force. *Stuck*: stands "
    "though the fault is over. *Coasts*: the goal, with a component dead or hung. *Runs on*: still moves at the end. "
    "*Contact*: a collision that the robot caused. "
    "*Rest after*: the longest time from the fault, or a death by it, until a robot that stops or is stuck stood. "
    "*Died or hangs*: components that raised because of a message, or did nothing at the end, with the number of cases."
)


def count(rows: Sequence[FaultRow]) -> Counter[RobotOutcome]:
    """Return how often each outcome occurs in the rows."""
    return Counter(one.outcome for row in rows for one in row.outcomes)


def died(row: FaultRow) -> str:
    """Return which components died of a message (not of the crash asked for) or hung, in how many cases, and why."""
    found = Counter(
        (death.component, death.why.partition(":")[0])
        for one in row.outcomes
        for death in one.deaths
        if death.why != "crash"
    )
    told = [f"{component} {n} ({why})" for (component, why), n in sorted(found.items())]
    hung = Counter(component for one in row.outcomes for component in one.silent)
    told += [f"{component} hangs {n}" for component, n in sorted(hung.items())]
    told += sorted({one.detail.partition("[")[0].strip() for one in row.outcomes if one.detail})
    return "; ".join(told)


def fault_table(results: FaultResults, schedule: str, group: str) -> Table:
    """Return the table fault x outcome of one schedule and group of the catalogue."""
    rows = [row for row in results.rows if row.schedule == schedule and row.entry.group == group]
    columns = (
        Column("fault", code=True), *(Column(outcome.value, align="right") for outcome in SHOWN),
        Column("rest after", ".1f", unit="s"), Column("died or hangs"),
    )  # fmt: skip
    return Table(f"{_GROUPS[group]}, {schedule}", columns, tuple(_cells(row) for row in rows))


def _cells(row: FaultRow) -> tuple[Cell, ...]:
    counts = count([row])
    rests = [one.rest_after for one in row.outcomes if one.rest_after != NEVER]
    return (
        str(row.entry), *(Marked(counts[outcome], _TONE[outcome]) if counts[outcome] else None for outcome in SHOWN),
        max(rests) * 1e-9 if rests else None, died(row),
    )  # fmt: skip


def total_table(results: FaultResults) -> Table:
    """Return how often each outcome occurs, by schedule and group of the catalogue."""
    cells: list[tuple[Cell, ...]] = []
    for schedule in results.t_goal:
        for group, title in _GROUPS.items():
            rows = [row for row in results.rows if row.schedule == schedule and row.entry.group == group]
            if rows:
                counts = count(rows)
                cells.append((schedule, title, len(rows), *(counts[outcome] or None for outcome in SHOWN)))
    columns = (Column("schedule"), Column("faults of"), Column("faults"), *(Column(one.value) for one in SHOWN))
    return Table("Outcomes by schedule", columns, tuple(cells), _NOTE)


def tables(results: FaultResults) -> tuple[Table, ...]:
    """Return all tables fault x outcome, and the totals."""
    found = {(row.schedule, row.entry.group) for row in results.rows}
    pairs = [(schedule, group) for schedule in results.t_goal for group in _GROUPS]
    return (*(fault_table(results, *pair) for pair in pairs if pair in found), total_table(results))


def fault_page(results: FaultResults) -> Page:
    """Return the report on all rows."""
    n, m = len(results.numbers), len(results.rows) // max(len(results.t_goal), 1)
    facts = (
        ("seed", str(results.seed)), ("cases", ", ".join(map(str, results.numbers))), ("faults", str(m)),
        ("watched", f"{WATCHED + 1.0:g} s"), ("run again", str(results.repeated)),
    )  # fmt: skip
    *detailed, total = tables(results)
    lead = (
        f"{m} faults, each in the same {n} cases, which all go well without. A fault may be survived, it may be "
        "answered by a stop, or it may go unnoticed until something is hit."
    )
    causes = _causes(results)
    listed = "Faults under which the robot was unsafe, or still stood after the fault was over, and in which cases."
    sections = [
        Section("Faults that were not survived", listed, (Failures("Faults", causes, what="fault"),), "failures")
    ]
    ended = Section("What becomes of the robot", lead, (Findings(_findings(results)), total), "outcomes")
    sections = [*(sections if causes else ()), ended]
    for schedule in results.t_goal:
        own = tuple(table for table in detailed if table.title.endswith(f", {schedule}"))
        sections.append(Section(f"Fault by fault, {schedule}", "", own))
    return Page("RAMP under faults", "", (*provenance().items(), *facts), tuple(sections), _summary(results, causes, m))


def _summary(results: FaultResults, causes: Sequence[Cause], n_faults: int) -> Summary:
    struck = [one for row in results.rows for one in row.outcomes if one.outcome is not RobotOutcome.NOT_STRUCK]
    unsafe = sum(one.outcome in (RobotOutcome.CONTACT, RobotOutcome.RUNS_ON) for one in struck)
    return Summary(
        f"**RAMP** ran under {n_faults} faults, one at a time, as {' and as '.join(results.t_goal)}.",
        f"It was unsafe in {unsafe} of {len(struck)} struck runs.", "bad" if unsafe else "good",
        (*results.repeated.warning(),
         *(f"{cause.count} fault{'s' * (cause.count != 1)}: [{cause.words}](#cause_{k})."
           for k, cause in enumerate(causes[:3], 1))),
        "Start with [the first fault of the list](#failures), and run its command." if causes
        else "Every fault was survived or answered by a stop.",
    )  # fmt: skip


def _causes(results: FaultResults) -> tuple[Cause, ...]:
    """Return the faults of each unwelcome outcome, the worst outcome first."""
    found = []
    for outcome in UNWELCOME:
        rows = []
        for row in results.rows:
            cases = [one.number for one in row.outcomes if one.outcome is outcome]
            if cases:
                why = f"in {len(cases)} of {len(row.outcomes)} cases: {', '.join(map(str, cases[:8]))}"
                command = ["parcours", "faults", "ramp_system", "--set", f"schedule={row.schedule}", "--seed",
                           str(results.seed), "--cases", str(len(row.outcomes)), "--only", str(row.entry)]  # fmt: skip
                told = died(row)
                rows.append(
                    Failing(f"{row.schedule}: {row.entry}", Marked(outcome.value, _TONE[outcome]),
                            f"{why}; {told}" if told else why, (), (shlex.join(command),))
                )  # fmt: skip
        if rows:
            found.append(Cause(_WORDS[outcome], len(rows), tuple(rows)))
    return tuple(found)


def _findings(results: FaultResults) -> tuple[KeyFigure, ...]:
    found: list[KeyFigure] = []
    for schedule in results.t_goal:
        counts = count([row for row in results.rows if row.schedule == schedule])
        total = max(sum(counts.values()) - counts[RobotOutcome.NOT_STRUCK], 1)
        unsafe = counts[RobotOutcome.CONTACT] + counts[RobotOutcome.RUNS_ON]
        found.append(
            KeyFigure(
                f"{unsafe / total:.1%}", f"of struck runs, {schedule}: contact, or never came to rest",
                f"{unsafe} of {total}", "worst" if unsafe else "good",
            )
        )  # fmt: skip
        reached = counts[RobotOutcome.NO_EFFECT] + counts[RobotOutcome.RECOVERS] + counts[RobotOutcome.LATE]
        found.append(KeyFigure(f"{reached / total:.1%}", f"of struck runs, {schedule}: the goal, all alive",
                             f"{reached} of {total}", "neutral"))  # fmt: skip
    return tuple(found)


def fault_document(results: FaultResults) -> dict[str, object]:
    """Return everything as JSON: seed, cases, and for each row the fault, the counts and every case; times in ns."""
    return {
        "seed": results.seed,
        "cases": list(results.numbers),
        "t_goal_without": {schedule: list(times) for schedule, times in results.t_goal.items()},
        "rows": [
            {
                "schedule": row.schedule,
                "fault": str(row.entry),
                "outcomes": {outcome.value: n for outcome in SHOWN if (n := count([row])[outcome])},
                "runs": [
                    {"case": one.number, **{k: v for k, v in asdict(one).items() if k != "number"}}
                    for one in row.outcomes
                ],
            }
            for row in results.rows
        ],
    }


def strike(request: FaultRequest, progress: Progress) -> FaultReport:
    """Run the catalogue, or what is chosen of it, under the schedule that the user named, or under both."""
    entries = chosen(request.only)
    lines = tuple(map(str, entries))
    if request.listed:
        return FaultReport(lines)
    schedules = (str(request.settings["schedule"]),) if "schedule" in request.given else SCHEDULES
    results = run_faults(
        entries, schedules, seed=request.seed, cases=request.cases, workers=request.workers, progress=progress
    )
    return FaultReport(lines, tables(results), fault_page(results), fault_document(results))

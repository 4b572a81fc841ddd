"""RAMP with added delays -> the report's chapter on what sensing, planning and stopping late would cost."""

from __future__ import annotations

from parcours.report.curves import curves
from parcours.report.pieces import Cell, Column, Marked, Section, Table, Text
from parcours.verdict.statistics import Rate
from parcours_ramp.system.delays import DELAYS, QUESTIONS, DelayResults
from parcours_ramp.system.study import SCHEDULES

WORDS = {
    "stuck": "stuck in imminent collision",
    "contact": "collision caused by the robot",
    "reached": "goal reached within 20 s",
}  # Questions as a reader of tables meets them

DIALS = {"sensing": "sensing", "planning": "planning and control", "stop": "stop command"}
"""Delays as a reader of charts meets them."""

_LEAD = (
    "How much later could RAMP see, plan or stop before it gets worse? To the published durations of work one delay is "
    "added at a time: obstacles are seen as they were so long ago; a planning or control cycle takes so much longer; a "
    "halt, or a limit of speed, reaches control so much later. The cases are the same at every setting."
)


def delays_chapter(results: DelayResults) -> Section:
    """Return the curves over each delay, the rates in numbers, and what the data show of the longest delay."""
    n, seconds = results.study.n_cases, results.study.seconds
    figure = curves(
        "Rates over an added delay",
        seconds,
        {
            WORDS[question]: {
                DIALS[delay]: {schedule: results.rates(schedule, delay, question) for schedule in SCHEDULES}
                for delay in DELAYS
            }
            for question in QUESTIONS
        },
        "added delay [s]",
        f"{n} cases a point, bands are Wilson 95 % intervals. Points of a curve are not independent: the cases are the "
        "same, but with other delays RAMP also draws other paths.",
    )
    return Section(
        "What delays cost", _LEAD, (figure, Text(_reading(results)), _ends(results), _rates(results)), "delays"
    )


def _ends(results: DelayResults) -> Table:
    """Return none against the longest delay, on the same cases."""
    longest = results.study.seconds[-1]
    rows: list[tuple[Cell, ...]] = []
    for schedule in SCHEDULES:
        for delay in DELAYS:
            for question in QUESTIONS:
                rates = results.rates(schedule, delay, question)
                pairs = results.against_none(schedule, delay, question)
                p = f"{pairs.p_value:.2g}"
                rows.append(
                    (schedule, DIALS[delay], WORDS[question], interval(rates[0]), interval(rates[-1]),
                     pairs.second_only, pairs.first_only, Marked(p, "neutral") if pairs.p_value < _CLEAR else p)
                )  # fmt: skip
    return Table(
        f"No delay against {longest:g} s",
        (Column("schedule"), Column("delay of"), Column("what"), Column("none"), Column(f"{longest:g} s"),
         Column("cases gained"), Column("cases lost"), Column("p", align="right")),
        tuple(rows),
        "Shares in per cent with Wilson 95 % intervals; gained: yes only with the delay; lost: yes only without; p: "
        f"McNemar's exact test, uncorrected; marked below {_CLEAR:.4f}, which is 0.05 over the {len(rows)} tests here.",
    )  # fmt: skip


_CLEAR = 0.05 / (len(SCHEDULES) * len(DELAYS) * len(QUESTIONS))


def _rates(results: DelayResults) -> Table:
    """Return every rate of the figure."""
    rows = tuple(
        (schedule, DIALS[delay], WORDS[question], *(interval(r) for r in results.rates(schedule, delay, question)))
        for schedule in SCHEDULES
        for delay in DELAYS
        for question in QUESTIONS
    )
    heads = (Column(f"{s:g} s", group="added") for s in results.study.seconds)
    return Table(
        "Rates over an added delay, in numbers", (Column("schedule"), Column("delay of"), Column("what"), *heads), rows,
        f"{results.study.n_cases} cases each; per cent with Wilson 95 % intervals.", folded=True,
    )  # fmt: skip


def _reading(results: DelayResults) -> str:
    """Return what can be said of each schedule from these runs, and what cannot."""
    longest = results.study.seconds[-1]
    lines = [f"With {longest:g} s added, against no delay, on the same cases (tests of the table below):"]
    for schedule in SCHEDULES:
        found = [
            f"{WORDS[question]} {_move(results, schedule, delay, question)} with late {DIALS[delay]}"
            for question in QUESTIONS
            for delay in DELAYS
            if results.against_none(schedule, delay, question).p_value < _CLEAR
        ]
        told = "; ".join(found) if found else "no rate changes by more than chance explains"
        lines.append(f"- **{schedule}**: {told}.")
    caution = (
        f"What is not named here changed by no more than {results.study.n_cases} cases can show, which is not to say "
        "that it does not matter. `guarded` keeps its parameters: its reaction time of 0.06 s, by which it chooses its "
        "speed near obstacles, does not know of what is added. What it does without a delay is therefore no promise "
        "for a slower machine; the curves say how much slower it may be. A late planning cycle blocks the planner "
        "after what it decided, which takes effect at once: of planning the curves show too little, not too much."
    )
    return "\n\n".join((lines[0], "\n".join(lines[1:]), caution))


def _move(results: DelayResults, schedule: str, delay: str, question: str) -> str:
    none, *_, late = results.rates(schedule, delay, question)
    return f"{100 * none.share:.1f} % → {100 * late.share:.1f} %"


def interval(rate: Rate) -> str:
    """Return a share and its interval in per cent."""
    return f"{100 * rate.share:.1f} [{100 * rate.low:.1f},\u00a0{100 * rate.high:.1f}]"

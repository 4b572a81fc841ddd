"""What became of the cases of campaigns, drawn: outcomes in a table and a figure, measures, errors."""

from __future__ import annotations

from collections.abc import Mapping

from parcours.report.pieces import Cell, Column, Figure, Marked, Table, Tone
from parcours.report.rates import shares
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import wilson
from parcours_navigation.outcomes import VERDICT_OF, Outcome, Share
from parcours_navigation.study.analysis import ASKED, Ended
from parcours_navigation.study.distribution import distribution_table

OUTCOME_WORDS = {
    Outcome.COLLIDED: "collision caused by the robot",
    Outcome.REACHED: "goal reached in time",
    Outcome.UNDER_WAY: "goal reached later",
    Outcome.BLOCKED: "goal could not be reached",
    Outcome.STUCK: "stopped for good",
    Outcome.ASTRAY: "goal not reached",
}
"""Outcomes as a reader of tables meets them; Outcome.ERROR is shown only where there is one."""

_PAPER_ROWS = (
    ("reached goal", "reached"),
    ("feasible at the end", "feasible"),
    ("imminent collision", "halted_once"),
    ("stuck in imminent collision", "stuck"),
)
"""The paper's results as readers meet them -> fields of `Published`."""

_FEW = 10
"""Reasons that a table of errors shows."""


def outcome_table(ended: Mapping[str, Ended]) -> Table:
    """Return the outcomes of campaigns side by side; the paper's results only of planners that signal what they need.

    What ran into something can be at the goal by the paper's rule: where a planner gives no signals, passed and failed
    come first.
    """
    every = ended.values()
    cases: tuple[Cell, ...] = ("cases", *(_finished(one) for one in every))
    paper: list[tuple[Cell, ...]] = [
        (words, *(_share(one.paper[field], one.n) if one.signals else "\N{EN DASH}" for one in every))
        for words, field in _PAPER_ROWS
    ]
    if all(one.signals for one in every):
        rows = [cases, *paper, *_counted(ended)]
        note = "First the paper's results by its own rule, with Wilson 95 % intervals; then one sound outcome per case."
    else:
        passed, failed = (
            (words, *(_share(sum(_of(one, verdict) for verdict in verdicts), one.n) for one in every))
            for words, verdicts in (("passed", [Verdict.PASS]), ("failed", [Verdict.FAIL, Verdict.ERROR]))
        )
        rows = [cases, passed, failed, *_counted(ended)]
        note = "Shares of all cases, with Wilson 95 % intervals; then the sound outcomes, one per case."
        if any(one.signals for one in every):
            rows += paper
            note += " Last what the paper's own rule says of planners that signal imminent collision, which it needs."
    return Table("Outcomes", (Column(""), *(Column(name) for name in ended)), tuple(rows), note)


def _of(one: Ended, verdict: Verdict) -> int:
    """Return how many cases earned the verdict."""
    return one.verdicts[verdict]


def _counted(ended: Mapping[str, Ended]) -> list[tuple[Cell, ...]]:
    """Return the rows that count the sound outcomes and their verdicts."""
    every = ended.values()
    words, verdicts = dict(OUTCOME_WORDS), [Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE]
    if any(one.outcomes[int(Outcome.ERROR)] for one in every):
        words[Outcome.ERROR] = "the planner itself failed"
        verdicts.append(Verdict.ERROR)
    rows: list[tuple[Cell, ...]] = [(said, *(one.outcomes[int(o)] for one in every)) for o, said in words.items()]
    return rows + [(f"verdict {verdict}", *(_of(one, verdict) for one in every)) for verdict in verdicts]


def _finished(one: Ended) -> Cell:
    return one.n if one.n == one.planned else Marked(f"{one.n} of {one.planned}, unfinished", "poor")


def _share(count: int, n: int) -> str:
    rate = wilson(count, n)
    return f"{rate.share:.1%} [{rate.low:.1%}, {rate.high:.1%}]"


def outcome_figure(ended: Mapping[str, Ended]) -> Figure:
    """Return how the tests ended: as in the paper where all planners give its signals, otherwise the sound verdicts."""
    tones: tuple[Tone, ...] = ("good", "fair", "poor", "bad")
    if all(one.signals for one in ended.values()):
        slices = {name: [one.shares[share] for share in Share] for name, one in ended.items()}
        return shares("How the tests ended", [str(share) for share in Share], slices, tones)
    parts = (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.ERROR, Verdict.FAIL)
    verdicts = {name: [_of(one, part) for part in parts] for name, one in ended.items()}
    return shares("The verdicts", [str(part) for part in parts], verdicts, tones)


def measure_table(ended: Mapping[str, Ended]) -> Table:
    """Return what was measured in campaigns, side by side."""
    note = (
        f"SCT and survivability over the first {ASKED} cases." if any(one.n > ASKED for one in ended.values()) else ""
    )
    return distribution_table("Measures", {name: one.measures for name, one in ended.items()}, note)


def error_table(ended: Mapping[str, Ended]) -> Table | None:
    """Return the commonest reasons of errors of each campaign, and a case of each; None if there were no errors."""
    rows = tuple((name, *error) for name, one in ended.items() for error in one.errors[:_FEW])
    if not rows:
        return None
    columns = (Column("campaign"), Column("reason"), Column("cases"), Column("first case"))
    note = f"What the planners themselves did wrong; the {_FEW} commonest reasons of each."
    return Table("Errors", columns, rows, note)


def failure_table(ended: Mapping[str, Ended]) -> Table | None:
    """Return how many cases of each campaign failed in which way, and the first of them; None if none failed."""
    ways = [outcome for outcome, verdict in VERDICT_OF.items() if verdict is Verdict.FAIL]
    rows = tuple(
        (name, OUTCOME_WORDS[way], one.outcomes[int(way)], one.first[int(way)])
        for name, one in ended.items()
        for way in ways
        if one.outcomes[int(way)]
    )
    if not rows:
        return None
    columns = (Column("campaign"), Column("outcome"), Column("cases"), Column("first case"))
    return Table("Failures", columns, rows, "To see one: parcours replay CAMPAIGN CASE.")

"""Results of system campaigns -> their outcomes in a table and a figure, for any report that shows them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Protocol as TypingProtocol

import numpy as np
from numpy.typing import NDArray

from parcours.report.pieces import Cell, Column, Figure, Marked, Table
from parcours.report.rates import shares
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import wilson
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.outcomes import VERDICT_OF, Outcome, Share, outcomes, published
from parcours_navigation.outcomes import shares as slices_of
from parcours_navigation.study.replay import Replay

OUTCOME_WORDS = {
    Outcome.COLLIDED: "the moving robot touched an obstacle",
    Outcome.REACHED: "goal reached in time",
    Outcome.UNDER_WAY: "goal reached later",
    Outcome.BLOCKED: "an obstacle rests on the goal",
    Outcome.STUCK: "stopped for ever",
    Outcome.ASTRAY: "never arrived",
}
"""Outcomes as a reader of tables meets them."""

ERROR_WORDS = "the planner itself failed"
"""Outcome.ERROR, which RAMP cannot have: shown only where there is one."""


class Results(TypingProtocol):
    """One campaign of any planner on system cases, as reports need it."""

    @property
    def label(self) -> str:
        """What ran: a schedule of RAMP, or a planner's name."""

    @property
    def signals(self) -> bool:
        """Whether it signals imminent collision and feasibility, without which the paper's rule tells little."""

    @property
    def cases(self) -> SystemCases:
        """The family of cases."""

    @property
    def facts(self) -> NDArray[np.void]:
        """Facts of its finished cases, shape (n,)."""

    @property
    def planned(self) -> int:
        """How many cases it plans."""

    def replay(self, number: int) -> Replay:
        """Return the replay of one case."""


_PAPER_ROWS = (
    ("reached goal", "reached"),
    ("feasible at the end", "feasible"),
    ("imminent collision", "halted_once"),
    ("stuck in imminent collision", "stuck"),
)
"""The paper's results as readers meet them -> fields of `Published`."""


def _only_ramp(results: Mapping[str, Results]) -> bool:
    return all(result.signals for result in results.values())


def outcome_table(results: Mapping[str, Results]) -> Table:
    """Return the outcomes of campaigns side by side; the paper's results, which need RAMP's signals, of RAMP only.

    What ran into something can be at the goal by the paper's rule: of other planners the sound outcomes alone are told.
    """
    paper: list[tuple[Cell, ...]] = []
    if any(r.signals for r in results.values()):
        paper = [
            (words, *(_share(getattr(published(r.facts), field)) if r.signals else "\N{EN DASH}"
                      for r in results.values()))
            for words, field in _PAPER_ROWS
        ]  # fmt: skip
    cases: tuple[Cell, ...] = ("cases", *(_finished(r) for r in results.values()))
    if _only_ramp(results):
        note = "First the paper's results by its own rule, with Wilson 95 % intervals; then sound outcomes, one a case."
        return _outcomes(results, (cases, *paper), _counted(results), note)
    passed = [np.isin(outcomes(r.facts), _PASSED) for r in results.values()]
    failed = [np.isin(outcomes(r.facts), _FAILED) for r in results.values()]
    head = (cases, ("passed", *(_share(f) for f in passed)), ("failed", *(_share(f) for f in failed)))
    note = "Shares of all cases, with Wilson 95 % intervals; then the sound outcomes, one a case."
    if paper:
        note += " Last what the paper's own rule says of RAMP, whose signals it needs."
    return _outcomes(results, (*head, *_counted(results)), paper, note)


_PASSED, _FAILED = ([int(o) for o in Outcome if VERDICT_OF[o] is verdict] for verdict in (Verdict.PASS, Verdict.FAIL))


def _outcomes(
    results: Mapping[str, Results], first: Sequence[tuple[Cell, ...]], then: Sequence[tuple[Cell, ...]], note: str
) -> Table:
    return Table("Outcomes", (Column(""), *(Column(name) for name in results)), (*first, *then), note)


def _counted(results: Mapping[str, Results]) -> list[tuple[Cell, ...]]:
    """Return the rows that count the sound outcomes and their verdicts."""
    rows: list[tuple[Cell, ...]] = []
    codes = [Counter(outcomes(r.facts).tolist()) for r in results.values()]
    rows += [(words, *(count[int(o)] for count in codes)) for o, words in OUTCOME_WORDS.items()]
    verdicts = [Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE]
    if any(count[int(Outcome.ERROR)] for count in codes):
        rows.append((ERROR_WORDS, *(count[int(Outcome.ERROR)] for count in codes)))
        verdicts.append(Verdict.ERROR)
    for verdict in verdicts:
        of = [o for o in Outcome if VERDICT_OF[o] is verdict]
        rows.append((f"verdict {verdict}", *(sum(count[int(o)] for o in of) for count in codes)))
    return rows


def _finished(result: Results) -> Cell:
    n = len(result.facts)
    return n if n == result.planned else Marked(f"{n} of {result.planned}, unfinished", "poor")


def _share(flags: np.ndarray) -> str:
    rate = wilson(int(flags.sum()), len(flags))
    return f"{rate.share:.1%} [{rate.low:.1%}, {rate.high:.1%}]"


def outcome_figure(results: Mapping[str, Results]) -> Figure:
    """Return how the tests ended: RAMP's as in the paper, otherwise the sound verdicts."""
    if not _only_ramp(results):
        parts = (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.ERROR, Verdict.FAIL)
        verdicts = {
            name: [VERDICT_OF[Outcome(code)] for code in outcomes(r.facts).tolist()] for name, r in results.items()
        }
        return shares(
            "The verdicts", [str(part) for part in parts],
            {name: [of.count(part) for part in parts] for name, of in verdicts.items()},
            ("good", "fair", "poor", "bad"),
        )  # fmt: skip
    return shares(
        "How the tests ended", [str(share) for share in Share],
        {name: [int(f.sum()) for f in slices_of(r.facts).values()] for name, r in results.items()},
        ("good", "fair", "poor", "bad"),
    )  # fmt: skip

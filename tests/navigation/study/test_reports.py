"""Reports on campaigns draw what was analysed once: no table, figure or document runs a case or asks the oracle."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from parcours.report.pieces import Marked
from parcours_navigation.outcomes import Outcome, Share
from parcours_navigation.study.analysis import ASKED, Ended
from parcours_navigation.study.distribution import MeasureSummary
from parcours_navigation.study.outcome_tables import (
    error_table,
    failure_table,
    measure_table,
    outcome_figure,
    outcome_table,
)


def ended(*, signals: bool, planned: int = 4, n: int = 4) -> Ended:
    """Two cases that pass, one that fails, one error."""
    outcomes = Counter({int(Outcome.REACHED): 2, int(Outcome.STUCK): 1, int(Outcome.ERROR): 1})
    paper = {"reached": 2, "feasible": 3, "halted_once": 1, "stuck": 1}
    shares = dict(zip(Share, (2, 1, 0, 1), strict=True))
    measures = {"spl": MeasureSummary("1", 4, 0.5, 0.4, 0.1, 0.9), "time_to_goal": MeasureSummary("s", 0)}
    errors = (("raised: KeyError", 1, 3),)
    first = {int(Outcome.REACHED): 0, int(Outcome.STUCK): 2, int(Outcome.ERROR): 3}
    return Ended("mine", "table-vii", 1, n, planned, signals, outcomes, paper, shares, measures, errors, first=first)


@pytest.fixture(autouse=True)
def without_oracle(monkeypatch: pytest.MonkeyPatch) -> None:
    def asked(*_: object, **__: object) -> None:
        raise AssertionError("a report asked the oracle")

    for name in ("oracle", "survived"):
        monkeypatch.setattr(f"parcours_navigation.study.analysis.{name}", asked)
        monkeypatch.setattr(f"parcours_navigation.study.distribution.{name}", asked)


def test_a_planner_without_signals_is_shown_by_sound_outcomes_alone() -> None:
    rows = {str(row[0]): row[1] for row in outcome_table({"a": ended(signals=False)}).rows}
    assert str(rows["passed"]).startswith("50.0% [") and str(rows["failed"]).startswith("50.0% [")  # errors, too
    assert rows["the planner itself failed"] == rows["verdict error"] == 1
    assert "reached goal" not in rows
    assert outcome_figure({"a": ended(signals=False)}).title == "The verdicts"


def test_what_the_published_rule_counts_as_reached_is_no_figure_of_a_planner_without_signals() -> None:
    assert "reached" not in ended(signals=False).document() and ended(signals=True).document()["reached"] == 2


def test_the_papers_results_stand_first_only_where_every_planner_signals() -> None:
    alone = [str(row[0]) for row in outcome_table({"a": ended(signals=True)}).rows]
    both = outcome_table({"a": ended(signals=True), "b": ended(signals=False)})
    assert alone[1] == "reached goal" and [str(row[0]) for row in both.rows][1] == "passed"
    assert both.rows[-1][1:] == (both.rows[-1][1], "–") and "signal imminent collision" in both.note


def test_unfinished_cases_and_a_capped_score_are_said() -> None:
    (cases,) = [row[1] for row in outcome_table({"a": ended(signals=True, planned=9)}).rows if row[0] == "cases"]
    assert cases == Marked("4 of 9, unfinished", "poor")
    assert "SCT and survivability over the first" in measure_table({"a": ended(signals=True, n=ASKED + 1)}).note
    assert "SCT over the first" not in measure_table({"a": ended(signals=True)}).note


def test_a_document_leaves_out_what_needs_signals_and_keeps_reasons() -> None:
    with_signals, without = ended(signals=True).document(), ended(signals=False).document()
    assert with_signals["schedule"] == without["planner"] == "mine"
    assert {"feasible", "imminent_collision", "stuck"} <= set(with_signals) - set(without)
    assert without["errors"] == {"raised: KeyError": 1} and without["outcomes"] == with_signals["outcomes"]
    table = error_table({"a": ended(signals=False)})
    assert table is not None and table.rows == (("a", "raised: KeyError", 1, 3),)


def test_failures_name_the_first_case_of_each_outcome_and_are_left_out_where_none_failed() -> None:
    table = failure_table({"out/a": ended(signals=False)})
    assert table is not None and table.rows == (("out/a", "stopped for good", 1, 2),)
    none = replace(ended(signals=False), outcomes=Counter({int(Outcome.REACHED): 4, int(Outcome.ERROR): 1}))
    assert failure_table({"out/a": none}) is None

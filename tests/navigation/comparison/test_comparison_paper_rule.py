"""The table by which a repair is judged, and the scores of published benchmarks, on planted results."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from parcours.report.pieces import Marked, Table
from parcours_navigation.arena.solvability import SOLVABILITY, SOLVABLE, UNDECIDED, UNSOLVABLE
from parcours_navigation.comparison.analysis import REPRODUCING, analyse, benchmark_scores
from parcours_navigation.comparison.document import comparison_document
from parcours_navigation.comparison.results import RULES, STUCK, ComparisonResults, Contender
from parcours_navigation.comparison.tables import HEADLINE, benchmark_tables, paper_table, to_markdown_page
from parcours_navigation.facts import FACTS, NEVER
from parcours_navigation.measures import BENCHMARKS, MEASURES, PUBLISHED

N = 40


def contender(name: str, n_stuck: int, n_reached: int) -> Contender:
    """Return a planner that is stuck in the first cases, and reaches the goal in the last ones."""
    facts = np.zeros(N, FACTS)
    for field in FACTS.names or ():
        if field.startswith("t_"):
            facts[field] = NEVER
    facts["number"], facts["t_end"], facts["to_goal"], facts["goal_gap"] = np.arange(N), 21_000_000_000, 1.0, 1.0
    facts["travelled"], facts["min_clearance"], facts["moved_after"] = 3.0, 0.1, 1
    stuck, there = facts[:n_stuck], facts[N - n_reached :]
    stuck["halted"], stuck["n_halts"], stuck["moved_after"] = 1, 1, 0
    there["to_goal"], there["t_goal"], there["t_end"], there["feasible"] = 0.19, 12_000_000_000, 12_000_000_000, 1
    measures, published = np.ones(N, MEASURES), np.ones(10, PUBLISHED)
    return Contender(name, facts, measures=measures, published=published)


@pytest.fixture
def results() -> ComparisonResults:
    known = np.zeros(N, SOLVABILITY)
    known["answer"], known["earliest_outer"], known["earliest_inner"] = SOLVABLE, 10.0, 10.5
    known["answer"][:4] = [UNSOLVABLE, UNSOLVABLE, UNSOLVABLE, UNDECIDED]
    both = contender("old", 12, 20), contender("new", 4, 20)
    return ComparisonResults(both, "table-vii", 1, N, ("(0, 0, 0)",) * N, 0.0, known, np.full(N, 0.9))


def cell(table: Table, row: str, column: str) -> object:
    at = [c.heading if not c.group else f"{c.heading}" for c in table.columns].index(column)
    (found,) = (r for r in table.rows if r[0] == row)
    value = found[at]
    value = value.value if isinstance(value, Marked) else value
    return value.replace("\xa0", " ") if isinstance(value, str) else value


def test_the_table_counts_pairs_and_tests_them_exactly(results: ComparisonResults) -> None:
    table = paper_table(analyse(results))
    assert cell(table, STUCK, "old") == "30.0 % [18.1, 45.4]"
    assert (cell(table, STUCK, "more"), cell(table, STUCK, "fewer")) == (0, 8)
    assert cell(table, STUCK, "p") == "0.0078"  # 2 / 2**8
    assert cell(table, "goal reached", "p") == "1.0000"


def test_rows_by_the_papers_rule_add_up(results: ComparisonResults) -> None:
    for one in results.contenders:
        counted = {words: int(ask(one.facts).sum()) for words, ask in RULES.items()}
        under_way = [counted[f"under way on {kind} trajectory"] for kind in ("a feasible", "an infeasible")]
        assert counted["goal reached"] + sum(under_way) == N
        assert counted["paused, then moved again"] + counted[STUCK] == counted["imminent collision at any time"]


def test_stuck_among_the_solvable_is_bracketed_by_what_is_undecided(results: ComparisonResults) -> None:
    found = analyse(results).standings[1].stuck_of_solvable
    assert found is not None
    sure, likely = found
    assert (sure.count, sure.n) == (0, 36) and (likely.count, likely.n) == (1, 37)
    shown = str(cell(paper_table(analyse(results)), f"{STUCK}, of the solvable cases", "new"))
    assert shown.startswith("0.0 %") and " to 2.7 %" in shown
    assert (
        "36 are solvable" in paper_table(analyse(results)).note
        and "1 are undecided" in paper_table(analyse(results)).note
    )


def test_without_an_oracle_nothing_is_said_of_solvable_cases(results: ComparisonResults) -> None:
    blind = dataclasses.replace(results, oracle=None)
    assert analyse(blind).standings[0].stuck_of_solvable is None
    assert all("solvable" not in str(row[0]) for row in paper_table(analyse(blind)).rows)
    assert "solvable" not in paper_table(analyse(blind)).note


def test_every_row_has_a_cell_for_every_column_with_any_number_of_planners(results: ComparisonResults) -> None:
    for n in (1, 2, 3):
        some = (*results.contenders, contender("third", 0, 30))[:n]
        table = paper_table(analyse(dataclasses.replace(results, contenders=some)))
        assert {len(row) for row in table.rows} == {len(table.columns)} == {1 + n + 3 * (n - 1)}


def test_markdown_holds_the_same_numbers(results: ComparisonResults) -> None:
    text = to_markdown_page(analyse(results)).replace("\xa0", " ")
    assert "| stuck in imminent collision | 30.0 % [18.1, 45.4] |" in text
    assert "**Measures over all cases**" in text and "| mean clearance | m | 1 [1, 1] |" in text


def test_every_mode_is_scored_and_those_of_published_code_on_the_cases_run_again(results: ComparisonResults) -> None:
    scores = benchmark_scores(results)
    assert {(s.benchmark, s.mode) for s in scores} == {(b, m) for b, known in BENCHMARKS.items() for m in known.modes}
    assert all(s.cases == (10 if s.mode in REPRODUCING else N) for s in scores)
    assert set(HEADLINE) <= {(s.benchmark, s.mode, s.score) for s in scores}
    known = {(s.benchmark, s.mode, s.score): s.means for s in scores}
    assert known["arena", "arena-evaluation", "goal reached"] == (1.0, 1.0)
    assert known["arena", "corrected", "goal reached"] == (0.5, 0.5)
    assert known["barn", "dynabarn-2022", "score"] == (0.5 * 0.125, 0.5 * 0.125)


def test_without_cases_run_again_only_corrected_modes_are_scored(results: ComparisonResults) -> None:
    bare = tuple(dataclasses.replace(c, published=None) for c in results.contenders)
    modes = {s.mode for s in benchmark_scores(dataclasses.replace(results, contenders=bare))}
    assert modes and not modes & set(REPRODUCING)
    unmeasured = tuple(dataclasses.replace(c, measures=None) for c in bare)
    assert benchmark_tables(analyse(dataclasses.replace(results, contenders=unmeasured))) == ()


def test_the_document_holds_both_ends_of_the_bracket_and_the_scores(results: ComparisonResults) -> None:
    document = json.loads(json.dumps(comparison_document(analyse(results)), allow_nan=False))
    assert document["solvable"]["count"] == 36 and document["undecided"] == 1
    new = document["planners"]["new"]
    assert new["stuck_of_solvable"]["solvable"]["count"] == 0
    assert new["stuck_of_solvable"]["not_unsolvable"]["count"] == 1
    assert new["paper_rule"][STUCK]["count"] == 4
    assert {s["benchmark"] for s in document["benchmarks"]} == set(BENCHMARKS)

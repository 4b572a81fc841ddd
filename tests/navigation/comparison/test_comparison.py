"""Contenders with planted facts: what the tables, the page and the document say of them."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.report.page import to_html
from parcours.report.pieces import Table
from parcours.report.standings import arrivals, dominance
from parcours.report.terminal import to_text
from parcours.verdict.statistics import RateDifference
from parcours_navigation.arena.solvability import SOLVABILITY, SOLVABLE, UNSOLVABLE
from parcours_navigation.comparison.analysis import DIFFERENT_ANSWERS, analyse, pair_tests
from parcours_navigation.comparison.document import comparison_document
from parcours_navigation.comparison.page import SLICES, compare_page
from parcours_navigation.comparison.pairing import TimeDifference
from parcours_navigation.comparison.results import QUESTIONS, ComparisonResults, Contender, DecisionTimes
from parcours_navigation.comparison.tables import outcome_table, question_table
from parcours_navigation.facts import FACTS, NEVER
from parcours_navigation.measures import MEASURES
from parcours_navigation.outcomes import Outcome
from parcours_navigation.study.distribution import spl_of, time_to_goal

N = 40


def facts(effects: str) -> NDArray[np.void]:
    """Return facts of cases by letter: g goal, t touched, s stopped for good, l later, e error, o run into."""
    made = np.zeros(len(effects), FACTS)
    for name in FACTS.names or ():
        if name.startswith("t_"):
            made[name] = NEVER
    made["number"] = np.arange(len(effects))
    made["t_end"], made["to_goal"], made["goal_gap"], made["min_clearance"] = 21_000_000_000, 1.0, 1.0, 0.1
    made["moved_after"], made["t_last_moving"], made["travelled"] = 1, 21_000_000_000, 3.0
    for row, effect in zip(made, effects, strict=True):
        if effect in "go":
            row["t_goal"] = row["t_end"] = row["t_last_moving"] = 12_000_000_000
            row["n_obstacle_contacts"] = effect == "o"
        elif effect == "t":
            row["n_robot_contacts"], row["t_contact"], row["min_clearance"] = 1, 5_000_000_000, -0.02
            row["t_robot_contact"] = 5_000_000_000
        elif effect == "s":
            row["halted"], row["moved_after"], row["t_last_moving"] = 1, 0, 9_000_000_000
        elif effect == "l":
            row["t_goal_after"] = 30_000_000_000
        elif effect == "e":
            row["error"] = 1
    return made


def results(**effects: str) -> ComparisonResults:
    contenders = tuple(
        Contender(
            name.replace("_", "-"), facts(effect), answers="published" if name.startswith("ramp") else "at once",
            reasons=tuple(f"raised at {k}.5 s" for k in range(effect.count("e"))),
        )
        for name, effect in effects.items()
    )  # fmt: skip
    n = len(contenders[0].facts)
    oracle = np.zeros(n, SOLVABILITY)
    oracle["answer"], oracle["earliest_outer"], oracle["earliest_inner"] = SOLVABLE, 10.0, 10.5
    oracle[-1] = (UNSOLVABLE, np.inf, np.inf)
    vectors = tuple("(0, 0, 0)" if k % 2 else "(0, 1, 1)" for k in range(n))
    return ComparisonResults(contenders, "table-vii", 1, n, vectors, 0.0, oracle)


@pytest.fixture
def compared() -> ComparisonResults:
    return results(ramp="g" * 20 + "t" * 10 + "s" * 8 + "ll", best="g" * 34 + "oo" + "ssss", broken="e" * 30 + "g" * 10)


def test_every_case_is_in_one_outcome_and_in_one_slice(compared: ComparisonResults) -> None:
    for contender in compared.contenders:
        assert sum((contender.outcomes == int(o)).sum() for o in Outcome) == compared.n_cases
    sliced = [outcome for members, _ in SLICES.values() for outcome in members]
    assert sorted(sliced) == sorted(Outcome)


def test_questions_count_what_was_planted(compared: ComparisonResults) -> None:
    counted = {words: [int(ask(c.facts).sum()) for c in compared.contenders] for words, ask in QUESTIONS.items()}
    assert list(counted.values()) == [[20, 36, 10], [10, 0, 0], [0, 2, 0], [8, 4, 0], [0, 0, 30]]


def test_errors_are_shown_with_their_commonest_reasons_and_never_left_out(compared: ComparisonResults) -> None:
    assert compared.contenders[2].errors() == [("raised at ... s", 30)]
    text = "\n".join(
        to_text(piece)
        for s in compare_page(analyse(compared)).sections
        for piece in s.pieces
        if isinstance(piece, Table)
    )
    assert "raised at ... s" in text
    assert "75.0 % [59.8, 85.8]" in to_text(outcome_table(analyse(compared))).replace("\xa0", " ")


def test_what_is_of_the_papers_arena_alone_is_not_said_of_other_worlds(compared: ComparisonResults) -> None:
    papers = {"The paper's results", "Start vectors"}
    elsewhere = dataclasses.replace(compared, vectors=("()",) * compared.n_cases)
    assert papers <= {one.title for one in compare_page(analyse(compared)).sections}
    page = compare_page(analyse(elsewhere))
    assert not papers & {one.title for one in page.sections}
    notes = [piece.note for one in page.sections for piece in one.pieces if isinstance(piece, Table)]
    assert not [note for note in notes if "stand for 1 s" in note or "do not avoid" in note]


def test_an_error_without_a_kept_reason_is_still_counted() -> None:
    bare = dataclasses.replace(results(one="eeg").contenders[0], reasons=("hung",))
    assert bare.errors() == [("hung", 1), ("no reason was kept", 1)]


def test_only_cases_where_two_differ_decide_and_holm_counts_every_test(compared: ComparisonResults) -> None:
    tests = pair_tests(compared.contenders)
    assert [(t.second, t.question) for t in tests] == [
        (name, question) for name in ("best", "broken") for question in ("reached", "contact", "time")
    ]
    first = tests[0].found
    assert isinstance(first, RateDifference)
    assert (first.pairs.first_only, first.pairs.second_only) == (0, 16)
    assert first.difference == pytest.approx(-0.4)
    assert tests[0].p_value == pytest.approx(2.0**-15) and tests[0].p_holm == pytest.approx(6 * 2.0**-15)
    every = pair_tests(compared.contenders, against_first=False)
    assert len(every) == 9
    assert all(
        a.p_holm >= b.p_holm
        for a, b in zip(every, tests, strict=False)
        if (a.second, a.question) == (b.second, b.question)
    )


def test_times_are_compared_where_both_reach_and_their_sign_says_who_is_faster() -> None:
    both = results(slow="g" * 12 + "t", fast="g" * 13)
    quick = both.contenders[1].facts.copy()
    quick["t_goal"] -= 1_000_000_000 + 10_000_000 * np.arange(13)
    both = dataclasses.replace(
        both, contenders=(both.contenders[0], dataclasses.replace(both.contenders[1], facts=quick))
    )
    found = pair_tests(both.contenders)[2].found
    assert isinstance(found, TimeDifference)
    assert found.n == 12 and found.median == pytest.approx(1.055) and found.rank_biserial == 1.0
    assert found.p_value == pytest.approx(2 * 2.0**-12)
    assert np.isnan(time_to_goal(both.contenders[0].facts)[-1])


def test_planners_that_ran_other_cases_are_not_compared(compared: ComparisonResults) -> None:
    other = compared.contenders[1].facts.copy()
    other["number"] += 1
    with pytest.raises(BadRequest, match=r"same cases.*\[pairs-shape\]"):
        pair_tests((compared.contenders[0], dataclasses.replace(compared.contenders[1], facts=other)))


def test_unequal_machines_are_told_on_page_and_document_and_only_where_there_are_some(
    compared: ComparisonResults,
) -> None:
    assert DIFFERENT_ANSWERS in outcome_table(analyse(compared)).note
    assert "Unequal machines" in to_html(compare_page(analyse(compared)))
    assert comparison_document(analyse(compared))["note"] == DIFFERENT_ANSWERS
    alike = dataclasses.replace(compared, contenders=compared.contenders[1:])
    assert (
        DIFFERENT_ANSWERS not in to_html(compare_page(analyse(alike)))
        and comparison_document(analyse(alike))["note"] == ""
    )


def test_scores_weigh_success_by_length_and_by_time(compared: ComparisonResults) -> None:
    best = compared.contenders[1]
    way = spl_of(best.facts)
    assert way[0] == pytest.approx((np.hypot(2.0, 2.0) - 0.2) / 3.0) and way[-1] == 0.0
    soon = compared.sct(best)
    assert soon is not None and soon[0] == pytest.approx(10.0 / 12.0) and np.isnan(soon[-1])
    assert dataclasses.replace(compared, oracle=None).sct(best) is None


def test_the_share_of_solvable_cases_leaves_out_those_nobody_can_solve(compared: ComparisonResults) -> None:
    last = question_table(analyse(compared)).rows[-1]
    assert last[0] == "of the 39 cases that are solvable: goal reached"
    assert (
        str(last[3]).replace("\xa0", " ").startswith("23.1 %")
    )  # broken: 9 of 39, since its tenth goal is in the unsolvable case


def test_the_document_is_json_and_complete(compared: ComparisonResults) -> None:
    timed = dataclasses.replace(
        compared.contenders[1],
        decisions=DecisionTimes(10.0, 20.0, 30.0, 400),
        measures=np.full(N, np.nan).astype([(name, "f8") for name in MEASURES.names or ()]),
    )
    document = comparison_document(analyse(dataclasses.replace(compared, contenders=(compared.contenders[0], timed))))
    again = json.loads(json.dumps(document, allow_nan=False))
    best = again["planners"]["best"]
    assert best["decision_us"] == {"median": 10.0, "p99": 20.0, "max": 30.0, "n": 400}
    assert best["measures"]["mean_jerk"] == {
        "unit": "m/s^3", "n": 0, "mean": None, "median": None, "p05": None, "p95": None,
    }  # fmt: skip
    assert best["measures"]["path_length"]["median"] == 3.0
    assert sum(rate["count"] for rate in best["outcomes"].values()) == N
    assert sum(rate["n"] for rate in best["reached_by_start_vector"].values()) == N
    assert {test["question"] for test in again["tests_against_first"]} == {"reached", "contact", "time"}


def test_who_beats_whom_is_counted_both_ways(compared: ComparisonResults) -> None:
    shares = analyse(compared).beats
    assert shares[1, 0] == 16 / 40 and shares[0, 1] == 0.0 and (np.diag(shares) == 0.0).all()
    figure = dominance("", [c.name for c in compared.contenders], shares)
    assert "best over ramp 40.0%" in figure.alt


def test_a_line_of_arrivals_ends_at_the_share_that_arrives() -> None:
    figure = arrivals("", {"half": [1.0, np.nan], "none": [np.nan, np.nan]}, "t [s]")
    assert figure.alt == "t [s]. half: 1 of 2 cases, median of these 1; none: 0 of 2 cases"


def test_dominance_refuses_what_is_not_one_share_a_pair() -> None:
    with pytest.raises(BadRequest, match=r"\[chart-data\]"):
        dominance("", ["a", "b"], [[0.0, 2.0], [0.0, 0.0]])


def test_one_planner_alone_has_a_page_without_tests() -> None:
    page = compare_page(analyse(results(alone="gggt")))
    assert "Reached the goal where the other did not" not in to_html(page)

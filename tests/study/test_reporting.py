"""One report for every study: what to know first, the cases that did not pass by cause, how to run them again."""

from __future__ import annotations

import subprocess
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from parcours.report.junit import CaseResult
from parcours.report.page import to_html
from parcours.report.pieces import Failures, Page
from parcours.study.finding import find
from parcours.study.journal import read_question
from parcours.study.mutation.fork_server import MutantOutcome
from parcours.study.mutation.mutant import Mutant
from parcours.study.mutation.results import MutationResults, mutation_page
from parcours.study.parameters import settings_of
from parcours.study.protocol import Measure, Reported, Request
from parcours.study.provenance import provenance
from parcours.study.reporting import report_page, summarised
from parcours.study.reproducing import Reruns
from parcours.study.summing import LISTED, sum_up
from parcours.verdict.judgement import Verdict

PARKING = Path(__file__).parents[2] / "examples" / "parking"


class Made:
    """Results whose cases fail by two causes, the numbered ones the oftener the more there are."""

    label, planned = "made", 0

    def __init__(self, verdicts: Sequence[Verdict]) -> None:
        self.verdicts, self.planned, self.asked = verdicts, len(verdicts), 0

    def cases(self) -> Sequence[CaseResult]:
        raise AssertionError("a million sentences are not needed")

    def case_verdicts(self) -> Sequence[Verdict]:
        return self.verdicts

    def verdict_counts(self) -> Counter[Verdict]:
        return Counter(self.verdicts)

    def causes(self) -> Sequence[str]:
        words = {Verdict.PASS: "", Verdict.FAIL: "too near", Verdict.ERROR: "raised", Verdict.INCONCLUSIVE: "unseen"}
        return [words[one] for one in self.verdicts]

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        self.asked += len(places)
        return [CaseResult(f"made/cases/{k}", self.verdicts[k], 0.0, f"gap {k}") for k in places]

    def measures(self) -> Mapping[str, Measure]:
        gap = np.arange(len(self.verdicts), 0.0, -1.0)
        return {"gap": Measure(gap, "quantity", "m", "less"), "same": Measure(np.ones(len(gap)), "quantity", "s")}

    def replay(self, case: str) -> Page:
        raise NotImplementedError


def made_page(results: Made, folder: str) -> Page:
    class Study:
        name = where = "made"
        doc, parameters = "A study.", ()

        def report(self, results: object) -> Reported:
            return Reported((), list, {})

    return report_page([(Study(), {folder: results})])  # type: ignore[list-item]


def listed(page: Page) -> Failures:
    (found,) = (piece for section in page.sections for piece in section.pieces if isinstance(piece, Failures))
    return found


def test_the_worst_cases_of_every_cause_are_listed_and_a_million_cases_make_a_small_page(tmp_path: Path) -> None:
    kinds = [Verdict.PASS, Verdict.FAIL, Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.FAIL]
    verdicts = [kinds[k % 5] for k in range(1_000_000)]
    verdicts[17] = Verdict.ERROR
    results = Made(verdicts)
    page = made_page(results, str(tmp_path))
    found = listed(page)
    assert [(cause.words, cause.count) for cause in found.causes] == [
        ("too near", 599_999), ("raised", 1), ("unseen", 200_000),
    ]  # fmt: skip
    assert found.causes[0].cases[0].id == "made/cases/999999", "the smallest gap is the worst"
    assert results.asked == sum(len(cause.cases) for cause in found.causes) <= LISTED
    assert "1,000 cases are listed; of each cause the worst by gap" in found.note
    assert len(to_html(page)) < 1_000_000
    assert page.summary is not None and "failed 600,000 of 1,000,000 cases (60.0 %)" in page.summary.verdict
    assert page.summary.facts[0] == "599,999 cases failed: [too near](#cause_1)."


@pytest.mark.parametrize(
    ("verdicts", "verdict", "fact"),
    [
        ([Verdict.PASS] * 50, "It passed all 50 cases.", "Fewer than 7.1 % of cases like these fail"),
        ([Verdict.PASS, Verdict.INCONCLUSIVE], "It failed none of 2 cases, but 1 could not be judged.", "1 case could"),
        ([Verdict.ERROR] * 3, "It failed 3 of 3 cases (100 %).", "3 cases ended in an error: [raised](#cause_1)."),
        ([], "Nothing is known yet: no case is finished.", ""),
    ],
)
def test_the_verdict_is_said_in_words(verdicts: list[Verdict], verdict: str, fact: str, tmp_path: Path) -> None:
    summary = made_page(Made(verdicts), str(tmp_path)).summary
    assert summary is not None and summary.verdict == verdict
    assert not fact or fact in summary.facts[0]


def test_a_run_keeps_where_it_comes_from_and_the_commands_on_the_page_run_its_cases_again(tmp_path: Path) -> None:
    study, folder = find(str(PARKING)), tmp_path / "out"
    study.run(Request(settings_of(study.parameters, {}, "parking"), 3, folder, 40), lambda *_: None)
    made = read_question(folder)["made"]
    assert isinstance(made, dict) and {"date", "machine", "versions"} <= made.keys()
    page = report_page([(study, {str(folder): study.read(folder)})])
    facts = dict(page.facts)
    assert facts["date"] == made["date"] and facts["seed"] == "3" and facts["cases"] == "40 of 40"
    assert facts["run again"].startswith("not yet: parcours reproduce")
    worst = listed(page).causes[0].cases[0]
    replay, run = worst.commands
    assert replay == f"parcours replay {folder} {worst.id}"
    assert study.read(folder).replay(replay.split()[-1]).subtitle == f"fail: {worst.why}"
    assert f"--seed 3 --case {worst.id} --out" in run


def test_a_summary_needs_no_page(tmp_path: Path) -> None:
    study = find(str(PARKING))
    results = Made([Verdict.PASS] * 9)
    assert "as *made*" in summarised([sum_up(study, str(tmp_path), results)]).tested


def test_mutants_that_survive_are_the_failures_of_a_test_suite() -> None:
    mutants = tuple(Mutant(f"m{k}", "stale" if k else "edge", "a.py", k, "a -> b") for k in range(3))
    seen = {"m0": {"cases": ("c", "w")}, "m1": {"golden twin": ("c", "w")}, "m2": {"golden twin": ("c", "w")}}
    outcomes = {id: MutantOutcome("ended", by, 1, {}, 0, 0) for id, by in seen.items()}
    page = mutation_page(
        MutationResults("lift", "code", mutants, outcomes),
        {"date": "today"},
        ["parcours", "mutate", "lift"],
        Reruns("noticed mutants", 1, 1, 1),
    )
    assert [(cause.words, cause.count) for cause in listed(page).causes] == [("stale", 2)]
    assert page.summary is not None and page.summary.verdict.startswith("The tests noticed 1 of 3 mutants")
    assert ("date", "today") in page.facts
    assert ("run again", "1 of 1 gave the same verdict and facts (1 of 1 noticed mutants were run again)") in page.facts
    run, show = listed(page).causes[0].cases[0].commands
    assert run == "parcours mutate lift --only m1 --out out/mutant" and show == "parcours mutate lift --only m1 --list"


def test_the_commit_is_that_of_what_is_tested_and_says_if_it_was_changed(tmp_path: Path) -> None:
    assert "commit" not in provenance(tmp_path)

    def git(*words: str) -> None:
        author = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", "-C", str(tmp_path), *author, *words], check=True, capture_output=True)

    git("init")
    (tmp_path / "study.yaml").write_text("a")
    git("add", ".")
    git("commit", "-m", "first")
    clean = provenance(tmp_path / "study.yaml")["commit"]
    (tmp_path / "study.yaml").write_text("b")
    assert provenance(tmp_path)["commit"] == f"{clean}-dirty"


def test_a_component_study_that_passed_says_what_it_covered(tmp_path: Path) -> None:
    study = find(str(PARKING.with_name("lift")))
    study.run(Request(settings_of(study.parameters, {}, "lift"), 1, tmp_path, 2), lambda *_: None)
    summary = report_page([(study, {str(tmp_path): study.read(tmp_path)})]).summary
    assert summary is not None and summary.facts[1:] == (
        "6 of 9 transitions of the model were taken by a case that passed.",
        "2 of 2 blocks of test data reached a component.",
    )

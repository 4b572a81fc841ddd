"""Requirements of a study: the same bits whatever runs the cases, in results, gates, comparisons and RAMP's loop."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from parcours.run.campaign import run_campaign
from parcours.study.comparing import Counted
from parcours.study.gate import check_condition, parse_condition
from parcours.study.study_file import check_study_file
from parcours.verdict.judgement import Verdict
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.comparison.analysis import analyse
from parcours_navigation.comparison.document import comparison_document
from parcours_navigation.comparison.page import compare_page
from parcours_navigation.comparison.requiring import own_measured, requirement_tables, requirement_tests
from parcours_navigation.comparison.running import run_comparison
from parcours_navigation.requirements.requirement import read_requirements, requirements_of
from parcours_navigation.requirements.signals import take
from parcours_navigation.requirements.vocabulary import SIGNALS
from parcours_navigation.study.results import read_folder, report_folders
from parcours_navigation.study.study import NavigationStudy, study_of
from temporal_logic import robustness

ASKED = requirements_of(
    {
        "keeps-away": "always[0, end] (clearance > 0.05)",
        "stops": "always (clearance < 0.2 -> eventually[0, 1.5 s] speed < 0.01)",
        "arrives": "eventually goal_distance < 0.2",
        "turns": "speed > 0.1 until[1 s, 9 s] abs(heading_error) < 0.4",
    },
    ["travelled > 2.6"],
)
STUDY = NavigationStudy("straight-ahead", SystemCases(3), requirements=ASKED)


def test_robustness_is_that_of_the_recorded_track_and_the_state_at_the_end() -> None:
    for number in range(4):
        (facts,) = STUDY.run(np.array([number]))
        _, track, places = STUDY.track(number)
        n, k = len(track), places.shape[1]
        entries = np.zeros((n, 7 + 2 * k))
        for column, name in enumerate(track.dtype.names or ()):
            entries[:, column] = track[name]
        entries[:, 7:] = places.reshape(n, -1)
        memory = np.zeros((len(SIGNALS) + 1, n + 1))
        take(entries, entries[-1], np.full(k, 0.1), 0.125, 2.0, 2.0, np.ones(len(SIGNALS), np.int64), memory)
        signals = {name: row[:n].tolist() for name, row in zip(SIGNALS, memory[:-1], strict=True)}
        if facts["t_end"] > track["time"][-1]:  # what is asked of the last sample is asked of the facts
            distances = {"goal_distance": [*signals["goal_distance"], float(facts["to_goal"])]}
            assert facts["robustness"][2] == robustness(ASKED.formulas[2].formula, distances)
        else:
            expected = [robustness(one.formula, signals) for one in ASKED.formulas]
            assert facts["robustness"].tolist() == expected


def test_a_robot_that_reaches_its_goal_between_two_samples_has_arrived() -> None:
    facts = STUDY(0, 40)
    arrived = facts["t_goal"] >= 0
    assert arrived.any() and (facts["robustness"][arrived, 2] > 0.0).all()
    assert (facts["t_end"][arrived] % 50_000_000 != 0).any()


def test_the_bits_do_not_depend_on_batches_or_workers_or_on_being_judged(tmp_path: Path) -> None:
    whole = STUDY(0, 24)
    pieces = np.concatenate([STUDY(0, 5), STUDY.run(np.arange(5, 24))])
    assert whole.tobytes() == pieces.tobytes()
    plain = dataclasses.replace(STUDY, requirements=requirements_of({}))(0, 24)
    for name in plain.dtype.names or ():
        assert plain[name].tobytes() == whole[name].tobytes(), name
    ran = run_campaign(STUDY, STUDY.campaign(24, 5), tmp_path, workers=2)
    assert ran.store.load().tobytes() == whole.tobytes()


def test_results_know_what_was_required(tmp_path: Path) -> None:
    run_campaign(STUDY, STUDY.campaign(24, 8), tmp_path, workers=1)
    results = read_folder(tmp_path, "navigation")
    facts, cases = results.found.facts, results.cases()
    violated = (facts["robustness"] < 0.0).any(axis=1) | (facts["travelled"] > 2.6)
    assert violated.any()
    assert all(cases[k].verdict is Verdict.FAIL for k in np.flatnonzero(violated).tolist())
    assert any("violates keeps-away at" in one.why for one in cases)
    measures = results.measures()
    assert measures["violated(keeps-away)"].values.sum() == (facts["robustness"][:, 0] < 0.0).sum()
    assert measures["failed"].values.sum() == sum(one.verdict is Verdict.FAIL for one in cases)
    report = report_folders({"mine": results})
    (table,) = [one for one in report.tables if one.title == "Requirements"]
    assert [row[1] for row in table.rows] == [*ASKED.names, "fail"]
    for text, fails in {
        "violated(keeps-away) > 1%": True, "violated( turns ) > 100%": False, "min(robustness(keeps-away)) < 0": True,
        "robustness(arrives) > 100": False, "p95(robustness(stops)) < -99": False,
    }.items():  # fmt: skip
        assert check_condition(parse_condition(text), results).failed == fails, text


@pytest.mark.parametrize("rules", ["", "contacts > 3 or far > 2.5 or min(switches, halts) > 6 or mean_clearance < 0.4"])
@pytest.mark.parametrize(
    "required", ["", "keeps-away: always clearance > 0.05; turns: goal_distance > 1 until time > 1 s"]
)
def test_what_is_compared_is_what_all_facts_say(required: str, rules: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def far(run):\n    return float(run.track['x'].max())\n")
    asked = read_requirements(required, rules, f"far: {tmp_path}/mine.py:far")
    study = dataclasses.replace(STUDY, requirements=asked)
    run_campaign(study, study.campaign(48, 9), tmp_path / "out", workers=1)
    results = read_folder(tmp_path / "out", "mine")
    outline, cases = results.outline(), results.cases()  # the first reads some fields, the second all
    assert outline.passed.any() and not outline.passed.all()
    assert [outline.id(number) for number in outline.numbers.tolist()] == [one.id for one in cases]
    assert outline.passed.tolist() == [one.verdict is Verdict.PASS for one in cases]
    rates = {name: Counted.of(one) for name, one in results.measures().items() if one.kind == "rate"}
    assert outline.rates.keys() == rates.keys()
    for name, one in rates.items():
        assert outline.rates[name].values.tolist() == one.values.tolist() and outline.rates[name].worse == one.worse


def test_other_requirements_are_another_campaign(tmp_path: Path) -> None:
    from parcours.errors import BadResults

    run_campaign(STUDY, STUDY.campaign(4, 4), tmp_path, workers=1)
    other = dataclasses.replace(STUDY, requirements=requirements_of({"keeps-away": "always clearance > 0.06"}))
    with pytest.raises(BadResults, match=r"holds another campaign: .*require"):
        run_campaign(other, other.campaign(4, 4), tmp_path, workers=1)


def test_planners_are_compared_by_measures_of_the_users_own(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def farthest(run):\n    return float(run.track['x'].max())\n")
    asked = read_requirements("", "far > 0.5", f"far: {tmp_path}/mine.py:farthest; rest: time_at_rest / time")
    names = ["straight-ahead", "stand-still"]
    results = run_comparison(names, tmp_path / "out", n_cases=6, measured=0, timed=0, requirements=asked)
    ahead, still = results.contenders
    assert (ahead.own["far"] > 0.5).all() and (still.own["far"] < 0.2).all()
    assert (still.own["rest"] > ahead.own["rest"]).all()
    [far, _] = [one for one in own_measured(results) if one.planner == "stand-still"]
    assert far.n == 6 and far.against_first is not None
    assert far.against_first.median == np.median(ahead.own["far"] - still.own["far"])
    (rule,) = requirement_tests(results)  # a pass rule reads it
    assert rule.violated.pairs.first_only == 6 and rule.violated.pairs.second_only == 0
    assert requirement_tables(results)[-1].title == "Own measures"
    assert len(comparison_document(analyse(results))["requirements"]["measures"]) == 4  # type: ignore[index]


def test_planners_are_compared_by_their_requirements(tmp_path: Path) -> None:
    names = ["straight-ahead", "stand-still"]
    results = run_comparison(names, tmp_path, n_cases=30, measured=0, timed=0, requirements=ASKED)
    tests = requirement_tests(results)
    assert [one.name for one in tests] == [*ASKED.names, "fail: travelled > 2.6"]
    arrives = tests[2]
    assert arrives.violated.pairs.second_only > 20 and arrives.p_violated < 0.001
    assert arrives.robustness is not None and arrives.robustness.median > 1.0  # metres nearer to the goal
    found = analyse(results)
    assert len(requirement_tables(results)) == 2
    assert "Requirements" in [section.title for section in compare_page(found).sections]
    asked = comparison_document(found)["requirements"]
    assert isinstance(asked, dict) and len(asked["of_planners"]["stand-still"]) == 5


def test_ramps_own_loop_judges_the_track_that_it_records() -> None:
    plain = study_of("ramp-guarded", SystemCases(2))
    study = study_of("ramp-guarded", SystemCases(2), None, ASKED)
    facts, before = study(0, 6), plain(0, 6)
    for name in before.dtype.names or ():
        assert facts[name].tobytes() == before[name].tobytes(), name
    assert facts.tobytes() == np.concatenate([study(0, 2), study(2, 4)]).tobytes()
    reached = facts["t_goal"] >= 0
    assert ((facts["robustness"][:, 2] > 0.0) == reached).all() and reached.any()
    gap = 0.05 + facts["robustness"][:, 0]
    assert (gap >= facts["min_clearance"] - 1e-12).all()  # which is asked between samples, too
    assert (gap - facts["min_clearance"] < 0.05).all()


STUDY_FILE = """parcours: study/1
name: careful
kind: planner
planner: straight-ahead
require:
  keeps-away: always[0, end] (clearance > 5 cm)
  stops: imminent -> eventually[0, 1.5 s] speed < 0.01
fail: clearance < 0.05 or time > 30
"""


def test_a_study_file_has_requirements_and_rules(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(STUDY_FILE)
    study, findings = check_study_file(path)
    assert study is not None and not findings
    settings = {one.name: one.default for one in study.parameters}
    made = study.study(settings, 1).requirements  # type: ignore[attr-defined]
    assert made.names == ("keeps-away", "stops") and made.rules[0].text == "clearance < 0.05 or time > 30"
    path.write_text(STUDY_FILE.replace("fail: ", "fail:\n  - travelled > 4\n  - "))
    again, _ = check_study_file(path)
    assert again is not None
    settings = {one.name: one.default for one in again.parameters}
    assert len(again.study(settings, 1).requirements.rules) == 2  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("wrong", "right", "line", "slug"),
    [
        ("clearence", "(clearance", 6, "require-name"),
        ("1.52 s", "1.5 s", 7, "require-interval"),
        ("always clearance", "fail: clearance", 8, "require-syntax"),
        ("{a: 1}", "fail: clearance < 0.05 or time > 30", 8, "kind"),
        ("x y: always", "keeps-away: always", 6, "require-name"),
    ],
)
def test_bad_lines_of_a_study_file_are_named(tmp_path: Path, wrong: str, right: str, line: int, slug: str) -> None:
    path = tmp_path / "study.yaml"
    head = right.partition(" ")[0] + " " if right.startswith("fail") else right[0] if right[0] == "(" else ""
    path.write_text(STUDY_FILE.replace(right, head + wrong, 1))
    study, findings = check_study_file(path)
    assert study is None
    assert (findings[0].line, findings[0].rule) == (line, slug), findings


def test_the_battery_warns_of_requirements_that_hardly_ask_anything(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(STUDY_FILE.replace("straight-ahead", "ramp-guarded"))
    study, _ = check_study_file(path)
    assert study is not None
    assert [one.where for one in study.check(lambda *_: None)] == ["require-start"]


def test_a_replay_shows_how_far_requirements_are_from_being_violated_while_the_case_goes_on(tmp_path: Path) -> None:
    run_campaign(STUDY, STUDY.campaign(12, 4), tmp_path, workers=1)
    found = read_folder(tmp_path, "navigation").found
    n_broken = 0
    for record in found.facts:
        shown = found.replay(int(record["number"])).required
        assert [one.name for one in shown] == list(ASKED.names)
        for k, (one, asked) in enumerate(zip(shown, ASKED.formulas, strict=True)):
            assert one.values[-1] == record["robustness"][k] and one.times[-1] == record["t_end"] * 1e-9
            way = 1.0 if asked.name == "arrives" else -1.0
            if asked.name in ("keeps-away", "arrives"):  # what is lost, or found, stays so
                assert (way * np.diff(one.values) >= 0.0).all(), one.name
            if asked.name == "keeps-away" and one.violated_at is not None:
                n_broken += 1
                assert one.times[int(np.argmax(one.values < 0.0))] <= one.violated_at + 0.5
                assert (one.values[one.times >= one.violated_at] == one.values[-1]).all()  # it was worst then
    assert n_broken

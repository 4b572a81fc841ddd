"""The lift of the examples through the door: found, run, resumed, read, replayed, recorded and judged again."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults, BadSuite
from parcours.report.page import to_html
from parcours.report.terminal import to_text
from parcours.study import Request, Results, Study, judge_case
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.verdict.judgement import Verdict

LIFT = Path(__file__).parents[2] / "examples" / "lift"


@pytest.fixture
def lift(tmp_path: Path) -> Path:
    """Return a lift of one's own."""
    return Path(shutil.copytree(LIFT, tmp_path / "lift", ignore=shutil.ignore_patterns("__pycache__")))


def run(
    study: Study, out: Path, n_cases: int | None = None, *chosen: str, seed: int = 1, **settings: object
) -> Results:
    request = Request(settings_of(study.parameters, settings), seed, out, n_cases, chosen)
    outcome = study.run(request, lambda what, done, total: None)
    assert not outcome.interrupted and f"cases are finished in {out}" in outcome.text
    return study.read(out)


def call(*words: object) -> Result:
    return CliRunner().invoke(parcours, [str(word) for word in words])


def keys(out: Path) -> list[str]:
    return [json.loads(line)["key"] for line in (out / "cases.jsonl").read_text().splitlines()]


def test_a_study_is_the_same_by_folder_and_file_from_wherever(lift: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(lift.parent)
    for given in ("lift", "./lift", "lift/study.yaml", str(lift), str(lift / "study.yaml")):
        study = find(given)
        assert (study.name, study.kind, study.where) == ("lift", "components", str(lift / "study.yaml"))


def test_all_cases_pass_and_are_read_reported_and_measured(lift: Path) -> None:
    study = find(str(lift))
    results = run(study, lift / "out")
    ids = [f"functional/{case.id}" for case in study.suite({}, 1)]
    assert len(ids) == results.planned == 8 and results.label == "simulated"
    assert [(case.id, case.verdict) for case in results.cases()] == [(id, Verdict.PASS) for id in ids]
    assert {name: one.values.sum() for name, one in results.measures().items()} == {
        "failed": 0, "passed": 8, "inconclusive": 0, "errors": 0,
    }  # fmt: skip
    reported = study.report({"here": results})
    assert "4 of 4" in to_text(reported.tables[0]) and len(reported.documents["here"]) == 8  # type: ignore[arg-type]


def test_chosen_cases_are_run_alone_by_id_by_abstract_case_and_by_number(lift: Path) -> None:
    study = find(str(lift))
    cases = list(study.suite({}, 1))
    abstract = cases[2].abstract
    run(study, lift / "out", None, abstract, cases[0].id, "5")
    assert keys(lift / "out") == [f"functional/{cases[k].id}" for k in (0, 2, 5, 6)]
    with pytest.raises(BadRequest, match=r"it has no ITP1-no/0, nobody; .*\[case-unknown\]"):
        run(study, lift / "other", None, "ITP1-no/0", cases[0].id, "nobody")
    assert not (lift / "other").exists()


def test_a_run_goes_on_where_it_was_interrupted_and_does_nothing_twice(lift: Path) -> None:
    study, out = find(str(lift)), lift / "out"

    def interrupt(what: str, done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    outcome = study.run(Request(settings_of(study.parameters, {}), 1, out), interrupt)
    assert outcome.interrupted
    assert outcome.text.startswith(
        f"interrupted: 3 of 8 cases are finished and kept in {out}; run the same command again"
    )
    begun = (out / "cases.jsonl").read_bytes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("parcours.study.journal.os.fsync", lambda file: None)
        assert len(run(study, out).cases()) == 8
    whole = (out / "cases.jsonl").read_bytes()
    assert whole.startswith(begun) and len(keys(out)) == len(set(keys(out))) == 8
    run(study, out)
    assert (out / "cases.jsonl").read_bytes() == whole


@pytest.mark.parametrize("cut", [1, 40, 150])
def test_a_line_that_was_cut_off_is_computed_again(cut: int, lift: Path) -> None:
    study, out = find(str(lift)), lift / "out"
    run(study, out)
    whole = (out / "cases.jsonl").read_bytes()
    (out / "components.json").unlink()
    (out / "cases.jsonl").write_bytes(whole[:-cut])
    assert len(study.read(out).cases()) == 7
    run(study, out)
    assert (out / "cases.jsonl").read_bytes() == whole


def test_a_line_that_is_damaged_is_refused_with_its_number(lift: Path) -> None:
    study, out = find(str(lift)), lift / "out"
    run(study, out)
    lines = (out / "cases.jsonl").read_text().splitlines()
    for spoilt in (lines[3][:-9], "[]", '{"id": 3}', '{"key": 7}'):
        (out / "cases.jsonl").write_text("\n".join([*lines[:3], spoilt, *lines[4:], ""]))
        with pytest.raises(BadResults, match=r"cases.jsonl:4: .*--fresh \[results-journal\]"):
            run(study, out)


def test_more_cases_may_follow_and_what_does_not_decide_may_differ(lift: Path) -> None:
    study, out = find(str(lift)), lift / "out"
    run(study, out, 2)
    run(study, out, 5, record="mcap")
    assert len(keys(out)) == 5 and len(list((out / "recordings").iterdir())) == 3
    assert len(run(study, out).cases()) == 8


@pytest.mark.parametrize("change", ["lift.py", "model.yaml", "domains.yaml", "study.yaml"])
def test_a_run_of_changed_files_is_refused_with_the_key_that_differs_and_begun_afresh(change: str, lift: Path) -> None:
    out = lift / "out"
    assert call("run", lift, "--out", out).exit_code == 0
    before = (out / "cases.jsonl").read_text()
    (lift / change).write_text((lift / change).read_text() + "\n# changed\n")
    refused = call("run", lift, "--out", out)
    assert isinstance(refused.exception, BadResults)
    said = str(refused.exception)
    assert said.startswith(f"{out}: holds another run: files.{change} is ") and said.count(", but was ") == 1
    assert "--fresh" in said and "[results-other]" in said and (out / "cases.jsonl").read_text() == before
    (out / "mine.txt").write_text("kept")
    assert call("run", lift, "--out", out, "--fresh").exit_code == 0
    assert (out / "mine.txt").read_text() == "kept" and len(keys(out)) == 8


@pytest.mark.parametrize(
    ("more", "key"),
    [({"seed": 2}, "seed is 2, but was 1"), ({"repeats": 7}, "settings.repeats is 7, but was 60")],
)
def test_a_run_of_another_question_is_refused_with_what_differs_only(
    more: dict[str, object], key: str, lift: Path
) -> None:
    study, out = find(str(lift)), lift / "out"
    run(study, out)
    with pytest.raises(BadResults, match=rf"holds another run: {key}; name another folder"):
        run(study, out, None, **more)  # type: ignore[arg-type]


def test_a_case_is_replayed_by_id_and_by_number_as_it_was(lift: Path) -> None:
    study, out = find(str(lift)), lift / "out"
    results = run(study, out)
    id = results.cases()[1].id
    pages = [results.replay(one) for one in (id, id.removeprefix("functional/"), "1")]
    assert len({to_html(page) for page in pages}) == 1
    assert pages[0].title == id.removeprefix("functional/") and pages[0].subtitle.startswith("pass: all 10 transitions")
    printed = call("replay", out, id)
    assert printed.exit_code == 0 and "p1" in printed.output and '{"floor": ' in printed.output
    assert call("replay", out, 3, "--html", out / "case.html").exit_code == 0
    assert "<html" in (out / "case.html").read_text() and "https:" not in (out / "case.html").read_text()
    for wrong in ("8", "nobody", "-1"):
        with pytest.raises(BadRequest, match=r"must be a finished one of the 8 .*\[case-number\]"):
            results.replay(wrong)


def test_a_folder_says_whose_it_is_and_a_study_that_moved_is_named(lift: Path) -> None:
    out = lift.parent / "out"
    assert call("run", lift, "--out", out).exit_code == 0
    assert call("report", out).exit_code == 0
    moved = lift.rename(lift.parent / "moved")
    refused = call("report", out)
    assert isinstance(refused.exception, BadRequest) and "say where it is: --study FOLDER" in str(refused.exception)
    assert call("report", out, "--study", moved).exit_code == 0
    with pytest.raises(BadResults, match="results-manifest"):
        raise call("report", moved).exception or AssertionError


SPOILT = ("def d3(self)", "def d4(self)")  # a door that never opens again


def test_a_lift_that_errs_fails_with_code_1_and_the_failing_cases_are_told_with_why(lift: Path) -> None:
    out = lift / "out"
    (lift / "lift.py").write_text((lift / "lift.py").read_text().replace(*SPOILT))
    ran = call("run", lift, "--out", out, "--junit", out / "j.xml")
    wrong = [case for case in find(str(lift)).read(out).cases() if case.verdict is Verdict.FAIL]
    assert ran.exit_code == 1 and wrong and len(wrong) < 8
    for case in wrong:
        assert case.id.removeprefix("functional/") in ran.output and case.why in ran.output
    assert f'failures="{len(wrong)}"' in (out / "j.xml").read_text()
    assert call("run", lift, "--out", out, "--fail-if", "failed > 90%").exit_code == 0
    assert call("report", out).exit_code == 1


@pytest.mark.parametrize("form", ["mcap", "bag"])
@pytest.mark.parametrize("spoilt", [False, True])
def test_recordings_earn_their_verdicts_again_wherever_they_are_judged(form: str, spoilt: bool, lift: Path) -> None:
    if spoilt:
        (lift / "lift.py").write_text((lift / "lift.py").read_text().replace(*SPOILT))
    out = lift / "out"
    results = run(find(str(lift)), out, record=form)
    recordings = sorted((out / "recordings").iterdir())
    judged = {one.case: one for one in map(find(str(lift)).rejudge, recordings)}
    assert len(recordings) == len(judged) == 8 and all(one.agrees for one in judged.values())
    for case in results.cases():
        one = judged[case.id.removeprefix("functional/")].judgement
        assert (one.verdict, one.why) == (case.verdict, case.why)
    said = call("judge", out / "recordings")
    assert said.exit_code == 0 and "8 of 8 recordings earn the verdict that was recorded" in said.output


def timed(lift: Path, limits: str) -> Study:
    (lift / "study.yaml").write_text((lift / "study.yaml").read_text() + f"limits: {{{limits}}}\n")
    return find(str(lift))


def test_a_case_that_is_timed_under_two_limits_has_two_results_and_two_recordings(lift: Path) -> None:
    study = timed(lift, 'ITP1: "p50 < 1 s", there: {from: p1, to: p2, bound: "p50 < 1 s"}')
    results = run(study, lift / "out", repeats=9, record="mcap")
    both = [one for one in results.cases() if one.id.startswith("timing/")]
    assert len({one.id for one in both}) == len(both) == 4
    recordings = sorted((lift / "out" / "recordings").glob("timing-*"))
    assert len(recordings) == len(both) and all(study.rejudge(path).agrees for path in recordings)


def test_durations_are_judged_against_their_limits(lift: Path) -> None:
    source = (
        (lift / "lift.py")
        .read_text()
        .replace("def close(self, message):", "def close(self, message):\n        sleep(0.04)")
    )
    (lift / "lift.py").write_text(f"from time import sleep\n{source}")
    study = timed(lift, 'ITP1: "p50 < 10 s", ITP2: "p50 < 1 ms"')
    for attempt in range(
        5
    ):  # the noise of a busy machine may be longer than those 40 ms, which is said, and tried again
        results = run(study, lift / f"out{attempt}", repeats=20)
        verdicts = {(one.id.split("/")[2][:4], one.verdict) for one in results.cases() if one.id.startswith("timing/")}
        if Verdict.INCONCLUSIVE not in dict(verdicts).values():
            break
    assert verdicts == {("ITP1", Verdict.PASS), ("ITP2", Verdict.FAIL)}
    assert 0.0 < results.measures()["duration"].values[-1] < 10.0


def test_one_case_is_judged_alone_and_its_command_shows_the_same(lift: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = list(find(str(lift)).suite({}, 4))[3]
    judged = judge_case(case, str(lift))
    assert judged.verdict is Verdict.PASS and case.id in str(judged) and f"parcours run {lift}" in judged.replay
    monkeypatch.chdir(lift)
    for command in judged.replay.split(" && "):
        done = call(*command.split()[1:])
        assert done.exit_code == 0, done.output
    assert case.id in done.output
    for foreign in (dataclasses.replace(case, values=(8.0,)), dataclasses.replace(case, abstract="ITP9-a-0")):
        with pytest.raises(BadSuite, match=r"\[foreign-case\]"):
            judge_case(foreign, str(lift))


def test_orders_are_tried_each_with_the_data_of_its_case_and_run_again_by_name(lift: Path, tmp_path: Path) -> None:
    study = find(str(lift))
    plain = run(study, tmp_path / "plain", instances="per-visit")
    base = plain.cases()[0].id.removeprefix("functional/")
    abstract, row = base.split("/")[-2:]
    found = run(study, tmp_path / "out", None, f"{abstract}/{row}", instances="per-visit", orders="all")
    names = [case.id.removeprefix("functional/") for case in found.cases()]
    assert len(names) > 5 and all(name.startswith(f"lift/{abstract}@") for name in names)
    assert {str(case.verdict) for case in found.cases()} == {"pass"}
    once = run(study, tmp_path / "once", None, names[3], instances="per-visit")
    assert [case.id for case in once.cases()] == [f"functional/{names[3]}"]
    page = call("replay", tmp_path / "once", names[3], "--study", lift)
    assert page.exit_code == 0 and names[3] in page.output
    suite = list(study.suite(settings_of(study.parameters, {"orders": "2", "instances": "per-visit"}), 1))
    values = {case.id: case.values for case in study.suite(settings_of(study.parameters, {}), 1)}
    assert all(values[f"lift/{case.abstract.partition('@')[0]}/{case.row}"] == case.values for case in suite)
    assert judge_case(suite[1], str(lift)).verdict is Verdict.PASS

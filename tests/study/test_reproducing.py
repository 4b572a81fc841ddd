"""Failing cases are run again, also those of a folder that came from elsewhere, and one that differs is named."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.run.store import open_results
from parcours.study.components import faults
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from parcours.study.reproducing import SAMPLE, Reruns, noted
from parcours.verdict.judgement import Verdict

EXAMPLES = Path(__file__).parents[2] / "examples"
PARKING, LIFT = str(EXAMPLES / "parking"), str(EXAMPLES / "lift")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, study = tmp_path_factory.mktemp("parking"), find(PARKING)
    chosen = tuple(f"cases/{number}" for number in (*range(60, 66), *range(24)))
    settings = settings_of(study.parameters, {"workers": 1})
    study.run(Request(settings, 3, folder, chosen=chosen), lambda what, done, total: None)
    return folder


def failing(folder: Path) -> list[str]:
    return [one.id for one in find(PARKING).read(folder).cases() if one.verdict is Verdict.FAIL]


def invoke(*words: str) -> Result:
    return CliRunner().invoke(parcours, list(words), catch_exceptions=False)


def test_all_failing_cases_of_a_folder_from_elsewhere_come_out_the_same_and_the_report_says_so(
    made: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "from-elsewhere"
    shutil.copytree(made, folder)
    n = len(failing(folder))
    result = invoke("reproduce", str(folder), "--workers", "1")
    sentence = f"{n} of {n} failing cases reproduced, equal to the byte"
    assert 1 < n < 30 and result.exit_code == 0 and sentence in result.stdout
    page = tmp_path / "page.html"
    assert sentence in invoke("report", str(folder), "--html", str(page)).stdout and sentence in page.read_text()
    shutil.copy(folder / "reproduced.json", tmp_path)
    assert noted(tmp_path) is None  # no results lie there


def test_a_case_that_comes_out_otherwise_is_named(made: Path, tmp_path: Path) -> None:
    folder = tmp_path / "changed"
    shutil.copytree(made, folder)
    store, ids = open_results(folder), failing(made)
    number = int(ids[1].rpartition("/")[2])
    for shard in store.shards:
        rows = store.read(shard).copy()
        fact = next(name for name in rows.dtype.names or () if rows.dtype[name] == np.float64)
        rows[fact][rows["number"] == number] += 1e-9
        store.write(shard, rows)
    result = invoke("reproduce", str(folder), "--workers", "1", "--json")
    found = json.loads(result.stdout)
    assert result.exit_code == 1 and found["differing"] == [ids[1]] and found["changed"] == []
    assert (found["equal"], found["failing"]) == (len(ids) - 1, len(ids))
    kept = noted(folder)
    assert kept is not None and dataclasses.replace(kept, differing=()).equal == len(ids) - 1


def test_a_page_on_mutants_says_how_many_gave_the_same_again(tmp_path: Path) -> None:
    out, html = tmp_path / "out", tmp_path / "mutants.html"
    words = ("mutate", LIFT, "--only", "Cabin.door", "--workers", "1", "--out", str(out), "--html", str(html))
    invoke(*words)
    lines = [json.loads(line) for line in (out / "cases.jsonl").read_text().splitlines()]
    n = sum("component cases" in line["seen"] for line in lines)
    tried = min(n, SAMPLE)
    said = f"{tried} of {tried} gave the same verdict and facts ({tried} of {n} noticed mutants were run again)"
    assert n == len(lines) > SAMPLE and said in html.read_text()
    lines[0]["facts"] = "0" * 16  # of the first, which is always among the sample
    (out / "cases.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    invoke(*words)
    assert f"{tried - 1} of {tried} gave the same" in html.read_text() and "Not reproducible: 1 of" in html.read_text()
    for line in lines:  # as older versions kept them
        line.pop("facts")
    (out / "cases.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    invoke(*words)
    assert said in html.read_text()


def test_a_page_on_faults_says_how_many_gave_the_same_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("faults", LIFT, "--only", "request", "--cases", "2", "--out", str(tmp_path))
    invoke(*words)
    html = (tmp_path / "faults.html").read_text()
    assert "5 of 5 gave the same verdict and facts (5 of" in html and "Not reproducible" not in html
    monkeypatch.setattr(faults, "print_of", lambda trace, codec: os.urandom(8))
    invoke(*words)
    html = (tmp_path / "faults.html").read_text()
    assert "0 of 5 gave the same" in html and "Not reproducible: 5 of 5 cases that noticed a fault" in html


def test_what_did_not_run_again_is_not_claimed() -> None:
    assert str(Reruns("noticed mutants")) == "there were no noticed mutants to run again"
    assert not Reruns("noticed mutants").warning()

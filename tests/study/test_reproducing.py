"""Failing cases are run again, also those of a folder that came from elsewhere, and one that differs is named."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.run.store import open_results
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from parcours.study.reproducing import noted
from parcours.verdict.judgement import Verdict

PARKING = str(Path(__file__).parents[2] / "examples" / "parking")


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

"""Runs over time: a line each in a history; runs without common cases are compared as separate samples."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults
from parcours.study.finding import find
from parcours.study.history import read_history
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from parcours.verdict.statistics import compare_with_published, wilson

PARKING = str(Path(__file__).parents[2] / "examples" / "parking")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Return a folder of 24 cases for each of two seeds."""
    study, folders = find(PARKING), {}
    for seed in (1, 2):
        folders[seed] = tmp_path_factory.mktemp(f"seed{seed}")
        request = Request(settings_of(study.parameters, {"workers": 1}), seed, folders[seed], 24)
        study.run(request, lambda what, done, total: None)
    return folders


def invoke(*words: str) -> Result:
    return CliRunner().invoke(parcours, list(words), catch_exceptions=False)


def failed(folder: Path) -> int:
    return int(find(PARKING).read(folder).measures()["failed"].values.sum())


def test_every_run_is_a_line_that_is_appended_and_drawn(runs: dict[int, Path], tmp_path: Path) -> None:
    file, page = tmp_path / "history.jsonl", tmp_path / "page.html"
    assert invoke("history", str(file), str(runs[1]), "--commit", "abc").exit_code == 0
    first = file.read_bytes()
    shown = invoke("history", str(file), str(runs[2]), "--commit", "def", "--html", str(page)).stdout
    assert file.read_bytes().startswith(first) and file.read_bytes().count(b"\n") == 2
    entries = read_history(file)
    assert [(one.commit, one.study, one.cases) for one in entries] == [("abc", "parking", 24), ("def", "parking", 24)]
    assert entries[1].rates["failed"] == (failed(runs[2]), 24)
    assert f"{wilson(failed(runs[1]), 24).share:.2%}" in shown and "abc" in page.read_text()
    file.write_bytes(first + b'{"parcours": "history/1"}\n')
    with pytest.raises(BadResults, match=r"history.jsonl:2.*\[history-line\]"):
        read_history(file)


def test_runs_of_other_seeds_are_compared_as_separate_samples(runs: dict[int, Path]) -> None:
    result = invoke("compare", str(runs[1]), str(runs[2]), "--json")
    found = json.loads(result.stdout)[str(runs[2])]
    row = next(one for one in found["rows"] if one["rate"] == "failed")
    expected = compare_with_published(failed(runs[2]), 24, failed(runs[1]), 24)
    assert found["shared"] == 0 and row["p (Holm)"] >= expected.p_value
    assert row["now"].startswith(f"{expected.ours.share:.2%} [{expected.ours.low:.2%}")


def test_paired_runs_give_the_interval_of_each_difference(runs: dict[int, Path]) -> None:
    found = json.loads(invoke("compare", str(runs[1]), str(runs[1]), "--json").stdout)[str(runs[1])]
    assert found["shared"] == 24
    for row in found["rows"]:
        assert row["low"] <= 0.0 == row["now"] - row["before"] <= row["high"] and row["high"] - row["low"] < 0.5


def test_a_rate_that_no_run_has_is_refused_before_anything_is_appended(runs: dict[int, Path], tmp_path: Path) -> None:
    file = tmp_path / "history.jsonl"
    refused = CliRunner().invoke(parcours, ["history", str(file), str(runs[1]), "--rate", "faild"])
    assert isinstance(refused.exception, BadRequest) and refused.exception.slug == "history-rate"
    assert "did you mean 'failed'" in str(refused.exception) and not file.exists()

"""A campaign in few large shards has the results of the one in many small ones, whatever happens on the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults
from parcours.run import merging
from parcours.run.campaign import run_campaign
from parcours.run.merging import merge
from parcours.run.store import Campaign, Rows, open_results
from parcours.run.sums import sum_of

CAMPAIGN = Campaign("toy", "plain", 1, 95, np.dtype([("number", "i8"), ("hit", "?")]), shard_size=10)
PARKING = str(Path(__file__).parents[2] / "examples" / "parking")


def simulate(first: int, count: int) -> Rows:
    return np.array([(k, k % 3 == 0) for k in range(first, first + count)], CAMPAIGN.dtype)


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(merging, "LEAST", 25)
    run_campaign(simulate, CAMPAIGN, tmp_path / "small")
    (tmp_path / "small" / "notes.json").write_text("{}")
    return tmp_path / "small"


def test_all_rows_and_notes_are_there_in_few_shards_of_one_row_group_each(small: Path, tmp_path: Path) -> None:
    merged = merge(small, tmp_path / "large")
    assert merged.load().tobytes() == open_results(small).load().tobytes()
    groups = [pq.ParquetFile(merged.path(shard)).metadata for shard in merged.shards]
    assert [(one.num_row_groups, one.num_rows) for one in groups] == [(1, 30), (1, 30), (1, 30), (1, 5)]
    assert (tmp_path / "large" / "notes.json").exists() and not merged.missing()


def test_what_was_killed_goes_on_and_damage_is_found_before_it_is_copied(small: Path, tmp_path: Path) -> None:
    merged = merge(small, tmp_path / "large")
    whole = {path.name: path.read_bytes() for path in (tmp_path / "large").iterdir()}
    sum_of(merged.path(1)).unlink()  # as if it had been killed there
    merge(small, tmp_path / "large")
    assert {path.name: path.read_bytes() for path in (tmp_path / "large").iterdir()} == whole
    path = open_results(small).path(4)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(BadResults, match="shard-damaged"):
        merge(small, tmp_path / "another")


def test_a_campaign_that_a_rule_has_ended_ends_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(merging, "LEAST", 25)
    run_campaign(
        simulate, CAMPAIGN, tmp_path / "small", enough=lambda rows: "enough" if rows["number"][0] >= 30 else ""
    )
    merged = merge(tmp_path / "small", tmp_path / "large")
    assert merged.load()["number"].tolist() == list(range(40)) and merged.planned == 40


def test_what_cannot_be_merged_is_refused(small: Path, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="merge-folder"):
        merge(small, small)
    run_campaign(simulate, CAMPAIGN, tmp_path / "other")
    with pytest.raises(BadResults, match="results-other"):
        merge(small, tmp_path / "other")
    sum_of(open_results(small).path(2)).unlink()
    with pytest.raises(BadResults, match="results-unfinished"):
        merge(small, tmp_path / "large")
    assert not (tmp_path / "large").exists()


def test_commands_say_the_same_of_both(tmp_path: Path) -> None:
    small, large = str(tmp_path / "small"), str(tmp_path / "large")
    CliRunner().invoke(parcours, ["run", PARKING, "--cases", "600", "--workers", "1", "--out", small])
    plain = CliRunner().invoke(parcours, ["results", small])
    merged = CliRunner().invoke(parcours, ["results", small, "--merge", large])
    assert merged.exit_code == 0 and "wrote 1 shards" in merged.stderr and merged.stdout == plain.stdout
    compared = CliRunner().invoke(parcours, ["compare", small, large])
    assert "600 cases that both have" in compared.stdout
    again = CliRunner().invoke(parcours, ["reproduce", large])
    assert again.exit_code == 0 and "equal to the byte" in again.stdout

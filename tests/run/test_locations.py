"""Campaigns in a bucket: the bytes of a folder, resumed, found damaged, refused; one class of storage for both."""

from __future__ import annotations

import pickle
import re
import uuid
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from click.testing import CliRunner
from upath import UPath

from parcours.cli import parcours as cli
from parcours.errors import BadRequest, BadResults
from parcours.run.campaign import run_campaign
from parcours.run.locations import is_bucket, location, names_in
from parcours.run.store import Campaign, Rows, open_results

DTYPE = np.dtype([("case", "i8"), ("value", "f8")])
CAMPAIGN = Campaign("toy", "plain", 7, 95, DTYPE, {}, 10)


def simulate(first: int, count: int) -> Rows:
    numbers = np.arange(first, first + count)
    return np.array([*zip(numbers, np.sqrt(numbers), strict=True)], DTYPE)


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in sorted(names_in(folder))}


@pytest.fixture
def bucket() -> Iterator[Path]:
    yield location(f"memory://{uuid.uuid4()}/campaign")


def test_a_bucket_holds_the_bytes_that_a_folder_holds(bucket: Path, tmp_path: Path) -> None:
    assert is_bucket(bucket) and names_in(bucket) == []
    outcome = run_campaign(simulate, CAMPAIGN, bucket)
    run_campaign(simulate, CAMPAIGN, tmp_path)
    assert str(outcome) == f"all 95 cases are finished in {bucket}"
    assert contents(bucket) == contents(tmp_path) and len(contents(bucket)) == 21
    assert open_results(bucket).load()["value"][94] == np.sqrt(94)


def test_a_campaign_in_a_bucket_computes_what_is_missing_or_damaged_and_nothing_else(bucket: Path) -> None:
    run_campaign(simulate, CAMPAIGN, bucket)
    whole, store = contents(bucket), open_results(bucket)
    store.discard([3])
    damaged = store.path(5)
    damaged.write_bytes(damaged.read_bytes()[:-1])
    computed = list[int]()

    def noting(first: int, count: int) -> Rows:
        computed.append(first)
        return simulate(first, count)

    assert run_campaign(noting, CAMPAIGN, bucket).repaired == (5,)
    assert computed == [30, 50] and contents(bucket) == whole


def test_a_campaign_in_a_bucket_ends_by_a_rule_and_goes_on_without_it(bucket: Path, tmp_path: Path) -> None:
    run_campaign(simulate, CAMPAIGN, bucket, enough=lambda rows: "enough" * int(rows["case"][0] >= 30), rules=("30",))
    assert open_results(bucket).planned == 40
    run_campaign(simulate, CAMPAIGN, bucket)
    run_campaign(simulate, CAMPAIGN, tmp_path)
    assert contents(bucket) == contents(tmp_path)


def test_a_bucket_with_another_campaign_is_refused(bucket: Path) -> None:
    run_campaign(simulate, CAMPAIGN, bucket)
    with pytest.raises(BadResults, match=r"results-other"):
        run_campaign(simulate, Campaign("toy", "plain", 8, 95, DTYPE, {}, 10), bucket)
    (bucket / "campaign.json").unlink()
    with pytest.raises(BadResults, match=r"results-manifest"):
        run_campaign(simulate, CAMPAIGN, bucket)


def test_a_place_is_sent_to_other_processes(bucket: Path) -> None:
    run_campaign(simulate, CAMPAIGN, bucket)
    assert pickle.loads(pickle.dumps(open_results(bucket))).missing() == ()


def test_a_file_url_is_a_folder_with_its_lock_and_an_unknown_scheme_is_refused(tmp_path: Path) -> None:
    assert location(f"file://{tmp_path}") == tmp_path and not is_bucket(location(str(tmp_path)))
    with pytest.raises(BadRequest, match=r"nowhere:// must be installed.*no-cloud-extra"):
        location("nowhere://bucket/campaign")


def test_what_a_bucket_refuses_is_said_in_our_words(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "archive.zip", "w") as archive:
        archive.writestr("campaign/note", "")
    readable = cast(Path, UPath("zip://campaign", fo=str(tmp_path / "archive.zip")))
    with pytest.raises(BadRequest, match=r"must be writable.*folder-unwritable"):
        run_campaign(simulate, CAMPAIGN, readable)


def test_the_commands_run_and_read_a_campaign_in_a_bucket_as_in_a_folder(bucket: Path, tmp_path: Path) -> None:
    for out in (str(bucket), str(tmp_path / "out")):
        arguments = ["run", "examples/parking", "--cases", "40", "--workers", "1", "--out", out]
        assert CliRunner().invoke(cli, arguments).exit_code in (0, 1)
    assert {name: content for name, content in contents(bucket).items() if name != "run.json"} == {
        name: content for name, content in contents(tmp_path / "out").items() if name != "run.json"
    }
    for command in ("results", "coverage", "report", "reproduce"):
        said = [
            re.sub(r"[\s-]+", " ", CliRunner().invoke(cli, [command, out]).stdout.replace(out, "OUT"))
            for out in (str(tmp_path / "out"), str(bucket))
        ]
        assert said[0] == said[1] != "", command
    compared = CliRunner().invoke(cli, ["compare", str(tmp_path / "out"), str(bucket)])
    assert compared.exit_code == 0 and "40 cases that both have" in compared.stdout
    fresh = CliRunner().invoke(cli, ["run", "examples/parking", "--cases", "30", "--fresh", "--out", str(bucket)])
    assert fresh.exit_code in (0, 1) and open_results(bucket).campaign.n_cases == 30


@pytest.mark.parametrize(
    "words",
    [
        ["run", "examples/lift", "--out", "memory://lift"],
        ["run", "ramp_system", "--host", "processes", "--out", "memory://live"],
        ["mutate", "examples/lift", "--out", "memory://mutants"],
    ],
)
def test_what_keeps_to_folders_refuses_a_url_before_anything_is_written(words: list[str]) -> None:
    refused = CliRunner().invoke(cli, words).exception
    assert isinstance(refused, BadRequest) and refused.slug == "location-local"
    assert names_in(location(words[-1])) == []

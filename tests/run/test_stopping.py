"""A campaign that a rule ends has the same cases for any number of workers, any interruption, and any time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadResults
from parcours.run.campaign import run_campaign
from parcours.run.stops import STOP
from parcours.run.store import Campaign, Rows, open_results

CAMPAIGN = Campaign("toy", "plain", 1, 95, np.dtype([("number", "i8"), ("hit", "?")]), shard_size=10)
RULES = ("ten hits",)
PARKING = str(Path(__file__).parents[2] / "examples" / "parking")


class Slowly:
    """Every other shard takes a while, so that several workers finish them out of order."""

    def __call__(self, first: int, count: int) -> Rows:
        import time

        time.sleep(0.05 * (first // 10 % 2 == 0))
        numbers = range(first, first + count)
        return np.array([(k, k % 3 == 0) for k in numbers], CAMPAIGN.dtype)


class TenHits:
    """Enough is known after ten hits: those of cases 0, 3, .. 27, so with shard 2 of ten cases each."""

    def __init__(self) -> None:
        self.hits, self.looked_at = 0, list[int]()

    def __call__(self, rows: Rows) -> str:
        self.hits += int(rows["hit"].sum())
        self.looked_at.append(int(rows["number"][0]))
        return f"{self.hits} hits" if self.hits >= 10 else ""


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stopped")
    outcome = run_campaign(Slowly(), CAMPAIGN, folder, enough=TenHits(), rules=RULES)
    assert (outcome.finished, outcome.interrupted, outcome.stopped) == (30, False, "10 hits")
    assert "stopped after 30 cases" in str(outcome)
    return folder


def test_the_last_case_and_all_bytes_are_the_same_for_any_number_of_workers(stopped: Path, tmp_path: Path) -> None:
    rule = TenHits()
    run_campaign(Slowly(), CAMPAIGN, tmp_path, workers=3, enough=rule, rules=RULES)
    assert rule.looked_at == [0, 10, 20]
    assert contents(tmp_path) == contents(stopped)
    assert open_results(stopped).load()["number"].tolist() == list(range(30))


def test_shards_that_a_killed_run_had_computed_beyond_the_end_change_nothing(stopped: Path, tmp_path: Path) -> None:
    run_campaign(Slowly(), CAMPAIGN, tmp_path, rules=RULES)  # by the same rules, which it did not live to ask
    for shard in (0, 2):
        open_results(tmp_path).path(shard).with_suffix(".parquet.sha256").unlink()
    run_campaign(Slowly(), CAMPAIGN, tmp_path, enough=TenHits(), rules=RULES)
    assert contents(tmp_path) == contents(stopped)


def test_the_same_command_computes_nothing_again_and_one_without_rules_goes_on(stopped: Path, tmp_path: Path) -> None:
    def never(first: int, count: int) -> Rows:
        raise AssertionError(first)

    run_campaign(Slowly(), CAMPAIGN, tmp_path, enough=TenHits(), rules=RULES)
    again = run_campaign(never, CAMPAIGN, tmp_path, enough=TenHits(), rules=RULES)
    assert again.stopped and contents(tmp_path) == contents(stopped)
    assert run_campaign(Slowly(), CAMPAIGN, tmp_path).finished == 95 and not (tmp_path / STOP).exists()
    rule = TenHits()  # of a folder that was begun without rules no finished case is thrown away
    run_campaign(never, CAMPAIGN, tmp_path, enough=rule, rules=RULES)
    assert len(open_results(tmp_path).load()) == 95


def test_a_finished_campaign_is_not_read_for_a_watch_that_ends_nothing(tmp_path: Path) -> None:
    watch, late = TenHits(), TenHits()
    watch.hits = late.hits = -100
    run_campaign(Slowly(), CAMPAIGN, tmp_path, enough=watch)
    assert watch.looked_at == list(range(0, 95, 10))
    assert run_campaign(Slowly(), CAMPAIGN, tmp_path, enough=late).finished == 95 and not late.looked_at


def test_when_time_is_over_the_first_shards_are_the_results_and_the_same_command_goes_on(tmp_path: Path) -> None:
    def sleepy(first: int, count: int) -> Rows:
        import time

        if first >= 20:
            time.sleep(60.0)
        return Slowly()(first, count)

    outcome = run_campaign(sleepy, CAMPAIGN, tmp_path, max_time=0.5)
    assert outcome.finished == 20 and not outcome.interrupted and "0.5 s are over" in str(outcome)
    assert len(open_results(tmp_path).load()) == 20
    assert run_campaign(Slowly(), CAMPAIGN, tmp_path).finished == 95
    nothing = run_campaign(lambda first, count: sleepy(first + 20, count), CAMPAIGN, tmp_path / "none", max_time=0.2)
    assert nothing.interrupted and "0.2 s are over before the first 10 cases were finished" in str(nothing)


# Every look at the time of day is a day later or earlier than the last one, in whatever process of Python.
JUMPS = """
import itertools, os, pathlib, time
day, real = itertools.cycle((86_400, 0, -86_400)), time.time
def jumping():
    pathlib.Path(__file__).with_name(f"looked-{os.getpid()}").touch()
    return real() + next(day)
time.time = jumping
"""


def test_a_clock_that_jumps_by_days_changes_no_byte_and_ends_nothing_too_soon(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(JUMPS)
    begins = "import time, sys; time.time(); from parcours.cli import main; main()"
    arguments = [PARKING, "--cases", "600", "--workers", "2"]
    folders = []
    for jumps, limit in ((True, ["--max-time", "300"]), (False, [])):
        folders.append(tmp_path / f"jumps-{jumps}")
        ran = subprocess.run(
            [sys.executable, "-c", begins, "run", *arguments, *limit, "--out", str(folders[-1])],
            env={**os.environ, "PYTHONPATH": str(tmp_path) if jumps else ""}, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        assert ran.returncode == 1 and "all 600 cases are finished" in ran.stdout, ran.stdout + ran.stderr
    assert list(tmp_path.glob("looked-*"))
    jumped, plain = ({path.name: path.read_bytes() for path in one.glob("shard-*")} for one in folders)
    assert jumped == plain and plain


@pytest.mark.parametrize("change", [{"cases": 25}, {"cases": 0}, {"cases": True}, {"first": -1}, {"campaign": "x"},
                                    {"rules": [1]}, {"cases": 1e30}])  # fmt: skip
def test_a_note_that_is_damaged_or_of_another_campaign_is_refused(
    stopped: Path, tmp_path: Path, change: dict[str, object]
) -> None:
    for name, content in contents(stopped).items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / STOP).write_text(json.dumps(json.loads((stopped / STOP).read_bytes()) | change))
    with pytest.raises(BadResults, match="results-stopped"):
        open_results(tmp_path).load()


def test_results_are_read_into_one_array_never_twice_into_memory(tmp_path: Path) -> None:
    import tracemalloc

    wide = Campaign("wide", "plain", 1, 4096, np.dtype([("number", "i8"), ("all", "f8", (127,))]), shard_size=64)
    run_campaign(lambda first, count: np.zeros(count, wide.dtype), wide, tmp_path)
    store = open_results(tmp_path)
    tracemalloc.start()
    rows = store.load()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows.nbytes == 4096 * 1024 and peak < 1.3 * rows.nbytes

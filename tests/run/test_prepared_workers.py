"""Workers of functions that prepare themselves: prepared once, ended with their parent, the same bytes."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadResults
from parcours.run.campaign import run_campaign
from parcours.run.store import open_results
from parcours.run.workers import can_fork
from parcours.study.journal import discard
from parcours_ramp.system.study import system_study

STUDY = """
import os, signal, sys, time
from pathlib import Path
import numpy as np
from parcours.run.campaign import run_campaign
from parcours.run.store import Campaign
DTYPE = np.dtype([("case", "i8"), ("prepared_in", "i8"), ("ran_in", "i8")])
CAMPAIGN = Campaign("prepared", "plain", 0, 60, DTYPE, shard_size=10)
prepared_in = -1

class Study:
    def __init__(self, ours, pause=0.0):
        self.ours, self.pause = ours, pause

    def prepare(self):
        global prepared_in
        prepared_in = os.getpid()
        return self.ours

    def __call__(self, first, count):
        time.sleep(self.pause)
        return np.array([(n, prepared_in, os.getpid()) for n in range(first, first + count)], DTYPE)

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores it
    print(run_campaign(Study(True, 0.2), CAMPAIGN, Path(sys.argv[1]), workers=2))
"""


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    file = tmp_path / "code" / "toy_prepared_study.py"
    file.parent.mkdir()
    file.write_text(STUDY)
    monkeypatch.syspath_prepend(str(file.parent))
    return file


def begin(script: Path, folder: Path) -> subprocess.Popen[str]:
    """Start the campaign in a process of its own, and wait for its first shard."""
    process = subprocess.Popen(
        [sys.executable, str(script), str(folder)], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 60
    while not list(folder.glob("*.sha256")) and time.monotonic() < deadline:
        time.sleep(0.005)
    return process


def alive(session: int) -> bool:
    """Return whether any process of that session still runs."""
    try:
        os.killpg(session, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("ours", [True, False])
def test_only_what_is_all_ours_is_prepared_for_the_workers_too(script: Path, tmp_path: Path, ours: bool) -> None:
    toy = importlib.import_module(script.stem)
    rows = run_campaign(toy.Study(ours), toy.CAMPAIGN, tmp_path / "c", workers=2).store.load()
    assert os.getpid() not in rows["ran_in"]
    assert toy.prepared_in == os.getpid()
    assert set(rows["prepared_in"].tolist()) == {os.getpid() if ours and can_fork() else -1}


def test_prepared_workers_do_not_outlive_a_killed_parent_and_their_shards_are_kept(
    script: Path, tmp_path: Path
) -> None:
    process = begin(script, tmp_path / "c")
    process.kill()
    process.wait()
    deadline = time.monotonic() + 30
    while alive(process.pid) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not alive(process.pid)
    store = open_results(tmp_path / "c")
    kept = len(store.campaign.shards) - len(store.missing())
    assert 0 < kept < 6
    assert len(store.load(partial=True)) == 10 * kept


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_campaign_of_prepared_workers_is_interrupted_in_order(
    script: Path, tmp_path: Path, how: signal.Signals
) -> None:
    process = begin(script, tmp_path / "c")
    os.killpg(process.pid, how)  # as a terminal does: to all of them
    said = process.communicate(timeout=60)[0]
    assert process.returncode == 0 and said.startswith("interrupted: ")
    assert not alive(process.pid)
    assert not [file for file in (tmp_path / "c").iterdir() if file.name.startswith(".")]


def test_a_second_run_on_a_folder_is_refused_by_name_and_a_killed_one_leaves_it_free(
    script: Path, tmp_path: Path
) -> None:
    toy = importlib.import_module(script.stem)
    process = begin(script, tmp_path / "c")
    try:
        with pytest.raises(BadResults, match=f"but process {process.pid} is writing") as refused:
            run_campaign(toy.Study(True), toy.CAMPAIGN, tmp_path / "c")
        assert refused.value.slug == "results-busy"
        with pytest.raises(BadResults, match="results-busy"):
            discard(tmp_path / "c", ("*",))
    finally:
        os.kill(process.pid, signal.SIGKILL)  # its workers may live a moment longer, without the lock
        process.wait()
    assert run_campaign(toy.Study(True), toy.CAMPAIGN, tmp_path / "c").finished == 60


def test_a_hangup_that_is_ignored_as_under_nohup_ends_nothing(script: Path, tmp_path: Path) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        process = begin(script, tmp_path / "c")  # a child ignores what its parent does
        os.killpg(process.pid, signal.SIGHUP)
        said = process.communicate(timeout=60)[0]
    finally:
        signal.signal(signal.SIGHUP, before)
    assert process.returncode == 0 and said.startswith("all 60 cases")


def test_system_cases_have_the_same_bits_in_any_number_of_workers(tmp_path: Path) -> None:
    study = system_study("guarded", seed=3)
    alone, both = (
        run_campaign(study, study.campaign(12, 4), tmp_path / str(n), workers=n).store.load() for n in (1, 2)
    )
    assert np.array_equal(alone.view(np.uint8), both.view(np.uint8))

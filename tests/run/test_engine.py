"""Campaigns on a real Dask cluster: the same bytes as at home, whoever is killed; unfit workers are refused by name."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest, BadResults, HostFailure
from parcours.run.campaign import run_campaign
from parcours.run.store import Campaign, open_results

pytest.importorskip("distributed")

DTYPE = np.dtype([("case", "i8"), ("value", "f8")])
STUDY = """
import os, time
from pathlib import Path
import numpy as np
DTYPE = np.dtype([("case", "i8"), ("value", "f8")])

def simulate(first, count):
    numbers = np.arange(first, first + count)
    rows = np.empty(count, DTYPE)
    rows["case"], rows["value"] = numbers, np.sqrt(numbers)
    return rows

def slowly(first, count):
    with open(os.environ["TOY_LOG"], "a") as log:
        log.write(f"{first} {os.getpid()}\\n")
    time.sleep(0.1)
    return simulate(first, count)

def raises(first, count):
    raise ArithmeticError("case 3 is odd") if first == 0 else KeyboardInterrupt
"""
CAMPAIGN = Campaign("toy", "plain", 7, 200, DTYPE, {"a": 1}, 5)


class Cluster:
    """A scheduler and workers, processes of their own that find the toy study."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.workers = folder, list[subprocess.Popen[bytes]]()
        (folder / "toy_engine_study.py").write_text(STUDY)
        self.log = folder / "log"
        self.environment = os.environ | {"PYTHONPATH": str(folder), "TOY_LOG": str(self.log)}
        self.environment |= {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "9"}
        self.scheduler = self.start_scheduler("0")

    def start_scheduler(self, port: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port,
             "--no-dashboard", "--no-show"],
            stderr=subprocess.PIPE, env=self.environment,
        )  # fmt: skip
        assert process.stderr is not None
        for line in process.stderr:
            if b"Scheduler at:" in line:
                self.address = line.split()[-1].decode()
                break
        return process

    def start_worker(self, **environment: str) -> None:
        self.workers.append(subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1", "--no-nanny",
             "--no-dashboard", "--death-timeout", "60", "--local-directory", str(self.folder / "scratch")],
            stderr=subprocess.DEVNULL, env=self.environment | environment,
        ))  # fmt: skip

    def computed(self) -> list[int]:
        """Return the first cases of the shards that workers have begun."""
        return [int(line.split()[0]) for line in self.log.read_text().splitlines()] if self.log.exists() else []

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
            if process.stderr is not None:
                process.stderr.close()
        self.workers.clear()

    def drive(self, out: Path) -> subprocess.Popen[str]:
        """Begin the campaign in a process of its own."""
        script = self.folder / "drive.py"
        script.write_text(
            "import sys, numpy as np\nfrom pathlib import Path\nfrom parcours.errors import ParcoursError\n"
            "from parcours.run.campaign import run_campaign\nfrom parcours.run.store import Campaign\n"
            "D = np.dtype([('case', 'i8'), ('value', 'f8')])\n"
            "try:\n    print(run_campaign('toy_engine_study:slowly',\n                       Campaign('toy', 'plain', 7, 200, D, {'a': 1}, 5),\n"
            "                       Path(sys.argv[1]), address=sys.argv[2]))\n"
            "except ParcoursError as error:\n    print(error)\n"
        )
        return subprocess.Popen(
            [sys.executable, str(script), str(out), self.address], env=self.environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    with contextlib.closing(contextlib.ExitStack()) as stack:
        stack.callback(made.end)
        yield made


def until(met: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not met() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert met()


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_bytes_are_those_of_one_process_though_workers_scheduler_and_driver_are_killed(
    cluster: Cluster, tmp_path: Path
) -> None:
    whole, out = tmp_path / "whole", tmp_path / "out"
    run_campaign("toy_engine_study:simulate", CAMPAIGN, whole)
    for _ in range(2):
        cluster.start_worker()
    driver = cluster.drive(out)
    until(lambda: len(cluster.computed()) >= 6)
    cluster.workers[0].kill()  # its shard goes to another one
    cluster.start_worker()
    until(lambda: len(cluster.computed()) >= 14)
    driver.kill()
    driver.communicate()
    time.sleep(0.5)  # what had begun is written
    begun = cluster.computed()
    assert len(begun) <= 14 + 4 and len(open_results(out).finished()) >= len(set(begun)) - 1

    driver = cluster.drive(out)  # the same command goes on
    until(lambda: len(cluster.computed()) >= len(begun) + 6)
    cluster.scheduler.kill()
    said = driver.communicate(timeout=60)[0]
    assert "the scheduler must stay" in said and "[engine-lost]" in said
    cluster.end()

    cluster.scheduler = cluster.start_scheduler("0")
    for _ in range(2):
        cluster.start_worker()
    said = cluster.drive(out).communicate(timeout=60)[0]
    assert said.startswith("all 200 cases are finished") and contents(out) == contents(whole)
    computed = cluster.computed()
    again = len(computed) - len(set(computed))  # by one worker killed, and two when the scheduler was
    assert set(computed) == set(range(0, 200, 5)) and again <= 1 + 2


def test_unfit_workers_are_refused_by_name_and_what_a_study_raises_is_said(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.start_worker()
    with pytest.raises(HostFailure, match=r"worker \d+ on .*ArithmeticError: case 3 is odd.*\[shard-raised\]"):
        run_campaign("toy_engine_study:raises", CAMPAIGN, tmp_path / "r", address=cluster.address)
    monkeypatch.setattr("parcours.run.engine.__version__", "0.0.1")
    with pytest.raises(BadRequest, match=r"worker \d+ on .*must have the driver's Parcours 0.0.1.*\[engine-version\]"):
        run_campaign("toy_engine_study:simulate", CAMPAIGN, tmp_path / "v", address=cluster.address)
    monkeypatch.undo()
    with pytest.raises(BadResults, match=r"must be the campaign's on every machine.*\[engine-folder\]"):
        run_campaign("toy_engine_study:simulate", CAMPAIGN, Path(f"/proc/self/fd/{hidden(tmp_path / 'x')}"),
                     address=cluster.address)  # fmt: skip
    cluster.workers.pop().kill()
    cluster.start_worker(PYTHONPATH="")
    (tmp_path / "other").mkdir()
    with pytest.raises(BadRequest, match=r"must be .*toy_engine_study.*\[(engine-study|simulate-name)\]"):
        run_campaign("toy_engine_study:simulate", CAMPAIGN, tmp_path / "s", address=cluster.address)


def hidden(folder: Path) -> int:
    """Return a descriptor of a folder: a path to it that other processes do not have."""
    folder.mkdir()
    return os.open(folder, os.O_RDONLY)


def test_an_address_where_no_scheduler_answers_is_refused(tmp_path: Path) -> None:
    for address in ("tcp://127.0.0.1:1", "nonsense://"):
        with pytest.raises(BadRequest, match=r"a Dask scheduler must answer there.*\[engine-address\]"):
            run_campaign(lambda first, count: np.zeros(count, DTYPE), CAMPAIGN, tmp_path / "a", address=address)

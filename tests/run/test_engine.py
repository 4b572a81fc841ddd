"""Campaigns on a real Dask cluster: the same bytes as at home, whoever is killed; unfit workers are refused by name.

Workers wait in front of gates, which the tests open, so that who is killed at what is no question of time.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.errors import BadRequest, BadResults, HostFailure, ParcoursError
from parcours.run import engine
from parcours.run.campaign import run_campaign
from parcours.run.store import Campaign, open_results

SOURCE = Path(engine.__file__).parents[2]
PARKING = Path(__file__).parents[2] / "examples" / "parking"
DTYPE = np.dtype([("case", "i8"), ("value", "f8")])
STUDY = """
import os, signal, time
from pathlib import Path
import numpy as np
HERE = Path(__file__).parent

def simulate(first, count):
    numbers = np.arange(first, first + count)
    rows = np.empty(count, [("case", "i8"), ("value", "f8")])
    rows["case"], rows["value"] = numbers, np.sqrt(numbers)
    return rows

def gated(first, count):
    with open(HERE / "log", "a") as log:
        log.write(f"{first} {os.getpid()}\\n")
    while first >= int((HERE / "gate").read_text()):
        time.sleep(0.01)
    return simulate(first, count)

def raises(first, count):
    raise ArithmeticError("case 3 is odd")

def kills(first, count):
    if first == 10:
        os.kill(os.getpid(), signal.SIGKILL)
    return simulate(first, count)
"""
DRIVER = """
import sys, numpy as np
from pathlib import Path
from parcours.errors import ParcoursError
from parcours.run import engine
from parcours.run.campaign import run_campaign
from parcours.run.store import Campaign
engine._FIRST = 1  # so all portions are one shard: how long one takes is never known
engine._RECOUNTED = 0.1
campaign = Campaign("toy", "plain", 7, 200, np.dtype([("case", "i8"), ("value", "f8")]), {"a": 1}, 5)
try:
    print(run_campaign("engine_study:gated", campaign, Path(sys.argv[1]), address=sys.argv[2]))
except ParcoursError as error:
    print(error)
"""
CAMPAIGN = Campaign("toy", "plain", 7, 200, DTYPE, {"a": 1}, 5)


class Cluster:
    """A scheduler and workers, processes of their own that find the toy study."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.workers = folder, list[subprocess.Popen[bytes]]()
        (folder / "study").mkdir()
        (folder / "study" / "engine_study.py").write_text(STUDY)
        (folder / "driver.py").write_text(DRIVER)
        self.path = f"{folder / 'study'}:{SOURCE}"
        self.open(0)
        self.start_scheduler()

    def _start(self, module: str, *arguments: str, path: str = "", **more: object) -> subprocess.Popen[bytes]:
        environment = os.environ | {
            "PYTHONPATH": path or self.path,
            "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
        }
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--no-dashboard"]
        return subprocess.Popen(command, cwd=self.folder, env=environment, start_new_session=True, **more)  # type: ignore[call-overload,no-any-return]

    def start_scheduler(self) -> None:
        self.scheduler = self._start(
            "dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show", stderr=subprocess.PIPE
        )
        assert self.scheduler.stderr is not None
        line = next(line for line in self.scheduler.stderr if b"Scheduler at:" in line)
        self.address = line.split()[-1].decode()

    def start_worker(self, *arguments: str, path: str = "") -> None:
        arguments = arguments or ("--no-nanny", "--nthreads", "1")
        self.workers.append(self._start(
            "dask_worker", self.address, *arguments, "--death-timeout", "60", "--local-directory",
            str(self.folder / "scratch"), path=path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ))  # fmt: skip

    def drive(self, out: Path) -> subprocess.Popen[str]:
        """Begin the gated campaign in a process of its own."""
        return subprocess.Popen(
            [sys.executable, str(self.folder / "driver.py"), str(out), self.address], text=True,
            env=os.environ | {"PYTHONPATH": self.path}, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def begun(self) -> list[tuple[int, int]]:
        """Return the first case of each shard that was begun, and the process that began it."""
        log = self.folder / "study" / "log"
        lines = log.read_text().splitlines() if log.exists() else []
        return [(int(first), int(pid)) for first, pid in (line.split() for line in lines)]

    def open(self, end: int) -> None:
        """Let shards of the cases below `end` pass."""
        self.opened = end
        (self.folder / "study" / "gate.new").write_text(str(end))
        (self.folder / "study" / "gate.new").rename(self.folder / "study" / "gate")

    def held(self) -> set[int]:
        """Return the first cases of the shards that wait at the gate."""
        return {first for first, _ in self.begun() if first >= self.opened}

    def end_workers(self) -> None:
        for process in self.workers:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # what a nanny has started, too
            process.wait()
        self.workers.clear()

    def end_scheduler(self) -> None:
        self.scheduler.kill()
        self.scheduler.wait()
        assert self.scheduler.stderr is not None
        self.scheduler.stderr.close()


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path / "study"))
    try:
        yield made
    finally:
        made.end_scheduler()
        made.end_workers()


def until(met: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 180
    while not met() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert met()


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_bytes_are_those_of_one_process_though_worker_driver_and_scheduler_are_killed(
    cluster: Cluster, tmp_path: Path
) -> None:
    whole, out = tmp_path / "whole", tmp_path / "out"
    run_campaign("engine_study:simulate", CAMPAIGN, whole)
    for _ in range(2):
        cluster.start_worker()
    driver = cluster.drive(out)
    until(lambda: len(cluster.held()) == 2)
    lost, pid = cluster.begun()[0]
    next(worker for worker in cluster.workers if worker.pid == pid).kill()
    cluster.open(100)
    until(lambda: len(cluster.held()) == 1)  # cases below 100 are done, and the only worker is at a later shard
    cluster.start_worker()  # which gets a portion though none is answered now
    until(lambda: len(cluster.held()) == 2)
    assert [first for first, _ in cluster.begun()].count(lost) == 2  # in another worker

    held, begun = cluster.held(), cluster.begun()
    driver.kill()
    driver.communicate()
    driver = cluster.drive(out)  # the same command goes on
    cluster.open(160)
    until(lambda: len(cluster.held()) == 2)
    again = {first for first, _ in cluster.begun()[len(begun) :]} & {first for first, _ in begun}
    assert again <= held and open_results(out).finished() >= set(range(20))
    cluster.end_scheduler()
    said = driver.communicate(timeout=180)[0]
    assert "the scheduler must stay" in said and "[engine-lost]" in said
    cluster.end_workers()

    cluster.start_scheduler()
    for _ in range(2):
        cluster.start_worker()
    cluster.open(200)
    assert cluster.drive(out).communicate(timeout=180)[0].startswith("all 200 cases are finished")
    assert contents(out) == contents(whole)
    firsts = [first for first, _ in cluster.begun()]
    assert len(firsts) - len(set(firsts)) <= 1 + 2 + 2  # by a worker killed; one a worker by driver and scheduler


def refused(kind: type[ParcoursError], pattern: str, function: str, out: Path, cluster: Cluster) -> None:
    with pytest.raises(kind, match=pattern):
        run_campaign(f"engine_study:{function}", CAMPAIGN, out, address=cluster.address)


def test_what_a_study_raises_names_worker_and_shard_and_so_does_a_shard_that_kills_its_workers(
    cluster: Cluster, tmp_path: Path
) -> None:
    cluster.start_worker("--nthreads", "1")  # with a nanny, which starts another one
    pattern = r"worker tcp://\S+, shard \d+ \(cases .*ArithmeticError: case 3 is odd.*\[shard-raised\]"
    refused(HostFailure, pattern, "raises", tmp_path / "r", cluster)
    out, hidden = tmp_path / "out", tmp_path / "hidden"
    pattern = r"shard 2 \(cases 10..14\): its worker must live, but 2 died on it, tcp://.*\[worker-died\]"
    refused(HostFailure, pattern, "kills", out, cluster)
    assert {0, 1} <= open_results(out).finished()
    hidden.mkdir()
    mine = Path(f"/proc/self/fd/{os.open(hidden, os.O_RDONLY)}")  # a path that no other process has
    pattern = r"worker tcp://\S+, /proc/\S+: the folder must be the same on all machines.*\[engine-folder\]"
    refused(BadResults, pattern, "simulate", mine, cluster)


def test_workers_that_are_not_fit_are_refused_by_name_at_once_and_when_they_come_later(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "_TO_COME", 0.1)
    refused(
        BadRequest, r"must have a worker, but none has come.*\[engine-workers\]", "simulate", tmp_path / "a", cluster
    )
    monkeypatch.undo()
    other, nothing = tmp_path / "other", tmp_path / "nothing"
    shutil.copytree(SOURCE / "parcours", other / "parcours", ignore=shutil.ignore_patterns("__pycache__"))
    (other / "parcours" / "__init__.py").write_text('__version__ = "0.0.7"\n')
    (other / "numpy-0.1.dist-info").mkdir()
    (other / "numpy-0.1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 0.1\n")
    nothing.mkdir()
    (nothing / "parcours.py").touch()

    cluster.start_worker()
    driver = cluster.drive(tmp_path / "out")
    until(lambda: len(cluster.held()) == 1)  # the first worker waits at its gate: another one gets the next portion
    cluster.start_worker(path=str(other))
    said = driver.communicate(timeout=180)[0]
    assert (
        "worker tcp://" in said and "0.0.7 (here" in said and "numpy 0.1 (here " in said and "[engine-version]" in said
    )
    pattern = r"worker tcp://\S+: it must have what is installed here.*parcours 0.0.7 \(here.*\[engine-version\]"
    refused(BadRequest, pattern, "simulate", tmp_path / "b", cluster)
    for arguments, path, pattern in (
        ((), str(nothing), r"worker tcp://\S+: it must have Parcours .*\[engine-version\]"),
        ((), str(SOURCE), r"worker tcp://\S+, simulate 'engine_study:simulate': .*\[simulate-name\]"),
        (("--nthreads", "2"), "", r"worker tcp://\S+: it must have one thread.*but has 2.*\[engine-threads\]"),
    ):
        cluster.end_workers()
        cluster.start_worker(*arguments, path=path)
        refused(BadRequest, pattern, "simulate", tmp_path / "c", cluster)


def test_an_address_without_a_scheduler_and_a_machine_without_dask_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "_TO_CONNECT", 0.1)
    for address in ("tcp://127.0.0.1:1", "nonsense://"):
        with pytest.raises(BadRequest, match=r"a Dask scheduler must answer there.*\[engine-address\]"):
            run_campaign("math:hypot", CAMPAIGN, tmp_path / "a", address=address)
    with pytest.raises(BadRequest, match=r"must be sent there, but: .*local.*\[not-picklable\]"):
        run_campaign(lambda first, count: np.zeros(count, DTYPE), CAMPAIGN, tmp_path / "a", address="tcp://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(BadRequest, match=r"needs the package distributed.*\[no-engine-extra\]"):
        run_campaign("math:hypot", CAMPAIGN, tmp_path / "a", address="tcp://127.0.0.1:1")


def test_a_study_is_run_from_the_command_line_and_its_file_is_shipped(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "_FIRST", 10)  # all in one portion
    cluster.start_worker("--nthreads", "1")
    study = f"/proc/self/fd/{os.open(PARKING, os.O_RDONLY)}/study.yaml"  # a path that no other process has
    ran = [
        CliRunner().invoke(parcours, ["run", study, "--cases", "40", "--out", str(tmp_path / out), *more])
        for out, more in (("here", ()), ("there", ("--engine", "dask", "--address", cluster.address)))
    ]
    assert [one.exit_code for one in ran] == [1, 1] and "all 40 cases are finished" in ran[1].output
    here, there = (
        {path.name: path.read_bytes() for path in sorted((tmp_path / out).glob("shard-*"))} for out in ("here", "there")
    )
    assert here == there and here


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["examples/parking", "--engine", "dask"], "go together"),
        (["examples/parking", "--address", "tcp://127.0.0.1:1"], "go together"),
        (["examples/lift", "--engine", "dask", "--address", "tcp://127.0.0.1:1"], "it is for campaigns"),
    ],
)
def test_options_that_do_not_fit_are_refused(arguments: list[str], said: str, tmp_path: Path) -> None:
    here = PARKING.parents[1]
    given = ["run", str(here / arguments[0]), *arguments[1:], "--out", str(tmp_path / "out")]
    with pytest.raises(BadRequest, match=f"{said}.*option-study"):
        CliRunner().invoke(parcours, given, catch_exceptions=False)

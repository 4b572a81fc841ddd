"""Kills workers, scheduler and driver of a campaign on a Dask cluster at random, and prints what that cost.

python bench/bench_cluster.py [--kills 100] [--cases 10000] [--workers 2] [--seed 1]

Campaigns of RAMP cases follow one another until that number of kills is reached; each must end with the bytes of a run
without a cluster. Who is killed, and when, is drawn by seed; what is killed is started again.
"""

from __future__ import annotations

import argparse
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from parcours.errors import ParcoursError
from parcours.run.campaign import run_campaign
from parcours.run.store import Campaign
from parcours_ramp.system.study import SystemStudy, system_study

SHARD = 64  # cases: less than a tenth of a second
COMPUTED = re.compile(rb"computed shard (\d+) .* of (\S+)")


def study_of(seed: int, n_cases: int) -> tuple[SystemStudy, Campaign]:
    study = system_study("guarded", seed=seed)
    return study, study.campaign(n_cases, SHARD)


class Cluster:
    """A scheduler, workers and a driver, processes that are started again when they have ended."""

    def __init__(self, folder: Path, n_workers: int) -> None:
        self.folder, self.log = folder, (folder / "workers.log").open("wb")
        self.scheduler = self._scheduler()
        self.workers = [self._worker() for _ in range(n_workers)]

    def _dask(self, what: str, *arguments: str, **more: object) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *arguments, "--no-dashboard"]
        return subprocess.Popen(command, cwd=self.folder, **more)  # type: ignore[call-overload,no-any-return]

    def _scheduler(self) -> subprocess.Popen[bytes]:
        process = self._dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show", stderr=subprocess.PIPE)
        assert process.stderr is not None
        line = next(line for line in process.stderr if b"Scheduler at:" in line)
        self.address = line.split()[-1].decode()
        return process

    def _worker(self) -> subprocess.Popen[bytes]:
        return self._dask(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--death-timeout", "60", stderr=self.log
        )

    def start_again(self) -> None:
        """Start what has ended."""
        if self.scheduler.poll() is not None:
            self.scheduler = self._scheduler()
            for worker in self.workers:  # they end without their scheduler
                worker.kill()
                worker.wait()
        self.workers = [one if one.poll() is None else self._worker() for one in self.workers]

    def drive(self, seed: int, n_cases: int, out: Path) -> subprocess.Popen[bytes]:
        command = [sys.executable, __file__, "--drive", str(out), self.address]
        return subprocess.Popen([*command, "--seed", str(seed), "--cases", str(n_cases)])

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drive", nargs=2, metavar=("FOLDER", "ADDRESS"), help="what the driver's process runs")
    given = parser.parse_args()
    if given.drive:
        study, campaign = study_of(given.seed, given.cases)
        try:
            run_campaign(study, campaign, Path(given.drive[0]), address=given.drive[1])
        except ParcoursError:  # the scheduler has ended: the next driver goes on
            sys.exit(2)
        return
    rng, killed, seed = random.Random(given.seed), Counter[str](), given.seed
    with tempfile.TemporaryDirectory(prefix="parcours-") as temporary:
        cluster = Cluster(Path(temporary), given.workers)
        try:
            while killed.total() < given.kills:
                run_killed(cluster, rng, killed, given.kills, seed, given.cases)
                seed += 1
        finally:
            cluster.end()


def run_killed(cluster: Cluster, rng: random.Random, killed: Counter[str], most: int, seed: int, n_cases: int) -> None:
    """Run a campaign through while its processes are killed, and compare it with one that was left alone."""
    whole, out = cluster.folder / f"whole-{seed}", cluster.folder / f"out-{seed}"
    study, campaign = study_of(seed, n_cases)
    start = time.perf_counter()
    run_campaign(study, campaign, whole)
    alone, start = time.perf_counter() - start, time.perf_counter()
    before, driver = Counter(killed), cluster.drive(seed, n_cases, out)
    while True:
        least = len(list(out.glob("*.sha256"))) + rng.randint(1, 4)  # so a kill meets processes that are at work
        while driver.poll() is None and (killed.total() >= most or len(list(out.glob("*.sha256"))) < least):
            time.sleep(rng.uniform(0.0, 0.1))
        if driver.poll() == 0:
            break
        what = rng.choices(["worker", "driver", "scheduler"], [80, 12, 8])[0]
        process = {"worker": rng.choice(cluster.workers), "driver": driver, "scheduler": cluster.scheduler}[what]
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            process.wait()
            killed[what] += 1
        if what == "scheduler":
            driver.wait()  # it says that the scheduler has ended
        cluster.start_again()
        if driver.poll() not in (None, 0):
            driver = cluster.drive(seed, n_cases, out)
    same = contents(whole) == contents(out)
    log = (cluster.folder / "workers.log").read_bytes()
    times = Counter(int(found[1]) for found in COMPUTED.finditer(log) if found[2].decode() == str(out))
    kills = ", ".join(f"{killed[what] - before[what]} of a {what}" for what in ("worker", "driver", "scheduler"))
    print(
        f"campaign {seed}: {'the same bytes' if same else 'OTHER BYTES'} as alone; kills: {kills}; "
        f"{len(times)} shards, {times.total() - len(times)} written twice; "
        f"{time.perf_counter() - start:.0f} s, alone in one process {alone:.0f} s; {killed.total()} kills so far",
        flush=True,
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


if __name__ == "__main__":
    main()

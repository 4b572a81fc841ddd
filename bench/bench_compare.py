"""Prints what `parcours compare` takes on campaigns of RAMP, half of them `guarded`, and how near that is to a limit.

python bench/bench_compare.py [--cases 20000] [--campaigns 10]

Two campaigns are run; the others are links to their files. The times are of processes of their own, the least of three.
The limit is reading the same files and their SHA-256 on one core: no comparison that trusts only what it has summed
takes less work. With --cases 1000000 the campaigns take 20 minutes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from parcours.run.campaign import run_campaign
from parcours_ramp.system.study import SCHEDULES, system_study


def least(work: Callable[[], object]) -> tuple[float, float]:
    """Return the least wall clock and the least processor time of three runs, children included [s]."""
    found = []
    for _ in range(3):
        before, start = _processor(), time.perf_counter()
        work()
        found.append((time.perf_counter() - start, _processor() - before))
    return min(wall for wall, _ in found), min(processor for _, processor in found)


def _processor() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def campaigns(folder: Path, n: int, n_cases: int) -> list[Path]:
    """Return the folders of n campaigns; all but the first two are links."""
    found = [folder / str(k) for k in range(n)]
    for k, out in enumerate(found):
        if k < len(SCHEDULES):
            study = system_study(SCHEDULES[k], seed=1)
            run_campaign(study, study.campaign(n_cases, min(8192, -(-n_cases // 4))), out, workers=2)
            continue
        out.mkdir()
        for path in found[k % len(SCHEDULES)].iterdir():
            os.link(path, out / path.name)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--campaigns", type=int, default=10)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = campaigns(Path(folder), max(2, given.campaigns), given.cases)
        files = [path for out in found for path in out.glob("shard-*.parquet")]

        def compare(*folders: Path) -> tuple[float, float]:
            command = [sys.executable, "-m", "parcours", "compare", *map(str, folders)]
            return least(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL))

        small = Path(folder) / "small"
        study = system_study("original", seed=1)
        run_campaign(study, study.campaign(16, 16), small, workers=1)
        start, whole = compare(small, small), compare(*found)
        limit = least(lambda: [hashlib.sha256(path.read_bytes()).digest() for path in files])
    n = given.cases * len(found)
    print(f"two campaigns of 16 cases:     {start[0]:6.2f} s, {start[1]:6.2f} s of processor time")
    print(f"{len(found)} campaigns of {given.cases:,d} cases: {whole[0]:6.2f} s, {whole[1]:6.2f} s of processor time")
    print(f"beyond that start:             {1e6 * (whole[0] - start[0]) / n:6.3f} s for a million cases")
    print(f"reading and summing the files: {1e6 * limit[1] / n:6.3f} s of processor time for a million cases")
    print(f"processor time to that limit:  {(whole[1] - start[1]) / limit[1]:6.2f}")


if __name__ == "__main__":
    main()

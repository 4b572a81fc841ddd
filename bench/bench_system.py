"""How many system cases one core runs in a second, and how that compares with running them in real time.

python bench/bench_system.py --cases 905          with compiled kernels on disk
python bench/bench_system.py --cases 905 --cold   in a process of its own with an empty cache: compiling is timed
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time

from parcours.kernels import is_warm
from parcours.studies.ramp_system.study import PUBLISHED_CASES, SCHEDULES, TIME_LIMIT, system_study

REAL_TIME = 1.0 + TIME_LIMIT
"""What one case takes in real time: the static second and the test [s]."""

_FIRST_CASES = """
import time
begun = time.perf_counter()
from parcours.studies.ramp_system.study import SCHEDULES, system_study
for schedule in SCHEDULES:
    system_study(schedule)(0, 1)
print(time.perf_counter() - begun)
"""


def compile_seconds() -> float:
    """Return how long a fresh process with an empty cache takes to its first result of each schedule [s]."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", _FIRST_CASES],
            env={**os.environ, "PARCOURS_CACHE_DIR": folder},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
    return float(done.stdout)


def main() -> None:
    """Time both schedules one after the other and print the figures; the last line is for machines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=PUBLISHED_CASES, help="cases a schedule")
    parser.add_argument("--seed", type=int, default=0, help="campaign seed")
    parser.add_argument("--cold", action="store_true", help="time compiling, too")
    chosen = parser.parse_args()
    if chosen.cases < 1:
        parser.error(f"--cases must be at least 1, but is {chosen.cases}")
    if chosen.cold:
        print(f"compiling, from an empty cache to the first results: {compile_seconds():.1f} s")
    if not is_warm():
        print("no compiled kernels on disk: compiling first, which is not timed here")
    rates = []
    for schedule in SCHEDULES:
        study = system_study(schedule, seed=chosen.seed)
        study(0, 1)
        begun = time.perf_counter()
        study(0, chosen.cases)
        taken = time.perf_counter() - begun
        rates.append(chosen.cases / taken)
        print(
            f"{schedule:>8}: {chosen.cases} cases in {taken:.2f} s, {rates[-1]:.0f} cases/s/core,"
            f" {REAL_TIME * rates[-1]:.0f} times real time"
        )
    both = len(rates) / sum(1.0 / rate for rate in rates)
    print(f"{'both':>8}: {REAL_TIME * both:.0f} times real time ({REAL_TIME:.0f} s a case)")
    print(f"system cases/s/core: {both:.0f}")


if __name__ == "__main__":
    main()

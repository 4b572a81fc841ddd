"""How the cost of system cases of RAMP grows: with obstacles, with the population, with the number of cases.

python bench/bench_growth.py --cases 100

Rooms of 1 to 50 obstacles are put together from the drawings of several cases and drawn before the clock starts, so
obstacles may pass through each other, and the more there are, the more often the robot halts and the longer a case
lasts: costs are therefore processor time per simulated second. A straight line is fitted to them, whose R2 says how
straight they lie. The numbers of cases are campaigns in processes of their own, so that their memory is their own; by
`run_campaign` with one worker, results written to a folder. Everything is published cases (1 + 20 s at most).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours.run.campaign import run_campaign
from parcours_navigation.cases.family import SystemCases
from parcours_ramp.planner.messages import MAX_POPULATION
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study

OBSTACLES = (1, 2, 3, 5, 10, 20, 30, 40, 50)
POPULATIONS = (1, 2, 5, 10, MAX_POPULATION)
CASES = (100, 1_000, 10_000)

_APART = 100_000
"""Between the numbers of the cases whose obstacles share a room."""


@dataclass(frozen=True, slots=True, eq=False)
class Rooms(SystemCases):
    """Cases drawn beforehand, of any number of obstacles: array of OBSTACLE, shape (n, k)."""

    drawn: Record = None

    def obstacles(self, numbers: NDArray[np.int64]) -> Record:
        """Return the obstacles of the cases as they were drawn."""
        return self.drawn[numbers].copy()


def rooms(seed: int, n: int, k: int) -> Rooms:
    """Return n cases of k obstacles each."""
    cases = SystemCases(seed)
    parts = [cases.obstacles(np.arange(n) + part * _APART) for part in range(-(-k // 3))]
    return Rooms(seed, drawn=np.concatenate(parts, axis=1)[:, :k].copy())


def cost(study: SystemStudy, cases: int, tries: int) -> tuple[float, float]:
    """Return processor time for a case [s] and for a simulated second [s], best of several runs."""
    study(0, 1)
    best, facts = np.inf, study(0, 1)
    for _ in range(tries):
        begun = time.process_time()
        facts = study(0, cases)
        best = min(best, time.process_time() - begun)
    return float(best) / cases, float(best / (facts["t_end"].sum() * 1e-9))


def grow(what: str, studies: Iterable[tuple[int, SystemStudy]], cases: int, tries: int) -> None:
    """Print a line for each size, and the straight line through them."""
    sizes, costs = [], []
    for size, study in studies:
        a_case, a_second = cost(study, cases, tries)
        sizes.append(float(size))
        costs.append(1e6 * a_second)
        print(
            f"{study.parameters.schedule:>10} {size:>4} {what:<10} {1e3 * a_case:>8.3f} ms/case {1.0 / a_case:>6.0f}"
            f" cases/s {1e6 * a_second:>8.1f} us/simulated s {1.0 / a_second:>8.0f} x real time",
            flush=True,
        )
    slope, at_none = np.polyfit(sizes, costs, 1)
    left = np.array(costs) - at_none - slope * np.array(sizes)
    straight = 1.0 - float(np.sum(left**2) / np.sum((np.array(costs) - np.mean(costs)) ** 2))
    ratio, growth = costs[-1] / costs[0], sizes[-1] / sizes[0]
    print(
        f"{'':>10} line: {at_none:.1f} us + {slope:.2f} us for each of the {what}, R2 = {straight:.3f};"
        f" {growth:.0f} times the {what} cost {ratio:.1f} times as much\n"
    )


def campaign(schedule: str, seed: int, cases: int) -> dict[str, float]:
    """Return what one campaign took, in this process: seconds of processor time, and memory [MB] at peak and before."""
    study = dataclasses.replace(system_study(schedule, seed=seed), watched_on=0.0)
    study(0, 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        run_campaign(study, study.campaign(cases), Path(folder), workers=1)
        taken = time.process_time() - begun
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {"taken": taken, "before": before / 1024, "peak": after / 1024}


def main() -> None:
    """Print three tables for each schedule."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100, help="cases for each number of obstacles or members")
    parser.add_argument("--seed", type=int, default=0, help="campaign seed")
    parser.add_argument("--tries", type=int, default=3, help="the best of this many runs counts")
    parser.add_argument("--one", nargs=2, metavar=("SCHEDULE", "CASES"), help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        print(json.dumps(campaign(chosen.one[0], chosen.seed, int(chosen.one[1]))))
        return
    for option in ("cases", "tries"):
        if getattr(chosen, option) < 1:
            parser.error(f"--{option} must be at least 1, but is {getattr(chosen, option)}")
    drawn = {k: rooms(chosen.seed, chosen.cases, k) for k in sorted({3, *OBSTACLES})}
    for schedule in SCHEDULES:
        study = dataclasses.replace(system_study(schedule, seed=chosen.seed), watched_on=0.0)
        crowds = ((k, dataclasses.replace(study, cases=drawn[k])) for k in OBSTACLES)
        grow("obstacles", crowds, chosen.cases, chosen.tries)
        study = dataclasses.replace(study, cases=drawn[3])
        members = (
            (n, dataclasses.replace(study, parameters=dataclasses.replace(study.parameters, population=n)))
            for n in POPULATIONS
        )
        grow("members", members, chosen.cases, chosen.tries)
    first = 0.0
    for schedule in SCHEDULES:
        for cases in CASES:
            arguments = [sys.executable, __file__, "--seed", str(chosen.seed), "--one", schedule, str(cases)]
            got = json.loads(subprocess.run(arguments, stdout=subprocess.PIPE, text=True, check=True).stdout)
            first = got["peak"] if cases == CASES[0] else first
            print(
                f"{schedule:>10} {cases:>6} cases {got['taken']:>8.2f} s {1e3 * got['taken'] / cases:>8.3f} ms/case;"
                f" peak {got['peak']:>4.0f} MB, of which {got['before']:.0f} MB before the first of them;"
                f" {got['peak'] / first:.2f} x",
                flush=True,
            )


if __name__ == "__main__":
    main()

"""Robustness of requirements: the kernel against rtamt, and what a dozen formulas cost a case.

python bench/bench_requirements.py                   10 000 random formulas and traces against rtamt; costs
python bench/bench_requirements.py --formulas 1000   fewer

All times are of the processor.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from parcours_navigation.cases.family import SystemCases
from parcours_navigation.requirements.kernel import judge
from parcours_navigation.requirements.programs import compile_formulas
from parcours_navigation.requirements.requirement import Monitor, Requirements, requirements_of
from parcours_navigation.study.study import NavigationStudy
from parcours_ramp.system.study import system_study

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from temporal_logic import by_rtamt, draw_formula, draw_traces, ours, to_rtamt

DOZEN = {
    "keeps-away": "always[0, end] (clearance > 0.05)",
    "stops": "always (imminent -> eventually[0, 1.5 s] speed < 0.01)",
    "arrives": "eventually[0, 20 s] goal_distance < 0.2",
    "turns-slowly": "always (abs(yaw_rate) < 1.2)",
    "slow-near": "always (clearance < 0.3 -> speed < 0.2 or eventually[0, 0.5 s] speed < 0.2)",
    "waits": "clearance > 0.1 until[0, 10 s] goal_distance < 1",
    "gentle": "always (acceleration > -0.9 and acceleration < 0.9)",
    "goes": "always[0, 15 s] (speed < 0.01 -> eventually[0, 3 s] speed > 0.05)",
    "looks": "always[2 s, end] (abs(heading_error) < 1.5 or speed < 0.1)",
    "progress": "always[0, 15 s] (goal_distance < 0.3 or eventually[0, 5 s] speed > 0.1)",
    "safe-stop": "always (clearance < 0.1 -> speed < 0.1 until[0, 2 s] clearance > 0.15)",
    "in-arena": "always (x > -0.5 and x < 2.5 and y > -0.5 and y < 2.5)",
}


def compare(n: int, seed: int) -> None:
    """Print how many formulas disagree with rtamt, and the times of both."""
    rng = np.random.default_rng(seed)
    wrong = infinite = 0
    largest = took = theirs_took = 0.0
    ours([draw_formula(rng)], draw_traces(rng, 3))  # compiled
    for _ in range(n):
        traces, formula = draw_traces(rng, int(rng.integers(2, 60))), draw_formula(rng)
        begun = time.thread_time()
        found = float(ours([formula], traces)[0])
        between = time.thread_time()
        theirs = by_rtamt(formula, traces)
        took, theirs_took = took + between - begun, theirs_took + time.thread_time() - between
        infinite += np.isinf(theirs)
        if found != theirs:
            largest = max(largest, abs(found - theirs))
            if not abs(found - theirs) <= 1e-12:
                wrong += 1
                print(f"  {found} and {theirs}: {to_rtamt(formula, len(traces['a']))}")
    print(f"{n} random formulas and traces (seed {seed}): {wrong} differ from rtamt by more than 1e-12; largest")
    print(f"difference {largest:g}; {infinite} are infinite; {1e6 * took / n:.0f} us a formula with its compilation,")
    print(f"rtamt {1e6 * theirs_took / n:.0f} us with its parsing")


def best(function: Callable[[], object], times: int, rounds: int = 7) -> float:
    """Return the least mean time of a call [us]."""
    found = np.inf
    for _ in range(rounds):
        begun = time.thread_time()
        for _ in range(times):
            function()
        found = min(found, (time.thread_time() - begun) / times * 1e6)
    return float(found)


def costs(cases: int) -> None:
    """Print what a dozen formulas cost, alone and in cases."""
    asked = requirements_of(DOZEN)
    plain = NavigationStudy("orca", SystemCases(1))
    _, track, places = plain.track(0)
    entries = np.zeros((len(track), 7 + 2 * places.shape[1]))
    for k, name in enumerate(track.dtype.names or ()):
        entries[:, k] = track[name]
    entries[:, 7:] = places.reshape(len(track), -1)
    radii, goal = np.full(places.shape[1], 0.1), (2.0, 2.0)
    n = len(compile_formulas([one.formula for one in asked.formulas]).code)

    def alone_of(requirements: Requirements) -> float:
        monitor, found = Monitor(requirements, len(track) + 2), np.zeros((2, len(requirements.formulas)))
        program = monitor.program
        arrays = program.code, program.roots, program.wanted, monitor.memory, monitor.absent, *found
        return best(lambda: judge(entries, entries[-1], radii, 0.125, *goal, *arrays), 1000)

    alone = alone_of(asked)
    print(f"\n12 formulas ({n} instructions) over a track of {len(track)} samples: {alone:.1f} us, signals included")
    print(f"one of them alone: {alone_of(requirements_of({'one': 'always clearance > 0.05'})):.1f} us")

    def paired(before: Callable[[], object], after: Callable[[], object], name: str) -> None:
        before(), after()
        gaps: list[float] = []
        base: list[float] = []
        for k in range(26):  # which goes first alternates: the second of a pair may be the slower for that
            for function, taken in ((before, base), (after, gaps))[:: 1 if k % 2 else -1]:
                begun = time.thread_time()
                function()
                taken.append((time.thread_time() - begun) / cases * 1e6)
        least, with_them = min(base), min(gaps)
        share, median = 100 * (with_them / least - 1), 100 * float(np.median(np.array(gaps) / np.array(base)) - 1)
        print(f"{name}: {least:.0f} us a case, with a dozen formulas {with_them:.0f} us ({share:+.1f} %; "
              f"median of pairs {median:+.1f} %)")  # fmt: skip

    orca = judged(plain, asked)
    paired(lambda: plain(0, cases), lambda: orca(0, cases), "planner in Python (orca)")

    def crawl(observation: object) -> tuple[float, float]:
        return 0.1, 0.0

    lone = NavigationStudy(crawl, SystemCases(1))
    idle = judged(lone, asked)
    paired(lambda: lone(0, cases), lambda: idle(0, cases), "planner that does nothing")
    ramp = system_study("guarded", seed=1)
    with_them = dataclasses.replace(ramp, requirements=asked)
    paired(lambda: ramp(0, cases), lambda: with_them(0, cases), "RAMP's own loop")


def judged(study: NavigationStudy, asked: Requirements) -> NavigationStudy:
    """Return the study with requirements."""
    return dataclasses.replace(study, requirements=asked)


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--formulas", type=int, default=10_000)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    costs(given.cases)
    print()
    compare(given.formulas, given.seed)


if __name__ == "__main__":
    main()

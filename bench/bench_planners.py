"""What the host costs a planner: cases a second on one core, for planners that cost nothing and for those that ship.

python bench/bench_planners.py

The first three do nothing but answer, so what they take is the host's: world, messages, judging. Processor time, best
of three. What is hoped for is 500 cases a second; the ratio says how far each is from that.
"""

from __future__ import annotations

import time

import numpy as np

from parcours_navigation.cases.family import SystemCases
from parcours_navigation.protocol import Answer, Observation, Trajectory
from parcours_navigation.study.study import NavigationStudy

CASES, TRIES = 256, 3
HOPED = 500.0
PATH = Trajectory(np.array([[0.0, 0.0, 0.0, 0.78539816], [21.0, 0.6, 0.6, 0.78539816]]))


def stand(observation: Observation) -> Answer:
    """Stand, as a plain function."""
    return 0.0, 0.0


def silent(observation: Observation) -> Answer:
    """Say nothing: the first command stays."""
    return None


def path(observation: Observation) -> Answer:
    """Follow one and the same trajectory, which never reaches the goal."""
    return PATH


def main() -> None:
    """Print one line a planner: cases a second, microseconds an observation."""
    cases = SystemCases(1)
    begin = time.perf_counter()
    NavigationStudy(stand, cases)(0, 1)
    print(f"first case of this process: {time.perf_counter() - begin:.2f} s")
    begin = time.process_time()
    cases.obstacles(np.arange(CASES))
    drawing = time.process_time() - begin
    print(f"drawing the cases themselves: {drawing / CASES * 1e6:.0f} us a case")
    for name, planner, n in (("a function that stands", stand, CASES), ("None", silent, CASES),
                             ("a trajectory each time", path, CASES), ("stand-still", "stand-still", CASES),
                             ("straight-ahead", "straight-ahead", CASES), ("orca", "orca", CASES // 4),
                             ("dwa", "dwa", CASES // 8), ("mppi", "mppi", CASES // 32)):  # fmt: skip
        study = NavigationStudy(planner, cases)
        study(0, 2)
        took, asked = float("inf"), 0
        for _ in range(TRIES):
            begin = time.process_time()
            facts = study(0, n)
            took = min(took, time.process_time() - begin)
            asked = int(facts["n_planning_cycles"].sum())
        print(
            f"{name:24} {n / took:>7.0f} cases/s {took / asked * 1e6:>8.2f} us an observation,"
            f" {asked / n:>4.0f} a case; {n / took / HOPED:>5.2f} x {HOPED:.0f} cases/s",
            flush=True,
        )


if __name__ == "__main__":
    main()

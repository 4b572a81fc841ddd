"""What the host costs a planner: cases a second on one core, for planners that cost nothing and for those that ship."""

from __future__ import annotations

import time

from parcours.planners.protocol import Answer, Observation, Trajectory
from parcours.studies.navigation.study import NavigationStudy
from parcours.studies.ramp_system.cases import SystemCases

CASES = 256
PATH = Trajectory([[0.0, 0.0, 0.0, 0.78539816], [21.0, 0.6, 0.6, 0.78539816]])  # type: ignore[arg-type]


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
    begin = time.process_time()
    NavigationStudy(stand, cases)(0, 1)
    print(f"first case of the process, kernels from the cache: {time.process_time() - begin:.2f} s")
    begin = time.process_time()
    import numpy as np

    cases.obstacles(np.arange(CASES))
    drawing = time.process_time() - begin
    print(f"drawing the cases themselves: {drawing / CASES * 1e6:.0f} us a case")
    for name, planner in (("a function that stands", stand), ("None", silent), ("a trajectory each time", path),
                          ("stand-still", "stand-still"), ("straight-ahead", "straight-ahead")):  # fmt: skip
        study = NavigationStudy(planner, cases)
        study(0, 2)
        begin = time.process_time()
        facts = study(0, CASES)
        took = time.process_time() - begin
        asked = int(facts["n_planning_cycles"].sum())
        print(f"{name:24} {CASES / took:7.0f} cases/s  {took / asked * 1e6:6.2f} us an observation, {asked} of them")


if __name__ == "__main__":
    main()

"""Navigation stacks on ROS 2: how fast simulated time passes, and whether anything of one case is left in the next.

python bench/bench_stacks.py --cases 20 --resets 1000

In an interpreter that has rclpy, and in a network of its own (.ci/ros2 shows how). Whole cases of the yard are driven
one after the other, by nodes that are started once. After that, short ones: each is to give the same track bit
for bit as by nodes that have just been started, whichever was before it. Processor time is that of tester and nodes.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from parcours_navigation.foreign.stack import StackPlanner, end, running
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.study.study import NavigationStudy
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import find_world

EXAMPLES = Path(__file__).parents[1] / "examples" / "ros2_navigation"
STACKS = tuple(sorted(file.stem for file in EXAMPLES.glob("*.yaml") if "\nstack:" in file.read_text()))
TICKS = os.sysconf("SC_CLK_TCK")


def study(name: str, period: float, time_limit: float | None = None) -> NavigationStudy:
    """Return the study of one of the stacks in the yard."""
    scenario = Scenario(period=period) if time_limit is None else Scenario(period=period, time_limit=time_limit)
    cases = WorldCases(1, find_world(str(EXAMPLES / "yard.yaml")))
    return NavigationStudy(StackPlanner(EXAMPLES / f"{name}.yaml"), cases, scenario)


def used(name: str) -> float:
    """Return the processor time of this process and of the nodes [s]."""
    spent = time.process_time()
    for pid in running(str(EXAMPLES / f"{name}.yaml")).processes:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        spent += (int(words[11]) + int(words[12])) / TICKS
    return spent


def speed(name: str, period: float, cases: int) -> None:
    """Print how fast whole cases are driven."""
    driven = study(name, period)
    driven.track(0)
    began, before, simulated = time.perf_counter(), used(name), 0.0
    for number in range(cases):
        simulated += float(driven.track(number)[1]["time"][-1]) * 1e-9
    took, worked = time.perf_counter() - began, used(name) - before
    print(f"{name:<14} {period * 1e3:6.0f} ms {cases:6d} {simulated / took:10.1f} x {simulated / worked:10.1f} x "
          f"{60 * cases / took:10.0f}", flush=True)  # fmt: skip


def resets(name: str, period: float, number: int) -> None:
    """Print how many short cases differ from what nodes made of them that had just been started."""
    driven = study(name, period, 0.5)
    kinds, first = 10, []
    for k in range(kinds):
        end(str(EXAMPLES / f"{name}.yaml"))
        first.append([part.tobytes() for part in driven.track(k)])
    began, differ = time.perf_counter(), 0
    for k in range(number):
        one = 7 * k * k % kinds
        differ += [part.tobytes() for part in driven.track(one)] != first[one]
    took = time.perf_counter() - began
    print(f"{name:<14} {number} resets in {took:.0f} s: {differ} cases differ", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stacks", nargs="+", default=STACKS, choices=STACKS)
    parser.add_argument("--periods", nargs="+", type=float, default=[0.1, 0.05], help="of the stacks [s]")
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--resets", type=int, default=1000)
    given = parser.parse_args()
    print(f"{'stack':<14} {'period':>9} {'cases':>6} {'sim / real':>12} {'sim / work':>12} {'cases/min':>10}")
    for name in given.stacks:
        for period in given.periods:
            speed(name, period, given.cases)
    for name in given.stacks:
        resets(name, given.periods[0], given.resets)
        end(str(EXAMPLES / f"{name}.yaml"))


if __name__ == "__main__":
    main()

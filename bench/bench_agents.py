"""What others cost: processor time of a tick against how many there are, 1 to 200, and the exponent of the growth.

python bench/bench_agents.py --cases 2000

Area grows with the number (density kept, 0.2 a square metre), or stays (20 m x 20 m); walls are a room's four and one
for each ten of the others. Best of three, decisions included: people decide at every fifth tick. The exponent is that
of the least-squares line through the logarithms, from 10 on and from 50 on, where everybody has as many neighbours as
are looked at: near 1 is near linear. Then how often people touch.
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.others.drawing import drawn
from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import ConstantVelocity, Motion, OrcaPeople, RandomWalk, SocialForcePeople

NUMBERS = (1, 2, 5, 10, 20, 50, 100, 200)
TICKS, TRIES = 1000, 3


@kernel
def run(agents: Record, ways: Record, obstacles: Record, walls: Record, ticks: int) -> None:
    """Run some ticks from the start, compiled: as a world's loop calls it."""
    begin_agents(agents, ways, obstacles, walls)
    for k in range(1, ticks + 1):
        step_agents(agents, ways, obstacles, walls, 2.0, 2.0, 0.2, 0.0, 0.3, k * 10_000_000, 0.01)


def room(side: float, n_walls: int) -> np.ndarray:
    """Return the walls of a room and short ones in it, as (ax, ay, bx, by)."""
    rng = np.random.default_rng(1)
    walls = [[0, 0, side, 0], [side, 0, side, side], [side, side, 0, side], [0, side, 0, 0]]
    for _ in range(n_walls):
        x, y = rng.uniform(0.2 * side, 0.8 * side, 2)
        walls.append([x, y, x + rng.uniform(-1, 1), y + rng.uniform(-1, 1)])
    return np.array(walls, np.float64)


def microseconds_a_tick(motion: Motion, n: int, side: float) -> float:
    """Return the processor time of one tick [us]."""
    walls = room(side, n // 10)
    crowd = drawn([Others(motion, number=n, area=(0.5, 0.5, side - 0.5, side - 0.5), radius=0.25)], 1, 0)
    best = math.inf
    for _ in range(TRIES):
        begin = time.process_time()
        run(crowd.agents, crowd.ways, crowd.obstacles, walls, TICKS)
        best = min(best, time.process_time() - begin)
    return best / TICKS * 1e6


def main() -> None:
    """Print a line for each kind and way to grow."""
    motions: dict[str, Motion] = {
        "social force": SocialForcePeople(), "ORCA": OrcaPeople(), "random walk": RandomWalk(),
        "constant velocity": ConstantVelocity(),
    }  # fmt: skip
    microseconds_a_tick(SocialForcePeople(), 1, 6.0)  # compiles
    print(f"{'us a tick':34}" + "".join(f"{n:>8}" for n in NUMBERS) + "   from 10   from 50")
    for name, motion in motions.items():
        for growth in ("density kept", "area kept"):
            took = []
            for n in NUMBERS:
                side = max(6.0, math.sqrt(n / 0.2)) if growth == "density kept" else 20.0
                took.append(microseconds_a_tick(motion, n, side))
            grown = f"{exponent(took, 10):>10.2f}{exponent(took, 50):>10.2f}"
            print(f"{name + ', ' + growth:34}" + "".join(f"{us:>8.1f}" for us in took) + grown, flush=True)


def exponent(took: list[float], least: int) -> float:
    """Return the exponent of the growth from that number on."""
    large = [k for k, n in enumerate(NUMBERS) if n >= least]
    return float(np.polyfit(np.log([NUMBERS[k] for k in large]), np.log([took[k] for k in large]), 1)[0])


@kernel
def least_gap(agents: Record, ways: Record, obstacles: Record, walls: Record, ticks: int) -> float:
    """Return the least gap of any two in some ticks from the start [m]."""
    begin_agents(agents, ways, obstacles, walls)
    least = np.inf
    for k in range(1, ticks + 1):
        step_agents(agents, ways, obstacles, walls, 1e4, 1e4, 0.0, 0.0, 0.3, k * 10_000_000, 0.01)
        for i in range(len(obstacles)):
            for j in range(i):
                dx, dy = obstacles[i].x - obstacles[j].x, obstacles[i].y - obstacles[j].y
                least = min(least, np.sqrt(dx * dx + dy * dy) - obstacles[i].radius - obstacles[j].radius)
    return least


def touching(cases: int) -> None:
    """Print how often people touch, and how deep: pairs, and 25 in a room; 20 s each, margin 0 for ORCA pairs."""
    area = (0.5, 0.5, 8.5, 8.5)
    crowds = {
        "ORCA, pairs": (Others(OrcaPeople(margin=0.0), number=2, area=area, speed_spread=0.2), np.empty((0, 4))),
        "ORCA, 25 in 9 m x 9 m": (Others(OrcaPeople(), number=25, area=area, radius=0.25), room(9.0, 0)),
        "social force, pairs": (Others(SocialForcePeople(), number=2, area=area, radius=0.25), np.empty((0, 4))),
        "social force, 25 in 9 m x 9 m": (Others(SocialForcePeople(), number=25, area=area, radius=0.25), room(9.0, 0)),
    }
    for name, (others, walls) in crowds.items():
        gaps = []
        for case in range(cases):
            crowd = drawn([others], 1, case)
            gaps.append(least_gap(crowd.agents, crowd.ways, crowd.obstacles, walls, 2000))
        touched = sum(gap < -1e-9 for gap in gaps)
        print(f"{name:34} touched in {touched} of {cases} cases; deepest {max(0.0, -min(gaps)):.3f} m", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=200, help="crowds of each kind that are watched for touching")
    main()
    touching(parser.parse_args().cases)

"""Worlds: what a case costs as they grow, and whether an independent world, pymunk's, sees the same contacts.

python bench/bench_worlds.py                    growth over obstacles, walls and people
python bench/bench_worlds.py --tracks 10000     and this many tracks against pymunk

Times are processor time of a case of 20 s with a planner that drives straight ahead, beside one in which nothing else
is. pymunk is asked every 2.5 ms of a track between whose entries, 50 ms apart, places are interpolated: a graze is a
contact that one of the two sees and that the other misses by less than 2 mm.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.facts import NEVER
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.stage.memory import Staged
from parcours_navigation.study.study import NavigationStudy
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import parse_world

PIECES = 20  # Of 50 ms
GRAZE = 2e-3  # [m]
HEAD = "parcours: world/1\nname: bench\n"
TASK = "task: {start: [1, 1, 45 deg], start_speed: 0.5 m/s, goal: [999, 999], time_limit: 20 s}\n"
ROBOT = "robot: {radius: 0.2, speed: 0.5 m/s}\n"


def cases_of(text: str, seed: int = 1) -> WorldCases:
    """Return the cases of a world."""
    return WorldCases(seed, parse_world(HEAD + text, "bench.yaml", Path()))


def study_of(text: str, seed: int = 1) -> NavigationStudy:
    """Return a study of a planner that drives straight ahead."""
    return NavigationStudy("straight-ahead", cases_of(text, seed), Scenario(time_limit=3600.0))


def grown(kind: str, n: int) -> str:
    """Return a world of n obstacles, walls or people; its area grows with their number."""
    side = max(6.0, 1.5 * math.sqrt(n))
    box = f"[2, 2, {2 + side:.2f}, {2 + side:.2f}]"
    if kind == "obstacles":
        other = f"others: [{{motion: stop-move-stop, number: {n}, radius: 0.1, area: {box}}}]\n"
    elif kind == "walls":
        rng = np.random.default_rng(1)
        at, turn = 2.0 + side * rng.random((n, 2)), rng.uniform(0, math.pi, n)
        ends = np.column_stack([at, at + 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])])
        other = f"ground: {{walls: {np.round(ends, 3).tolist()}}}\n"
    else:
        other = f"others: [{{motion: {kind}, number: {n}, radius: 0.25, area: {box}}}]\n"
    return ROBOT + other + TASK


def cost(text: str) -> float:
    """Return the processor time of a case [ms]."""
    study, numbers = study_of(text), np.arange(6)
    study.run(numbers[:1])
    taken = []
    for _ in range(3):
        begun = time.process_time()
        study.run(numbers)
        taken.append(time.process_time() - begun)
    return 1e3 * min(taken) / len(numbers)


def growth() -> None:
    """Print what a case costs as its world grows."""
    cost(ROBOT + TASK)  # a process takes twice as long for its first tenth of a second
    alone = cost(ROBOT + TASK)
    print(f"nothing else: {alone:.2f} ms a case")
    for kind, counts in (
        ("obstacles", (1, 10, 50, 100, 200)), ("walls", (10, 30, 100, 300, 1000)),
        ("social-force", (1, 10, 30, 100)), ("orca", (1, 10, 30, 100)),
    ):  # fmt: skip
        times = [cost(grown(kind, n)) for n in counts]
        more = np.maximum(np.array(times) - alone, 1e-3)
        exponent = math.log(more[-1] / more[-3]) / math.log(counts[-1] / counts[-3])
        listed = ", ".join(f"{n}: {taken:.2f}" for n, taken in zip(counts, times, strict=True))
        print(f"{kind:>13}: {listed} ms a case; exponent {exponent:.2f} over the last three")


def least_gap(
    staged: Staged, walls: NDArray[np.float64], track: NDArray[np.void], places: NDArray[np.float64]
) -> float:
    """Return the least gap that pymunk finds along a track [m]; negative in overlap."""
    import pymunk

    space = pymunk.Space()
    standing = [pymunk.Segment(space.static_body, tuple(w[:2]), tuple(w[2:]), 0.0) for w in walls.tolist()]
    space.add(*standing)
    radii, radius = staged.scene.obstacles["radius"], staged.task.robot_radius
    least = math.inf
    share = np.arange(PIECES)[:, None] / PIECES
    for i in range(len(track) - 1):
        at, to = (np.array([track[k]["x"], track[k]["y"]]) for k in (i, i + 1))
        way = at + share * (to - at)
        for k in range(places.shape[1]):
            other = places[i, k] + share * (places[i + 1, k] - places[i, k])
            least = min(least, float(np.hypot(*(other - way).T).min() - radius - radii[k]))
        for point in (way[0], way[PIECES // 2]) if len(standing) else ():
            found = space.point_query_nearest(tuple(point), radius + 0.1, pymunk.ShapeFilter())
            if found is not None and found.distance - radius < least + 0.02:
                for fine in way:
                    near = space.point_query_nearest(tuple(fine), radius + 0.1, pymunk.ShapeFilter())
                    least = min(least, near.distance - radius if near is not None else math.inf)
    return least


def agreement(n: int) -> None:
    """Print in how many of n tracks pymunk sees a contact if and only if the facts have one."""
    text = ROBOT + (
        "ground: {bounds: [0, 0, 8, 8], walls: [[4, 0, 4, 2.5], [2, 5, 5, 6]]}\n"
        "others:\n  - {motion: stop-move-stop, number: 4, radius: 0.15, area: [2, 2, 7, 7], waits: [0, 4]}\n"
        "  - {motion: social-force, number: 3, radius: 0.25, yields: 0}\n"
    )
    task = "task: {start: [1, 1, heading], start_speed: 0.5 m/s, goal: [7.5, 7.5], time_limit: 12 s}\n"
    data = "data: {parameters: {heading: {kind: angle, unit: rad, blocks: ['[0, pi/2]']}}}\n"
    study, cases = study_of(text + task + data, 5), cases_of(text + task + data, 5)
    contacts = grazes = wrong = 0
    for number in range(n):
        facts, track, places = study.track(number)
        [staged] = study.staged(np.array([number]))
        ours = facts[0]["t_contact"] != NEVER
        gap = least_gap(staged, cases.land(number).edges(), track, places)
        contacts += int(ours)
        if ours != (gap <= 0.0):
            near = abs(gap) < GRAZE
            grazes, wrong = grazes + near, wrong + (not near)
            if not near:
                print(f"  case {number}: contact {ours}, least gap by pymunk {gap:.4f} m")
        if (number + 1) % 1000 == 0:
            print(f"  {number + 1} tracks", flush=True)
    print(f"{n} tracks, {contacts} with a contact: pymunk sees another in {grazes + wrong}, of which {grazes} graze; "
          f"agreement {1 - (grazes + wrong) / n:.2%}, {1 - wrong / n:.2%} without grazes")  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tracks", type=int, default=0)
    asked = parser.parse_args()
    if asked.tracks >= 0:
        growth()
    if asked.tracks:
        agreement(asked.tracks)

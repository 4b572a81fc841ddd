"""A planner and a few of its own tracks -> how long its decisions take on this machine."""

from __future__ import annotations

import contextlib
import math
import time

import numpy as np

from parcours.arena.obstacles import move
from parcours.planners.protocol import Observation, Task
from parcours.studies.comparison.results import DecisionTimes
from parcours.studies.navigation.host import planner_seed
from parcours.studies.navigation.planners import load_planner
from parcours.studies.navigation.study import NavigationStudy
from parcours.verdict.facts import TRACK_PERIOD


def decision_times(study: NavigationStudy, n_cases: int, *, patience: float = 20.0) -> DecisionTimes | None:
    """Return how long `observe` takes on what the planner saw in its first cases; None if it fails in all of them.

    Each case is run, and its observations are shown again to a planner that was reset. The first decision of all does
    not count: it may compile.

    Args:
        study: the planner on its cases.
        n_cases: how many cases, at least 1.
        patience: no further case begins after this time [s of wall clock].
    """
    taken: list[float] = []
    begun = time.perf_counter()
    plugin = load_planner(study.planner)
    for number in range(n_cases):
        facts, track, _ = study.track(number)
        if facts[0]["error"]:
            continue
        seen = _observations(study, number, track)
        if not seen:
            continue
        with contextlib.suppress(Exception):  # what it does wrong is told by its facts
            if plugin.reset is not None:
                plugin.reset(seen[0].task)
            if not taken:
                plugin.observe(seen[0])
                if plugin.reset is not None:
                    plugin.reset(seen[0].task)
            for observation in seen:
                before = time.perf_counter()
                plugin.observe(observation)
                taken.append((time.perf_counter() - before) * 1e6)
        if time.perf_counter() - begun > patience:
            break
    if not taken:
        return None
    return DecisionTimes(float(np.median(taken)), float(np.quantile(taken, 0.99)), max(taken), len(taken))


def _observations(study: NavigationStudy, number: int, track: np.ndarray) -> list[Observation]:
    """Return what the planner saw where its track has an entry."""
    scenario = study.scenario
    task = Task(
        scenario.goal, scenario.goal_tolerance, study.cases.robot_radius, scenario.limits, scenario.period,
        scenario.arena, planner_seed(study.cases.seed, number),
    )  # fmt: skip
    obstacles = study.cases.obstacles(np.array([number]))[0].view(np.recarray)
    every = max(math.ceil(scenario.period * 1e9 / TRACK_PERIOD), 1)
    seen = []
    for entry in track[::every]:
        rows = np.zeros((len(obstacles), 6))
        for row, obstacle in zip(rows, obstacles, strict=True):
            move(obstacle, int(entry["time"]))
            row[:] = obstacle.x, obstacle.y, obstacle.heading, obstacle.v, obstacle.w, obstacle.radius
        robot = np.array([entry[name] for name in ("x", "y", "heading", "v", "w")], dtype=np.float64)
        seen.append(Observation(int(entry["time"]) * 1e-9, robot, rows, task))
    return seen

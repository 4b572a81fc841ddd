"""A planner and a few of its own tracks -> how long its decisions take on this machine, measured in another process."""

from __future__ import annotations

import contextlib
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from parcours.errors import ParcoursError
from parcours.run import heartbeat as heartbeat
from parcours.run.pool import run_tasks
from parcours_navigation.arena.obstacles import move
from parcours_navigation.comparison.results import DecisionTimes
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.guests.deadline import FIRST_CASE
from parcours_navigation.guests.host import planner_seed
from parcours_navigation.guests.planners import load_planner
from parcours_navigation.protocol import Observation, Task
from parcours_navigation.study.study import NavigationStudy


def decision_times(
    study: NavigationStudy, numbers: Sequence[int], *, patience: float = 20.0
) -> tuple[DecisionTimes | None, str]:
    """Return how long `observe` takes on what the planner saw, or None, and what went wrong meanwhile, or "".

    Each case is run, and its observations are shown again to a planner that was reset, in a process of its own, which
    is ended when a call takes much longer than the scenario allows. In each case the first decision is made twice, and
    does not count the first time: it may compile.

    Args:
        study: the planner, which must have a name, on its cases.
        numbers: of the cases: some that its own error does not end.
        patience: neither a case nor, in it, a decision begins after this time [s of wall clock].
    """
    begun, failed = time.monotonic(), ""
    with tempfile.TemporaryDirectory() as folder:
        task = _TimeCase(study, Path(folder), patience)
        forks = len(numbers) > 0 and study.prepare()
        try:
            with contextlib.closing(
                run_tasks(task, numbers, 1, _name, heartbeat_words=study.heartbeat_words, forks=forks)
            ) as done:
                for _ in done:
                    if time.monotonic() - begun > patience:
                        break
        except ParcoursError as failure:
            failed = f"its decisions could not be timed: {failure.rule}"
        taken = [np.load(file) for file in sorted(Path(folder).glob("*.npy"))]
        told = [file.read_text() for file in sorted(Path(folder).glob("*.txt"))]
    if told and not failed:
        failed = f"in {len(told)} of {len(numbers)} cases its decisions could not be timed: there it {told[0]}"
    times = np.concatenate(taken) if taken else np.zeros(0)
    if not len(times):
        return None, failed
    median, p99 = (float(np.quantile(times, q)) for q in (0.5, 0.99))
    return DecisionTimes(median, p99, float(times.max()), len(times)), failed


def _name(number: int) -> str:
    return f"the timing of case {number}"


@dataclass(frozen=True, slots=True)
class _TimeCase:
    """Times the decisions of one case, in a process that shares its words with its parent.

    Attributes:
        study: the planner on its cases.
        folder: gets a file of the times [us], or one of words on what went wrong.
        patience: no further decision is timed after this time [s of wall clock].
    """

    study: NavigationStudy
    folder: Path
    patience: float

    def __call__(self, number: int, lost: tuple[heartbeat.LostCase, ...]) -> None:
        """Time one case, unless it is lost."""
        for case in lost:
            said = "did not answer" if case.how == "hung" else f"died: its process {case.detail}"
            (self.folder / f"{number}.txt").write_text(said)
        if lost:
            return
        words = heartbeat.words(self.study.heartbeat_words)
        _at(words, number, -1.0, FIRST_CASE * self.study.scenario.call_timeout)  # it is loaded here
        plugin = load_planner(self.study.located)
        facts, track, _ = self.study.track(number)
        if facts[0]["error"]:
            said = facts[0]["reason"].decode("utf-8", "replace")
            (self.folder / f"{number}.txt").write_text(f"failed: {said}")
            return
        taken: list[float] = []
        limit = self.study.scenario.call_timeout
        seen = _observations(self.study, number, track)
        try:
            for count in (1, len(seen)):
                taken = []
                _at(words, number, -1.0, limit)
                if plugin.reset is not None:
                    plugin.reset(seen[0].task)
                begun = time.perf_counter()
                for observation in seen[:count]:
                    _at(words, number, observation.time, FIRST_CASE * limit if count == 1 else limit)
                    before = time.perf_counter()
                    plugin.observe(observation)
                    after = time.perf_counter()
                    taken.append((after - before) * 1e6)
                    if after - begun > self.patience:
                        break
        except BaseException as raised:  # also SystemExit
            (self.folder / f"{number}.txt").write_text(f"raised {type(raised).__name__}")
        finally:
            words[heartbeat.CASE] = heartbeat.NO_CASE
        np.save(self.folder / f"{number}.npy", np.array(taken))


def _at(words: heartbeat.Words, number: int, now: float, limit: float) -> None:
    """Tell the parent where this process is: the case, the time in it, and how long it may stay there [s]."""
    words[heartbeat.TIME], words[heartbeat.LIMIT], words[heartbeat.CASE] = now * 1e9, limit, number


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

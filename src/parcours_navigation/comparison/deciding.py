"""Measures in another process how long the decisions of a planner take on this machine, on what it saw in its cases."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from parcours.errors import ParcoursError
from parcours.run import heartbeat as heartbeat
from parcours.run.workers import Crew, Done, Lost, failure_of
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
    does not count the first time: it may compile. Neither a case nor a decision starts after `patience` [s].
    """
    begun, failed = time.monotonic(), ""
    taken: list[float] = []
    faults: list[str] = []
    forks = len(numbers) > 0 and study.prepare()
    try:
        work = Crew(_TimeCase(study, patience), 1, forks=forks, n_words=study.heartbeat_words)
        with contextlib.closing(work) as crew:
            crew.pending.extend((number, (number,)) for number in numbers)
            for number, answer in crew.answers():
                if isinstance(answer, Done):
                    taken += answer.result[0]
                    faults += [answer.result[1]] if answer.result[1] else []
                elif isinstance(answer, Lost):
                    faults.append("did not answer" if answer.how == "hung" else f"died: its process {answer.ending}")
                else:
                    raise failure_of(f"the timing of case {number}", answer)
                if time.monotonic() - begun > patience:
                    break
    except ParcoursError as failure:
        failed = f"its decisions could not be timed: {failure.rule}"
    if faults and not failed:
        failed = f"in {len(faults)} of {len(numbers)} cases its decisions could not be timed: there it {faults[0]}"
    if not taken:
        return None, failed
    times = np.array(taken)
    median, p99 = (float(np.quantile(times, q)) for q in (0.5, 0.99))
    return DecisionTimes(median, p99, float(times.max()), len(times)), failed


@dataclass(frozen=True, slots=True)
class _TimeCase:
    """Times the decisions of one case, in a process that shares its words with its parent."""

    study: NavigationStudy
    patience: float  # no further decision is timed after this time [s of wall clock]

    def __call__(self, number: int) -> tuple[list[float], str]:
        """Return the times of one case [us], and what went wrong, or ""."""
        words = heartbeat.words(self.study.heartbeat_words)
        _at(words, number, -1.0, FIRST_CASE * self.study.scenario.call_timeout)  # it is loaded here
        plugin = load_planner(self.study.located)
        facts, track, _ = self.study.track(number)
        if facts[0]["error"]:
            return [], f"failed: {facts[0]['reason'].decode('utf-8', 'replace')}"
        taken: list[float] = []
        wrong, limit = "", self.study.scenario.call_timeout
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
            wrong = f"raised {type(raised).__name__}"
        finally:
            words[heartbeat.CASE] = heartbeat.NO_CASE
        return taken, wrong


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

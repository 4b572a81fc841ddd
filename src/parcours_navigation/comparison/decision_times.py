"""Measures in another process how long the decisions of a planner take on this machine, on what it saw in its cases."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from parcours.errors import ParcoursError
from parcours.run import heartbeat as heartbeat
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours_navigation.arena.obstacles import move
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.comparison.results import DecisionTimes
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.guests.deadline import FIRST_CASE
from parcours_navigation.guests.host import GuestHost
from parcours_navigation.guests.planner_tasks import planner_seed
from parcours_navigation.guests.planners import Plugin, load_planner
from parcours_navigation.protocol import Answer, Observation, Task
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
        work = Crew(
            _TimeCase(study, patience), 1, forks=forks, n_words=study.heartbeat_words, strangers=True,
            patience=study.patience_to_load,
        )  # fmt: skip
        with contextlib.closing(work) as crew:
            crew.pending.extend((number, (number,)) for number in numbers)
            for number, answer in crew.answers():
                if isinstance(answer, Done):
                    taken += answer.result[0]
                    faults += [answer.result[1]] if answer.result[1] else []
                elif isinstance(answer, Lost):
                    how = {"hung": "did not answer", "died": f"died: its process {answer.ending}"}
                    faults.append(how.get(answer.how, answer.place))
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
        plugin = load_planner(self.study.found_as, self.study.known.source if self.study.known else None)
        if not isinstance(self.study.cases, SystemCases):
            return self._in_world(plugin, number)
        facts, track, _ = self.study.track(number)
        if facts[0]["error"]:
            return [], f"failed: {facts[0]['reason'].decode('utf-8', 'replace')}"
        taken: list[float] = []
        wrong, limit = "", self.study.scenario.call_timeout
        seen = _observations(self.study, number, track)
        try:
            for count in (1, len(seen)):
                taken = []
                heartbeat.enter(number, limit)
                if plugin.reset is not None:
                    plugin.reset(seen[0].task)
                begun = time.perf_counter()
                for observation in seen[:count]:
                    heartbeat.enter(number, FIRST_CASE * limit if count == 1 else limit)
                    before = time.perf_counter()
                    plugin.observe(observation)
                    after = time.perf_counter()
                    taken.append((after - before) * 1e6)
                    if after - begun > self.patience:
                        break
        except BaseException as raised:  # also SystemExit
            wrong = f"raised {type(raised).__name__}"
        finally:
            heartbeat.leave()
        return taken, wrong

    def _in_world(self, plugin: Plugin, number: int) -> tuple[list[float], str]:
        """Return the times of the decisions of one case of a world, run with the planner; the first does not count."""
        taken: list[float] = []

        def observe(observation: Observation) -> Answer:
            before = time.perf_counter()
            answer = plugin.observe(observation)
            taken.append((time.perf_counter() - before) * 1e6)
            return answer

        host = GuestHost(replace(plugin, observe=observe), self.study.setting(), self.study.heartbeat_words)
        facts = host.run(self.study.staged(np.array([number])), self.study.cases.seed)
        wrong = facts[0]["reason"].decode("utf-8", "replace") if facts[0]["error"] else ""
        return taken[1:], f"failed: {wrong}" if wrong else ""


def _observations(study: NavigationStudy, number: int, track: np.ndarray) -> list[Observation]:
    """Return what the planner saw where its track has an entry."""
    scenario = study.scenario
    assert isinstance(study.cases, SystemCases)
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

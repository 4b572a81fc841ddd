"""The system study: numbered cases, run compiled -> facts; and what is needed to run them as a campaign."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, require_known
from parcours.kernels import Record, kernel, require_numba
from parcours.run.store import Campaign
from parcours_navigation.cases.family import LONGEST, TIME_LIMIT, WATCHED_ON, Protocol, SystemCases
from parcours_navigation.facts import TRACK, TRACK_PERIOD
from parcours_navigation.requirements.judging import joined
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Monitor, Requirements
from parcours_navigation.study.study import code_digest
from parcours_navigation.worlds.paper import ArenaCases
from parcours_ramp.planner.latency import Latencies
from parcours_ramp.planner.messages import OBSTACLE_STATE, PREDICTION, one
from parcours_ramp.planner.parameters import Parameters, guarded, original
from parcours_ramp.system.closed_loop import Floats, run_case
from parcours_ramp.system.ramp_facts import FACTS
from parcours_ramp.system.workspace import SETTING, WORKSPACE

Track = tuple[NDArray[np.void], NDArray[np.void], Floats]
"""Of one case: facts, array of FACTS of shape (1,); track, array of TRACK, shape (n,); places, shape (n, k, 2) [m]."""

STUDY = "ramp_system"  # The name with which ids of its cases begin

SCHEDULES = ("original", "guarded")

_JUDGED_TOGETHER = 16  # cases whose tracks are kept at once

LIVE_FILE = "live.jsonl"  # by which a folder holds cases that ran in real time


@dataclass(frozen=True, slots=True)
class SystemStudy:
    """RAMP with one schedule on one family of cases; callable as a campaign's `simulate`.

    Raises BadRequest: a time is out of its range, or cases and planner have robots of different size.
    """

    cases: SystemCases  # the cases
    parameters: Parameters  # of RAMP
    latencies: Latencies = dataclasses.field(default_factory=Latencies)  # how long its work takes
    time_limit: float = TIME_LIMIT  # length of a test [s]; see `SystemCases.end` from when on
    watched_on: float = WATCHED_ON  # how long an unfinished case is watched beyond its end [s]
    solid: bool = False  # whether an obstacle stops for good where it touches the robot; it drives through if not
    requirements: Requirements = NO_REQUIREMENTS  # beside the sound outcome

    def __post_init__(self) -> None:
        for name, value in (("time_limit", self.time_limit), ("watched_on", self.watched_on)):
            least = 0.0 if name == "watched_on" else 0.01
            if not least <= value <= LONGEST:
                _refuse(name, f"it must be from {least:g} to {LONGEST:g} s, but is {value} s")
        radius, planned = self.cases.robot_radius, self.parameters.robot_radius
        if radius != planned:
            _refuse("robot_radius", f"cases and planner must agree, but have {radius} m and {planned} m")

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return the facts of cases first .. first + count - 1, array of FACTS of shape (count,)."""
        return self.run(np.arange(first, first + count))

    @property
    def answers(self) -> str:
        """How long RAMP's work takes in the simulated world."""
        return "after its published durations"

    @property
    def heartbeat_words(self) -> int:
        """None are shared with a parent: RAMP is no stranger."""
        return 0

    def prepare(self) -> bool:
        """Load or compile the kernels, and derive the start vectors, that every case needs; all of it is ours."""
        self._run(np.arange(0))
        return True

    def run(self, numbers: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the facts of the cases, shape (n,): FACTS, and the robustness of requirements; each by itself."""
        results = np.full((len(numbers), 2, len(self.requirements.formulas)), np.nan)
        facts = self._run(numbers, results if self.requirements.formulas else None)[0]
        return joined(facts, dict(zip(numbers.tolist(), results, strict=True)), self.requirements)

    def track(self, number: int) -> Track:
        """Return facts, track and the obstacles' places of one case run again, for a replay."""
        facts, track, places = self._run(np.array([number]))
        n = int(facts[0]["n_track"])
        return facts, track[:n], places[:n]

    def _run(self, numbers: NDArray[np.int64], results: Floats | None = None) -> Track:
        """Return the facts of the cases, and the working memory in which the last one has left its track.

        `results` receives what `Monitor.judge` finds in each case, shape (n, 2, n_requirements).
        """
        require_numba("simulating the world")
        facts = np.zeros(len(numbers), FACTS)
        obstacles = self.cases.obstacles(numbers)
        n = obstacles.shape[1]
        length = int((self.cases.end(self.time_limit) + self.watched_on) * 1e9 / TRACK_PERIOD) + 2
        track, places = np.zeros(length, TRACK), np.zeros((length, n, 2))
        setting, work, radii = self.setting(), one(WORKSPACE), np.zeros(n)
        given = (
            setting, self.parameters.record(), self.latencies.record(), work, np.zeros(n, OBSTACLE_STATE),
            np.zeros(n, PREDICTION), np.zeros(n, PREDICTION),
        )  # fmt: skip
        monitor = None if results is None else Monitor(self.requirements, length + 1)
        together = max(len(numbers), 1) if monitor is None else _JUDGED_TOGETHER
        entries = np.empty((0 if monitor is None else together, length + 1, 7 + 2 * n))
        lengths = np.zeros(len(entries), np.int64)
        for first in range(0, max(len(numbers), 1), together):
            some = slice(first, first + together)
            _run_cases(numbers[some], obstacles[some], *given, facts[some], track, places, radii, entries, lengths)
            if monitor is not None and results is not None:
                reaches, goal = np.ascontiguousarray(obstacles[some]["radius"]), (setting.goal_x, setting.goal_y)
                for k, found in enumerate(results[some]):
                    rows = entries[k, : lengths[k] + 1]
                    found[:] = monitor.judge(rows[:-1], rows[-1], reaches[k], self.cases.robot_radius, goal)
        return facts, track, places

    def setting(self) -> Record:
        """Return the SETTING of the paper: start (0, 0) heading 45 degrees at 0.249 m/s, goal (2, 2).

        Under the published protocol RAMP is told that speed, but the robot stands until its first trajectory arrives.
        """
        setting = one(SETTING)
        setting.seed = self.cases.seed
        setting.limit = round(self.cases.end(self.time_limit) * 1e9)
        setting.extension = round(self.watched_on * 1e9)
        setting.robot_heading, setting.told_speed = 0.7853981633974483, 0.249
        setting.starts_late = self.cases.protocol == "published"
        setting.robot_speed = 0.0 if setting.starts_late else setting.told_speed
        setting.solid = self.solid
        setting.goal_x = setting.goal_y = 2.0
        setting.goal_tolerance = 0.2
        return setting

    def campaign(self, n_cases: int, shard_size: int | None = None) -> Campaign:
        """Return the campaign of cases 0 .. n_cases - 1.

        By default in about eight shards, of 64 to 2048 cases each; a large campaign has 128, of up to 8192 cases, which
        take some seconds each.
        """
        require_numba("simulating the world")  # before a folder is made
        return Campaign(
            study=STUDY,
            schedule=self.parameters.schedule,
            seed=self.cases.seed,
            n_cases=n_cases,
            dtype=self.requirements.facts(FACTS),
            parameters={
                "code": ramp_digest(),
                "protocol": self.cases.protocol,
                "robot_radius": self.cases.robot_radius,
                "obstacle_radius": self.cases.obstacle_radius,
                "planner": dataclasses.asdict(self.parameters),
                "latencies": dataclasses.asdict(self.latencies),
                "time_limit": self.time_limit,
                "watched_on": self.watched_on,
                "solid": self.solid,
                **(self.cases.of.manifest() if isinstance(self.cases, ArenaCases) else {}),
                **self.requirements.manifest(),
            },
            shard_size=shard_size or max(min(max(n_cases // 8, 64), 2048), min(n_cases // 128, 8192)),
        )


def _refuse(name: str, rule: str) -> None:
    raise BadRequest(f"system study, {name}", rule, slug="study-range")


def ramp_digest() -> str:
    """Return a digest of all that the bits of a case depend on."""
    here = Path(__file__).parent
    return code_digest(str(here.parent / "planner"), str(here))


@kernel
def _run_cases(
    numbers: Record, obstacles: Record, setting: Record, parameters: Record, latencies: Record, work: Record,
    seen: Record, predictions: Record, guarded: Record, facts: Record, track: Record, places: Floats, radii: Floats,
    entries: Floats, lengths: Record,
) -> None:  # fmt: skip
    """Run the cases one after the other; shapes as in `run_case`, with the cases as leading axis.

    Where `entries` has room for cases, shape (n, length of the track + 1, 7 + 2 n_obstacles), it receives their tracks
    as requirements are judged over them, and `lengths` how long these are; the state at the end of the case follows.
    """
    for k in range(len(numbers)):
        run_case(
            numbers[k], obstacles[k], setting, parameters, latencies, work, seen, predictions, guarded, facts[k], track,
            places, radii,
        )  # fmt: skip
        if len(entries):
            lengths[k] = _lay_out(facts[k], track, places, obstacles[k], work, entries[k])


@kernel
def _lay_out(facts: Record, track: Record, places: Floats, obstacles: Record, work: Record, entries: Floats) -> int:
    """Write down the track up to the end of the case, and the state there; return how many entries come before it."""
    n = 0
    while n < facts.n_track and track[n].time <= facts.t_end:
        entry = track[n]
        entries[n, 0], entries[n, 1], entries[n, 2], entries[n, 3] = float(entry.time), entry.x, entry.y, entry.heading
        entries[n, 4], entries[n, 5], entries[n, 6] = entry.v, entry.w, float(entry.halted)
        for k in range(places.shape[1]):
            entries[n, 7 + 2 * k], entries[n, 8 + 2 * k] = places[n, k, 0], places[n, k, 1]
        n += 1
    # The world stands as it did at the end, unless it was observed further: then the track has an entry there.
    robot = work.world.robot
    entries[n, 0], entries[n, 1], entries[n, 2], entries[n, 3] = float(facts.t_end), robot.x, robot.y, robot.heading
    entries[n, 4], entries[n, 5], entries[n, 6] = robot.v, robot.w, float(work.control.halt)
    for k in range(len(obstacles)):
        entries[n, 7 + 2 * k], entries[n, 8 + 2 * k] = obstacles[k].x, obstacles[k].y
    return n


def system_study(
    schedule: str, *, seed: int = 0, protocol: Protocol = "table-vii", radius: float = 0.125,
    obstacle_radius: float = 0.1,
) -> SystemStudy:  # fmt: skip
    """Return the study of the paper for one schedule.

    Args:
        radius: of the robot [m].
        obstacle_radius: [m].

    Raises BadRequest: schedule or protocol is unknown, or a radius is out of range.
    """
    require_known(schedule, SCHEDULES, "schedule", slug="unknown-schedule")
    cases = SystemCases(seed, protocol, radius, obstacle_radius, STUDY)
    make = original if schedule == "original" else guarded
    return SystemStudy(cases, make(robot_radius=radius))

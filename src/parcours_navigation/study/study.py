"""Runs numbered system cases with any planner, alone or as a campaign, and gives their facts and tracks."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

import parcours
from parcours.errors import BadRequest
from parcours.kernels import require_numba
from parcours.run.heartbeat import LostCase
from parcours.run.store import Campaign
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.cases.running import CaseStudy, Track
from parcours_navigation.guests.host import Host, host_words, hung
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault, lost
from parcours_navigation.guests.planners import SHIPPED, PlannerLike, load_planner, located, own_loop, source_digest
from parcours_navigation.guests.scenario import Scenario

_N_OBSTACLES = 3
_CHECKED = 10_000


@dataclass(frozen=True, slots=True)
class NavigationStudy:
    """A planner on one family of cases; callable as a campaign's `simulate`.

    Raises BadRequest if the planner is not one, or the robot does not fit into the arena.

    A plain function will do for a planner:

    >>> def crawl(observation):
    ...     return 0.05, 0.0
    >>> facts = NavigationStudy(crawl, SystemCases(1))(0, 4)
    >>> [round(float(way), 2) for way in facts["travelled"]]
    [1.07, 1.07, 1.07, 1.07]
    """

    planner: PlannerLike  # see `load_planner`; for a campaign it must be a name
    cases: SystemCases  # the cases
    scenario: Scenario = field(default_factory=Scenario)  # robot, goal, clock, deadlines
    # cases that are not to be run, because the planner hangs there or takes its process down
    lost: tuple[LostCase, ...] = ()
    # the planner with the whole path of its file (`located`); found out when the study is made, so that a planner that
    # changes the current folder is found all the same
    located: PlannerLike = None

    def __post_init__(self) -> None:
        require_numba("simulating the world")
        if self.located is None:
            object.__setattr__(self, "located", located(self.planner))
        self.scenario.require_room(self.cases.robot_radius)
        self._host()

    @property
    def label(self) -> str:
        """What to call the planner in a table."""
        return self.planner if isinstance(self.planner, str) else load_planner(self.planner).name

    @property
    def answers(self) -> str:
        """Empty: the planner answers at once, or after the scenario's command delay."""
        return ""

    @property
    def digest(self) -> str:
        """A digest of the planner's own source file; empty for planners that ship with Parcours."""
        return source_digest(self.located) if isinstance(self.located, str) else ""

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent."""
        return host_words(self.scenario, _N_OBSTACLES)

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the study that gives the facts of these cases as errors and does not run them."""
        return dataclasses.replace(self, lost=lost)

    def prepare(self) -> bool:
        """Compile the kernels of a shipped planner by driving it a moment; return whether it is one."""
        if self.planner not in SHIPPED:
            return False
        moment = dataclasses.replace(self.scenario, time_limit=2.0 * self.scenario.period, watched_on=0.0)
        dataclasses.replace(self, scenario=moment).run(np.arange(1))
        _host.cache_clear()  # a worker's host writes into the array that the worker shares
        return True

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return the facts of cases first .. first + count - 1, array of FACTS of shape (count,)."""
        return self.run(np.arange(first, first + count))

    def run(self, numbers: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the facts of the cases, array of FACTS of shape (n,); independent of what else is run."""
        facts = np.zeros(len(numbers), FACTS)
        left = np.ones(len(numbers), bool)
        for case in self.lost:
            for k in np.flatnonzero(numbers == case.number):
                facts[k : k + 1] = self._lost_facts(case)
                left[k] = False
        ran = np.zeros(int(left.sum()), FACTS)
        self._run(numbers[left], ran)
        facts[left] = ran
        return facts

    def track(self, number: int) -> Track:
        """Return facts, track and the obstacles' places of one case run again, for a replay or for measures."""
        facts = np.zeros(1, FACTS)
        track, places = self._run(np.array([number]), facts).track()
        return facts, track, places

    def _host(self) -> Host:
        key = self.located if isinstance(self.located, str) else id(self.located)
        end = self.cases.end(self.scenario.time_limit)
        return _host(_Same(key, self.located), self.digest, self.scenario, self.cases.robot_radius, end)

    def _run(self, numbers: NDArray[np.int64], facts: NDArray[np.void]) -> Host:
        host = self._host()
        if len(numbers):
            words = self._obstacles(numbers)
            host.run(numbers.tolist(), words, self.cases.seed, facts)
        return host

    def _obstacles(self, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the obstacles of the cases as float64 words, once they are found clear of the robot's start."""
        obstacles = np.ascontiguousarray(self.cases.obstacles(numbers))
        x, y, _ = self.scenario.start
        reach = self.cases.robot_radius + obstacles["radius"]
        gap = np.hypot(obstacles["x0"] - x, obstacles["y0"] - y) - reach
        if len(numbers) and gap.min() < 0.0:
            k = int(np.argmin(gap.min(axis=1)))
            inside = f"at ({x:g}, {y:g}) m it is {-gap[k].min():.3f} m inside"
            rule, id = f"the robot must start clear of obstacles, but {inside}", self.cases.id(int(numbers[k]))
            raise BadRequest(id, rule, "give another start, or smaller radii", slug="start-occupied")
        return obstacles.view(np.float64).reshape(len(numbers), -1)

    def _lost_facts(self, case: LostCase) -> NDArray[np.void]:
        if case.how == "hung":
            return hung(case.number, case.time, self.scenario.call_timeout)
        reason = f"died: its process {case.detail} after the observation at {case.time * 1e-9:.2f} s"
        return lost(case.number, PlannerFault.DIED, reason, case.time)

    def campaign(self, n_cases: int, shard_size: int | None = None) -> Campaign:
        """Return the campaign of cases 0 .. n_cases - 1; by default in shards of 4 to 64 cases, about 16 if they can.

        Raises BadRequest if the planner has no name under which workers could find it, or an obstacle of the first
        cases stands where the robot starts.
        """
        if not isinstance(self.planner, str):
            rule, remedy = "in a campaign it must be a name that worker processes find", "module:name or file.py:name"
            raise BadRequest(f"planner {self.label!r}", rule, remedy, slug="planner-name")
        self._obstacles(np.arange(min(n_cases, _CHECKED)))
        return Campaign(
            study="navigation",
            schedule=self.planner,
            seed=self.cases.seed,
            n_cases=n_cases,
            dtype=FACTS,
            parameters={
                "code": code_digest(),
                "planner_source": self.digest,
                "protocol": self.cases.protocol,
                "robot_radius": self.cases.robot_radius,
                "obstacle_radius": self.cases.obstacle_radius,
                "scenario": dataclasses.asdict(self.scenario),
            },
            shard_size=shard_size or min(max(n_cases // 16, 4), 64),  # a slow planner loses little by Ctrl-C
        )


@dataclass(frozen=True, slots=True)
class _Same:
    """A planner as a key: the same name, or the same object, which need not be hashable."""

    key: str | int
    planner: PlannerLike = field(compare=False)


@functools.lru_cache(maxsize=16)
def _host(planner: _Same, digest: str, scenario: Scenario, robot_radius: float, end: float) -> Host:
    """Return the host of a planner in this process; one planner object serves all its cases."""
    return Host(load_planner(planner.planner), scenario, robot_radius, _N_OBSTACLES, end)


_ENGINE_ROOMS = ("data", "model", "paths", "abtc", "suite")
_ROOMS = ("arena", "cases", "guests", "measures", "planners", "study/study.py", "facts.py", "protocol.py")


@functools.cache
def code_digest(*more: str) -> str:
    """Return a digest of all that the bits of a case depend on, also in `more` folders of other packages."""
    engine, here = Path(parcours.__file__).parent, Path(__file__).parent.parent
    roots = [*engine.glob("*.py"), *(engine / room for room in _ENGINE_ROOMS), *(here / room for room in _ROOMS)]
    digest = hashlib.sha256()
    for root in (*roots, *map(Path, more)):
        files = sorted(root.rglob("*")) if root.is_dir() else [root]
        for path in files:
            if path.suffix in (".py", ".yaml"):
                digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def study_of(planner: PlannerLike, cases: SystemCases, scenario: Scenario | None = None) -> CaseStudy:
    """Return the study that runs a planner: of its own loop if it has one, else a NavigationStudy.

    Raises BadRequest if the planner is not one, or its own loop cannot run the scenario.

    >>> study_of("orca", SystemCases(1)).scenario.watched_on
    0.0
    """
    scenario = scenario or Scenario()
    loop = own_loop(planner)
    return NavigationStudy(planner, cases, scenario) if loop is None else loop.study_of(cases, scenario)

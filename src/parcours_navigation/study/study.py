"""Runs numbered system cases with any planner, alone or as a campaign, and gives their facts and tracks."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

import parcours
from parcours.errors import BadRequest
from parcours.kernels import require_numba
from parcours.run import canaries as canaries
from parcours.run.heartbeat import LostCase
from parcours.run.serving import is_worker
from parcours.run.store import Campaign
from parcours.run.strangers import computed
from parcours.study.campaign.running import Chosen
from parcours.study.loading import SourceFile
from parcours_navigation.arena.solvability import UNSOLVABLE
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.cases.running import CaseStudy, Track
from parcours_navigation.facts import NEVER, TRACK_PERIOD
from parcours_navigation.guests.deadline import FIRST_CASE
from parcours_navigation.guests.host import GuestHost, HostSetting, hung
from parcours_navigation.guests.measuring import require_innocent
from parcours_navigation.guests.planner_facts import FACTS, PlannerFault, lost
from parcours_navigation.guests.planner_process import LOADING, Introduction, done_apart, introduce
from parcours_navigation.guests.planners import SHIPPED, PlannerLike, load_planner, own_loop
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.guests.staging import Cases, clear_obstacles, plain_scene, staged
from parcours_navigation.requirements.judging import joined
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Monitor, Requirements
from parcours_navigation.stage.memory import ROW, Staged, size_of
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.solving import solve_worlds

Floats = NDArray[np.float64]
_CHECKED = 10_000
_LOOKED_AT = 16


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
    cases: Cases  # the cases
    scenario: Scenario = field(default_factory=Scenario)  # robot, goal, clock, deadlines
    # cases that are not to be run, because the planner hangs there or takes its process down
    lost: tuple[LostCase, ...] = ()
    requirements: Requirements = NO_REQUIREMENTS  # beside the sound outcome
    # what is known of a planner that others wrote and that is given by its name: it is never loaded in this process,
    # unless this is a worker
    known: Introduction | None = None

    def __post_init__(self) -> None:
        require_numba("simulating the world")
        if isinstance(self.cases, SystemCases):
            self.scenario.require_room(self.cases.robot_radius)
        if isinstance(self.planner, str) and self.planner not in SHIPPED:
            if self.known is None:
                object.__setattr__(self, "known", introduce(self.planner, self.patience_to_load))
        else:
            self._host()
        needs = self.known.needs if self.known is not None else self._host().needs
        if needs and isinstance(self.cases, WorldCases):
            self.cases.require(needs, self.label)
        elif needs:
            rule = f"it needs {' and '.join(needs)}, but the paper's arena gives neither scan, map nor path"
            raise BadRequest(f"planner {self.label!r}", rule, "run it in a world: --world corridor-people",
                             slug="world-gives")  # fmt: skip

    @property
    def found_as(self) -> PlannerLike:
        """The planner as a worker finds it, whatever its current folder."""
        return self.planner if self.known is None else self.known.planner

    @property
    def patience_to_load(self) -> float:
        """How long a worker may give no sign of life while it is on no case [s]."""
        return max(LOADING, FIRST_CASE * self.scenario.call_timeout)

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
        return self._source.digest if self._source else ""

    @property
    def _source(self) -> SourceFile | None:
        return self.known.source if self.known is not None else None

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent."""
        if not self._is_plain:
            return 3
        setting = self.setting()
        return size_of(plain_scene(self.scenario, 0.1), setting.most_track(setting.longest))

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the study that gives the facts of these cases as errors and does not run them."""
        return dataclasses.replace(self, lost=lost)

    def prepare(self) -> bool:
        """Compile the kernels of a shipped planner by driving it a moment; return whether workers may be forked then.

        Those of a planner that is not loaded here are compiled with one that is.
        """
        if not isinstance(self.planner, str):
            return False
        if self.known is not None:
            return dataclasses.replace(self, planner="stand-still", known=None, lost=()).prepare()
        moment = dataclasses.replace(self.scenario, time_limit=2.0 * self.scenario.period, watched_on=0.0)
        asked = dataclasses.replace(self.requirements, measures=())  # those in Python are not for this process
        dataclasses.replace(self, scenario=moment, requirements=asked).run(np.arange(1))
        _host.cache_clear()  # a worker's host writes into the array that the worker shares
        return True

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return the facts of cases first .. first + count - 1, array of FACTS of shape (count,)."""
        return self.run(np.arange(first, first + count))

    def run(self, numbers: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the facts of the cases, shape (n,): FACTS, and the robustness of requirements; each by itself.

        A planner that others wrote and that is given by its name runs in a process of its own.
        """
        if self._is_elsewhere and not {case.number for case in self.lost}.issuperset(numbers.tolist()):
            chosen = Chosen(self, tuple(numbers.tolist()))
            [(_, rows)] = computed(chosen, [range(len(numbers))], 1, lambda k: "the cases", forks=self.prepare())
            return rows
        lost, order = {case.number: case for case in self.lost}, tuple(numbers.tolist())
        left = [number for number in order if number not in lost]
        monitor = self._monitor()
        ran = np.zeros(0, FACTS)
        if left:
            host = self._host()
            host.monitor = monitor
            try:
                _, ran = self._run(np.array(left))
            finally:
                host.monitor = None
        facts, found = np.zeros(len(order), FACTS), dict(zip(left, ran, strict=True))
        for k, number in enumerate(order):
            facts[k] = self._lost_facts(lost[number])[0] if number in lost else found[number]
        return joined(facts, monitor.results if monitor else {}, self.requirements, monitor.own if monitor else {})

    def _excuse(self, facts: NDArray[np.void]) -> None:
        """Note which of the unsolved cases of a world were unsolvable."""
        lost = (facts["t_goal"] == NEVER) & (facts["t_goal_after"] == NEVER) & (facts["error"] == 0)
        if isinstance(self.cases, WorldCases) and lost.any():
            known = solve_worlds(self.cases, facts["number"][lost], limit=self.scenario.time_limit)
            facts["goal_gap"][np.flatnonzero(lost)[known["answer"] == UNSOLVABLE]] = -np.inf

    @property
    def _is_elsewhere(self) -> bool:
        """Whether its planner must not run in this process."""
        return (self.known is not None or bool(self.requirements.in_python)) and not is_worker()

    def track(self, number: int) -> Track:
        """Return facts, track and the obstacles' places of one case run again, for a replay or for measures."""
        return self.track_and_gaps(number)[:3]

    def track_and_gaps(self, number: int) -> tuple[NDArray[np.void], NDArray[np.void], Floats, Floats]:
        """Return what `track` does, and the gap between robot and ground at each entry [m], shape (n,)."""
        if self._is_elsewhere:
            work = functools.partial(self.track_and_gaps, number)
            return done_apart(
                self.cases.id(number), work, n_words=self.heartbeat_words, patience=self.patience_to_load,
                forks=self.prepare(),
            )  # fmt: skip
        host, facts = self._run(np.array([number]))
        return facts, *host.track(), host.ground_gaps()

    @property
    def _is_plain(self) -> bool:
        return isinstance(self.cases, SystemCases)

    def setting(self) -> HostSetting:
        """Return what all its cases have in common."""
        scenario, cases = self.scenario, self.cases
        end = cases.end(scenario.time_limit) if isinstance(cases, SystemCases) else scenario.time_limit
        period, delay, longest, extension = (
            round(t * 1e9) for t in (scenario.period, scenario.command_delay, end, scenario.watched_on)
        )
        return HostSetting(period, delay, longest, extension, scenario.call_timeout)

    def _host(self) -> GuestHost:
        planner = self.found_as
        key = planner if isinstance(planner, str) else id(planner)
        return _host(_Same(key, planner, self._source), self.digest, self.setting(), self.heartbeat_words)

    def _monitor(self) -> Monitor | None:
        """Return what judges the requirements, with no results yet; None if there are none."""
        if not (self.requirements.formulas or self.requirements.in_python):
            return None
        monitor = _monitor(self.requirements, int(self.cases.end(self.scenario.time_limit) * 1e9 / TRACK_PERIOD) + 3)
        monitor.results.clear()
        monitor.own.clear()
        return monitor

    def _run(self, numbers: NDArray[np.int64]) -> tuple[GuestHost, NDArray[np.void]]:
        host = self._host()
        facts = host.run(self.staged(numbers), self.cases.seed)
        self._excuse(facts)
        return host, facts

    def staged(self, numbers: NDArray[np.int64]) -> Sequence[Staged]:
        """Return cases at their beginning."""
        return staged(self.cases, self.scenario, numbers)

    def _lost_facts(self, case: LostCase) -> NDArray[np.void]:
        require_innocent(case)
        time = case.time or 0
        if case.how == "hung":
            return hung(case.number, time, self.scenario.call_timeout)
        if case.how == "tampered":
            return lost(case.number, PlannerFault.TAMPERED, case.detail, time)
        when = "" if case.time is None else f" after the observation at {time * 1e-9:.2f} s"
        return lost(case.number, PlannerFault.DIED, f"died: its process {case.detail}{when}", time)

    def campaign(self, n_cases: int, shard_size: int | None = None) -> Campaign:
        """Return the campaign of cases 0 .. n_cases - 1; by default in shards of 4 to 64 cases, about 16 if they can.

        Where the planner is asked for many cases at once, shards may be as large as a batch.


        Raises BadRequest if the planner has no name under which workers could find it, or an obstacle of the first
        cases stands where the robot starts.
        """
        if not isinstance(self.planner, str):
            rule, remedy = "in a campaign it must be a name that worker processes find", "module:name or file.py:name"
            raise BadRequest(f"planner {self.label!r}", rule, remedy, slug="planner-name")
        if isinstance(self.cases, SystemCases):
            clear_obstacles(self.cases, self.scenario, np.arange(min(n_cases, _CHECKED)))
            about: dict[str, object] = {
                "protocol": self.cases.protocol, "robot_radius": self.cases.robot_radius,
                "obstacle_radius": self.cases.obstacle_radius,
            }  # fmt: skip
        else:
            self.cases.staged(range(min(n_cases, _LOOKED_AT)), self.scenario.period)
            about = self.cases.manifest()
        batch = self.known.batch_size if self.known is not None else 0
        return Campaign(
            study="navigation",
            schedule=self.planner,
            seed=self.cases.seed,
            n_cases=n_cases,
            dtype=self.requirements.facts(FACTS),
            parameters={
                "code": code_digest(),
                "planner_source": self.digest,
                **about,
                "scenario": dataclasses.asdict(self.scenario),
                **self.requirements.manifest(),
            },
            # A slow planner loses little by Ctrl-C; one for batches is quick.
            shard_size=shard_size or min(max(n_cases // (4 if batch else 16), 4), max(64, batch)),
        )


@dataclass(frozen=True, slots=True)
class _Same:
    """A planner as a key: the same name, or the same object, which need not be hashable."""

    key: str | int
    planner: PlannerLike = field(compare=False)
    source: SourceFile | None


@functools.lru_cache(maxsize=16)
def _host(planner: _Same, digest: str, setting: HostSetting, words: int) -> GuestHost:
    """Return the host of a planner in this process; one planner object serves all its cases."""
    plugin = load_planner(planner.planner, planner.source)
    canaries.accept()
    return GuestHost(plugin, setting, words)


@functools.lru_cache(maxsize=16)
def _monitor(requirements: Requirements, n_samples: int) -> Monitor:
    monitor = Monitor(requirements, n_samples)
    monitor.judge(np.zeros((0, ROW)), np.zeros(ROW), np.zeros(0), 0.0, (0.0, 0.0))  # before a planner's time counts
    return monitor


_ENGINE_ROOMS = ("data", "model", "paths", "abtc", "suite")
_ROOMS = (
    "adapters",
    "arena",
    "cases",
    "ground",
    "guests",
    "measures",
    "others",
    "planners",
    "requirements",
    "robots",
    "sensing",
    "stage",
    "worlds",
    "study/study.py",
    "facts.py",
    "protocol.py",
)


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


def study_of(
    planner: PlannerLike, cases: Cases, scenario: Scenario | None = None, requirements: Requirements = NO_REQUIREMENTS
) -> CaseStudy:
    """Return the study that runs a planner: of its own loop if it has one, else a NavigationStudy.

    Raises BadRequest if the planner is not one, or its own loop cannot run the scenario or judge requirements.

    >>> study_of("orca", SystemCases(1)).scenario.watched_on
    0.0
    """
    scenario = scenario or Scenario()
    loop = own_loop(planner)
    if loop is None:
        return NavigationStudy(planner, cases, scenario, requirements=requirements)
    if requirements.in_python:
        rule = "it runs in a loop of its own, which takes no measures in Python"
        raise BadRequest(f"planner {planner!r}", rule, "write them as formulas", slug="planner-own-loop")
    if not requirements:
        return loop.study_of(cases, scenario)
    return loop.study_of(cases, scenario, requirements)

"""Runs the campaigns of several planners on the same cases, in one folder, resumably: the results of a comparison."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.run.campaign import Interrupted, run_campaign
from parcours.run.heartbeat import LostCase
from parcours.run.store import Campaign, create
from parcours.run.strangers import Simulate
from parcours_navigation.cases.family import LONGEST, TIME_LIMIT, WATCHED_ON, Protocol, SystemCases
from parcours_navigation.cases.running import CaseStudy
from parcours_navigation.comparison.decision_times import decision_times
from parcours_navigation.comparison.results import AT_ONCE, ComparisonResults, Contender
from parcours_navigation.facts import FACTS
from parcours_navigation.guests.planners import own_loop
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.guests.staging import Cases
from parcours_navigation.measures.one_case import measures_as_published
from parcours_navigation.measures.table import PUBLISHED
from parcours_navigation.requirements.judging import own_values, robustness
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements
from parcours_navigation.requirements.tables import violations_of
from parcours_navigation.study.case_parameters import world_cases
from parcours_navigation.study.distribution import GOAL, oracle, survived
from parcours_navigation.study.study import NavigationStudy, study_of

Progress = Callable[[str, int, int], None]
"""Called with (what, done, in all)."""


def run_comparison(
    names: Sequence[str],
    folder: Path,
    *,
    n_cases: int,
    seed: int = 1,
    workers: int = 1,
    protocol: Protocol = "table-vii",
    world: str = "",
    command_delay: float = 0.0,
    measured: int = 200,
    timed: int = 3,
    requirements: Requirements = NO_REQUIREMENTS,
    progress: Progress = lambda what, done, total: None,
) -> ComparisonResults:
    """Run planners on the same cases and return what became of them. Interrupted work is resumed.

    Args:
        names: of planners (`guests.planners`); the others are tested against the first.
        folder: gets one campaign a planner, and one of its cases as published code measures them.
        n_cases, seed, protocol: which cases.
        world: in which they are, a shipped name or a file; nothing: the paper's arena.
        workers: processes.
        command_delay: from a planner's answer to the robot [s]; a planner with a loop of its own keeps its durations.
        measured: how many of the first cases are run again, to be measured as published benchmark code does.
        timed: on how many of the first cases without a planner's error its decisions are timed.
        requirements: of every case, beside the sound outcome.
        progress: called as each part goes on.

    Raises:
        BadRequest: a name is unknown or given twice, or a number is out of range.
        BadResults: the folder holds the campaign of other planners or cases under these names.
        Interrupted: Ctrl-C.
    """
    cases = world_cases({"world": world}, seed) if world else SystemCases(seed, protocol)
    entries = _entries(names, cases, command_delay, requirements)
    plans: dict[str, tuple[Campaign, Path]] = {}
    for name, study in entries.items():  # refuse what cannot be resumed before anything is computed
        plans[name] = study.campaign(n_cases), folder / folder_name(name)
        create(plans[name][1], plans[name][0])
    facts = {name: _run(study, *plans[name], workers, name, progress) for name, study in entries.items()}
    published, repeated = {}, {}
    if sample := min(measured, n_cases):
        for name, study in entries.items():
            again = Reproducing(study, frozenset(np.flatnonzero(facts[name]["error"]).tolist()))
            campaign, place = again.campaign(plans[name][0], sample), folder / f"{folder_name(name)}.as-published"
            rows = _run(again, campaign, place, workers, f"{name}, as published", progress)
            published[name] = _fields(rows, PUBLISHED)
            repeated[name] = _repeated(facts[name], rows)
    contenders = []
    for name, study in entries.items():
        decisions, untimed, kept = None, "", facts[name]
        if timed and isinstance(study, NavigationStudy):
            progress(f"{name}, time to decide", 0, 1)
            decisions, untimed = decision_times(study, np.flatnonzero(kept["error"] == 0)[:timed].tolist())
            progress(f"{name}, time to decide", 1, 1)
        at_once = f"after {1e3 * command_delay:g} ms" if command_delay else AT_ONCE
        contenders.append(
            Contender(
                name, _fields(kept, FACTS), study.answers or at_once, _reasons(kept), decisions,
                kept["measures"].copy(), published.get(name), untimed, robustness(kept, requirements).copy(),
                violations_of(kept, requirements), own_values(kept, requirements), _shown(plans[name][1]),
                repeated.get(name, (0, 0)),
            )
        )  # fmt: skip
    vectors, numbers = tuple(str(cases.vector(number)) for number in range(n_cases)), np.arange(n_cases)
    known = oracle(cases, numbers, lambda done, total: progress("which cases are solvable", done, total))
    survival = survived(cases, numbers)
    made = tuple(contenders)
    return ComparisonResults(made, cases.protocol, seed, n_cases, vectors, command_delay, known, survival, requirements)


def _shown(folder: Path) -> str:
    """Return a folder as a user would name it: from the current one, where it lies in that."""
    return str(folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder)


def folder_name(planner: str) -> str:
    """Return the name of a planner's folder: of its letters, digits, dots and dashes.

    >>> folder_name("my/planners.py:Best")
    'my-planners.py-Best'
    """
    return re.sub(r"[^A-Za-z0-9.]+", "-", planner).strip("-.") or "planner"


def _fields(rows: NDArray[np.void], wanted: np.dtype[np.void]) -> NDArray[np.void]:
    """Return some fields of the rows as an array of their own, shape (n,)."""
    plain = np.zeros(len(rows), wanted)
    for name in wanted.names or ():
        plain[name] = rows[name]
    return plain


def _entries(
    names: Sequence[str], cases: Cases, command_delay: float, requirements: Requirements
) -> dict[str, CaseStudy]:
    """Return the study of each name, refusing names that cannot stand side by side."""
    taken: dict[str, str] = {}
    for name in names:
        if (other := taken.setdefault(folder_name(name).lower(), name)) != name or list(names).count(name) > 1:
            rule = f"each planner is named once, but {name!r} and {other!r} would be kept in the same folder"
            raise BadRequest("compare", rule, "name other planners", slug="compare-twice")
    if not names:
        raise BadRequest("compare", "at least one planner is needed, but none given", slug="compare-none")
    limit = TIME_LIMIT if isinstance(cases, SystemCases) else LONGEST  # a world has a limit of its own
    at_once = Scenario(time_limit=limit, watched_on=WATCHED_ON)
    given = replace(at_once, command_delay=command_delay)
    scenes = {name: given if own_loop(name) is None else at_once for name in names}
    return {name: study_of(name, cases, scene, requirements) for name, scene in scenes.items()}


def _run(
    simulate: Simulate, campaign: Campaign, folder: Path, workers: int, what: str, progress: Progress
) -> NDArray[np.void]:
    ran = run_campaign(simulate, campaign, folder, workers=workers, progress=lambda done, n: progress(what, done, n))
    if ran.interrupted:
        raise Interrupted(str(ran))
    return ran.store.load()


def _digest_of(facts: np.void) -> int:
    """Return a number of 64 bits that stands for the judge's facts of a case."""
    content = _fields(np.array([facts]), FACTS).tobytes()
    return int.from_bytes(hashlib.sha256(content).digest()[:8], "little")


def _repeated(kept: NDArray[np.void], again: NDArray[np.void]) -> tuple[int, int]:
    """Return how many cases gave the same facts when they were run again, and how many were."""
    ran = np.flatnonzero(again["facts"])
    return sum(int(again["facts"][k]) == _digest_of(kept[k]) for k in ran), len(ran)


def _reasons(facts: NDArray[np.void]) -> tuple[str, ...]:
    if "reason" not in (facts.dtype.names or ()):
        return ()
    return tuple(bytes(reason).decode("utf-8", "replace") for reason in facts["reason"][facts["error"] != 0])


REPRODUCED = np.dtype([("number", "i8"), ("facts", "u8"), *PUBLISHED.descr])
"""What published code computes of one case, NaN where the planner's own error ended it; a digest of the new facts."""


@dataclass(frozen=True, slots=True)
class Reproducing:
    """A study's cases run again, as published code measures them; callable as a campaign's `simulate`.

    The correct measures are taken while a case runs. Those of published code need the whole track, so they are only
    taken of a sample, for comparison.
    """

    study: CaseStudy
    failed: frozenset[int] = frozenset()  # not to be run, because the planner's own error ended them
    lost: tuple[LostCase, ...] = ()  # not to be run, because the planner hangs there or takes its process down

    @property
    def heartbeat_words(self) -> int:
        """How many words a worker shares with its parent."""
        return self.study.heartbeat_words

    @property
    def patience_to_load(self) -> float:
        """How long a worker may give no sign of life while it is on no case [s]."""
        return float(getattr(self.study, "patience_to_load", np.inf))

    def prepare(self) -> bool:
        """Compile what every case needs; return whether workers may be forked then."""
        return self.study.prepare()

    def without(self, lost: tuple[LostCase, ...]) -> Self:
        """Return the same, which does not run the lost cases."""
        return replace(self, lost=lost)

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return what is computed of cases first .. first + count - 1, array of REPRODUCED of shape (count,)."""
        rows = np.zeros(count, REPRODUCED)
        skipped = self.failed | {case.number for case in self.lost}
        for row, number in zip(rows, range(first, first + count), strict=True):
            facts, found = (None, None) if number in skipped else self._measured(number)
            row["number"] = number
            row["facts"] = 0 if facts is None else _digest_of(facts)
            for name in PUBLISHED.names or ():
                row[name] = np.nan if found is None else found[name]
        return rows

    def _measured(self, number: int) -> tuple[np.void, np.void | None]:
        facts, track, places = self.study.track(number)
        if facts[0]["error"]:
            return facts[0], None
        cases, until = self.study.cases, int(facts[0]["t_end"])
        if isinstance(cases, SystemCases):
            radii, radius, goal = np.full(places.shape[1], cases.obstacle_radius), cases.robot_radius, GOAL
        else:
            assert isinstance(self.study, NavigationStudy)
            [one] = self.study.staged(np.array([number]))
            radii, radius = one.scene.obstacles["radius"], one.task.robot_radius
            goal = (one.task, *one.goals)[-1].goal
        found = measures_as_published(track, places, radii, robot_radius=radius, goal=goal, until=until)
        return facts[0], found

    def campaign(self, campaign: Campaign, n_cases: int) -> Campaign:
        """Return the campaign that runs the first cases of a campaign again."""
        name = f"{campaign.study}/as-published"
        return replace(campaign, study=name, n_cases=n_cases, dtype=REPRODUCED, shard_size=64)

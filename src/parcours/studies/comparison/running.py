"""Planners' names -> their campaigns on the same cases, in one folder, resumable -> the results of the comparison."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.arena.solvability import solve
from parcours.errors import BadRequest
from parcours.run.campaign import Simulate, run_campaign
from parcours.run.store import Campaign, create
from parcours.studies.comparison.deciding import decision_times
from parcours.studies.comparison.measuring import Measuring
from parcours.studies.comparison.results import AT_ONCE, GOAL, START, Contender, DecisionTimes, Floats, Results
from parcours.studies.navigation.planners import RAMP
from parcours.studies.navigation.scenario import Scenario
from parcours.studies.navigation.study import NavigationStudy, study_of
from parcours.studies.ramp_system.cases import Protocol, SystemCases
from parcours.studies.ramp_system.study import TIME_LIMIT, WATCHED_ON, SystemStudy
from parcours.verdict.facts import FACTS
from parcours.verdict.measures.table import MEASURES
from parcours.verdict.navigation import GOAL_TOLERANCE

Progress = Callable[[str, int, int], None]
"""Told (what, done, in all)."""


class Interrupted(Exception):
    """The user stopped the runs; what was finished is in the folder."""


def run_comparison(
    names: Sequence[str],
    folder: Path,
    *,
    n_cases: int,
    seed: int = 1,
    workers: int = 1,
    protocol: Protocol = "table-vii",
    command_delay: float = 0.0,
    measured: int = 200,
    timed: int = 3,
    progress: Progress = lambda what, done, total: None,
) -> Results:
    """Run planners on the same cases and return what became of them. Interrupted work is resumed.

    Args:
        names: of planners, as `parcours.studies.navigation.planners` knows them; the first is the one the others are
            tested against.
        folder: gets one campaign a planner, and one of measures.
        n_cases: how many cases, at least 1.
        seed: of the cases.
        workers: processes.
        protocol: which family of cases.
        command_delay: from a planner's answer to the robot [s]; RAMP keeps its published durations.
        measured: how many of the first cases are measured along their way; 0 for none.
        timed: on how many of the first cases decisions are timed; 0 for none.
        progress: told how far each part is.

    Raises:
        BadRequest: a name is unknown or given twice, or a number is out of range.
        BadResults: the folder holds the campaign of other planners or cases under these names.
        Interrupted: Ctrl-C.
    """
    entries = _entries(names, SystemCases(seed, protocol), command_delay)
    plans: dict[str, tuple[Campaign, Path]] = {}
    for name, study in entries.items():  # refuse what cannot be resumed before anything is computed
        plans[name] = study.campaign(n_cases), folder / folder_name(name)
        create(plans[name][1], plans[name][0])
    facts = {name: _run(study, *plans[name], workers, name, progress) for name, study in entries.items()}
    measures = {}
    sample = min(measured, n_cases)
    if sample:
        for name, study in entries.items():
            measuring = Measuring(study)
            campaign, place = measuring.campaign(plans[name][0], sample), folder / f"{folder_name(name)}.measures"
            measures[name] = _run(measuring, campaign, place, workers, f"{name}, measures", progress)
    contenders = []
    for name, study in entries.items():
        decisions: DecisionTimes | None = None
        if timed and isinstance(study, NavigationStudy):
            progress(f"{name}, time to decide", 0, 1)
            decisions = decision_times(study, min(timed, n_cases))
            progress(f"{name}, time to decide", 1, 1)
        contenders.append(
            Contender(
                name, base_facts(facts[name]), _answers(study, command_delay), _reasons(facts[name]), decisions,
                _columns(measures[name]) if name in measures else {},
            )
        )  # fmt: skip
    cases = SystemCases(seed, protocol)
    vectors = tuple(str(cases.vector(number)) for number in range(n_cases))
    return Results(tuple(contenders), protocol, seed, n_cases, vectors, command_delay, _oracle(cases, n_cases))


def folder_name(planner: str) -> str:
    """Return the name of a planner's folder: of its letters, digits, dots and dashes.

    >>> folder_name("my/planners.py:Best")
    'my-planners.py-Best'
    """
    return re.sub(r"[^A-Za-z0-9.]+", "-", planner).strip("-.") or "planner"


def base_facts(facts: NDArray[np.void]) -> NDArray[np.void]:
    """Return the judge's part of a study's facts, array of FACTS, shape (n,)."""
    plain = np.zeros(len(facts), FACTS)
    for name in FACTS.names or ():
        plain[name] = facts[name]
    return plain


def _entries(
    names: Sequence[str], cases: SystemCases, command_delay: float
) -> dict[str, NavigationStudy | SystemStudy]:
    """Return the study of each name, refusing names that cannot stand side by side."""
    taken: dict[str, str] = {}
    for name in names:
        other = taken.setdefault(folder_name(name).lower(), name)
        if name in list(taken.values()) and other == name and list(names).count(name) == 1:
            continue
        rule = f"each planner is named once, but {name!r} and {other!r} would be kept in the same folder"
        raise BadRequest("compare", rule, "name other planners", slug="compare-twice")
    if not names:
        raise BadRequest("compare", "at least one planner is needed, but none given", slug="compare-none")
    given = Scenario(time_limit=TIME_LIMIT, watched_on=WATCHED_ON, command_delay=command_delay)
    at_once = Scenario(time_limit=TIME_LIMIT, watched_on=WATCHED_ON)
    return {name: study_of(name, cases, at_once if name in RAMP else given) for name in names}


def _run(
    simulate: Simulate, campaign: Campaign, folder: Path, workers: int, what: str, progress: Progress
) -> NDArray[np.void]:
    outcome = run_campaign(
        simulate, campaign, folder, workers=workers, progress=lambda done, total: progress(what, done, total)
    )
    if outcome.interrupted:
        raise Interrupted(str(outcome))
    return outcome.store.load()


def _answers(study: NavigationStudy | SystemStudy, command_delay: float) -> str:
    """Return in words how long a planner's work takes in the simulated world."""
    if isinstance(study, SystemStudy):
        return "after its published durations"
    return f"after {1e3 * command_delay:g} ms" if command_delay else AT_ONCE


def _reasons(facts: NDArray[np.void]) -> tuple[str, ...]:
    if "reason" not in (facts.dtype.names or ()):
        return ()
    return tuple(bytes(reason).decode("utf-8", "replace") for reason in facts["reason"][facts["error"] != 0])


def _columns(rows: NDArray[np.void]) -> dict[str, Floats]:
    return {name: np.ascontiguousarray(rows[name]) for name in MEASURES.names or ()}


def _oracle(cases: SystemCases, n_cases: int) -> NDArray[np.void]:
    """Return what could be reached in the cases by a robot that knows the future, array of SOLVABILITY."""
    parts = []
    for first in range(0, n_cases, 4096):
        obstacles = cases.obstacles(np.arange(first, min(first + 4096, n_cases)))
        parts.append(
            solve(
                obstacles, start=START, goal=GOAL, tolerance=GOAL_TOLERANCE, limit=1.0 + TIME_LIMIT,
                v_max=Scenario().limits.speed, robot_radius=cases.robot_radius,
            )
        )  # fmt: skip
    return np.concatenate(parts)

"""The catalogue of faults x cases x schedules -> an outcome each.

The cases are those that go well without a fault: the first by number in which the robot reaches the goal soon and
without closing the gap to any obstacle, under both schedules, whichever is asked for.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, HostFailure, require_known
from parcours.run.faults import FaultPlan
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours.study.reproducing import Reruns, spread
from parcours_navigation.facts import NEVER
from parcours_ramp.faults.catalogue import CatalogueEntry
from parcours_ramp.faults.judging import UNWELCOME, CaseOutcome, RobotOutcome, judge
from parcours_ramp.planner.latency import none
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study

WATCHED = 39.0  # A case is watched for this long after its static second [s], twice as long as the paper's
SOON = 25.0  # A case goes well if the goal is reached by then [s]: the rest of the time is for what a fault delays
PATIENCE = 120.0  # A case that takes longer has hung [s of wall clock]; one takes about a second
_AGAIN = "struck cases"  # a few are run again, of those that ended badly if there are any
_BLOCK, _MOST = 64, 4096  # Cases are looked at by blocks, and at most this number of cases


@dataclass(frozen=True, slots=True)
class FaultRow:
    """One entry of the catalogue under one schedule, with one outcome per case."""

    schedule: str
    entry: CatalogueEntry
    outcomes: tuple[CaseOutcome, ...]


@dataclass(frozen=True, slots=True)
class FaultResults:
    """All rows; which cases were run, by which seed; and when each case reaches the goal without a fault [ns]."""

    seed: int
    numbers: tuple[int, ...]
    rows: tuple[FaultRow, ...]
    t_goal: dict[str, tuple[int, ...]]
    repeated: Reruns = field(default_factory=lambda: Reruns(_AGAIN))


@dataclass(frozen=True, slots=True)
class Trial:
    """One case under one fault."""

    study: SystemStudy
    number: int
    entry: CatalogueEntry
    t_goal: int

    @property
    def plan(self) -> FaultPlan:
        """The plan of faults; its seed is that of the study and the number of the case together."""
        return FaultPlan((self.study.cases.seed + self.number) % 2**63, (self.entry.fault,))

    def __str__(self) -> str:
        return f"case {self.study.cases.id(self.number)}, {self.entry}"


def faults_study(schedule: str, seed: int) -> SystemStudy:
    """Return the study whose cases are run: RAMP's work takes no time, and each case is watched for WATCHED seconds."""
    return dataclasses.replace(system_study(schedule, seed=seed), latencies=none(), time_limit=WATCHED, watched_on=0.0)


def good_cases(
    studies: Sequence[SystemStudy], count: int, most: int = _MOST
) -> tuple[tuple[int, ...], list[tuple[int, ...]]]:
    """Return the first cases that go well under every study, and for each study when they reach the goal [ns].

    Args:
        most: at most this number of cases is looked at, rounded up to a block of 64.

    Raises BadRequest: there are fewer.
    """
    numbers: list[int] = []
    times: list[list[int]] = [[] for _ in studies]
    for first in range(0, most, _BLOCK):
        if len(numbers) >= count:
            break
        facts = [study(first, _BLOCK) for study in studies]
        well = np.all([_goes_well(f) for f in facts], axis=0)
        for place in np.flatnonzero(well)[: count - len(numbers)]:
            numbers.append(first + int(place))
            for kept, f in zip(times, facts, strict=True):
                kept.append(int(f["t_goal"][place]))
    if len(numbers) < count:
        rule = f"{count} cases that pass without a fault are needed, but there are {len(numbers)}"
        raise BadRequest("faults, cases", rule, f"ask for {len(numbers)} at most", slug="fault-cases")
    return tuple(numbers), [tuple(kept) for kept in times]


def _goes_well(facts: NDArray[np.void]) -> NDArray[np.bool_]:
    reached = (facts["t_goal"] != NEVER) & (facts["t_goal"] <= SOON * 1e9)
    return np.asarray(reached & (facts["n_robot_contacts"] + facts["n_shared_contacts"] == 0))


def run_trial(trial: Trial) -> CaseOutcome:
    """Run one case under one fault and judge it."""
    plan = trial.plan
    try:
        ran = run_components(trial.study, trial.number, recording=False, faults=plan)
    except HostFailure as error:
        return CaseOutcome(trial.number, RobotOutcome.ERROR, detail=str(error))
    return judge(ran, plan.begins_ns, plan.until_ns, trial.t_goal)


def run_faults(
    entries: Sequence[CatalogueEntry], schedules: Sequence[str] = SCHEDULES, *, seed: int = 1, cases: int = 5,
    workers: int = 1,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> FaultResults:  # fmt: skip
    """Return what becomes of RAMP under each entry.

    Args:
        seed: of the cases and of what happens to which message.
        progress: given what is done, how much of it, and of how much.

    Raises BadRequest: a schedule is unknown, or there are too few cases that go well without a fault.
    """
    for schedule in schedules:
        require_known(schedule, SCHEDULES, "schedule", slug="unknown-schedule")
    numbers, reached_by = good_cases([faults_study(schedule, seed) for schedule in SCHEDULES], cases)
    studies = [faults_study(schedule, seed) for schedule in schedules]
    times = [reached_by[SCHEDULES.index(schedule)] for schedule in schedules]
    run_components(studies[0], numbers[0], 0.5)  # all that is compiled is loaded before processes are forked
    trials = [
        Trial(study, number, entry, t_goal)
        for study, reached in zip(studies, times, strict=True)
        for entry in entries
        for number, t_goal in zip(numbers, reached, strict=True)
    ]
    found: list[CaseOutcome | None] = [None] * len(trials)
    with contextlib.closing(Crew(run_trial, workers, forks=True, patience=PATIENCE)) as crew:
        crew.pending.extend((index, (trial,)) for index, trial in enumerate(trials))
        for done, (index, answer) in enumerate(crew.answers(), 1):
            number = trials[index].number
            if isinstance(answer, Lost):
                why = f"hung for {PATIENCE:g} s" if answer.how == "hung" else answer.ending
                found[index] = CaseOutcome(number, RobotOutcome.ERROR, detail=f"its process {why}")
            elif isinstance(answer, Done):
                found[index] = answer.result
            else:
                raise failure_of(f"case {number}", answer)
            progress("cases under a fault", done, len(trials))
        repeated = _repeated(crew, trials, found)
    rows = []
    for place, (schedule, entry) in enumerate((schedule, entry) for schedule in schedules for entry in entries):
        outcomes = found[place * cases : (place + 1) * cases]
        rows.append(FaultRow(schedule, entry, tuple(one for one in outcomes if one is not None)))
    return FaultResults(seed, numbers, tuple(rows), dict(zip(schedules, times, strict=True)), repeated)


def _repeated(crew: Crew[CaseOutcome], trials: Sequence[Trial], found: Sequence[CaseOutcome | None]) -> Reruns:
    """Run a few struck cases again, of those that ended badly if there are any: is all that became of them the same?

    Those whose process hung or died are left out: they have no facts.
    """
    idle = (RobotOutcome.NOT_STRUCK, RobotOutcome.ERROR)
    ended = {k: one.outcome for k, one in enumerate(found) if one is not None and one.outcome not in idle}
    bad = [k for k, outcome in ended.items() if outcome in UNWELCOME]
    again = spread(bad or list(ended))
    crew.pending.extend((k, (trials[k],)) for k in again)
    equal = sum(isinstance(answer, Done) and answer.result == found[k] for k, answer in crew.answers())
    return Reruns(_AGAIN, equal, len(again), len(ended))

"""RAMP on the same cases with ever more delay in sensing, planning or stopping -> how often it sticks, hits, arrives.

What is added to the published durations of work: `sensing`, the age of an obstacle message; `planning`, the length of a
planning or control cycle; `stop`, the way of a halt or a limit of speed to control.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, require_known
from parcours.run.store import Campaign
from parcours.verdict.statistics import Pairs, Rate, compare_pairs, wilson
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import published
from parcours_ramp.planner.latency import Latencies
from parcours_ramp.system.study import SCHEDULES, SystemStudy, ramp_digest, system_study

DELAYS = ("sensing", "planning", "stop")  # What a delay can be added to
SECONDS = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)  # How much is added [s]; the first adds nothing

QUESTIONS = ("stuck", "contact", "reached")
"""What is asked of a case: stuck in imminent collision at the end by the published rule; a contact whose gap the moving
robot caused, alone or with the obstacle; the goal reached within 20 s."""

DELAYED = np.dtype([("number", "i8"), *((name, "i1") for name in QUESTIONS)])
"""What is kept of one case under one setting: its number in the family of cases, and 1 where the answer is yes."""


@dataclass(frozen=True, slots=True)
class DelaySetting:
    """One schedule with one delay."""

    schedule: str  # "original" or "guarded"
    delay: str  # one of DELAYS; "" where none is added
    seconds: float  # how much is added [s]

    def study(self, seed: int) -> SystemStudy:
        """Return the study that runs cases under this setting; nothing is watched beyond the end."""
        plain = system_study(self.schedule, seed=seed)
        added = {f"added_{self.delay}": self.seconds} if self.delay else {}
        return dataclasses.replace(plain, latencies=Latencies(**added), watched_on=0.0)  # type: ignore[arg-type]


def settings_of(seconds: tuple[float, ...] = SECONDS) -> tuple[DelaySetting, ...]:
    """Return every setting once: for each schedule that without delay, then each delay with each time above 0.

    Args:
        seconds: what is added [s], increasing, from 0.

    Raises BadRequest: the times do not increase from 0.
    """
    if not seconds or seconds[0] != 0.0 or any(b <= a for a, b in itertools.pairwise(seconds)):
        raise BadRequest("delays", f"times must increase, from 0 s, but are {list(seconds)}", slug="delay-times")
    return tuple(
        setting
        for schedule in SCHEDULES
        for setting in (
            DelaySetting(schedule, "", 0.0),
            *(DelaySetting(schedule, delay, s) for delay in DELAYS for s in seconds[1:]),
        )
    )


@dataclass(frozen=True, slots=True)
class DelayStudy:
    """The same cases under every setting, one setting after the other; callable as a campaign's `simulate`."""

    seed: int  # of the cases
    n_cases: int  # how many cases each setting runs
    seconds: tuple[float, ...] = SECONDS  # what is added [s], increasing, from 0

    def __post_init__(self) -> None:
        if self.n_cases < 1:
            raise BadRequest("delays", f"at least one case is needed, but {self.n_cases} given", slug="count-range")
        settings_of(self.seconds)

    @property
    def n_runs(self) -> int:
        """How many cases are run over all settings."""
        return len(settings_of(self.seconds)) * self.n_cases

    def __call__(self, first: int, count: int) -> NDArray[np.void]:
        """Return what became of runs first .. first + count - 1, array of DELAYED of shape (count,).

        Run i is case i modulo n_cases under setting i // n_cases.
        """
        runs = np.arange(first, first + count)
        rows = np.zeros(count, DELAYED)
        settings = settings_of(self.seconds)
        for at in np.unique(runs // self.n_cases).tolist():
            here = runs // self.n_cases == at
            facts = settings[at].study(self.seed).run(runs[here] % self.n_cases)
            part = np.zeros(len(facts), DELAYED)
            part["number"] = facts["number"]
            part["stuck"] = published(facts).stuck
            part["contact"] = (facts["n_robot_contacts"] > 0) | (facts["n_shared_contacts"] > 0)
            part["reached"] = facts["t_goal"] != NEVER
            rows[here] = part
        return rows

    def campaign(self) -> Campaign:
        """Return the campaign of all runs, one setting a shard."""
        return Campaign(
            study="ramp_system/delays", schedule=" and ".join(SCHEDULES), seed=self.seed, n_cases=self.n_runs,
            dtype=DELAYED, parameters={"code": ramp_digest(), "seconds": list(self.seconds), "cases": self.n_cases},
            shard_size=self.n_cases,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class DelayResults:
    """What became of the runs of a DelayStudy. Raises BadRequest: the rows are not one a run."""

    study: DelayStudy  # what was run
    rows: NDArray[np.void]  # array of DELAYED, shape (study.n_runs,)

    def __post_init__(self) -> None:
        if len(self.rows) != self.study.n_runs:
            rule = f"there must be {self.study.n_runs} runs, but there are {len(self.rows)}"
            raise BadRequest("delays", rule, slug="runs-shape")

    def flags(self, schedule: str, delay: str, seconds: float, question: str) -> NDArray[np.bool_]:
        """Return in which cases the answer is yes, shape (n_cases,); with 0 s, any delay is the run without.

        Raises BadRequest: schedule, delay or question is unknown, or that much was not added.
        """
        require_known(schedule, SCHEDULES, "schedule", slug="unknown-schedule")
        require_known(delay, DELAYS, "delay", slug="unknown-delay")
        require_known(question, QUESTIONS, "question", slug="unknown-question")
        if seconds not in self.study.seconds:
            rule = f"{seconds:g} s were not added, but one of {', '.join(f'{s:g}' for s in self.study.seconds)} s"
            raise BadRequest("delays", rule, slug="delay-times")
        wanted = DelaySetting(schedule, delay if seconds else "", seconds)
        n = self.study.n_cases
        at = settings_of(self.study.seconds).index(wanted) * n
        return np.asarray(self.rows[question][at : at + n] == 1)

    def rates(self, schedule: str, delay: str, question: str) -> tuple[Rate, ...]:
        """Return the share of cases with its Wilson 95 % interval for every time added, shape (n_seconds,)."""
        found = (self.flags(schedule, delay, s, question) for s in self.study.seconds)
        return tuple(wilson(int(flags.sum()), self.study.n_cases) for flags in found)

    def against_none(self, schedule: str, delay: str, question: str) -> Pairs:
        """Return how the longest delay changes the same cases against none: first none, then the longest."""
        none, longest = self.study.seconds[0], self.study.seconds[-1]
        flags = [self.flags(schedule, delay, s, question) for s in (none, longest)]
        return compare_pairs(*flags)

"""What a comparison has found out: the facts of several planners on the same cases, and what is known of the cases."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.arena.solvability import SOLVABLE, UNSOLVABLE
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import Outcome, outcomes, published, touched
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements
from parcours_navigation.requirements.tables import Violations
from parcours_navigation.study.distribution import measured, reached, sct_of

Facts = NDArray[np.void]
Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]

AT_ONCE = "at once"
"""How a planner answers whose work takes no time in the simulated world."""


@dataclass(frozen=True, slots=True)
class DecisionTimes:
    """Wall times of one `observe` on this machine, now [us]: not part of the results that are equal bit by bit."""

    median: float
    p99: float
    largest: float
    n: int


@dataclass(frozen=True, slots=True)
class Contender:
    """One planner's part of a comparison."""

    name: str  # as it was given on the command line
    facts: Facts  # array of FACTS in the order of the cases, shape (n_cases,)
    answers: str = AT_ONCE  # how long its work takes in the simulated world, in words
    reasons: tuple[str, ...] = ()  # one for each case that ended in the planner's own error, in their order
    decisions: DecisionTimes | None = None  # None if not measured
    measures: Facts | None = None  # array of MEASURES, shape (n_cases,), NaN where its own error ended the case
    published: Facts | None = None  # array of PUBLISHED of the first cases, shape (n,), NaN likewise
    untimed: str = ""  # what went wrong while decisions were timed
    robustness: Floats | None = None  # of each requirement in each case, shape (n_cases, n); None if none are asked
    required: tuple[Violations, ...] = ()  # what became of each requirement and pass rule
    own: Mapping[str, Floats] = field(default_factory=dict)  # the user's own measures of each case, NaN where none
    folder: str = ""  # of its campaign
    repeated: tuple[int, int] = (0, 0)  # first cases that gave the same facts when they were run again, and all such

    @property
    def outcomes(self) -> NDArray[np.int64]:
        """The sound Outcome of each case, shape (n_cases,)."""
        return outcomes(self.facts)

    def errors(self) -> list[tuple[str, int]]:
        """Return why cases ended in the planner's own error and how many did, commonest first; times are left out."""
        n = int(erred(self.facts).sum())
        said = [*self.reasons, *["no reason was kept"] * (n - len(self.reasons))]
        return Counter(re.sub(r"\b\d+(\.\d+)? s\b", "... s", reason) for reason in said).most_common()


def repeats_of(contenders: Sequence[Contender]) -> str:
    """Return in words how many first cases gave the same facts, to the byte, when they were run again.

    >>> facts = np.zeros(2)
    >>> repeats_of([Contender("orca", facts, repeated=(2, 2)), Contender("dice", facts, repeated=(0, 2))])
    'orca 2 of 2, dice 0 of 2 first cases, equal to the byte'
    """
    known = ", ".join(f"{one.name} {one.repeated[0]} of {one.repeated[1]}" for one in contenders if one.repeated[1])
    return f"{known} first cases, equal to the byte" if known else "not tried"


def struck(facts: Facts) -> Flags:
    """Return in which cases an obstacle ran into the robot, closing the gap alone."""
    return np.asarray(facts["n_obstacle_contacts"] > 0)


def stuck(facts: Facts) -> Flags:
    """Return in which cases the robot did not reach the goal, stood at the end, and never moved again."""
    never = (facts["t_goal"] == NEVER) & (facts["t_goal_after"] == NEVER) & (facts["error"] == 0)
    stood = facts["t_end"] - facts["t_last_moving"] > 1_000_000_000
    return np.asarray(never & stood & (facts["moved_after"] == 0))


def erred(facts: Facts) -> Flags:
    """Return in which cases the planner's own fault ended the case."""
    return np.asarray(facts["error"] != 0)


QUESTIONS: dict[str, Callable[[Facts], Flags]] = {
    "goal reached in time, no collision": reached,
    "collision caused by the robot": touched,
    "contact that the obstacle alone caused": struck,
    "stopped for good": stuck,
    "ended by the planner's own error": erred,
}
"""What is asked of every case, in words -> which cases say yes."""

TESTED: dict[str, Callable[[Facts], Flags]] = {"reached": reached, "contact": touched}
"""The questions that are tested between two planners."""

STUCK = "stuck in imminent collision"

RULES: dict[str, Callable[[Facts], Flags]] = {
    "goal reached": lambda f: published(f).reached,
    "goal reached, after an obstacle had run into the robot": lambda f: published(f).reached & struck(f),
    "under way on a feasible trajectory": lambda f: published(f).feasible & ~published(f).reached,
    "under way on an infeasible trajectory": lambda f: ~published(f).feasible & ~published(f).reached,
    "imminent collision at any time": lambda f: published(f).halted_once,
    "paused, then moved again": lambda f: published(f).halted_once & ~published(f).stuck,
    STUCK: lambda f: published(f).stuck,
    "halted for good": lambda f: np.asarray(outcomes(f) == int(Outcome.STUCK)),
    "collision caused by the robot": touched,
    "contact that the obstacle alone caused": struck,
}
"""What the table of the paper's results asks: first those results by their own rule, then what the world says."""


@dataclass(frozen=True, slots=True)
class ComparisonResults:
    """A whole comparison."""

    contenders: tuple[Contender, ...]  # in the order given; the others are tested against the first
    protocol: str
    seed: int
    n_cases: int
    vectors: tuple[str, ...]  # start vector of each case, in words
    command_delay: float = 0.0  # from an answer to the robot, for planners that answer at once [s]
    oracle: Facts | None = None  # array of SOLVABILITY, shape (n_cases,); None if not asked
    survival: Floats | None = None  # how long a standing robot survives in each case, as a share
    requirements: Requirements = NO_REQUIREMENTS  # of every case, beside the sound outcome

    @property
    def solvable(self) -> Flags | None:
        """Cases that could have been solved, shape (n_cases,); None if no oracle was asked."""
        return None if self.oracle is None else np.asarray(self.oracle["answer"] == SOLVABLE)

    @property
    def unsolvable(self) -> Flags | None:
        """Cases that were unsolvable; what is neither solvable nor this is undecided."""
        return None if self.oracle is None else np.asarray(self.oracle["answer"] == UNSOLVABLE)

    @property
    def earliest(self) -> Floats | None:
        """The earliest possible arrival [s], infinite where none is possible, shape (n_cases,)."""
        return None if self.oracle is None else np.asarray(self.oracle["earliest_outer"])

    def measured(self, contender: Contender) -> dict[str, Floats]:
        """Return what was measured on a planner's cases, by the names of `distribution.SHOWN`."""
        return measured(contender.facts, contender.measures, earliest=self.earliest, survival=self.survival)

    def sct(self, contender: Contender) -> Floats | None:
        """Return SCT of each case, NaN where no robot could have arrived, shape (n_cases,); None without an oracle."""
        return None if self.earliest is None else sct_of(contender.facts, self.earliest)

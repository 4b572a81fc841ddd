"""Facts of several planners on the same cases -> the questions asked of each, and every paired test between two."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.verdict.statistics import holm
from parcours_navigation.arena.solvability import SOLVABLE, UNSOLVABLE
from parcours_navigation.comparison.pairing import (
    RateDifference,
    TimeDifference,
    rate_difference,
    time_difference,
)
from parcours_navigation.facts import NEVER
from parcours_navigation.outcomes import outcomes
from parcours_navigation.study.distribution import measured, reached, sct_of, spl_of, time_to_goal

Facts = NDArray[np.void]
Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]

AT_ONCE = "at once"
"""How a planner answers whose work takes no time in the simulated world."""


@dataclass(frozen=True, slots=True)
class DecisionTimes:
    """How long a planner took to decide, on this machine and now: no part of results that are equal bit by bit.

    Attributes:
        median, p99, largest: of the wall time of one `observe` [us].
        n: decisions measured.
    """

    median: float
    p99: float
    largest: float
    n: int


@dataclass(frozen=True, slots=True)
class Contender:
    """One planner's part of a comparison.

    Attributes:
        name: as it was given on the command line.
        facts: array of FACTS, one a case, in the order of the cases, shape (n_cases,).
        answers: how long its work takes in the simulated world, in words.
        reasons: what the planner did wrong, in words, one for each case that ended in its own error, in their order.
        decisions: how long it took to decide; None where it was not measured.
        measures: array of MEASURES, one a case, NaN where the planner's own error ended it, shape (n_cases,); None if
            nothing was measured.
        published: what published benchmark code computes of the first cases, array of PUBLISHED, shape (n,), NaN
            likewise; None if no case was run again for it.
        untimed: what went wrong while decisions were timed, in words; empty if nothing did.
    """

    name: str
    facts: Facts
    answers: str = AT_ONCE
    reasons: tuple[str, ...] = ()
    decisions: DecisionTimes | None = None
    measures: Facts | None = None
    published: Facts | None = None
    untimed: str = ""

    @property
    def outcomes(self) -> NDArray[np.int64]:
        """The sound Outcome of each case, shape (n_cases,)."""
        return outcomes(self.facts)

    def errors(self) -> list[tuple[str, int]]:
        """Return why cases ended in the planner's own error, and how many did, commonest first; times are left out."""
        n = int(erred(self.facts).sum())
        said = [*self.reasons, *["no reason was kept"] * (n - len(self.reasons))]
        return Counter(re.sub(r"\b\d+(\.\d+)? s\b", "... s", reason) for reason in said).most_common()


def contact(facts: Facts) -> Flags:
    """Return in which cases the moving robot closed the gap at a contact, alone or with the obstacle."""
    return np.asarray((facts["n_robot_contacts"] > 0) | (facts["n_shared_contacts"] > 0))


def struck(facts: Facts) -> Flags:
    """Return in which cases an obstacle ran into the robot, closing the gap alone."""
    return np.asarray(facts["n_obstacle_contacts"] > 0)


def stuck(facts: Facts) -> Flags:
    """Return in which cases the robot did not reach the goal, stood at the end, and never moved again while watched."""
    never = (facts["t_goal"] == NEVER) & (facts["t_goal_after"] == NEVER) & (facts["error"] == 0)
    stood = facts["t_end"] - facts["t_last_moving"] > 1_000_000_000
    return np.asarray(never & stood & (facts["moved_after"] == 0))


def erred(facts: Facts) -> Flags:
    """Return in which cases the planner's own fault ended the case."""
    return np.asarray(facts["error"] != 0)


QUESTIONS: dict[str, Callable[[Facts], Flags]] = {
    "goal reached in time, nothing touched": reached,
    "contact that the moving robot closed": contact,
    "contact that the obstacle closed alone": struck,
    "stopped for ever": stuck,
    "ended by the planner's own error": erred,
}
"""What is asked of every case, in words -> which cases say yes."""

TESTED: dict[str, Callable[[Facts], Flags]] = {"reached": reached, "contact": contact}
"""The questions that are tested between two planners."""


@dataclass(frozen=True, slots=True)
class PairTest:
    """One test between two planners.

    Attributes:
        first, second: their names.
        question: "reached", "contact" or "time".
        found: the difference and its p-value.
        p_value: uncorrected.
        p_holm: corrected for all tests of the family it was made in.
    """

    first: str
    second: str
    question: str
    found: RateDifference | TimeDifference
    p_value: float
    p_holm: float


def pair_tests(contenders: Sequence[Contender], *, against_first: bool = True) -> tuple[PairTest, ...]:
    """Return the tests of one family, corrected by Holm over the whole of it.

    Args:
        contenders: on the same cases in the same order.
        against_first: compare each with the first only; otherwise each with each.

    Raises:
        BadRequest: the cases differ.
    """
    for other in contenders[1:]:
        if not np.array_equal(contenders[0].facts["number"], other.facts["number"]):
            raise BadRequest(
                f"compare {contenders[0].name} and {other.name}",
                f"both must have run the same cases, but have {len(contenders[0].facts)} and {len(other.facts)} of "
                "other numbers",
                slug="pairs-shape",
            )
    pairs = list(itertools.combinations(contenders, 2))
    if against_first:
        pairs = [(first, second) for first, second in pairs if first is contenders[0]]
    raw: list[tuple[str, str, str, RateDifference | TimeDifference, float]] = []
    for first, second in pairs:
        for question, ask in TESTED.items():
            rates = rate_difference(ask(first.facts), ask(second.facts))
            raw.append((first.name, second.name, question, rates, rates.pairs.p_value))
        times = time_difference(time_to_goal(first.facts), time_to_goal(second.facts))
        raw.append((first.name, second.name, "time", times, times.p_value))
    corrected = holm([p_value for *_, p_value in raw])
    return tuple(PairTest(*row, p_holm) for row, p_holm in zip(raw, corrected, strict=True))


@dataclass(frozen=True, slots=True)
class Results:
    """A whole comparison.

    Attributes:
        contenders: in the order given; the first is what the others are tested against.
        protocol, seed, n_cases: which cases.
        vectors: start vector of each case, in words, shape (n_cases,).
        command_delay: from an answer to the robot for planners that answer at once [s].
        oracle: what could have been reached by a robot that knows the future, array of SOLVABILITY, shape (n_cases,).
        survival: how long a standing robot survives in each case, as a share, shape (n_cases,).
    """

    contenders: tuple[Contender, ...]
    protocol: str
    seed: int
    n_cases: int
    vectors: tuple[str, ...]
    command_delay: float = 0.0
    oracle: Facts | None = None
    survival: Floats | None = None

    @property
    def solvable(self) -> Flags | None:
        """Cases that could have been solved, shape (n_cases,); None if no oracle was asked."""
        return None if self.oracle is None else np.asarray(self.oracle["answer"] == SOLVABLE)

    @property
    def unsolvable(self) -> Flags | None:
        """Cases that nobody could have solved; what is neither solvable nor this is undecided."""
        return None if self.oracle is None else np.asarray(self.oracle["answer"] == UNSOLVABLE)

    @property
    def earliest(self) -> Floats | None:
        """When nobody could have arrived before [s], infinite where nobody could at all, shape (n_cases,)."""
        return None if self.oracle is None else np.asarray(self.oracle["earliest_outer"])

    def measured(self, contender: Contender) -> dict[str, Floats]:
        """Return what was measured on a planner's cases, by the names of `distribution.SHOWN`."""
        return measured(contender.facts, contender.measures, earliest=self.earliest, survival=self.survival)


def weighted_by_way(contender: Contender) -> Floats:
    """Return SPL of each case: success times the shortest conceivable way over the way driven, shape (n_cases,)."""
    return spl_of(contender.facts)


def weighted_by_time(results: Results, contender: Contender) -> Floats | None:
    """Return SCT of each case: success times the earliest conceivable arrival over the time taken, shape (n_cases,).

    NaN where nobody could have arrived; None if no oracle was asked.
    """
    return None if results.earliest is None else sct_of(contender.facts, results.earliest)

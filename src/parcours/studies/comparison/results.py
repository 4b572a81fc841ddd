"""Facts of several planners on the same cases -> the questions asked of each, and every paired test between two."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from parcours.arena.solvability import SOLVABLE, shortest_way
from parcours.errors import BadRequest
from parcours.studies.comparison.pairing import (
    RateDifference,
    TimeDifference,
    holm,
    rate_difference,
    time_difference,
)
from parcours.verdict.facts import NEVER
from parcours.verdict.measures.scores import sct, spl
from parcours.verdict.navigation import GOAL_TOLERANCE, Outcome, outcomes

Facts = NDArray[np.void]
Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]

START, GOAL = (0.0, 0.0), (2.0, 2.0)
"""Where the robot starts and is to go in a system case [m]."""

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
        measures: name of a measure -> its value in each measured case, NaN where it has none.
    """

    name: str
    facts: Facts
    answers: str = AT_ONCE
    reasons: tuple[str, ...] = ()
    decisions: DecisionTimes | None = None
    measures: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def outcomes(self) -> NDArray[np.int64]:
        """The sound Outcome of each case, shape (n_cases,)."""
        return outcomes(self.facts)

    def errors(self) -> list[tuple[str, int]]:
        """Return why cases ended in the planner's own error, and how many did, commonest first; times are left out."""
        n = int(erred(self.facts).sum())
        said = [*self.reasons, *["no reason was kept"] * (n - len(self.reasons))]
        return Counter(re.sub(r"\b\d+(\.\d+)? s\b", "... s", reason) for reason in said).most_common()


def reached(facts: Facts) -> Flags:
    """Return in which cases the goal was reached in time, and no obstacle touched by the moving robot."""
    return np.asarray(outcomes(facts) == int(Outcome.REACHED))


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


def time_to_goal(facts: Facts) -> Floats:
    """Return when the goal was reached [s] in cases that count as reached, else NaN; shape (n_cases,)."""
    known = reached(facts) & (facts["t_goal"] != NEVER)
    return np.where(known, facts["t_goal"] * 1e-9, np.nan)


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
    """

    contenders: tuple[Contender, ...]
    protocol: str
    seed: int
    n_cases: int
    vectors: tuple[str, ...]
    command_delay: float = 0.0
    oracle: Facts | None = None

    @property
    def solvable(self) -> Flags | None:
        """Cases that could have been solved, shape (n_cases,); None if no oracle was asked."""
        return None if self.oracle is None else np.asarray(self.oracle["answer"] == SOLVABLE)


def weighted_by_way(results: Results, contender: Contender) -> Floats:
    """Return SPL of each case: success times the shortest conceivable way over the way driven, shape (n_cases,).

    Success is `reached`; the shortest way is the straight line to the goal's tolerance, which no way undercuts.
    """
    shortest = shortest_way(START, GOAL, GOAL_TOLERANCE)
    return spl(reached(contender.facts), np.full(results.n_cases, shortest), contender.facts["travelled"])


def weighted_by_time(results: Results, contender: Contender) -> Floats | None:
    """Return SCT of each case: success times the earliest conceivable arrival over the time taken, shape (n_cases,).

    NaN where nobody could have arrived; None if no oracle was asked.
    """
    if results.oracle is None:
        return None
    earliest = np.where(np.isfinite(results.oracle["earliest_outer"]), results.oracle["earliest_outer"], np.nan)
    return sct(reached(contender.facts), earliest, time_to_goal(contender.facts))

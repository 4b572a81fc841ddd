"""Everything that a comparison says, computed once from its results: rates, quantiles, tests, scores.

The page, the terminal, Markdown and JSON draw this one value, so that all give the same numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from parcours.errors import BadRequest
from parcours.verdict.statistics import Rate, holm, wilson
from parcours_navigation.comparison.benchmarking import Score, benchmark_scores
from parcours_navigation.comparison.pairing import RateDifference, TimeDifference, rate_difference, time_difference
from parcours_navigation.comparison.results import (
    QUESTIONS,
    RULES,
    STUCK,
    TESTED,
    Contender,
    DecisionTimes,
    Facts,
    Flags,
    Floats,
    Results,
)
from parcours_navigation.outcomes import Outcome
from parcours_navigation.study.distribution import Summary, reached, spl_of, summarised, time_to_goal

DIFFERENT_ANSWERS = (
    "Planners that come with published durations of work keep them; the others answer at once, which no real machine "
    "does, unless a command delay is given. So a difference between the two kinds is one of planner and machine "
    "together."
)
"""What must be said wherever planners stand side by side that answer at different speeds."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How one planner fared.

    Attributes:
        name, answers: as in `Contender`.
        outcomes: of all cases; each has one.
        questions: of all cases; a case may say yes to several.
        rules: the paper's results.
        stuck_of_solvable: rates of STUCK among the solvable cases, and among those not proved unsolvable; equal where
            no case is undecided. None if no oracle was asked.
        reached_of_solvable: None if no oracle was asked.
        reached_by_vector: rates of the goal reached, by start vector.
        times: to the goal [s], NaN where it was not reached in time, shape (n_cases,).
        shared_times: the same of cases that all planners reach, shape (n,).
        clearances: least gap to an obstacle [m], shape (n_cases,).
        spl, sct: means over all cases; sct None if it is not known of any.
        measures: by the names of `distribution.SHOWN`.
        errors: reasons of its own errors, commonest first, with the number of cases.
        decisions, untimed: as in `Contender`.
    """

    name: str
    answers: str
    outcomes: Mapping[Outcome, Rate]
    questions: Mapping[str, Rate]
    rules: Mapping[str, Rate]
    stuck_of_solvable: tuple[Rate, Rate] | None
    reached_of_solvable: Rate | None
    reached_by_vector: Mapping[str, Rate]
    times: Floats
    shared_times: Floats
    clearances: Floats
    spl: float
    sct: float | None
    measures: Mapping[str, Summary]
    errors: Sequence[tuple[str, int]]
    decisions: DecisionTimes | None
    untimed: str


@dataclass(frozen=True, slots=True)
class PairTest:
    """One test between two planners.

    Attributes:
        first, second: their names.
        question: what was compared.
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


@dataclass(frozen=True, slots=True)
class Analysis:
    """What a comparison says.

    Attributes:
        protocol, seed, n_cases, command_delay: as in `Results`.
        standings: one a planner, in the order given.
        solvable, unsolvable: how many cases are; None if no oracle was asked.
        n_shared: cases that all planners reach.
        vectors: how many cases each start vector has.
        beats: share of cases that the planner of the row reaches and the one of the column does not.
        tests: each planner against the first; every_test: each against each.
        rule_tests: of the paper's results, each planner against the first.
        scores: of published benchmarks; empty if the cases were not measured.
        caution: what must be said where planners answer at different speeds, else "".
    """

    protocol: str
    seed: int
    n_cases: int
    command_delay: float
    standings: tuple[Standing, ...]
    solvable: int | None
    unsolvable: int | None
    n_shared: int
    vectors: Mapping[str, int]
    beats: Floats
    tests: tuple[PairTest, ...]
    every_test: tuple[PairTest, ...]
    rule_tests: tuple[PairTest, ...]
    scores: tuple[Score, ...]
    caution: str

    @property
    def names(self) -> tuple[str, ...]:
        """The planners' names, in the order given."""
        return tuple(one.name for one in self.standings)


def analyse(results: Results) -> Analysis:
    """Return what a comparison says. Raises BadRequest if the planners ran other cases."""
    every = results.contenders
    flags = [reached(c.facts) for c in every]
    shared = np.all(flags, axis=0)
    can, cannot = results.solvable, results.unsolvable
    vectors = {name: results.vectors.count(name) for name in sorted(set(results.vectors))}
    return Analysis(
        results.protocol,
        results.seed,
        results.n_cases,
        results.command_delay,
        tuple(_standing(results, contender, shared) for contender in every),
        None if can is None else int(can.sum()),
        None if cannot is None else int(cannot.sum()),
        int(shared.sum()),
        vectors,
        np.array([[float((a & ~b).mean()) for b in flags] for a in flags]),
        pair_tests(every),
        pair_tests(every, against_first=False),
        _rule_tests(every),
        benchmark_scores(results),
        DIFFERENT_ANSWERS if len({c.answers for c in every}) > 1 else "",
    )


def _rate(yes: Flags, among: Flags | None = None) -> Rate:
    """Return how many of the cases say yes, of all or of some."""
    return wilson(int(yes.sum()), len(yes)) if among is None else wilson(int((yes & among).sum()), int(among.sum()))


def _standing(results: Results, contender: Contender, shared: Flags) -> Standing:
    facts, codes = contender.facts, contender.outcomes
    good, times = reached(facts), time_to_goal(facts)
    can, cannot = results.solvable, results.unsolvable
    rules = {words: ask(facts) for words, ask in RULES.items()}
    bracket = None if can is None or cannot is None else (_rate(rules[STUCK], can), _rate(rules[STUCK], ~cannot))
    vectors = np.asarray(results.vectors)
    sct = results.sct(contender)
    return Standing(
        contender.name,
        contender.answers,
        {outcome: _rate(codes == int(outcome)) for outcome in Outcome},
        {words: _rate(ask(facts)) for words, ask in QUESTIONS.items()},
        {words: _rate(yes) for words, yes in rules.items()},
        bracket,
        None if can is None else _rate(good, can),
        {vector: _rate(good, vectors == vector) for vector in sorted(set(results.vectors))},
        times,
        times[shared],
        facts["min_clearance"],
        float(spl_of(facts).mean()),
        None if sct is None or not np.isfinite(sct).any() else float(np.nanmean(sct)),
        summarised(results.measured(contender)),
        contender.errors(),
        contender.decisions,
        contender.untimed,
    )


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
            lengths = f"{len(contenders[0].facts)} and {len(other.facts)}"
            rule = f"both must have run the same cases, but have {lengths} of other numbers"
            raise BadRequest(f"compare {contenders[0].name} and {other.name}", rule, slug="pairs-shape")
    pairs = itertools.combinations(contenders, 2)
    chosen = [(a, b) for a, b in pairs if a is contenders[0]] if against_first else list(pairs)
    return _family(chosen, TESTED, {"time": time_to_goal})


def _rule_tests(contenders: Sequence[Contender]) -> tuple[PairTest, ...]:
    """Return the tests of the paper's results and of two quantities, each planner against the first."""
    pairs = [(contenders[0], other) for other in contenders[1:]]
    return _family(pairs, RULES, {"clearances": lambda f: finite(f["min_clearance"]), "times": time_to_goal})


def _family(
    pairs: Sequence[tuple[Contender, Contender]],
    rates: Mapping[str, Callable[[Facts], Flags]],
    quantities: Mapping[str, Callable[[Facts], Floats]],
) -> tuple[PairTest, ...]:
    """Return a test of every rate and quantity for every pair, corrected by Holm over all of them."""
    raw: list[tuple[str, str, str, RateDifference | TimeDifference, float]] = []
    for first, second in pairs:
        for question, ask in rates.items():
            found = rate_difference(ask(first.facts), ask(second.facts))
            raw.append((first.name, second.name, question, found, found.pairs.p_value))
        for question, of in quantities.items():
            gap = time_difference(of(first.facts), of(second.facts))
            raw.append((first.name, second.name, question, gap, gap.p_value))
    corrected = holm([p_value for *_, p_value in raw])
    return tuple(PairTest(*row, p_holm) for row, p_holm in zip(raw, corrected, strict=True))


def finite(values: Floats) -> Floats:
    """Return the values with NaN for what is not finite: a clearance without any obstacle."""
    return np.where(np.isfinite(values), values, np.nan)

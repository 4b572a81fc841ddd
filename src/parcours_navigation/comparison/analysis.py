"""Everything that a comparison says, computed once from its results: rates, quantiles, tests, scores.

The page, the terminal, Markdown and JSON draw this one value, so all give the same numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from parcours.errors import BadRequest
from parcours.verdict.statistics import Rate, RateDifference, holm, rate_difference, wilson
from parcours_navigation.arena.solvability import shortest_way
from parcours_navigation.comparison.pairing import TimeDifference, time_difference
from parcours_navigation.comparison.results import (
    QUESTIONS,
    RULES,
    STUCK,
    TESTED,
    ComparisonResults,
    Contender,
    DecisionTimes,
    Facts,
    Flags,
    Floats,
)
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.measures.benchmarks import BENCHMARKS, score
from parcours_navigation.measures.scores import Runs, ScoreColumn
from parcours_navigation.outcomes import GOAL_TOLERANCE, Outcome
from parcours_navigation.study.distribution import (
    GOAL,
    START,
    MeasureSummary,
    reached,
    spl_of,
    summarised,
    time_to_goal,
)

DIFFERENT_ANSWERS = (
    "Planners with published computing times keep them. The others answer instantly, which no real machine does, "
    "unless a command delay is given. So a difference between the two kinds is one of planner and machine together."
)
"""The caution wherever planners stand side by side that answer at different speeds."""

REPRODUCING = ("mrpb-2021", "arena-evaluation", "hunav-evaluator", "socnavbench-code")
"""Modes that need what published code computes of a track: known of the cases that were run again for it."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How one planner fared. Rates and quantities are over all cases unless their comment says otherwise."""

    of: Contender
    outcomes: Mapping[Outcome, Rate]  # each case has one
    questions: Mapping[str, Rate]  # a case may say yes to several
    rules: Mapping[str, Rate]  # the paper's results
    # STUCK among the solvable cases, and among those not proved unsolvable: equal where no case is undecided
    stuck_of_solvable: tuple[Rate, Rate] | None
    reached_of_solvable: Rate | None
    reached_by_vector: Mapping[str, Rate]
    times: Floats  # to the goal [s], NaN where it was not reached in time, shape (n_cases,)
    shared_times: Floats  # the same, of the cases that all planners reach
    clearances: Floats  # least gap to an obstacle [m], shape (n_cases,)
    spl: float
    sct: float | None  # None if not known of any case
    measures: Mapping[str, MeasureSummary]  # by the names of `distribution.SHOWN`
    errors: Sequence[tuple[str, int]]  # reasons of its own errors, commonest first, with the number of cases

    @property
    def name(self) -> str:
        """The planner's name."""
        return self.of.name

    @property
    def decisions(self) -> DecisionTimes | None:
        """How long it took to decide."""
        return self.of.decisions


@dataclass(frozen=True, slots=True)
class PairTest:
    """One test between two planners; `p_holm` is corrected for all tests of its family."""

    first: str
    second: str
    question: str
    found: RateDifference | TimeDifference
    p_value: float
    p_holm: float


@dataclass(frozen=True, slots=True)
class Score:
    """One score of a published benchmark for every planner."""

    benchmark: str
    mode: str
    score: str
    unit: str
    cases: int  # the mean is over these, less those for which the score is not defined
    means: tuple[float, ...]  # one a planner; NaN where it is defined for no case


@dataclass(frozen=True, slots=True)
class Analysis:
    """What a comparison says."""

    results: ComparisonResults
    standings: tuple[Standing, ...]  # one a planner, in the order given
    solvable: int | None  # None if no oracle was asked
    unsolvable: int | None
    n_shared: int  # cases that all planners reach
    vectors: Mapping[str, int]  # how many cases each start vector has
    beats: Floats  # share of cases that the planner of the row reaches and the one of the column does not
    tests: tuple[PairTest, ...]  # each planner against the first
    every_test: tuple[PairTest, ...]  # each against each
    rule_tests: tuple[PairTest, ...]  # of the paper's results, each against the first
    scores: tuple[Score, ...]  # empty if the cases were not measured
    caution: str  # where planners answer at different speeds

    @property
    def names(self) -> tuple[str, ...]:
        """The planners' names, in the order given."""
        return tuple(one.name for one in self.standings)

    @property
    def has_order(self) -> bool:
        """Whether obstacles set out in an order, as in the paper's arena, and not in a world of the user's own."""
        return any(vector != "()" for vector in self.vectors)


def analyse(results: ComparisonResults) -> Analysis:
    """Return what a comparison says. Raises BadRequest if the planners ran other cases."""
    every = results.contenders
    flags = [reached(c.facts) for c in every]
    shared = np.all(flags, axis=0)
    can, cannot = results.solvable, results.unsolvable
    return Analysis(
        results,
        tuple(_standing(results, contender, shared) for contender in every),
        None if can is None else int(can.sum()),
        None if cannot is None else int(cannot.sum()),
        int(shared.sum()),
        {name: results.vectors.count(name) for name in sorted(set(results.vectors))},
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


def _standing(results: ComparisonResults, contender: Contender, shared: Flags) -> Standing:
    facts, codes = contender.facts, contender.outcomes
    good, times = reached(facts), time_to_goal(facts)
    can, cannot = results.solvable, results.unsolvable
    rules = {words: ask(facts) for words, ask in RULES.items()}
    vectors = np.asarray(results.vectors)
    sct = results.sct(contender)
    return Standing(
        contender,
        {outcome: _rate(codes == int(outcome)) for outcome in Outcome},
        {words: _rate(ask(facts)) for words, ask in QUESTIONS.items()},
        {words: _rate(yes) for words, yes in rules.items()},
        None if can is None or cannot is None else (_rate(rules[STUCK], can), _rate(rules[STUCK], ~cannot)),
        None if can is None else _rate(good, can),
        {vector: _rate(good, vectors == vector) for vector in sorted(set(results.vectors))},
        times,
        times[shared],
        facts["min_clearance"],
        float(spl_of(facts).mean()),
        None if sct is None or not np.isfinite(sct).any() else float(np.nanmean(sct)),
        summarised(results.measured(contender)),
        contender.errors(),
    )


def pair_tests(contenders: Sequence[Contender], *, against_first: bool = True) -> tuple[PairTest, ...]:
    """Return the tests of each planner against the first, or of each against each, corrected by Holm over all of them.

    Raises BadRequest if the planners did not run the same cases in the same order.
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


def benchmark_scores(results: ComparisonResults) -> tuple[Score, ...]:
    """Return every score of every mode; empty if the cases were not measured.

    Modes of REPRODUCING are over the cases that were run again, the rest over all.
    """
    if any(c.measures is None for c in results.contenders):
        return ()
    found: list[Score] = []
    for benchmark, known in BENCHMARKS.items():
        for mode in known.modes:
            columns = [_columns(results, c, benchmark, mode) for c in results.contenders]
            for same in zip(*columns, strict=True):
                means = tuple(column.mean for column in same)
                found.append(Score(benchmark, mode, same[0].name, same[0].unit, len(same[0].values), means))
    return tuple(found)


def _columns(results: ComparisonResults, contender: Contender, benchmark: str, mode: str) -> tuple[ScoreColumn, ...]:
    """Return the columns of one planner; none where the mode needs tracks and no case was run again."""
    published = contender.published if mode in REPRODUCING else None
    if mode in REPRODUCING and published is None:
        return ()
    n = results.n_cases if published is None else len(published)
    assert contender.measures is not None
    earliest = results.earliest
    runs = Runs(
        contender.facts[:n], contender.measures[:n], published=published,
        shortest=np.full(n, shortest_way(START, GOAL, GOAL_TOLERANCE)),
        fastest=None if earliest is None else finite(earliest)[:n], top_speed=Scenario().limits.speed,
    )  # fmt: skip
    return score(runs, benchmark, mode)

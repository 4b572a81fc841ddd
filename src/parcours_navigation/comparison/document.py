"""Results of a comparison -> one JSON document, complete; docs/comparing.md says what each entry is."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from parcours import __version__
from parcours.verdict.statistics import Rate, quantiles, wilson
from parcours_navigation.comparison.benchmarking import benchmark_scores
from parcours_navigation.comparison.pairing import RateDifference
from parcours_navigation.comparison.paper_rule import RULES, stuck_of_solvable
from parcours_navigation.comparison.results import (
    QUESTIONS,
    Contender,
    PairTest,
    Results,
    pair_tests,
    weighted_by_time,
    weighted_by_way,
)
from parcours_navigation.comparison.tables import beats, speaks_of_answers
from parcours_navigation.outcomes import Outcome
from parcours_navigation.study.distribution import distribution_document, reached, time_to_goal

FORMAT = "comparison/1"

_AT = (0.05, 0.25, 0.5, 0.75, 0.95)


def comparison_document(results: Results) -> dict[str, object]:
    """Return the whole comparison as JSON values; what is not known is null."""
    document = {
        "parcours": FORMAT,
        "version": __version__,
        "cases": results.n_cases,
        "seed": results.seed,
        "protocol": results.protocol,
        "command_delay_s": results.command_delay,
        "note": speaks_of_answers(results),
        "solvable": None if results.solvable is None else _rate(wilson(int(results.solvable.sum()), results.n_cases)),
        "undecided": None if results.solvable is None else _undecided(results),
        "planners": {c.name: _planner(results, c) for c in results.contenders},
        "benchmarks": [
            {
                "benchmark": s.benchmark,
                "mode": s.mode,
                "score": s.name,
                "unit": s.unit,
                "cases": s.cases,
                "means": dict(zip((c.name for c in results.contenders), s.means, strict=True)),
            }
            for s in benchmark_scores(results)
        ],
        "tests_against_first": [_test(test) for test in pair_tests(results.contenders)],
        "tests_of_all_pairs": [_test(test) for test in pair_tests(results.contenders, against_first=False)],
        "reached_where_other_did_not": beats(results).tolist(),
    }
    plain = _plain(document)
    assert isinstance(plain, dict)
    return plain


def _planner(results: Results, contender: Contender) -> dict[str, object]:
    n = results.n_cases
    times = time_to_goal(contender.facts)
    both = np.all([reached(c.facts) for c in results.contenders], axis=0)
    gaps = contender.facts["min_clearance"]
    by_time = weighted_by_time(results, contender)
    taken = contender.decisions
    vectors = np.asarray(results.vectors)
    can = results.solvable
    good = reached(contender.facts)
    return {
        "answers": contender.answers,
        "outcomes": {o.name.lower(): _rate(wilson(int((contender.outcomes == int(o)).sum()), n)) for o in Outcome},
        "questions": {words: _rate(wilson(int(ask(contender.facts).sum()), n)) for words, ask in QUESTIONS.items()},
        "paper_rule": {words: _rate(wilson(int(ask(contender.facts).sum()), n)) for words, ask in RULES.items()},
        "stuck_of_solvable": _bracket(stuck_of_solvable(results, contender)),
        "reached_of_solvable": None if can is None else _rate(wilson(int((good & can).sum()), int(can.sum()))),
        "time_to_goal_s": _quantiles(times),
        "time_to_goal_where_all_reach_s": _quantiles(times[both]),
        "min_clearance_m": _quantiles(gaps[np.isfinite(gaps)]),
        "spl": float(weighted_by_way(contender).mean()),
        "sct": None if by_time is None or not np.isfinite(by_time).any() else float(np.nanmean(by_time)),
        "measures": distribution_document(results.measured(contender)),
        "reached_by_start_vector": {
            vector: _rate(wilson(int(good[vectors == vector].sum()), int((vectors == vector).sum())))
            for vector in sorted(set(results.vectors))
        },
        "errors": [{"reason": reason, "cases": count} for reason, count in contender.errors()],
        "decision_us": None
        if taken is None
        else {"median": taken.median, "p99": taken.p99, "max": taken.largest, "n": taken.n},
    }


def _quantiles(values: np.ndarray) -> dict[str, float | int]:
    named = {f"q{round(100 * share):02d}": value for share, value in zip(_AT, quantiles(values, _AT), strict=True)}
    return {"n": int((~np.isnan(values)).sum()), **named}


def _undecided(results: Results) -> int:
    """Return how many cases are neither known to be solvable nor known not to be."""
    assert results.solvable is not None and results.unsolvable is not None
    return int((~results.solvable & ~results.unsolvable).sum())


def _bracket(rates: tuple[Rate, Rate] | None) -> dict[str, object] | None:
    """Return a rate among the solvable cases, and among those that may be."""
    return None if rates is None else {"solvable": _rate(rates[0]), "not_unsolvable": _rate(rates[1])}


def _rate(rate: Rate) -> dict[str, float | int]:
    return {"count": rate.count, "n": rate.n, "share": rate.share, "low": rate.low, "high": rate.high}


def _test(test: PairTest) -> dict[str, object]:
    found = test.found
    common = {
        "first": test.first,
        "second": test.second,
        "question": test.question,
        "p": test.p_value,
        "p_holm": test.p_holm,
    }
    if isinstance(found, RateDifference):
        pairs = found.pairs
        return {
            **common,
            "test": "McNemar, exact, two-sided",
            "both": pairs.both,
            "first_only": pairs.first_only,
            "second_only": pairs.second_only,
            "neither": pairs.neither,
            "difference": found.difference,
            "low": found.low,
            "high": found.high,
            "odds_ratio": found.odds_ratio,
        }
    return {
        **common,
        "test": "Wilcoxon signed-rank, Pratt's zeros, two-sided",
        "n": found.n,
        "median_difference_s": found.median,
        "low_s": found.low,
        "high_s": found.high,
        "rank_biserial": found.rank_biserial,
    }


def _plain(value: object) -> object:
    """Return the value with null for numbers that are not finite, which JSON has no word for."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value

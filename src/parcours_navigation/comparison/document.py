"""A comparison as one JSON document, complete; docs/comparing.md says what each entry is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import cast

import numpy as np

from parcours import __version__
from parcours.verdict.statistics import Rate, RateDifference, quantiles, wilson
from parcours_navigation.comparison.analysis import Analysis, PairTest, Standing
from parcours_navigation.comparison.requiring import requirement_document
from parcours_navigation.comparison.results import Floats

FORMAT = "comparison/1"

_AT = (0.05, 0.25, 0.5, 0.75, 0.95)


def comparison_document(found: Analysis) -> dict[str, object]:
    """Return the whole comparison as JSON values; what is not known is null."""
    can, cannot, made = found.solvable, found.unsolvable, found.results
    document: dict[str, object] = {
        "parcours": FORMAT,
        "version": __version__,
        "cases": made.n_cases,
        "seed": made.seed,
        "protocol": made.protocol,
        "command_delay_s": made.command_delay,
        "note": found.caution,
        "solvable": None if can is None else wilson(can, made.n_cases),
        "undecided": None if can is None or cannot is None else made.n_cases - can - cannot,
        "planners": {one.name: _planner(one) for one in found.standings},
        "benchmarks": [asdict(s) | {"means": dict(zip(found.names, s.means, strict=True))} for s in found.scores],
        "tests_against_first": [_test(test) for test in found.tests],
        "tests_of_all_pairs": [_test(test) for test in found.every_test],
        "reached_where_other_did_not": found.beats.tolist(),
    }
    if made.requirements:
        document["requirements"] = requirement_document(made)
    return cast("dict[str, object]", _plain(document))


def _planner(one: Standing) -> dict[str, object]:
    bracket, taken = one.stuck_of_solvable, one.decisions
    return {
        "answers": one.of.answers,
        "run_again": dict(zip(("equal", "n"), one.of.repeated, strict=True)),
        "outcomes": {outcome.name.lower(): rate for outcome, rate in one.outcomes.items()},
        "questions": one.questions,
        "paper_rule": one.rules,
        "stuck_of_solvable": bracket and dict(zip(("solvable", "not_unsolvable"), bracket, strict=True)),
        "reached_of_solvable": one.reached_of_solvable,
        "time_to_goal_s": _quantiles(one.times),
        "time_to_goal_where_all_reach_s": _quantiles(one.shared_times),
        "min_clearance_m": _quantiles(one.clearances[np.isfinite(one.clearances)]),
        "spl": one.spl,
        "sct": one.sct,
        "measures": one.measures,
        "reached_by_start_vector": one.reached_by_vector,
        "errors": [{"reason": reason, "cases": count} for reason, count in one.errors],
        "decision_us": taken and {"median": taken.median, "p99": taken.p99, "max": taken.largest, "n": taken.n},
    }


def _quantiles(values: Floats) -> dict[str, float | int]:
    named = {f"q{round(100 * share):02d}": value for share, value in zip(_AT, quantiles(values, _AT), strict=True)}
    return {"n": int((~np.isnan(values)).sum()), **named}


def _test(test: PairTest) -> dict[str, object]:
    names = {"first": test.first, "second": test.second, "question": test.question}
    head: dict[str, object] = {**names, "p": test.p_value, "p_holm": test.p_holm}
    found = test.found
    if isinstance(found, RateDifference):
        counts = {name: getattr(found.pairs, name) for name in ("both", "first_only", "second_only", "neither")}
        interval = {"difference": found.difference, "low": found.low, "high": found.high}
        return head | {"test": "McNemar, exact, two-sided", **counts, **interval, "odds_ratio": found.odds_ratio}
    head |= {"test": "Wilcoxon signed-rank, Pratt's zeros, two-sided", "n": found.n}
    interval = {"median_difference_s": found.median, "low_s": found.low, "high_s": found.high}
    return head | interval | {"rank_biserial": found.rank_biserial}


def _plain(value: object) -> object:
    """Return the value as JSON values, with null for numbers that are not finite."""
    if isinstance(value, Rate):
        return {name: _plain(getattr(value, name)) for name in ("count", "n", "share", "low", "high")}
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

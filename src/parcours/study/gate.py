"""Decides whether a build may pass, and why not: `--fail-if "failed > 1%"`. For `--baseline` see `comparing`.

    condition = [statistic "("] measure [")"] ("<" | "<=" | ">" | ">=") number ["%"] ["with" number "% confidence"]
    statistic = "mean" | "median" | "min" | "max" | "p" number
    measure   = name | ("violated" | "robustness") "(" requirement ")"

A rate is the share of the cases; a quantity is averaged by default. The interval is printed beside the
figure (Wilson's of a rate, Student's of a mean, by ranks of a quantile). The condition is asked of the figure itself,
or, with a confidence, of the whole interval.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, one_of
from parcours.study.parameters import Settings
from parcours.study.protocol import Measure, Results
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import wilson

_STATISTIC = r"(?P<statistic>mean|median|min|max|p[0-9]{1,2}(?:\.[0-9]+)?)"
_MEASURE = r"(?:(?:violated|robustness)\s*\(\s*[A-Za-z_][A-Za-z0-9_.-]*\s*\)|[A-Za-z_][A-Za-z0-9_]*)"
_CONDITION = re.compile(
    rf"\s*(?:{_STATISTIC}\s*\(\s*(?P<inner>{_MEASURE})\s*\)|(?P<measure>{_MEASURE}))"
    r"\s*(?P<relation><=|>=|<|>)\s*(?P<limit>-?[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?)\s*(?P<percent>%)?"
    r"(?:\s+with\s+(?P<confidence>[0-9]+(?:\.[0-9]+)?)\s*%\s+confidence)?\s*"
)


@dataclass(frozen=True, slots=True)
class Statistic:
    """A figure of a run with its interval; `n` cases have it."""

    value: float
    low: float
    high: float
    n: int


@dataclass(frozen=True, slots=True)
class GateCondition:
    """A condition under which a build fails.

    >>> condition = parse_condition("failed > 1%")
    >>> measure = Measure(np.array([0.0] * 95 + [1.0] * 5))
    >>> condition.holds(condition.figure(measure))
    True
    >>> parse_condition("p95(duration) >= 0.02 with 99% confidence").confidence
    0.99
    """

    text: str
    measure: str
    relation: str
    limit: float
    statistic: str = ""
    confidence: float | None = None

    def figure(self, measure: Measure) -> Statistic:
        """Return the figure that the condition speaks of, with its interval."""
        confidence = self.confidence or 0.95
        values = measure.values[np.isfinite(measure.values)]
        if measure.kind == "rate" and self.statistic in ("", "mean"):
            rate = wilson(int(values.sum()), len(values), confidence)
            return Statistic(rate.share, rate.low, rate.high, rate.n)
        return _figure(values, self.statistic or "mean", confidence)

    def holds(self, figure: Statistic) -> bool:
        """Return whether the condition holds of a figure: of its whole interval if a confidence is given."""
        if math.isnan(figure.value):
            return False
        if self.confidence is None:
            return _compare(figure.value, self.relation, self.limit)
        return all(_compare(end, self.relation, self.limit) for end in (figure.low, figure.high))


def _compare(value: float, relation: str, limit: float) -> bool:
    return {"<": value < limit, "<=": value <= limit, ">": value > limit, ">=": value >= limit}[relation]


def _figure(values: NDArray[np.float64], statistic: str, confidence: float) -> Statistic:
    n = len(values)
    if n == 0:
        return Statistic(math.nan, math.nan, math.nan, 0)
    if statistic == "mean":
        mean = float(values.mean())
        if n < 2:
            return Statistic(mean, -math.inf, math.inf, n)
        from scipy.stats import t

        half = float(t.ppf(0.5 + confidence / 2, n - 1)) * float(values.std(ddof=1)) / math.sqrt(n)
        return Statistic(mean, mean - half, mean + half, n)
    ordered = np.sort(values)
    if statistic in ("min", "max"):
        end = float(ordered[0 if statistic == "min" else -1])
        return Statistic(end, end, end, n)
    from parcours.verdict.timing.ranks import quantile_ranks

    share = 0.5 if statistic == "median" else float(statistic[1:]) / 100.0
    low, high = quantile_ranks(n, share, (1.0 - confidence) / 2.0)  # on either side
    ends = (float(ordered[low - 1]) if low >= 1 else -math.inf, float(ordered[high - 1]) if high <= n else math.inf)
    return Statistic(float(ordered[min(max(math.ceil(share * n), 1), n) - 1]), *ends, n)


def parse_condition(text: str) -> GateCondition:
    """Return the condition of a text. Raises BadRequest if it is not one."""
    match = _CONDITION.fullmatch(text)
    if match is None:
        rule = f"must be a measure compared with a number, but is {text!r}"
        remedy = 'write "failed > 1%", "errors > 0" or "p95(duration) > 0.02"'
        raise BadRequest("--fail-if", rule, remedy, slug="gate-form")
    confidence = float(match["confidence"]) / 100.0 if match["confidence"] else None
    if confidence is not None and not 0.5 <= confidence < 1.0:
        rule = f"a confidence must be from 50 % to below 100 %, but is {match['confidence']} %"
        raise BadRequest("--fail-if", rule, slug="gate-form")
    limit = float(match["limit"]) / (100.0 if match["percent"] else 1.0)
    measure = "".join((match["inner"] or match["measure"]).split())
    return GateCondition(text.strip(), measure, match["relation"], limit, match["statistic"] or "", confidence)


@dataclass(frozen=True, slots=True)
class GateResult:
    """What became of a condition, or of the comparison with a baseline."""

    name: str
    failed: bool
    why: str


class Measured(Protocol):
    """Whatever has measures to ask for."""

    def measures(self) -> Mapping[str, Measure]:
        """Return them by name."""


@runtime_checkable
class Naming(Protocol):
    """A study that knows before a run which measures its results may have."""

    def measure_names(self, settings: Settings) -> Collection[str]:
        """Return their names; none if it cannot tell."""


def require_measures(conditions: Sequence[GateCondition], known: Collection[str]) -> None:
    """Raise BadRequest if a condition asks for a measure that is not among the known ones."""
    for condition in conditions:
        if condition.measure not in known:
            rule = f"it asks for {condition.measure!r}, which these results do not have"
            raise BadRequest("--fail-if", rule, one_of(condition.measure, list(known)), slug="gate-measure")


def check_condition(condition: GateCondition, results: Measured) -> GateResult:
    """Return what became of a condition. Raises BadRequest if the results have no such measure."""
    measures = results.measures()
    require_measures([condition], measures)
    measure = measures[condition.measure]
    if measure.kind == "rate" and not 0.0 <= condition.limit <= 1.0:  # `stuck > 5` would never fail a build
        rule = f"{condition.measure} is a share, from 0 to 1, but is compared with {condition.limit:g}"
        raise BadRequest(
            "--fail-if", rule, f"write per cent as `{condition.measure} {condition.relation} 5%`", slug="gate-form"
        )
    figure = condition.figure(measure)
    if figure.n == 0:
        return GateResult(condition.text, False, f"no case has a value of {condition.measure}")
    confidence = 100.0 * (condition.confidence or 0.95)
    what = condition.statistic or ("share" if measure.kind == "rate" else "mean")
    values = (figure.value, figure.low, figure.high)
    shown = [f"{100 * one:.4g} %" if measure.kind == "rate" else f"{one:.6g}" for one in values]
    unit = "" if measure.kind == "rate" or measure.unit == "1" else f" {measure.unit}"
    interval = f"{confidence:g} % interval [{shown[1]}, {shown[2]}]"
    why = f"{condition.measure}: {what} {shown[0]}{unit}, {interval}, {figure.n} cases"
    return GateResult(condition.text, condition.holds(figure), why)


def check_conditions(conditions: Sequence[GateCondition], results: Results) -> list[GateResult]:
    """Return what became of each condition; and of cases in error, which no other condition may hide.

    A case that ended in an error shows nothing else that is bad: without this, a system that raises at once
    would pass most gates. A condition on `errors` decides instead, where one is given.
    """
    checked = [check_condition(condition, results) for condition in conditions]
    n = verdicts_of(results)[Verdict.ERROR] if conditions else 0
    if conditions and n and all(condition.measure != "errors" for condition in conditions):
        first = next(case for case in results.cases() if case.verdict is Verdict.ERROR)
        why = f"{n} of {len(results.cases())} cases ended in an error, the first: {first.id}: {first.why}"
        checked.append(GateResult("errors > 0", True, f"{why}; allow some with --fail-if 'errors > 1%'"))
    return checked


@runtime_checkable
class JudgedResults(Protocol):
    """Results that know the verdicts of their cases without wording a reason for each."""

    def case_verdicts(self) -> Sequence[Verdict]:
        """Return the verdicts of `cases`, in their order."""

    def verdict_counts(self) -> Counter[Verdict]:
        """Return how many of `cases` have each verdict."""


def verdicts_of(results: Results) -> Counter[Verdict]:
    """Return how many cases of results have each verdict."""
    return (
        results.verdict_counts()
        if isinstance(results, JudgedResults)
        else Counter(one.verdict for one in results.cases())
    )


def exit_code(results: Iterable[Results]) -> int:
    """Return 0 if all cases passed, 1 if one failed, 3 if some are inconclusive and none failed.

    A run without any case has passed nothing: 3.
    """
    verdicts = {verdict for result in results for verdict, n in verdicts_of(result).items() if n}
    if verdicts & {Verdict.FAIL, Verdict.ERROR}:
        return 1
    return 3 if Verdict.INCONCLUSIVE in verdicts or not verdicts else 0

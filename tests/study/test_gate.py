"""Conditions under which a build fails: what they ask, with which interval, how sure that is, and the exit codes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.stats import binom, t

from parcours.errors import BadRequest
from parcours.report.junit import CaseResult
from parcours.report.pieces import Page
from parcours.study import Measure
from parcours.study.gate import GateCondition, check_condition, check_conditions, exit_code, parse_condition
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import wilson

PASS, FAIL, ERROR, INCONCLUSIVE = Verdict.PASS, Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE


@dataclass
class Made:
    """Results that a test makes up; each case lasts a second."""

    verdicts: Mapping[str, Verdict] = field(default_factory=dict)
    values: Mapping[str, Measure] = field(default_factory=dict)
    label: str = "made up"

    @property
    def planned(self) -> int:
        return len(self.verdicts)

    def cases(self) -> Sequence[CaseResult]:
        return [CaseResult(id, verdict, 1.0) for id, verdict in self.verdicts.items()]

    def measures(self) -> Mapping[str, Measure]:
        return self.values

    def replay(self, case: str) -> Page:
        raise AssertionError("nothing is replayed here")


def rate(count: int, n: int = 100) -> Measure:
    """Return a rate that the first `count` of `n` cases have."""
    return Measure((np.arange(n) < count).astype(float))


def quantity(*values: float, unit: str = "s") -> Measure:
    return Measure(np.array(values), "quantity", unit)


def failed(text: str, measure: Measure) -> bool:
    return check_condition(parse_condition(text), Made(values={"it": measure})).failed


# Conditions as they are written


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("stuck > 1%", ("stuck", ">", 0.01, "", None)),
        ("stuck>0.01", ("stuck", ">", 0.01, "", None)),
        (" contacts  >=  0 ", ("contacts", ">=", 0.0, "", None)),
        ("passed < 99.5 %", ("passed", "<", 0.995, "", None)),
        ("min_clearance <= -1e-3", ("min_clearance", "<=", -0.001, "", None)),
        ("mean(spl) < 0.9", ("spl", "<", 0.9, "mean", None)),
        ("median ( duration ) > 2", ("duration", ">", 2.0, "median", None)),
        ("p99.9(duration) > 0.02", ("duration", ">", 0.02, "p99.9", None)),
        ("max(duration) > 1e3", ("duration", ">", 1000.0, "max", None)),
        ("stuck > 1% with 95% confidence", ("stuck", ">", 0.01, "", 0.95)),
        ("p95(duration) > 0.02 with 99.9 % confidence", ("duration", ">", 0.02, "p95", 0.999)),
        ("mean > 1", ("mean", ">", 1.0, "", None)),
        ("with > 1", ("with", ">", 1.0, "", None)),
    ],
)
def test_a_condition_compares_a_measure_or_a_statistic_of_it_with_a_number(
    text: str, means: tuple[object, ...]
) -> None:
    read = parse_condition(text)
    measure, relation, limit, statistic, confidence = means
    assert (read.measure, read.relation, read.statistic) == (measure, relation, statistic)
    assert read.limit == pytest.approx(limit) and read.confidence == (confidence and pytest.approx(confidence))
    assert read.text == text.strip()


@pytest.mark.parametrize(
    "text",
    ["", "stuck", "stuck >", "> 1%", "stuck = 1", "stuck == 1", "stuck > one", "1% < stuck", "stuck > 1% and late > 1%",
     "mean(stuck > 1", "stuck) > 1", "mean() > 1", "mode(stuck) > 1", "p100(it) > 1", "p(it) > 1", "(it) > 1",
     "stuck > 1% with confidence", "stuck > 1% with 95 confidence", "stuck > 1 %%", "stuck > nan", "stuck > 1_0",
     "violated() > 1", "violated(9) > 1"],
)  # fmt: skip
def test_what_is_no_condition_is_refused_with_what_to_write(text: str) -> None:
    said = re.escape(repr(text))
    with pytest.raises(BadRequest, match=rf'^--fail-if: must be .*{said}; write "failed > 1%".*\[gate-form\]$'):
        parse_condition(text)


@pytest.mark.parametrize("percent", ["49.9", "100", "100.5", "0"])
def test_a_confidence_that_says_nothing_or_all_is_refused(percent: str) -> None:
    with pytest.raises(BadRequest, match=rf"from 50 % to below 100 %, but is {percent} % \[gate-form\]"):
        parse_condition(f"stuck > 1% with {percent}% confidence")


# Figures and their intervals


def test_a_rate_is_the_share_of_the_cases_with_wilsons_interval() -> None:
    for text, confidence in (("it > 1%", 0.95), ("it > 1% with 99% confidence", 0.99)):
        figure, expected = parse_condition(text).figure(rate(5)), wilson(5, 100, confidence)
        assert (figure.value, figure.low, figure.high, figure.n) == (0.05, expected.low, expected.high, 100)


def test_a_condition_is_asked_of_the_figure_or_beyond_chance_of_the_whole_interval() -> None:
    assert failed("it > 4%", rate(5)) and not failed("it > 5%", rate(5)) and failed("it >= 5%", rate(5))
    assert not failed("it > 4% with 95% confidence", rate(5))
    assert not failed("it > 4% with 95% confidence", rate(50, 1000))
    assert failed("it > 4% with 95% confidence", rate(500, 10_000))
    assert failed("it > 4% with 60% confidence", rate(50, 1000))
    assert failed("it < 99%", rate(98)) and not failed("it < 99% with 95% confidence", rate(98))


def test_of_a_quantity_the_mean_is_taken_with_students_interval() -> None:
    values = np.array([1.0, 2.0, 4.0, 8.0])
    low, high = t.interval(0.9, 3, values.mean(), values.std(ddof=1) / 2.0)
    for text in ("it > 1 with 90% confidence", "mean(it) > 1 with 90% confidence"):
        figure = parse_condition(text).figure(quantity(*values))
        assert (figure.value, figure.low, figure.high) == pytest.approx((3.75, low, high))


def test_statistics_of_a_quantity_are_those_of_its_ordered_values() -> None:
    measure = quantity(*range(100, 0, -1))
    for statistic, value in (("min", 1), ("max", 100), ("median", 50), ("p95", 95), ("p99.5", 100), ("p1", 1)):
        assert parse_condition(f"{statistic}(it) > 0").figure(measure).value == value


@pytest.mark.parametrize(("statistic", "share"), [("median", 0.5), ("p90", 0.9)])
def test_the_interval_of_a_quantile_holds_it_as_often_as_it_says(statistic: str, share: float) -> None:
    holds = {}
    for n in (5, 8, 20, 59, 100):
        figure = GateCondition("", "it", ">", 0.0, statistic, 0.95).figure(quantity(*range(1, n + 1)))
        low, high = max(figure.low, 0.0), min(figure.high, n + 1.0)  # ranks
        holds[n] = float(binom.cdf(high - 1, n, share) - (binom.cdf(low - 1, n, share) if low >= 1 else 0.0))
    assert {n: share for n, share in holds.items() if share < 0.95 - 1e-9} == {}


def test_one_value_bounds_nothing_and_none_decides_nothing() -> None:
    assert failed("it > 1", quantity(3.0))
    for statistic in ("mean", "median"):
        assert not failed(f"{statistic}(it) > 1 with 95% confidence", quantity(3.0))
    nothing = check_condition(parse_condition("it > 1"), Made(values={"it": quantity(math.nan, math.inf)}))
    assert not nothing.failed and nothing.why == "no case has a value of it"
    assert not failed("it >= 0%", rate(0, 0))


def test_cases_without_a_value_do_not_count() -> None:
    figure = parse_condition("it > 1%").figure(Measure(np.array([1.0, 0.0, math.nan, math.nan])))
    assert (figure.value, figure.n) == (0.5, 2)
    assert parse_condition("it > 1").figure(quantity(1.0, math.nan, 3.0)).value == 2.0


def test_what_became_of_a_condition_is_said_with_figure_interval_unit_and_number() -> None:
    made = Made(values={"stuck": rate(5), "duration": quantity(0.5, 0.5)})
    stuck = check_condition(parse_condition("stuck > 1%"), made)
    assert (stuck.name, stuck.failed) == ("stuck > 1%", True)
    assert stuck.why == "stuck: share 5 %, 95 % interval [2.154 %, 11.18 %], 100 cases"
    duration = check_condition(parse_condition("max(duration) > 1 with 99% confidence"), made)
    assert not duration.failed
    assert duration.why == "duration: max 0.5 s, 99 % interval [0.5, 0.5], 2 cases"


def test_a_measure_that_the_results_lack_is_refused_with_those_they_have() -> None:
    with pytest.raises(BadRequest, match=r"asks for 'stuk', .*did you mean 'stuck'.*\[gate-measure\]"):
        check_condition(parse_condition("stuk > 1%"), Made(values={"stuck": rate(5)}))


def test_cases_in_error_fail_every_gate_that_does_not_speak_of_them() -> None:
    made = Made({"s/a/0": PASS, "s/a/1": ERROR}, {"stuck": rate(0, 2), "errors": rate(1, 2)})
    stuck, errors = parse_condition("stuck > 1%"), parse_condition("errors > 60%")
    checked = check_conditions([stuck], made)
    assert [(one.name, one.failed) for one in checked] == [("stuck > 1%", False), ("errors > 0", True)]
    assert checked[1].why.startswith("1 of 2 cases ended in an error, the first: s/a/1: ")
    assert [one.failed for one in check_conditions([stuck, errors], made)] == [False, False]
    assert check_conditions([], made) == []


# Exit codes


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [([PASS], 0), ([PASS, FAIL], 1), ([ERROR], 1), ([PASS, INCONCLUSIVE], 3), ([INCONCLUSIVE, FAIL], 1), ([], 3)],
)
def test_the_exit_code_is_that_of_the_worst_case_and_nothing_has_passed_nothing(
    verdicts: list[Verdict], code: int
) -> None:
    assert exit_code([Made({f"s/a/{k}": one for k, one in enumerate(verdicts)})]) == code
    assert exit_code(Made({"s/a/0": one}) for one in verdicts) == code


@pytest.mark.parametrize("text", ["stuck > 5", "stuck >= 101%", "stuck < -0.1"])
def test_a_share_is_not_compared_with_what_no_share_can_be(text: str) -> None:
    with pytest.raises(BadRequest, match=r"stuck is a share, from 0 to 1, but .*stuck .* 5%` \[gate-form\]"):
        check_condition(parse_condition(text), Made(values={"stuck": rate(3)}))

"""Baselines: two runs of the same cases, told apart beyond chance, with the cases that made the difference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.report.junit import CaseResult
from parcours.report.pieces import Page
from parcours.report.terminal import to_text
from parcours.study import Measure
from parcours.study.comparing import Baseline, Compared, outline_of
from parcours.study.comparing import compare_with_baseline as compare_outlines
from parcours.verdict.judgement import Verdict
from parcours.verdict.statistics import holm

PASS, FAIL, ERROR, INCONCLUSIVE = Verdict.PASS, Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE


def compare_with_baseline(now: Made, earlier: Made) -> Baseline:
    return compare_outlines(outline_of(now), outline_of(earlier))


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


def rate(count: int, n: int) -> Measure:
    """Return a rate that the first `count` of `n` cases have."""
    return Measure((np.arange(n) < count).astype(float))


def shown(row: Compared) -> tuple[str, float, float, int, int]:
    return row.name, row.before, row.now, row.only_before, row.only_now


def run(n: int, only: Mapping[str, Sequence[int]], worse: Mapping[str, str] | None = None) -> Made:
    """Return a run of `n` cases: each rate is 1 in the cases of these numbers; those of `failed` do not pass."""
    values = {
        name: Measure(np.isin(np.arange(n), cases).astype(float), worse=(worse or {}).get(name, "more"))  # type: ignore[arg-type]
        for name, cases in only.items()
    }
    return Made({f"s/a/{k}": FAIL if k in only.get("failed", ()) else PASS for k in range(n)}, values)


def test_a_run_is_no_worse_than_itself() -> None:
    one = run(50, {"failed": [1, 2, 3], "late": []})
    compared = compare_with_baseline(one, one)
    assert not compared.failed and compared.shared == 50 and not len(compared.flipped) and not len(compared.repaired)
    assert list(map(shown, compared.rows)) == [("failed", 0.06, 0.06, 0, 0), ("late", 0.0, 0.0, 0, 0)]
    assert compared.lines() == []


def test_a_rate_that_grew_beyond_chance_fails_and_its_cases_are_named() -> None:
    compared = compare_with_baseline(run(50, {"failed": range(6)}), run(50, {"failed": [49]}))
    (row,) = compared.rows
    assert shown(row) == ("failed", 0.02, 0.12, 1, 6)
    assert row.p_value == pytest.approx(0.125) and not compared.failed
    compared = compare_with_baseline(run(50, {"failed": range(7)}), run(50, {"failed": [0]}))
    (row,) = compared.rows
    assert row.p_value == pytest.approx(2 * 0.5**6) and compared.failed
    assert list(compared.flipped) == [f"s/a/{k}" for k in range(1, 7)] == list(row.flipped) and not len(
        compared.repaired
    )
    assert compared.lines() == ["6 cases no longer pass: s/a/1, s/a/2, s/a/3, s/a/4, s/a/5, s/a/6"]
    assert "yes" in to_text(compared.table()) and "50 cases that both have" in to_text(compared.table())


def test_a_rate_that_fell_is_no_failure_and_the_repaired_cases_are_named() -> None:
    compared = compare_with_baseline(run(50, {"failed": []}), run(50, {"failed": range(25)}))
    assert not compared.failed and not len(compared.flipped) and len(compared.repaired) == 25
    (line,) = compared.lines()
    assert line.startswith("25 cases now pass: s/a/0, ") and line.endswith("s/a/19 and 5 more")


def test_which_way_is_worse_is_the_measures_and_what_is_neither_is_not_tested() -> None:
    worse = {"reached": "less", "shown": ""}
    many, few = (run(50, {"reached": range(n), "shown": range(n)}, worse) for n in (40, 10))
    few.values = {**few.values, "length": Measure(np.arange(50.0), "quantity", "m")}
    many.values = {**many.values, "length": Measure(np.arange(50.0), "quantity", "m")}
    compared = compare_with_baseline(few, many)
    assert [row.name for row in compared.rows if row.worse] == ["reached"]
    assert list(compared.rows[0].flipped) == [f"s/a/{k}" for k in range(10, 40)] and not len(compared.flipped)
    (line,) = compared.lines()
    assert line.startswith("30 cases made reached worse: s/a/10, ") and line.endswith("s/a/29 and 10 more")
    assert not compare_with_baseline(many, few).failed
    assert [row.name for row in compare_with_baseline(many, few).rows] == ["reached"]


def test_many_rates_are_tested_with_a_correction_for_their_number() -> None:
    alone = compare_with_baseline(run(50, {"late": range(6)}), run(50, {"late": []}))
    assert alone.failed and alone.rows[0].p_value == pytest.approx(0.03125)
    beside = compare_with_baseline(run(50, {"late": range(6), "stuck": []}), run(50, {"late": [], "stuck": []}))
    assert not beside.failed and beside.rows[0].p_value == pytest.approx(0.0625)


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_holms_correction_is_that_of_its_definition(p_values: list[float]) -> None:
    adjusted, n = holm(p_values), len(p_values)
    order = sorted(range(n), key=lambda k: p_values[k])
    for rank, k in enumerate(order):
        assert adjusted[k] == max(min(1.0, (n - j) * p_values[order[j]]) for j in range(rank + 1))


def test_cases_are_paired_by_their_ids_in_whatever_order_and_number() -> None:
    earlier = run(30, {"failed": range(10, 20)})
    turned = Made(
        dict(reversed(list(earlier.verdicts.items()))), {"failed": Measure(earlier.values["failed"].values[::-1])}
    )
    assert shown(compare_with_baseline(turned, earlier).rows[0])[3:] == (0, 0)
    first = run(15, {"failed": range(10, 15)})
    compared = compare_with_baseline(first, earlier)
    assert compared.shared == 15 and shown(compared.rows[0]) == ("failed", 1 / 3, 1 / 3, 0, 0)


def test_runs_without_a_common_case_cannot_be_compared() -> None:
    other = Made({f"other/a/{k}": PASS for k in range(5)}, {"failed": rate(0, 5)})
    with pytest.raises(BadRequest, match=r"must have cases in common.*same seed.*\[baseline-cases\]"):
        compare_with_baseline(run(5, {"failed": []}), other)


def test_a_case_that_becomes_inconclusive_has_flipped() -> None:
    earlier, now = Made({"s/a/0": PASS, "s/a/1": FAIL}), Made({"s/a/0": INCONCLUSIVE, "s/a/1": ERROR})
    compared = compare_with_baseline(now, earlier)
    assert (list(compared.flipped), list(compared.repaired), compared.rows) == (["s/a/0"], [], ())

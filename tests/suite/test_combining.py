"""A plan crosses abstract cases, rows and time budgets; each case is found by its number."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import InputModel, cover, split
from parcours.errors import BadRequest, BadSuite
from parcours.suite import Plan, combine

INPUTS = InputModel(
    "m",
    (
        split("x", "m", [0.5, 1, 1.5, 2]),
        split("v", "m/s", [0, 0.25, 0.5]),
        split("n", "1", [1, 7], kind="integer"),
    ),
)
ABSTRACTS = tuple(f"DOPS-0.{i}.{j}" for i in range(3) for j in range(i, i + 3))
PLANS = st.builds(
    lambda n_abstracts, budgets, seed, n_cases: combine(
        "s", ABSTRACTS[:n_abstracts], INPUTS, time_budgets=budgets, seed=seed, n_cases=n_cases
    ),
    st.integers(1, 9),
    st.lists(st.floats(0.01, 30), min_size=1, max_size=3),
    st.integers(0, 2**64 - 1),
    st.integers(1, 60),
)


@settings(max_examples=40)
@given(PLANS)
def test_a_case_is_the_same_alone_in_a_stream_and_in_a_shuffled_batch(plan: Plan) -> None:
    stream = list(plan.cases())
    assert [case.number for case in stream] == list(range(len(plan)))
    order = np.random.default_rng(len(plan)).permutation(len(plan))
    batch = plan.values(order)
    for number, values in zip(order, batch, strict=True):
        assert plan.case(int(number)) == stream[number]
        assert np.array(stream[number].values).tobytes() == values.tobytes()


@settings(max_examples=40)
@given(PLANS)
def test_ids_are_unique_and_lead_back_to_the_number(plan: Plan) -> None:
    cases = list(plan.cases())
    assert len({case.id for case in cases}) == len(cases)
    assert all(plan.number(case.abstract, case.row) == case.number for case in cases)


def test_a_longer_plan_begins_with_the_shorter_one() -> None:
    short = combine("s", ABSTRACTS, INPUTS, seed=3, n_cases=20)
    long = combine("s", ABSTRACTS, INPUTS, seed=3, n_cases=3000)
    assert list(long.cases(0, 20)) == list(short.cases())
    assert list(long.cases(1015, 20)) == [long.case(number) for number in range(1015, 1035)]


def test_by_default_every_abstract_case_meets_every_block_with_nine_times_three_cases() -> None:
    plan = combine("s", ABSTRACTS, INPUTS, seed=3)
    assert len(plan) == 27
    cases = list(plan.cases())
    for abstract in ABSTRACTS:
        table = np.array([case.values for case in cases if case.abstract == abstract])
        assert len(table) == 3 and cover(INPUTS, table).is_complete


def test_a_plan_cut_anywhere_treats_abstract_cases_alike() -> None:
    plan = combine("s", ABSTRACTS, INPUTS, n_cases=905)
    counts = [sum(case.abstract == abstract for case in plan.cases()) for abstract in ABSTRACTS]
    assert sorted(counts) == [100] * 4 + [101] * 5


def test_every_row_of_data_is_run_with_every_time_budget() -> None:
    plan = combine("s", ABSTRACTS[:2], INPUTS, time_budgets=(0.005, 0.05), seed=3)
    assert len(plan) == 2 * 2 * 3
    budgets: dict[tuple[str, tuple[float, ...]], set[float]] = {}
    for case in plan.cases():
        budgets.setdefault((case.abstract, case.values), set()).add(case.time_budget)
    assert len(budgets) == 6 and all(found == {0.005, 0.05} for found in budgets.values())


def test_abstract_cases_share_no_values_and_no_shuffling() -> None:
    plan = combine("s", ABSTRACTS, INPUTS, n_cases=900)
    assert len({case["x"] for case in plan.cases()}) == 900
    patterns = plan.blocks(np.arange(900)).reshape(100, 9, 3)
    assert (patterns[:, 0] != patterns[:, 1]).any()


def test_the_last_case_of_a_huge_plan_costs_no_more_than_the_first() -> None:
    plan = combine("s", ABSTRACTS, INPUTS, n_cases=10**15)
    began = time.perf_counter()
    case = plan.case(10**15 - 1)
    assert case.row == (10**15 - 1) // 9 and time.perf_counter() - began < 1.0


@pytest.mark.parametrize("n_cases", [0, -1])
def test_no_or_fewer_cases_are_refused(n_cases: int) -> None:
    with pytest.raises(BadRequest, match="case-count"):
        combine("s", ABSTRACTS, INPUTS, n_cases=n_cases)


def test_requests_that_make_no_sense_are_refused() -> None:
    with pytest.raises(BadRequest, match="plan-empty"):
        combine("s", [], INPUTS)
    with pytest.raises(BadRequest, match="plan-empty"):
        combine("s", ["a", "a"], INPUTS)
    with pytest.raises(BadRequest, match="unknown-criterion"):
        combine("s", ["a"], INPUTS, criterion="pairwize")
    with pytest.raises(BadSuite, match="case-id"):
        combine("s", ["a/b"], INPUTS)
    with pytest.raises(BadSuite, match="time-budget"):
        combine("s", ["a"], INPUTS, time_budgets=[-1.0])
    with pytest.raises(BadSuite, match="case-number"):
        combine("s", ["a"], INPUTS, seed=-1)


def test_numbers_and_names_outside_the_plan_are_refused() -> None:
    plan = combine("s", ABSTRACTS, INPUTS, n_cases=10)
    for number in (-1, 10):
        with pytest.raises(BadRequest, match="case-number"):
            plan.case(number)
    with pytest.raises(BadRequest, match="unknown-abstract"):
        plan.number("DOPS-9", 0)
    with pytest.raises(BadRequest, match="case-number"):
        plan.number(ABSTRACTS[0], 5)

"""Covering arrays hold every combination, as a checker that shares no code with them counts it."""

from __future__ import annotations

import itertools
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data.arrays.building import covering_array, fewest_rows
from parcours.data.arrays.constructions import constructions, field, halves, orthogonal, starter_vector, turned
from parcours.data.arrays.covertable_engine import covertable_rows
from parcours.data.arrays.goals import Ints, goals_of
from parcours.errors import BadRequest

QUICK = 0.2  # seconds


def missing_of(rows: Ints, sizes: list[int], strength: int) -> set[tuple[tuple[int, int], ...]]:
    """Return the combinations that no row holds, by looking at each."""
    wanted = {
        tuple(zip(columns, blocks, strict=True))
        for columns in itertools.combinations(range(len(sizes)), min(strength, len(sizes)))
        for blocks in itertools.product(*(range(sizes[c]) for c in columns))
    }
    held = {
        tuple((c, row[c]) for c in columns)
        for row in rows.tolist()
        for columns in itertools.combinations(range(len(sizes)), min(strength, len(sizes)))
    }
    assert held <= wanted
    return wanted - held


@pytest.mark.parametrize(
    ("sizes", "strength", "most"),
    [
        ([3] * 4, 2, 9),
        ([3] * 13, 2, 19),
        ([4] * 15 + [3] * 17 + [2] * 29, 2, 38),
        ([4] + [3] * 39 + [2] * 35, 2, 28),
        ([2] * 100, 2, 10),
        ([10] * 20, 2, 190),
        ([4] * 10, 3, 156),
        ([2] * 20, 4, 68),
    ],
)
def test_arrays_are_as_small_as_the_issue_asks_and_hold_everything(sizes: list[int], strength: int, most: int) -> None:
    array = covering_array(goals_of(sizes, strength))  # by the work that is allowed, not by the clock
    assert not missing_of(array.rows, sizes, strength)
    assert array.fewest <= len(array.rows) <= most


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 4), min_size=1, max_size=6), st.integers(1, 4), st.integers(0, 9))
def test_any_array_holds_every_combination_and_no_fewer_rows_than_its_bound(
    sizes: list[int], strength: int, seed: int
) -> None:
    goals = goals_of(sizes, strength)
    array = covering_array(goals, budget=0.01, seed=seed)
    assert not missing_of(array.rows, sizes, strength)
    assert math.prod(sorted(sizes)[-strength:]) <= array.fewest <= len(array.rows)
    for row in range(len(array.rows)):
        part = np.delete(array.rows, row, axis=0)
        named = {goals.tuple_of(int(number)) for number in goals.missing(part)}
        wide = {tuple(pairs) for pairs in missing_of(part, sizes, strength)}
        assert named == wide


def test_without_a_budget_a_seed_gives_the_same_array_and_another_seed_another() -> None:
    goals = goals_of([4, 3, 3, 3, 2, 2], 2)
    first, again, other = (covering_array(goals, seed=seed).rows for seed in (3, 3, 4))
    assert (first == again).all() and len(first) == 12
    assert first.tobytes() != other.tobytes()


def test_without_a_budget_a_slow_machine_finds_the_same_array(monkeypatch: pytest.MonkeyPatch) -> None:
    goals = goals_of([4, 3, 3, 3, 2], 2)
    swift = covering_array(goals, seed=3)
    ticks = itertools.count(step=1000.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(ticks))
    slow = covering_array(goals, seed=3)
    assert "covertable" in {stage.name for stage in swift.stages}
    assert [stage.name for stage in slow.stages] == [stage.name for stage in swift.stages]
    assert (slow.rows == swift.rows).all()
    hurried = covering_array(goals, seed=3, budget=1.0)
    assert "covertable" not in {stage.name for stage in hurried.stages}


def test_groups_have_a_strength_of_their_own() -> None:
    sizes = [3, 3, 3, 2, 2]
    array = covering_array(goals_of(sizes, 2, [((0, 1, 2), 3)]), budget=QUICK)
    assert not missing_of(array.rows, sizes, 2)
    assert not missing_of(array.rows[:, :3], [3, 3, 3], 3)
    assert len(array.rows) == 27 == array.fewest


def test_must_have_rows_stay_come_first_and_count() -> None:
    must = np.array([[0, 0, 0, 0], [1, 1, 1, 1], [2, 2, 2, 2]])
    array = covering_array(goals_of([3] * 4, 2), must, budget=QUICK)
    assert (array.rows[:3] == must).all()
    assert not missing_of(array.rows, [3] * 4, 2)
    assert len(array.rows) <= 11
    whole = covering_array(goals_of([3] * 4, 2), array.rows, budget=QUICK)
    assert (whole.rows == array.rows).all()


@pytest.mark.parametrize("q", [2, 3, 4, 5, 7, 8, 9, 16, 25, 27])
def test_fields_have_the_laws_of_fields(q: int) -> None:
    plus, times = field(q)
    everything = set(range(q))
    for table in (plus, times[1:, 1:]):
        assert all(set(row) == everything - ({0} if table is not plus else set()) for row in table.tolist())
    a, b, c = np.meshgrid(*[np.arange(q)] * 3, indexing="ij")
    assert (times[a, plus[b, c]] == plus[times[a, b], times[a, c]]).all()
    assert (times[a, times[b, c]] == times[times[a, b], c]).all()
    assert (plus == plus.T).all() and (times == times.T).all()


@pytest.mark.parametrize(("q", "strength"), [(3, 2), (4, 2), (4, 3), (5, 3), (9, 2)])
def test_orthogonal_arrays_hold_each_combination_exactly_once(q: int, strength: int) -> None:
    rows = orthogonal(q, strength)
    assert rows.shape == (q**strength, q + 1)
    for columns in itertools.combinations(range(q + 1), strength):
        assert len({tuple(row) for row in rows[:, columns].tolist()}) == q**strength


@pytest.mark.parametrize(("k", "n"), [(2, 4), (3, 4), (4, 5), (10, 6), (35, 8), (36, 9), (126, 10), (127, 11)])
def test_two_block_arrays_have_the_sizes_of_kleitman_and_spencer(k: int, n: int) -> None:
    rows = halves(k)
    assert len(rows) == n == fewest_rows(goals_of([2] * k, 2))
    assert not missing_of(rows, [2] * k, 2)


@pytest.mark.parametrize(("k", "v"), [(20, 10), (7, 3), (12, 5), (13, 6)])
def test_starter_vectors_make_covering_arrays(k: int, v: int) -> None:
    starter = starter_vector(k, v, seed=1)
    assert starter is not None
    rows = turned(starter, v)
    assert len(rows) == k * (v - 1) + 1
    assert not missing_of(rows, [v] * k, 2)


def test_constructions_fill_smaller_parameters_and_stay_whole() -> None:
    sizes = [4, 3, 1, 2, 4]
    for _, rows in constructions(sizes, 3, seed=2):
        assert not missing_of(rows, sizes, 3)


def test_the_other_engine_agrees_on_what_must_be_held() -> None:
    goals = goals_of([3, 2, 2, 4], 2, [((0, 1, 2), 3)])
    must = np.array([[2, 1, 1, 3]])
    rows = covertable_rows(goals, must, seed=1, deadline=math.inf)
    assert rows is not None and (rows[0] == must[0]).all() and goals.are_met_by(rows)
    assert covertable_rows(goals, must, seed=1, deadline=-math.inf) is None


def test_more_combinations_than_can_be_counted_are_refused_before_any_work() -> None:
    with pytest.raises(BadRequest, match="tuples-many"):
        goals_of([10] * 1000, 6)


def test_what_compiling_takes_is_in_the_time_of_no_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]

    def slow(*given: object) -> None:
        now[0] += 60.0  # as the compiler takes

    monkeypatch.setattr("parcours.data.arrays.building.repair", slow)
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    assert covering_array(goals_of((2, 2), 2)).stages[0].seconds == 0.0

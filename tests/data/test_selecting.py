"""Combination criteria: what each must combine, how many rows it takes, any row found by number."""

from __future__ import annotations

import itertools
import time
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.data.selecting import count, select
from parcours.errors import BadRequest

LISTED = ("each_choice", "base_choice", "all_combinations")
SIZES = st.lists(st.integers(1, 6), min_size=1, max_size=8)
OBSTACLE = [3, 3, 2, 2, 1, 1]


@pytest.mark.parametrize(
    ("sizes", "each", "base", "every"),
    [
        (OBSTACLE, 3, 7, 36),
        (OBSTACLE * 3, 3, 19, 46_656),
        ([9, *OBSTACLE * 3], 9, 27, 419_904),
        ([3, 1, 2, 1, 3], 3, 6, 18),
        ([1] * 10, 1, 1, 1),
    ],
)
def test_set_sizes_are_those_of_ammann_and_offutt(sizes: list[int], each: int, base: int, every: int) -> None:
    assert [count(name, sizes) for name in ("each_choice", "base_choice", "all_combinations")] == [
        each,
        base,
        every,
    ]
    assert len(select("each_choice", sizes)) == each
    assert len(select("base_choice", sizes)) == base


@given(SIZES, st.integers(0, 2**64 - 1), st.integers(0, 10**9))
def test_every_repetition_of_each_choice_places_every_block(sizes: list[int], seed: int, repetition: int) -> None:
    n = count("each_choice", sizes)
    rows = select("each_choice", sizes, np.arange(n) + repetition * n, seed=seed)
    assert rows.shape == (max(sizes), len(sizes))
    for column, size in enumerate(sizes):
        assert set(rows[:, column]) == set(range(size))


@given(SIZES, st.integers(0, 2**32), st.sampled_from(LISTED), st.randoms())
def test_a_row_is_the_same_alone_in_company_and_in_any_order(
    sizes: list[int], seed: int, criterion: str, random: Random
) -> None:
    numbers = list(range(12))
    random.shuffle(numbers)
    together = select(criterion, sizes, np.array(numbers), seed=seed)
    for number, row in zip(numbers, together, strict=True):
        assert (select(criterion, sizes, np.array([number]), seed=seed)[0] == row).all()


def test_pairings_vary_between_repetitions_and_between_seeds() -> None:
    table = select("each_choice", OBSTACLE, np.arange(300), seed=1).reshape(100, 3, 6)
    # 36 pairings of x, y, v, w blocks are possible; 300 shuffled rows meet them all.
    assert len({tuple(row) for row in table.reshape(300, 6)}) == 36
    assert len({table[i].tobytes() for i in range(100)}) > 50
    assert (select("each_choice", OBSTACLE, np.arange(300), seed=2) != table.reshape(300, 6)).any()


def test_each_choice_favours_no_block() -> None:
    rows = select("each_choice", [3, 2, 1], np.arange(30_000), seed=5)
    # sizes 3 and 2 in 3 rows: shares 1/3 and 1/2, standard error below 0.003
    assert np.abs(np.bincount(rows[:, 0]) / 30_000 - 1 / 3).max() < 0.015
    assert np.abs(np.bincount(rows[:, 1]) / 30_000 - 1 / 2).max() < 0.015


@given(SIZES)
def test_base_choice_changes_one_parameter_at_a_time_through_all_its_blocks(sizes: list[int]) -> None:
    rows = select("base_choice", sizes)
    assert not rows[0].any()
    changed = [(int(np.flatnonzero(row)[0]), int(row[row > 0][0])) for row in rows[1:]]
    assert all(np.count_nonzero(row) == 1 for row in rows[1:])
    assert changed == [(column, block) for column, size in enumerate(sizes) for block in range(1, size)]


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4))
def test_all_combinations_are_all_and_each_once(sizes: list[int]) -> None:
    rows = [tuple(row) for row in select("all_combinations", sizes).tolist()]
    assert rows == list(itertools.product(*(range(size) for size in sizes)))


def test_all_combinations_are_counted_and_reached_without_being_listed() -> None:
    sizes = [9, *OBSTACLE * 3] + [10] * 10
    began = time.perf_counter()
    assert count("all_combinations", sizes) == 419_904 * 10**10
    last = select("all_combinations", sizes, np.array([419_904 * 10**10 - 1]))[0]
    assert last.tolist() == [size - 1 for size in sizes]
    assert time.perf_counter() - began < 1.0
    with pytest.raises(BadRequest, match="rows-too-many"):
        select("all_combinations", sizes)


@pytest.mark.parametrize(("criterion", "strength"), [("pairwise", 2), ("3-wise", 3)])
def test_every_repetition_of_t_wise_holds_every_combination_and_no_two_are_alike(criterion: str, strength: int) -> None:
    sizes = [3, 3, 2, 4]
    n = count(criterion, sizes)
    tables = [select(criterion, sizes, np.arange(n) + k * n, seed=5) for k in range(4)]
    for table in tables:
        for columns in itertools.combinations(range(4), strength):
            assert len({tuple(row) for row in table[:, columns].tolist()}) == np.prod([sizes[c] for c in columns])
    assert len({table.tobytes() for table in tables}) == 4
    alone = [select(criterion, sizes, np.array([k]), seed=5)[0].tolist() for k in range(n)]
    assert alone == tables[0].tolist()


def test_an_unknown_criterion_is_answered_with_the_known_ones() -> None:
    with pytest.raises(BadRequest, match=r"did you mean 'each_choice'\? Known: .*all_combinations"):
        count("each_choise", [2])


@pytest.mark.parametrize("sizes", [[], [2, 0], [-1]])
def test_parameters_without_blocks_are_refused(sizes: list[int]) -> None:
    with pytest.raises(BadRequest, match="blocks-none"):
        select("each_choice", sizes)


def test_a_negative_row_number_and_a_seed_beyond_64_bits_are_refused() -> None:
    with pytest.raises(BadRequest, match="row-number"):
        select("each_choice", [2], np.array([-1]))
    with pytest.raises(BadRequest, match="seed"):
        select("each_choice", [2], seed=2**64)

"""Neighbours: the grid finds what a plain search over all bodies finds, in the same order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours_navigation.others.neighbours import FEW, fill_grid, nearest_bodies, table_size
from parcours_navigation.protocol import Floats


def by_grid(bodies: Floats, cell: float, i: int, reach: float, most: int) -> list[int]:
    heads, cells = np.empty(table_size(len(bodies)), np.int64), np.empty((len(bodies), 3), np.int64)
    fill_grid(bodies, cell, heads, cells)
    found, squares = np.empty(max(most, 1), np.int64), np.empty(max(most, 1))
    n = nearest_bodies(bodies, cell, heads, cells, i, reach, most, found, squares)
    return [int(j) for j in found[:n]]


def by_search(bodies: Floats, i: int, reach: float, most: int) -> list[int]:
    near = []
    for j, other in enumerate(bodies):
        square = float((other[0] - bodies[i, 0]) ** 2 + (other[1] - bodies[i, 1]) ** 2)
        if j != i and square < reach * reach:
            near.append((square, j))
    return [j for _, j in sorted(near)[:most]]


@settings(max_examples=200)
@given(
    st.integers(0, 2**32 - 1), st.integers(1, 200), st.sampled_from([0.5, 5.0, 40.0, 1e5]), st.floats(0.1, 12.0),
    st.integers(0, 16), st.booleans(),
)  # fmt: skip
def test_the_nearest_few_are_those_of_a_plain_search(
    seed: int, n: int, wide: float, reach: float, most: int, on_grid: bool
) -> None:
    rng = np.random.default_rng(seed)
    bodies = rng.uniform(-wide, wide, (n, 2))
    if on_grid:  # equal distances, equal places
        bodies = np.round(bodies)
    for i in rng.integers(0, n, 5):
        for cell in (0.25 * reach, 1.0):
            assert by_grid(bodies, cell, int(i), reach, most) == by_search(bodies, int(i), reach, most)


@pytest.mark.parametrize("n", [FEW, FEW + 1])
def test_bodies_in_one_place_come_by_number(n: int) -> None:
    bodies = np.zeros((n, 2))
    assert by_grid(bodies, 1.0, 3, 2.0, 5) == [0, 1, 2, 4, 5]

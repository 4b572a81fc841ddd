"""Block coverage is counted from the values themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.data import InputModel, cover, draw, select, split
from parcours.errors import BadRequest

MODEL = InputModel("m", (split("v", "m/s", [0.0, 0.25, 0.5]), split("x", "m", [0.5, 1.0, 1.5, 2.0])))
TABLES = st.lists(st.tuples(st.floats(-0.1, 0.6), st.floats(0.4, 2.1)), max_size=12).map(
    lambda rows: np.array(rows, dtype=float).reshape(len(rows), 2)
)


@given(TABLES)
def test_every_value_is_counted_once_in_its_block_or_outside(table: np.ndarray) -> None:
    coverage = cover(MODEL, table)
    for column, domain in enumerate(MODEL.domains):
        slow = [sum(value in block for value in table[:, column]) for block in domain.blocks]
        assert list(coverage.counts[column]) == slow
        assert sum(slow) + coverage.outside[column] == len(table) == coverage.n_rows


@given(st.integers(0, 2**64 - 1))
def test_one_repetition_of_each_choice_hits_every_block(seed: int) -> None:
    rows = select("each_choice", MODEL.sizes, seed=seed)
    coverage = cover(MODEL, draw(MODEL, rows, np.arange(len(rows)), seed=seed))
    assert coverage.is_complete and coverage.n_hit == coverage.n_blocks == 5


def test_what_is_missing_is_named() -> None:
    coverage = cover(MODEL, np.array([[0.1, 0.7], [0.2, 1.7]]))
    assert coverage.uncovered == ("v in (0.25, 0.5] m/s", "x in (1, 1.5] m")
    assert not coverage.is_complete and coverage.n_hit == 3


def test_a_value_outside_every_block_spoils_completeness() -> None:
    table = np.array([[0.1, 0.7], [0.3, 1.2], [0.9, 1.7]])
    assert not cover(MODEL, table).uncovered
    assert cover(MODEL, table).outside == (1, 0)
    assert not cover(MODEL, table).is_complete


def test_a_table_of_another_model_is_refused() -> None:
    with pytest.raises(BadRequest, match="table-shape"):
        cover(MODEL, np.zeros((1, 3)))

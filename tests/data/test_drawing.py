"""Drawn values lie in their blocks, meet the constraints, and depend on (seed, case number) alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import Block, Constraint, Domain, InputModel, draw, parse_input_model, select, split
from parcours.errors import BadDomain, BadRequest
from parcours.model.expression import parse_expression
from parcours.streams import VALUES, starts, uniforms

DISCS = parse_input_model(
    """
parcours: data/1
name: discs
repeat: 3
parameters:
  x: {unit: m, blocks: ["[0.5, 1]", "(1, 1.5]", "(1.5, 2]"]}
  y: {unit: m, blocks: ["[0.5, 1]", "(1, 1.5]", "(1.5, 2]"]}
  n: {unit: "1", kind: integer, edges: [2, 4, 7]}
constraints:
  apart: {pairs: "hypot(a.x - b.x, a.y - b.y) >= 0.2"}
""",
    "discs.yaml",
)
SEEDS = st.integers(0, 2**64 - 1)


@settings(max_examples=50)
@given(SEEDS, st.integers(0, 2**62))
def test_every_value_lies_in_its_block_and_every_row_meets_the_constraints(seed: int, first: int) -> None:
    cases = first + np.arange(30)
    rows = select("each_choice", DISCS.sizes, cases, seed=seed)
    values = draw(DISCS, rows, cases, seed=seed)
    for row, blocks in zip(values, rows, strict=True):
        for value, domain, block in zip(row, DISCS.domains, blocks, strict=True):
            assert value in domain.blocks[block]
            assert domain.kind == "real" or float(value).is_integer()
        centres = [row[0:2], row[3:5], row[6:8]]
        for i in range(3):
            for j in range(i):
                assert math.dist(centres[i], centres[j]) >= 0.2 - 1e-12


@settings(max_examples=30)
@given(SEEDS, st.permutations(range(12)))
def test_a_row_has_the_same_bits_alone_in_a_batch_and_in_any_order(seed: int, order: list[int]) -> None:
    cases = np.array(order)
    rows = select("each_choice", DISCS.sizes, cases, seed=seed)
    batch = draw(DISCS, rows, cases, seed=seed)
    for number, row, values in zip(order, rows, batch, strict=True):
        alone = draw(DISCS, row[np.newaxis], np.array([number]), seed=seed)
        assert alone.tobytes() == values.tobytes()


def test_seeds_and_case_numbers_give_different_values() -> None:
    rows = np.zeros((2, len(DISCS.domains)), dtype=np.int64)
    first = draw(DISCS, rows, np.array([0, 1]), seed=1)
    second = draw(DISCS, rows, np.array([0, 1]), seed=2)
    reals = [column for column, domain in enumerate(DISCS.domains) if domain.kind == "real"]
    assert (first[0, reals] != first[1, reals]).all()
    assert (first[:, reals] != second[:, reals]).all()


def test_values_fill_their_block_evenly() -> None:
    model = InputModel("m", (split("x", "m", [1.0, 3.0]), split("n", "1", [1, 4], kind="integer")))
    n = 40_000
    values = draw(model, np.zeros((n, 2), dtype=np.int64), np.arange(n), seed=3)
    tenths = np.bincount(((values[:, 0] - 1.0) * 5).astype(int), minlength=10) / n
    assert np.abs(tenths - 0.1).max() < 0.01  # standard error 0.0015
    assert np.abs(np.bincount(values[:, 1].astype(int), minlength=5)[1:] / n - 0.25).max() < 0.012


def test_within_constraints_the_remaining_part_of_the_block_is_filled_evenly() -> None:
    rule = Constraint("lower", parse_expression("x + y <= 1"))
    model = InputModel("triangle", (split("x", "m", [0, 1]), split("y", "m", [0, 1])), (rule,))
    values = draw(model, np.zeros((20_000, 2), dtype=np.int64), np.arange(20_000), seed=3)
    assert (values.sum(axis=1) <= 1).all()
    assert np.abs(values.mean(axis=0) - 1 / 3).max() < 0.01  # centroid of the triangle; standard error 0.0017


@pytest.mark.parametrize("low_closed", [True, False])
@pytest.mark.parametrize("high_closed", [True, False])
def test_open_ends_are_never_drawn_even_from_the_narrowest_block(low_closed: bool, high_closed: bool) -> None:
    block = Block(1.0, 1.0 + 4 * math.ulp(1.0), low_closed=low_closed, high_closed=high_closed)
    model = InputModel("narrow", (Domain("x", "m", (block,)),))
    values = draw(model, np.zeros((2000, 1), dtype=np.int64), np.arange(2000))[:, 0]
    assert all(value in block for value in values)
    assert len(set(values)) >= 3


def test_the_streams_are_those_of_compiled_code() -> None:
    from parcours import streams

    for seed, case, purpose in [(0, 0, VALUES), (7, 904, VALUES), (2**64 - 1, 2**40, 1)]:
        stream = np.zeros(1, dtype=np.uint64)
        streams.start(stream, np.uint64(seed), np.uint64(case), np.uint64(purpose))
        compiled = [streams.uniform(stream) for _ in range(20)]
        assert uniforms(starts(seed, np.array([case]), purpose), 0, 20)[0].tolist() == compiled


def test_a_constraint_that_cannot_be_met_is_named_with_the_blocks() -> None:
    rule = Constraint("far", parse_expression("x1 - x2 >= 1"))
    domains = (split("x1", "m", [0.0, 1.0, 2.0]), split("x2", "m", [0.0, 1.0]), split("z", "m", [0.0, 1.0]))
    model = InputModel("m", domains, (rule,))
    assert draw(model, np.array([[1, 0, 0]]), np.array([5])).shape == (1, 3)
    with pytest.raises(BadDomain) as caught:
        draw(model, np.array([[1, 0, 0], [0, 0, 0]]), np.array([5, 6]), tries=50)
    message = str(caught.value)
    assert "case 6" in message and "'far'" in message and "x1 - x2 >= 1" in message
    assert "x1 in [0, 1] m, x2 in [0, 1] m" in message and "z in" not in message
    assert "50 draws" in message and caught.value.slug == "constraint-unmet"


@pytest.mark.parametrize("case", range(12))
def test_the_very_last_try_counts_and_there_is_none_after_it(case: int) -> None:
    rule = Constraint("rare", parse_expression("x < 0.05"))
    model = InputModel("m", (split("x", "m", [0.0, 1.0]),), (rule,))
    rows, cases = np.zeros((1, 1), dtype=np.int64), np.array([case])
    words = uniforms(starts(0, cases, VALUES), 0, 1000)[0]
    needed = int(np.argmax(words < 0.05)) + 1
    assert draw(model, rows, cases, tries=needed)[0, 0] == words[needed - 1]
    with pytest.raises(BadDomain, match=f"within {needed - 1} draws"):
        draw(model, rows, cases, tries=needed - 1)


def test_rows_that_do_not_fit_the_model_are_refused() -> None:
    with pytest.raises(BadRequest, match="rows-shape"):
        draw(DISCS, np.zeros((2, 3), dtype=np.int64), np.arange(2))
    with pytest.raises(BadRequest, match="block-index"):
        draw(DISCS, np.full((1, 9), 3), np.array([0]))
    with pytest.raises(BadRequest, match="case-number"):
        draw(DISCS, np.zeros((1, 9), dtype=np.int64), np.array([-1]))


def test_no_case_gives_an_empty_table() -> None:
    assert draw(DISCS, np.zeros((0, 9), dtype=np.int64), np.zeros(0, dtype=np.int64)).shape == (0, 9)


def test_a_constraint_met_once_in_thousands_of_draws_is_met_and_alone_as_in_company() -> None:
    rule = Constraint("rare", parse_expression("x < 0.0002"))
    model = InputModel("m", (split("x", "m", [0.0, 1.0]),), (rule,))
    rows = np.zeros((30, 1), dtype=np.int64)
    together = draw(model, rows, np.arange(30))
    assert (together < 0.0002).all()
    for case in (0, 13, 29):
        words = uniforms(starts(0, np.array([case]), VALUES), 0, 100_000)[0]
        first = words[words < 0.0002][0]
        assert together[case, 0] == first == draw(model, rows[:1], np.array([case]))[0, 0]

"""Blocks partition their domain: every value of the range lies in exactly one of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.data.blocks import Block
from parcours.data.domains import OUTSIDE, Domain, split
from parcours.errors import BadDomain

EDGES = st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=8, unique=True).map(sorted)
CLOSED = st.sampled_from(["left", "right"])


@given(EDGES, CLOSED, st.floats(0, 1))
def test_a_value_of_the_range_lies_in_exactly_one_block(edges: list[float], closed: str, share: float) -> None:
    domain = split("d", "m", edges, closed="left" if closed == "left" else "right")
    value = min(max(edges[0] + share * (edges[-1] - edges[0]), edges[0]), edges[-1])
    holders = [index for index, block in enumerate(domain.blocks) if value in block]
    assert holders == [domain.block_of(value)]


@given(EDGES, CLOSED)
def test_edges_and_their_neighbours_have_one_owner_and_beyond_the_ends_none(edges: list[float], closed: str) -> None:
    domain = split("d", "m", edges, closed="left" if closed == "left" else "right")
    near = [x for edge in edges for x in (edge, math.nextafter(edge, -math.inf), math.nextafter(edge, math.inf))]
    for value in near:
        holders = [index for index, block in enumerate(domain.blocks) if value in block]
        inside = edges[0] <= value <= edges[-1]
        assert holders == ([domain.block_of(value)] if inside else [])
        assert (value in domain) == inside


@pytest.mark.parametrize(("closed", "owner"), [("right", 0), ("left", 1)])
def test_closed_says_which_neighbour_owns_an_inner_edge(closed: str, owner: int) -> None:
    assert split("v", "m/s", [0, 1, 2], closed="left" if closed == "left" else "right").block_of(1.0) == owner


def test_the_fast_lookup_agrees_with_asking_every_block() -> None:
    domain = split("x", "m", [0.5, 1.0, 1.5, 2.0])
    values = np.concatenate([np.linspace(0, 2.5, 1001), [0.5, 1.0, 1.5, 2.0, math.nan, math.inf, -math.inf]])
    slow = [next((i for i, block in enumerate(domain.blocks) if v in block), OUTSIDE) for v in values]
    assert domain.blocks_of(values).tolist() == slow


def test_only_whole_numbers_lie_in_an_integer_domain() -> None:
    domain = split("n", "1", [2, 7], kind="integer")
    assert [domain.block_of(n) for n in (1.0, 2.0, 2.5, 7.0, 8.0)] == [OUTSIDE, 0, OUTSIDE, 0, OUTSIDE]


@pytest.mark.parametrize(
    ("blocks", "slug"),
    [
        ((), "blocks-none"),
        ((Block(0, 1), Block(2, 3)), "blocks-gap"),
        ((Block(0, 2), Block(1, 3)), "blocks-overlap"),
        ((Block(1, 2), Block(0, 1)), "blocks-overlap"),
        ((Block(0, 1), Block(1, 2)), "blocks-edge"),
        ((Block(0, 1, high_closed=False), Block(1, 2, low_closed=False)), "blocks-edge"),
    ],
)
def test_blocks_that_do_not_partition_are_refused(blocks: tuple[Block, ...], slug: str) -> None:
    with pytest.raises(BadDomain) as caught:
        Domain("d", "m", blocks)
    assert caught.value.slug == slug


def test_a_stated_range_may_differ_in_openness_but_not_in_its_ends() -> None:
    blocks = (Block(0.0, 0.25), Block(0.25, 0.5, low_closed=False))
    Domain("v", "m/s", blocks, stated=Block(0.0, 0.5, low_closed=False, high_closed=False))
    with pytest.raises(BadDomain, match="blocks-range"):
        Domain("v", "m/s", blocks, stated=Block(0.0, 0.6))


@pytest.mark.parametrize("ends", [(1.0, 0.0), (0.0, math.inf), (math.nan, 1.0)])
def test_a_block_without_values_or_without_bounds_is_refused(ends: tuple[float, float]) -> None:
    with pytest.raises(BadDomain):
        Block(*ends)


def test_an_open_block_of_no_width_holds_nothing_and_is_refused() -> None:
    assert 1.0 in Block(1.0, 1.0)
    with pytest.raises(BadDomain, match="block-empty"):
        Block(1.0, 1.0, low_closed=False)


def test_a_block_of_an_integer_domain_needs_a_whole_number() -> None:
    with pytest.raises(BadDomain, match="block-empty"):
        Domain("n", "1", (Block(0.2, 0.8),), kind="integer")


@pytest.mark.parametrize(("edges", "slug"), [([1.0], "edges-few"), ([0.0, 0.5, 0.25], "edges-order")])
def test_edges_that_make_no_blocks_are_refused(edges: list[float], slug: str) -> None:
    with pytest.raises(BadDomain) as caught:
        split("v", "m/s", edges)
    assert caught.value.slug == slug


def test_the_message_names_domain_values_and_unit() -> None:
    with pytest.raises(BadDomain, match=r"domain 'v': edges must increase, but 0.25 m/s follows 0.5 m/s"):
        split("v", "m/s", [0.0, 0.5, 0.25])


def test_blocks_of_integers_may_be_written_by_their_first_and_last_number() -> None:
    blocks = (Block(0, 3), Block(4, 7))
    domain = Domain("n", "1", blocks, "integer")
    assert domain.blocks_of(np.arange(-1.0, 9.0)).tolist() == [OUTSIDE, 0, 0, 0, 0, 1, 1, 1, 1, OUTSIDE]
    with pytest.raises(BadDomain, match="blocks-gap"):
        Domain("n", "1", (Block(0, 3), Block(5, 7)), "integer")
    with pytest.raises(BadDomain, match="blocks-gap"):
        Domain("n", "1", blocks, "real")

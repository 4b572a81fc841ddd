"""Waterfalls of chains: what is drawn are reactions that occurred, and the table says how sure p99 is."""

from __future__ import annotations

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.report.chains import chain_table, reaction_at, waterfall
from parcours.report.terminal import to_text
from parcours.verdict.timing import Chain

SHARES = np.random.default_rng(3).integers(1_000_000, 9_000_000, (400, 3))
REACTION = Chain("stop", ("Filter", "on plan", "Follower"), tuple(map(tuple, SHARES.tolist())))


def test_the_waterfall_shows_two_reactions_that_occurred() -> None:
    for quantile in (0.5, 0.99):
        shown = reaction_at(REACTION, quantile)
        assert tuple(shown) in REACTION.rows
        assert shown.sum() == np.quantile(REACTION.totals, quantile, method="inverted_cdf")
    figure = waterfall("Reaction", REACTION, [20_000_000])
    assert all(f">{name}<" in figure.svg for name in (*REACTION.steps, "whole", "typical (p50)", "rare (p99)"))
    assert f"typical (p50) {reaction_at(REACTION, 0.5).sum() * 1e-6:.3g} ms: Filter" in figure.alt
    assert figure.alt.endswith("; limit 20 ms")


def test_the_table_has_an_interval_and_counts_repeats_that_depend_on_each_other_as_fewer() -> None:
    *_, (_, _, p99, low, high, counted, share) = chain_table("Shares", REACTION).rows
    assert low <= p99 <= high  # type: ignore[operator]
    assert (counted, share) == (400, 1.0)
    slow = Chain("stop", REACTION.steps, tuple(sorted(REACTION.rows)))
    assert chain_table("Shares", slow).rows[0][-2] < 100  # type: ignore[operator]
    few = Chain("stop", REACTION.steps, REACTION.rows[:50])
    assert chain_table("Shares", few).rows[-1][4] is None
    assert "on plan" in to_text(chain_table("Shares", few))


def test_a_chain_without_reactions_is_not_drawn() -> None:
    with pytest.raises(BadRequest, match="chart-data"):
        waterfall("Reaction", Chain("stop", ("A",), ()))

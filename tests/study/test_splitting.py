"""A rare failure is estimated without bias, its interval holds the truth, and moves stay among what campaigns draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from input_axes import AXES
from parcours.data import InputModel, parse_input_model
from parcours.data.constraints import allows
from parcours.data.drawing import draw
from parcours.data.selecting import select
from parcours.errors import BadRequest
from parcours.streams import starts, uniforms
from parcours.study.cube import Cube
from parcours.study.splitting import FAILS, Descent, Rarity, _Flight, estimate, rarity
from parcours.verdict.statistics import mean_of_log_normal

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
CORNER = "constraints: {corner: {row: a + b < 3}}\n"


class Ours:
    """Needs no preparation: workers are forked."""

    def prepare(self) -> bool:
        return True


@dataclass
class Corner:
    """Fails in a corner of a, b, c and of a number that the case's own number decides: as likely as `side`**4."""

    side: float
    inputs: InputModel = field(default_factory=lambda: parse_input_model(AXES, "axes"))
    event: str = "in the corner"
    study: object = field(default_factory=Ours)
    period: int = 3

    def drawn(self, numbers: Integers) -> Floats:
        return draw(self.inputs, select("each_choice", self.inputs.sizes, numbers, seed=3), numbers, seed=3)

    def settled(self, values: Floats, numbers: Integers) -> tuple[Floats, NDArray[np.bool_]]:
        return values, allows(self.inputs, values)

    def simulate(self, values: Floats, numbers: Integers) -> tuple[Floats, Sequence[Sequence[str]]]:
        assert len(set(numbers.tolist())) == len(numbers)
        a, b, c = values[:, 0], values[:, 1] / 2.0, 0.5 + values[:, 2] / 2.0
        a = np.where(a < 1.0, a / 2.0, 0.5 + (a - 1.0) / 6.0)  # uniform, as the blocks are equally likely
        other = uniforms(starts(1, numbers, 9), 0, 1)[:, 0]
        far = 1.0 - np.min([a, b, c, other], axis=0) - self.side
        return far, [("cornered",) if one < 0.0 else () for one in far]

    def keep(self, values: Floats, number: int, cause: str, out: Path) -> Sequence[Path]:
        raise AssertionError


def estimated(search: Corner, seed: int = 1, budget: int = 1000, workers: int = 1, repeats: int = 3) -> Rarity:
    return estimate(search, seed=seed, budget=budget, repeats=repeats, workers=workers, progress=lambda *_: None)


def here(search: Corner, seed: int, n: int, levels: tuple[float, ...]) -> Rarity:
    """Return what ten repeats find in this process."""
    descent = Descent(search, seed, n, levels)
    return rarity(descent, 0, descent(1, 10))


def test_intervals_hold_a_known_probability_and_estimates_have_no_bias() -> None:
    side = 0.1
    levels = (0.4623, 0.2162, 0.0778, FAILS)  # each passed by a tenth
    found = [here(Corner(side), seed, 600, levels) for seed in range(2)]
    assert all(one.low <= side**4 <= one.high for one in found)
    values = np.concatenate([one.repeats for one in found]) / side**4
    assert abs(values.mean() - 1.0) < 3.0 * values.std() / np.sqrt(len(values)) < 1.0
    for one in found:
        assert one.values is not None and one.values["a"] > 3.4 and one.values["b"] > 1.8 and one.values["c"] > 0.8


def test_moves_keep_to_what_a_campaign_draws_also_where_constraints_leave_blocks_unlike_room() -> None:
    search = Corner(0.1, parse_input_model(AXES + CORNER, "axes"))
    flight = _Flight(Descent(search, 1, 1), 1)
    cube, numbers = Cube(search.inputs), np.arange(3000)
    values = search.drawn(numbers)
    points = cube.points(values, np.full(values.shape, 0.5))
    assert np.abs(cube.values(points) - values).max() < 1e-9
    for _ in range(15):
        points = flight._proposed(points, numbers)
    moved = cube.values(points)
    assert allows(search.inputs, moved).all()
    # Within the constraint the second block of a has a third of its room, yet half of the cases of a campaign.
    assert abs((moved[:, 0] > 1.0).mean() - 0.5) < 0.03
    assert np.abs(moved.mean(axis=0) - values.mean(axis=0)).max() < 0.1
    before = cube.points(values, np.full(values.shape, 0.5))
    one = flight._proposed(before, numbers)
    steps = np.abs(one - before)[(one != before).any(axis=1)]
    assert ((steps > 0.0).sum(axis=1) == 1).mean() > 0.2 and np.median(steps.max(axis=1)) < 0.05  # most are short


def test_workers_change_nothing_and_no_more_is_simulated_than_the_budget() -> None:
    found = estimated(Corner(0.3))
    assert found.simulations <= 1000 and found.reached and len(found.repeats) == 3
    assert estimated(Corner(0.3), workers=2) == found != estimated(Corner(0.3), seed=2)


def test_common_failures_are_counted_and_what_was_not_reached_is_bounded() -> None:
    often = estimated(Corner(0.8))
    assert often.levels == () and often.low <= 0.8**4 <= often.high and often.high - often.low < 0.12
    never = estimated(Corner(-0.3))
    assert not never.reached and never.nearest > 0.0 and never.values is None
    assert "no failure was found" in str(never) and f"within {never.nearest:.4g} of (in the corner)" in str(never)


def test_repeats_that_find_nothing_widen_the_interval_but_leave_one() -> None:
    found = here(Corner(0.1), 1, 100, (0.4, 0.15, FAILS))
    assert 0.0 in found.repeats and 0.0 < found.low <= 0.1**4 <= found.high < 0.01
    assert "of the repeats found none" in str(found)


def test_what_no_repeat_reaches_is_bounded_by_the_cases_that_a_campaign_draws() -> None:
    descent = Descent(Corner(-0.1), 1, 100, (0.9, 0.5, FAILS))
    found = rarity(descent, 0, descent(1, 10))
    assert found.probability == found.low == 0.0
    assert 3.0 / 3000 < found.high < 4.0 / 3000  # 10 times 100 at each level, and three times as many at first


def test_the_interval_is_one_of_the_mean_of_skew_estimates() -> None:
    drawn = np.exp(np.random.default_rng(1).normal(-0.32, 0.8, (400, 10)))  # of mean 1 and median 0.7
    ends = np.array([mean_of_log_normal(one) for one in drawn])
    assert 0.92 < ((ends[:, 0] <= 1.0) & (ends[:, 1] >= 1.0)).mean() < 0.98
    some = np.where(np.random.default_rng(2).random(drawn.shape) < 0.3, drawn / 0.3, 0.0)  # most find nothing
    ends = np.array([mean_of_log_normal(one) for one in some])
    assert (ends[:, 0] <= 1.0).mean() > 0.97 and np.median(ends[:, 0]) > 0.1 and (ends[:, 1] >= 1.0).mean() > 0.97


def test_without_inputs_or_budget_there_is_no_estimate() -> None:
    with pytest.raises(BadRequest, match="falsify-inputs"):
        estimated(Corner(0.1, InputModel("none", ())))
    with pytest.raises(BadRequest, match="rare-budget"):
        estimated(Corner(0.1), budget=200)

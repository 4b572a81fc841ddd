"""A search over input domains fails where random cases do not, takes the same way each time, and obeys constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from input_axes import AXES
from parcours.data import InputModel, parse_input_model
from parcours.errors import BadRequest
from parcours.study.cube import Cube
from parcours.study.falsifying import Falsified, falsify
from parcours.study.samplers import Method

Floats = NDArray[np.float64]


@dataclass
class Bowl:
    """Fails within `radius` of a point of the inputs; remembers what it was given."""

    radius: float
    inputs: InputModel = field(default_factory=lambda: parse_input_model(AXES, "axes"))
    event: str = "too near"
    seen: list[Floats] = field(default_factory=list)

    def simulate(self, values: Floats, numbers: NDArray[np.int64]) -> tuple[Floats, Sequence[Sequence[str]]]:
        self.seen.append(values)
        far = np.abs((values - [3.0, 0.5, 0.3, 4.0]) / [3.0, 2.0, 2.0, 6.0]).max(axis=1) - self.radius
        return far, [("too near",) if one < 0.0 else () for one in far]

    def keep(self, values: Floats, number: int, cause: str, out: Path) -> Sequence[Path]:
        raise AssertionError


def ran(search: Bowl, seed: int, method: Method = "evolution", budget: int = 2000, cause: str = "") -> Falsified:
    return falsify(search, seed=seed, budget=budget, progress=lambda what, done, all: None, method=method, cause=cause)


@pytest.mark.parametrize("method", ["evolution", "cma-es"])
def test_a_guided_search_finds_in_hundreds_of_simulations_what_random_cases_find_in_thousands(method: Method) -> None:
    guided = [ran(Bowl(0.03), seed, method) for seed in range(10)]
    assert all(one.cause == "too near" and one.robustness < 0.0 for one in guided)
    assert np.median([one.simulations for one in guided]) < 500
    assert sum(not ran(Bowl(0.03), seed, "random").cause for seed in range(10)) >= 6


@pytest.mark.parametrize("method", get_args(Method))
def test_a_search_ends_with_its_budget_counts_what_it_simulates_and_repeats_itself(method: Method) -> None:
    search = Bowl(-1.0)  # never
    found = ran(search, 3, method, 701)
    assert (found.cause, found.simulations, sum(map(len, search.seen))) == ("", 701, 701)
    assert ran(Bowl(-1.0), 3, method, 701) == found != ran(Bowl(-1.0), 4, method, 701)
    assert ran(Bowl(2.0), 3, method).simulations == 1 and ran(Bowl(2.0), 3, method, cause="other").simulations == 2000


@pytest.mark.parametrize("limit", [3.0, 0.15])  # no case of some generations of CMA-ES meets the second
def test_cases_lie_in_their_domains_and_meet_the_constraints(limit: float) -> None:
    given = parse_input_model(f"{AXES}constraints: {{near: {{row: a + b < {limit}}}}}\n", "axes")
    for method in get_args(Method):
        search = Bowl(-1.0, given)
        ran(search, 1, method, 400)
        seen = np.concatenate(search.seen)
        assert (seen[:, 0] + seen[:, 1] < limit).all() and given.blocks_of(seen).min() >= 0
    assert set(seen[:, 3].tolist()) <= {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}


def test_random_cases_have_each_block_equally_often() -> None:
    points = np.random.default_rng(0).random((4000, 4))
    given = parse_input_model(AXES, "axes")
    share = (given.blocks_of(Cube(given).values(points))[:, 0] == 0).mean()
    assert abs(share - 0.5) < 0.03


def test_without_inputs_or_with_constraints_that_cannot_be_met_there_is_nothing_to_search() -> None:
    with pytest.raises(BadRequest, match="falsify-inputs"):
        ran(Bowl(0.1, InputModel("none", ())), 1)
    never = parse_input_model(AXES + "constraints: {never: {row: a + b < 0.0000001}}\n", "axes")
    with pytest.raises(BadRequest, match="falsify-inputs"):
        ran(Bowl(0.1, never), 1)

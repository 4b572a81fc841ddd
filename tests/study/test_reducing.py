"""Reduced cases fail still, are found within the budget, and are the same each time."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours.study.reducing import CaseShape, Reduced, reduce

SHAPE = CaseShape(lists=("discs", "only"), optional=("noise",), times=(("limit",),), zero=("turn",), fixed=("robot",))


def case(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    discs = [{"x": float(rng.uniform(0, 9)), "turn": float(rng.normal()), "only": [0, 1, 2]} for _ in range(12)]
    return {"robot": {"radius": 0.12345}, "discs": discs, "noise": 0.3, "limit": 60.5}


def fails(one: dict[str, Any]) -> bool:
    """Two discs that lie apart matter, one member of the second, and time; a case without any disc is none."""
    if not one["discs"]:
        raise BadRequest("case", "it must have discs", slug="test")
    low = any(disc["x"] < 3.3 for disc in one["discs"])
    high = any(disc["x"] > 6.6 and 1 in disc["only"] for disc in one["discs"])
    return low and high and one["limit"] > 12.5


def reduced(seed: int, budget: int = 199) -> tuple[Reduced, int]:
    calls = 0

    def counted(one: dict[str, Any]) -> bool:
        nonlocal calls
        found = fails(one)
        calls += 1
        return found

    return reduce(case(seed), counted, SHAPE, budget), calls


@pytest.mark.parametrize("seed", range(5))
def test_what_is_left_is_what_the_failure_needs(seed: int) -> None:
    given = case(seed)
    before = copy.deepcopy(given)
    found, calls = reduced(seed)
    assert given == before  # what was given is left as it was
    assert found.complete and found.runs == calls <= 120 and fails(found.data)
    assert len(found.data["discs"]) == 2 and sum(len(disc["only"]) for disc in found.data["discs"]) == 1
    assert found.data["limit"] == 13 and "noise" not in found.data and found.data["robot"] == {"radius": 0.12345}
    assert all(disc["turn"] == 0 and len(str(disc["x"])) <= 3 for disc in found.data["discs"])
    assert reduced(seed)[0] == found


@pytest.mark.parametrize("budget", [0, 1, 7, 20])
def test_a_budget_is_kept_and_what_was_found_by_then_fails(budget: int) -> None:
    found, calls = reduced(3, budget)
    assert calls == found.runs == budget and not found.complete and fails(found.data)

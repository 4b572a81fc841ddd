"""What campaigns cover together is what their cases are made of, and what is missing has a name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from parcours.data import split
from parcours.data.inputs import InputModel
from parcours.errors import BadRequest
from parcours.study.covering import Drawn, coverage
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request

INPUTS = InputModel("inputs", (split("x", "m", [0.0, 1.0, 2.0]), split("y", "m", [0.0, 1.0, 2.0])))


class Made:
    """Results whose cases a test makes up."""

    def __init__(self, values: list[tuple[float, float]], starts: list[str]) -> None:
        self._drawn = Drawn(INPUTS, np.array(values), {"start": (("a", "b"), np.array(starts))}, "start")

    def drawn(self) -> Drawn:
        return self._drawn


def test_folders_count_together_and_what_is_missing_is_named() -> None:
    one, other = Made([(0.5, 0.5), (1.5, 0.5)], ["a", "a"]), Made([(0.5, 1.5)], ["a"])
    goals = {goal.name: goal for goal in coverage({"one": one, "other": other})}  # type: ignore[dict-item]
    assert [(goal.wanted, goal.held) for goal in goals.values()] == [(4, 4), (4, 3), (2, 1), (8, 4)]
    assert goals["blocks, pairs"].missing == ("x = (1, 2], y = (1, 2]",) and goals["start, each"].missing == ("b",)
    assert goals["start x blocks"].missing[0] == "b: x in [0, 1] m"
    alone = {goal.name: goal for goal in coverage({"one": one})}  # type: ignore[dict-item]
    assert alone["blocks, each"].missing == ("y in (1, 2] m",) and "a: y in (1, 2] m" in alone["start x blocks"].missing


def test_a_campaign_is_asked_and_a_study_of_components_refused(tmp_path: Path) -> None:
    study = find(str(Path(__file__).parents[2] / "examples" / "parking"))
    request = Request(settings_of(study.parameters, {"workers": 1}), 1, tmp_path, 24)
    study.run(request, lambda what, done, total: None)
    goals = {goal.name: goal for goal in coverage({"x": study.read(tmp_path)})}
    assert goals["blocks, each"].held == goals["blocks, each"].wanted > 0 and "error" in goals["verdicts, each"].missing
    with pytest.raises(BadRequest, match="coverage-kind"):
        coverage({"x": object()})  # type: ignore[dict-item]

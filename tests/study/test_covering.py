"""What campaigns cover together is what their cases are made of, and what is missing has a name."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from parcours.cli import parcours
from parcours.data import measure, split
from parcours.data.inputs import InputModel
from parcours.errors import BadRequest
from parcours.study.covering import Drawn, closing, coverage
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request

INPUTS = InputModel("inputs", (split("x", "m", [0.0, 1.0, 2.0]), split("y", "m", [0.0, 1.0, 2.0])))


class Made:
    """Results whose cases a test makes up."""

    def __init__(self, values: list[tuple[float, float]], starts: list[str]) -> None:
        codes = np.array(["ab".index(one) for one in starts])
        self._drawn = Drawn(INPUTS, np.array(values), {"start": (("a", "b"), codes)}, "start")

    def drawn(self) -> Iterator[Drawn]:
        yield self._drawn


def test_folders_count_together_and_what_is_missing_is_named() -> None:
    one, other = Made([(0.5, 0.5), (1.5, 0.5)], ["a", "a"]), Made([(0.5, 1.5)], ["a"])
    goals = {goal.name: goal for goal in coverage({"one": one, "other": other})}  # type: ignore[dict-item]
    assert [(goal.wanted, goal.held) for goal in goals.values()] == [(4, 4), (4, 3), (2, 1), (8, 4), (8, 3)]
    assert goals["blocks, pairs"].missing == ("x = (1, 2], y = (1, 2]",) and goals["start, each"].missing == ("b",)
    assert goals["start x blocks"].missing[0] == "b: x in [0, 1] m"
    assert goals["start x pairs"].missing[0] == "a: x = (1, 2], y = (1, 2]"
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


def test_a_campaign_that_closes_pairs_runs_its_own_cases_those_that_fill_most_holes_first(tmp_path: Path) -> None:
    parking = str(Path(__file__).parents[2] / "examples" / "parking")
    words = ["run", parking, "--until", "pairwise = 100%", "--workers", "1", "--out"]
    result = CliRunner().invoke(parcours, [*words, str(tmp_path / "pairs")])
    assert result.exit_code in (0, 1) and "pairwise = 100%: by " in result.output
    study = find(parking)
    goals = {goal.name: goal for goal in coverage({"x": study.read(tmp_path / "pairs")})}
    assert goals["blocks, pairs"].held == goals["blocks, pairs"].wanted > 0
    kept = {one.name: one.read_bytes() for one in (tmp_path / "pairs").glob("shard*")}
    again = CliRunner().invoke(parcours, [*words, str(tmp_path / "pairs")])  # resumed: nothing is left to do
    CliRunner().invoke(parcours, [*words, str(tmp_path / "other")])
    assert again.exit_code == result.exit_code and kept
    assert all((tmp_path / "other" / name).read_bytes() == content for name, content in kept.items())
    facts = study.read(tmp_path / "pairs").facts  # type: ignore[attr-defined]
    plain = Request(settings_of(study.parameters, {"workers": 1}), 1, tmp_path / "all", int(facts["number"].max()) + 1)
    study.run(plain, lambda what, done, total: None)
    every = study.read(tmp_path / "all").facts  # type: ignore[attr-defined]
    assert len(facts) < len(every) and every[facts["number"]].tobytes() == facts.tobytes()


def test_classes_meet_every_block_and_what_cannot_be_covered_is_refused(tmp_path: Path) -> None:
    def request(*until: str, most: int = 5000) -> Request:
        return Request({}, 1, tmp_path, most, until=until)

    drawn = np.random.default_rng(1).random((5000, 2)) * 2.0
    given = (INPUTS, lambda numbers: drawn[numbers], lambda numbers: ["ab"[n % 2] for n in numbers], ["a", "b"])
    chosen = closing(request("pairwise = 100%"), *given)
    assert measure(drawn[list(chosen)], INPUTS).is_complete and len(chosen) <= 6
    of = np.array(chosen) % 2
    blocks = INPUTS.blocks_of(drawn[list(chosen)])
    assert all(len(np.unique(blocks[of == k, i])) == 2 for k in (0, 1) for i in (0, 1))
    assert closing(request("stuck ± 1%"), *given) == ()
    assert len(closing(request("pairwise = 50%"), *given)) < len(chosen)
    wrong = {"pairs": ["pairwise = 100%"], "form": ["pairwise = 9%", "stuck ± 1%"]}
    for slug, until in wrong.items():
        with pytest.raises(BadRequest, match=f"until-{slug}"):
            closing(request(*until, most=2), *given)


class Marked(Made):
    """Results whose cases meet what a test says."""

    def __init__(self, words: tuple[str, ...], met: list[list[bool]]) -> None:
        super().__init__([(0.5, 0.5)] * len(met), ["a"] * len(met))
        self._drawn = dataclasses.replace(self._drawn, marks={"marks": (words, np.array(met))})


def test_marks_that_some_case_met_count_over_all_folders_also_where_these_have_different_ones() -> None:
    one = Marked(("p1", "p2", "p3"), [[True, False, False], [False, True, False]])
    other = Marked(("p3", "p4"), [[False, False]])
    (goal,) = (goal for goal in coverage({"one": one, "other": other}) if goal.name == "marks")  # type: ignore[dict-item]
    assert (goal.wanted, goal.held, goal.missing) == (4, 2, ("p3", "p4"))


def test_rules_that_decided_a_case_count_and_three_blocks_together_are_looked_for_on_request(tmp_path: Path) -> None:
    parking = str(Path(__file__).parents[2] / "examples" / "parking")
    CliRunner().invoke(parcours, ["run", parking, "--cases", "60", "--workers", "1", "--out", str(tmp_path / "out")])
    page = str(tmp_path / "page.html")
    shown = CliRunner().invoke(
        parcours, ["coverage", str(tmp_path / "out"), "--strength", "3", "--html", page, "--json"]
    )
    goals = {one["name"]: one for one in json.loads(shown.stdout)}
    assert goals["blocks, 3-wise"]["held"] == goals["blocks, 3-wise"]["wanted"] == 12
    rules = goals["rules that decided a case"]
    assert (rules["held"], rules["wanted"]) == (2, 2)
    assert "Covered and missing" in Path(page).read_text() and "verdicts, each" in Path(page).read_text()

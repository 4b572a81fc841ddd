"""What a search for failing cases finds is a case like any other: replayed, reproduced, made small, kept as a test."""

from __future__ import annotations

import dataclasses
import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.study.falsifying import falsify
from parcours.study.parameters import settings_of
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import touched
from parcours_navigation.requirements.judging import FAR
from parcours_navigation.study.door import study
from parcours_navigation.study.falsifying import NEARNESS, PlannerSearch
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.system.study import system_study


def invoke(*words: str) -> Result:
    return CliRunner().invoke(parcours, list(words))


def falsified(out: Path, *more: str) -> Result:
    return invoke("falsify", "navigation", "--set", "planner=straight-ahead", "--out", str(out), *more)


def test_a_failure_is_found_kept_made_small_and_reproduced(tmp_path: Path) -> None:
    result = falsified(tmp_path / "found", "--seed", "5", "--cause", "collided", "--json")
    found = json.loads(result.stdout)
    assert (result.exit_code, found["cause"], found["seed"]) == (1, "collided", 5) and found["robustness"] < 0.0
    world, test, run = map(Path, found["files"])
    [function] = [one for name, one in runpy.run_path(str(test)).items() if name.startswith("test_")]
    with pytest.raises(AssertionError, match="collided"):
        function()
    number = str(found["number"])
    assert "the robot drove into an obstacle" in " ".join(invoke("replay", str(run), number).stdout.split())
    assert "1 of 1 failing cases reproduced" in invoke("reproduce", str(run)).stdout
    small = json.loads(invoke("shrink", str(run), number, "--out", str(tmp_path / "small"), "--json").stdout)
    assert small["cause"] == "collided" and small["after"]["digits"] < small["before"]["digits"]
    assert json.loads(falsified(tmp_path / "again", "--seed", "5", "--cause", "collided", "--json").stdout) == {
        **found, "files": [one.replace("found/", "again/", 1) for one in found["files"]]
    }  # fmt: skip
    assert (tmp_path / "again" / world.name).read_bytes() == world.read_bytes()


def test_what_the_study_requires_decides_what_is_searched_for(tmp_path: Path) -> None:
    rule = ("--set", "fail=clearance < -0.17", "--cause", "fails by", "--json")
    found = json.loads(falsified(tmp_path / "found", *rule).stdout)
    assert found["cause"] == "fails by clearance < -0.17" and found["robustness"] < 0.0
    none = falsified(tmp_path / "none", "--set", "require=lives: always clearance > -9", "--cause", "violates",
                     "--max-runs", "3")  # fmt: skip
    assert none.exit_code == 0 and "no failure in 3 simulations; nearest 8." in none.stdout
    assert not (tmp_path / "none").exists()


WORLD = """
parcours: world/1
name: yard
ground: {bounds: [0, 0, 12, 8], discs: [[x, 2, 0.4]]}
sensing: {scan: {beams: 9}}
task: {start: [1, 2, 0], goal: [11, 2], time_limit: 3}
data: {parameters: {x: {unit: m, edges: [2, 6, 10]}}}
"""


@pytest.mark.parametrize(("least", "world"), [(0.1, []), (0.3, ["--set", "world=yard.yaml"])])
def test_a_failure_of_a_planner_in_a_file_is_kept_when_it_is_not_case_0(
    least: float, world: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("yard.yaml").write_text(WORLD)
    needs = 'mine.needs = ("scan",)\n' if world else ""
    Path("mine.py").write_text(f"def mine(observation):\n    return 0.2, 0.1\n{needs}")
    rule = ["--set", "planner=mine.py:mine", "--set", f"fail=clearance < {least}", "--seed", "2", "--cause", "fails by"]
    found = json.loads(invoke("falsify", "navigation", *rule, *world, "--out", "found", "--json").stdout)
    assert found["number"] > 0 and all(Path(one).exists() for one in found["files"])


@pytest.mark.parametrize(
    "given",
    [
        {"planner": "ramp-guarded"},
        {"planner": "straight-ahead", "world": "crossing-flows"},
        {"planner": "straight-ahead", "protocol": "published"},
    ],
)
def test_with_the_values_that_a_campaign_draws_a_case_is_the_campaign_s(given: dict[str, str]) -> None:
    settings = settings_of(study().parameters, given)
    campaign, search = study().study(settings, 7), study().search(settings, 7)
    numbers = np.array([40, 3])
    values = campaign.cases.values(numbers)
    again = search._with(values, numbers)  # type: ignore[attr-defined]
    assert again.run(numbers).tobytes() == campaign.run(numbers).tobytes()
    settled, taken = search.settled(values, numbers + 5 * search.period)  # type: ignore[attr-defined]
    assert taken.all() and (settled == values).all() and (search.drawn(numbers) == values).all()  # type: ignore[attr-defined]
    far, _ = search.simulate(values, numbers)
    assert (far < FAR).all() and (search.simulate(values[::-1], numbers[::-1])[0] == far[::-1]).all()


@pytest.mark.parametrize("planner", ["straight-ahead", "ramp-original"])
def test_the_time_to_a_collision_is_negative_where_the_robot_causes_one(planner: str) -> None:
    search = study().search(settings_of(study().parameters, {"planner": planner}), 7)
    numbers = np.arange(400)
    far, causes = search.simulate(search.drawn(numbers), numbers)  # type: ignore[attr-defined]
    collided = np.array([one[:1] == ("collided",) for one in causes])
    assert collided.any() and not collided.all() and ((far < 0.0) == collided).all()
    found = study().study(settings_of(study().parameters, {"planner": planner, "require": f"near: {NEARNESS}"}), 7)
    facts = found.run(numbers)
    negative = facts["robustness"][:, 0] < 0.0  # by itself, from samples
    assert (negative != touched(facts)).sum() <= 1 and (far[~collided] >= 0.0).all()
    assert (facts["t_contact"] != NEVER).sum() > touched(facts).sum()  # who is merely run into is not near


def test_a_planted_fault_is_found() -> None:
    study = dataclasses.replace(system_study("guarded", seed=4), parameters=guarded(guard_horizon=0.2))
    found = falsify(
        PlannerSearch(study, Scenario(), {}), seed=4, budget=300, cause="collided", progress=lambda *_: None
    )
    assert found.cause == "collided" and found.robustness < 0.0


def test_what_cannot_be_searched_is_refused(tmp_path: Path) -> None:
    parking = str(Path(__file__).parents[3] / "examples" / "parking")
    other = invoke("falsify", parking, "--out", str(tmp_path / "no"))
    assert "falsify-study" in str(other.exception) and other.exit_code
    assert not (tmp_path / "no").exists()


def test_how_likely_a_failure_is_agrees_with_a_campaign_and_decides_the_exit_code(tmp_path: Path) -> None:
    asked = ("rare", "navigation", "--set", "planner=straight-ahead", "--set", "fail=clearance < -0.18",
             "--max-runs", "1500", "--repeats", "3", "--workers", "2", "--json")  # fmt: skip
    result = invoke(*asked, "--max-probability", "0.5", "--out", str(tmp_path / "found"))
    found = json.loads(result.stdout)
    assert result.exit_code == 0 and found["event"] == "clearance < -0.18" and found["simulations"] <= 1500
    facts = study().study(settings_of(study().parameters, {"planner": "straight-ahead"}), 9)(0, 2000)
    assert found["low"] <= (facts["min_clearance"] < -0.18).mean() <= found["high"] < 0.5
    assert "fails by clearance < -0.18" in Path(found["files"][1]).read_text()
    assert invoke(*asked, "--max-probability", "0.001").exit_code == 1

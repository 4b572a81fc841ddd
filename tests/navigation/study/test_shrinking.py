"""A failing case becomes a small file and a test that fails as long as the planner has the fault."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from parcours.cli import parcours
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from parcours_navigation.study.shrinking import written
from parcours_navigation.worlds.file import read_world

FAULTY = """
import math

class Straight:
    def observe(self, seen):
        x, y, heading, v, w = seen.robot
        for ox, oy, *_ in seen.obstacles:
            ahead = abs(math.remainder(math.atan2(oy - y, ox - x) - heading, 2 * math.pi)) < 1.2
            if ahead and math.hypot(ox - x, oy - y) < {margin}:
                return 0.0, 0.0
        gx, gy = seen.task.goal
        return 0.2, math.remainder(math.atan2(gy - y, gx - x) - heading, 2 * math.pi)
"""


def invoke(*words: str) -> Result:
    return CliRunner().invoke(parcours, list(words), catch_exceptions=False)


def ran(folder: Path, study: str, chosen: list[str], **given: Any) -> Path:
    found = find(study)
    request = Request(settings_of(found.parameters, {"workers": 1, **given}), 1, folder, chosen=tuple(chosen))
    found.run(request, lambda what, done, total: None)
    return folder


def test_a_test_is_written_that_fails_until_the_planner_is_repaired(tmp_path: Path) -> None:
    planner = tmp_path / "mine.py"
    planner.write_text(FAULTY.format(margin=0.1))
    folder = ran(tmp_path / "now", "navigation", ["0"], planner=f"{planner}:Straight")
    result = invoke("shrink", str(folder), "0", "--out", str(tmp_path / "small"), "--runs", "6", "--json")
    found = json.loads(result.stdout)
    assert (found["cause"], found["runs"], found["complete"]) == ("collided", 6, False)
    [function] = [one for name, one in runpy.run_path(found["files"][1]).items() if name.startswith("test_")]
    with pytest.raises(AssertionError, match="collided"):
        function()
    assert "the robot drove into an obstacle" in invoke("replay", found["files"][2], "0").stdout
    planner.write_text(FAULTY.format(margin=0.5))
    function()


def test_one_obstacle_round_numbers_and_a_short_time_are_left_and_the_same_each_time(tmp_path: Path) -> None:
    folder = ran(tmp_path / "now", "navigation", ["0"], planner="straight-ahead")
    found = json.loads(invoke("shrink", str(folder), "0", "--out", str(tmp_path / "small"), "--json").stdout)
    assert found["complete"] and found["runs"] < 60
    assert (found["before"]["things that move"], found["after"]["things that move"]) == (3, 1)
    assert found["after"]["time limit [s]"] < 21 and found["after"]["digits"] < found["before"]["digits"] / 5
    world, test, _ = map(Path, found["files"])
    kept = world.read_bytes(), test.read_bytes()
    invoke("shrink", str(folder), "0", "--out", str(tmp_path / "small"))
    assert (world.read_bytes(), test.read_bytes()) == kept


@pytest.mark.parametrize(
    ("study", "number", "given"),
    [
        ("ramp_system", 7, {}),
        ("navigation", 3, {"planner": "straight-ahead", "protocol": "published"}),
        ("navigation", 2, {"planner": "straight-ahead", "world": "crossing-flows"}),
        ("navigation", 1, {"planner": "straight-ahead", "world": "office"}),
    ],
)
def test_a_case_written_as_a_world_is_the_case_that_was_drawn(
    tmp_path: Path, study: str, number: int, given: dict[str, Any]
) -> None:
    folder = ran(tmp_path / "now", study, [str(number)], **given)
    results = find(study).read(folder)
    case = written(results, folder, str(number))
    case.write(case.data, tmp_path)
    again = find(study if study == "ramp_system" else "navigation").read(tmp_path / "run")
    kept, facts = results.found.facts[0], again.found.facts[0]  # type: ignore[attr-defined]
    differing = [name for name in kept.dtype.names if kept[name].tobytes() != facts[name].tobytes()]
    assert not differing, {name: (kept[name], facts[name]) for name in differing}
    assert read_world(next(tmp_path.glob("*.yaml"))).inputs is None


def test_what_cannot_be_made_small_is_refused_with_the_reason(tmp_path: Path) -> None:
    folder = ran(tmp_path / "now", "navigation", ["0", "5"], planner="dwa")
    passed = CliRunner().invoke(parcours, ["shrink", str(folder), "0", "--out", str(tmp_path / "no")])
    assert "shrink-passed" in str(passed.exception) and "goal reached" in str(passed.exception)
    parking = str(Path(__file__).parents[3] / "examples" / "parking")
    cars = ran(tmp_path / "cars", parking, ["0"])
    other = CliRunner().invoke(parcours, ["shrink", str(cars), "0", "--out", str(tmp_path / "no")])
    assert "shrink-study" in str(other.exception) and not (tmp_path / "no").exists()


def test_a_violation_is_kept_and_a_shorter_case_violates_it_before_its_end(tmp_path: Path) -> None:
    require = "slow: always speed < 0.2; arrives: eventually goal_distance < 0.3"
    folder = ran(tmp_path / "now", "navigation", ["4"], planner="stand-still", require=require)
    case = written(find("navigation").read(folder), folder, "4")
    assert (case.cause, case.shape.times) == ("violates slow", (("task", "time_limit"),))
    short = {**case.data, "task": {**case.data["task"], "time_limit": 0.5}}
    assert case.causes(short)[:2] == ("violates slow", "violates arrives at the end")
    assert np.isclose(case.sizes(short)["time limit [s]"], 0.5)

"""World files: what they may say, and what is said of those that are wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld, find_world, parse_world, shipped
from parcours_navigation.worlds.plan import Detection, WorldPlan

HERE = Path(__file__).parent
LEAST = "parcours: world/1\nname: yard\ntask: {start: [0, 0, 0], goal: [3, 0]}\n"


def _world(text: str = "", least: str = LEAST) -> WorldPlan:
    return parse_world(least + text, "yard.yaml", HERE).plan()


def test_what_is_left_out_is_the_papers_robot_with_perfect_senses_on_open_ground() -> None:
    plan = _world()
    assert (plan.robot.kind, plan.robot.radius, plan.robot.speed) == ("unicycle", 0.125, 0.25)
    assert plan.sensing.others == Detection()
    assert plan.ground.bounds is None and plan.others == ()


def test_numbers_have_units_and_may_be_expressions() -> None:
    plan = _world(
        "robot: {speed: 50 cm/s, yaw_rate: 90 deg/s, acceleration: 2 * 0.5 m/s2, delay: 20 ms}\n"
        "sensing: {others: {dropped: 5 %}}\n"
    )
    assert plan.sensing.others.dropped == 0.05
    assert (plan.robot.speed, plan.robot.acceleration, plan.robot.delay) == (0.5, 1.0, 0.02)
    assert plan.robot.yaw_rate == pytest.approx(np.pi / 2)


def test_numbers_may_name_inputs_and_each_case_has_its_own() -> None:
    text = "robot: {speed: 2 * slow}\ndata: {parameters: {slow: {unit: m/s, edges: [0.1, 0.2, 0.3]}}}\n"
    world = parse_world(LEAST + text, "yard.yaml", HERE)
    cases = WorldCases(1, world)
    speeds = [cases.plan(number).robot.speed for number in range(20)]
    assert all(0.2 <= speed <= 0.6 for speed in speeds) and len(set(speeds)) == 20
    assert speeds == [2.0 * value for value in cases.values(np.arange(20))[:, 0]]
    assert any(speed < 0.4 for speed in speeds[:2]) and any(speed > 0.4 for speed in speeds[:2])  # each block at once


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("robot: {sped: 1}\n", 4, "no key 'sped'; did you mean 'speed'"),
        ("robot: {speed: fast}\n", 4, "'fast' has none"),
        ("robot: {speed: 5 %}\n", 4, "it must be in m/s"),
        ("robot: {speed: 5 +}\n", 4, "write a number, as 0.5"),
        ("robot: {speed: -1}\n", 4, "must lie in"),
        ("robot:\n  kind: car\n  wheelbase: 0\n", 4, "wheelbase"),
        ("robot: {kind: tank}\n", 4, "unicycle or differential or car or holonomic"),
        ("sensing: {others: {dropped: 2}}\n", 4, "from 0 to 1, but is 2"),
        ("sensing: {scan: {beams: 1000000}}\n", 4, "from 1 to 10000, but is 1e+06"),
        ("sensing: {others: {position_noise: -0.1}}\n", 4, "at least"),
        ("sensing: {scan: {beams: 2.5}}\n", 4, "whole number"),
        ("ground: {bounds: [0, 0, 4]}\n", 4, "must have 4 items, but has 3"),
        ("robot: &a {speed: 1}\n", 4, "a world has no anchors"),
        ("data: {parameters: {v: {unit: m, edges: [0.1, 2e999]}}}\n", 4, "a number must fit 64 bits"),
        ("ground: {walls: [[0, 0, 1, 1], [0, 0, 1]]}\n", 4, "the world, ground, walls 2 must have 4 items"),
        ("worlds: 1\n", 4, "no key 'worlds'"),
        ("data: {parameters: {s: {unit: m, edges: [1, 2]}}}\n", 4, "may not be called 's'"),
    ],
)
def test_a_mistake_is_named_with_its_line(text: str, line: int, words: str) -> None:
    with pytest.raises(BadWorld) as caught:
        _world(text)
    assert words in str(caught.value) or words.replace("at least", "from 0") in str(caught.value)
    assert f"yard.yaml:{line}" in str(caught.value) or f"yard.yaml:{line + 2}" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must have the keys"),
        ("parcours: world/2\nname: x\ntask: {}\n", "the format must be world/1"),
        ("parcours: world/1\nname: 'a b'\ntask: {}\n", "a name consists of"),
        ("- 1\n", "must be a mapping"),
        (
            "parcours: world/1\nname: x\ntask: {goal: [1, 1], ends_outside: [1, 0, 0, 1]}\n",
            "task, ends_outside: its lower corner must be below and left of its upper one",
        ),
        ("parcours: world/1\nname: x\n", "'task'"),
    ],
)
def test_a_file_that_is_no_world_is_refused(text: str, words: str) -> None:
    with pytest.raises(BadWorld) as caught:
        _world(least=text)
    assert words in str(caught.value) or not text


def test_a_world_is_checked_with_values_that_are_drawn_and_says_with_which() -> None:
    text = "robot: {speed: fast}\ndata: {parameters: {fast: {unit: m/s, edges: [-1, -0.5]}}}\n"
    with pytest.raises(BadWorld, match=r"with fast = -0\.\d"):
        _world(text)


@pytest.mark.parametrize("name", sorted(shipped()))
def test_shipped_worlds_are_found_by_name(name: str) -> None:
    world = find_world(name)
    assert world.name == name and world.doc and world.reference == name


def test_an_unknown_world_is_refused_with_a_hint() -> None:
    with pytest.raises(BadWorld, match="did you mean 'doorway'"):
        find_world("dorway")


def test_the_name_of_a_file_without_its_ending_is_refused_with_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "yard.yaml").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadWorld, match=r"did you mean the file 'yard\.yaml'"):
        find_world("yard")

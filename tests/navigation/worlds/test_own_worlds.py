"""Worlds of strangers: what is wrong is said with its line, what nobody can solve is nobody's failure."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from parcours_navigation.checking.scenes import observation, sensed, standard_task
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import Outcome, explain, outcomes
from parcours_navigation.requirements.judging import own_values, verdicts
from parcours_navigation.requirements.requirement import read_requirements
from parcours_navigation.requirements.user_measures import BadMeasure
from parcours_navigation.study.study import NavigationStudy
from parcours_navigation.worlds import staging
from parcours_navigation.worlds.checking import check_world, lines
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld, parse_world, read_world
from parcours_navigation.worlds.solving import _inner_radius
from parcours_navigation.worlds.survivability import survived_worlds

HEAD = "parcours: world/1\nname: own\nrobot: {radius: 0.2, speed: 0.5, yaw_rate: 2}\n"
TASK = "task: {start: [1, 1, 0], goal: [5, 1], time_limit: 20}\n"
ROOM = "ground: {bounds: [0, 0, 6, 4]}\n"


def _cases(folder: Path, text: str) -> WorldCases:
    path = folder / "own.yaml"
    path.write_text(HEAD + text)
    return WorldCases(1, read_world(path))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (ROOM + "others:\n  - 5\n" + TASK, 6, "must be a mapping"),
        ("ground: {generated: null}\n" + TASK, 4, "must be a mapping"),
        ("ground: {generated: {kind: corridor, length: [3]}}\n" + TASK, 4, "it must be a number"),
        ("ground: {generated: {kind: corridor, length: wide}}\n" + TASK, 4, "it must be a number"),
        ("ground: {generated: {kind: barn, fill: -1}}\n" + TASK, 4, "it must be from 0 to 1"),
        ("ground: {generated: {kind: barn}}\ntask: {start: [0, 0, 0], goal: [0, 5]}\n", 5, "start clear of the ground"),
        ("ground: {generated: {kind: barn-300, number: 300}}\ntask: {}\n", 4, "whole numbers from 0 to 299"),
        (ROOM + "others:\n  - {motion: stop-move-stop, speed: fast}\n" + TASK, 6, "speed: it must be two numbers"),
        (ROOM + "others:\n  - {motion: stop-move-stop, area: [1, 2]}\n" + TASK, 6, "area: it must be x_low"),
        (ROOM + "others:\n  - {motion: stop-move-stop, colour: 3}\n" + TASK, 6, "key: must be a known name"),
        (ROOM + "others:\n  - {motion: orca, number: 200, radius: 1}\n" + TASK, 6, "must find room"),
        (ROOM + "others:\n  - {motion: recorded, tracks: /dev/zero}\n" + TASK, 6, "must be readable"),
        (ROOM + "others:\n  - {motion: recorded, tracks: pipe}\n" + TASK, 6, "must be readable"),
        (ROOM + "others:\n  - {motion: recorded, tracks: secret.csv}\n" + TASK, 6, "missing from the first line"),
        (ROOM + "others:\n  - {motion: waypoints, number: 1}\n" + TASK, 6, "must have the key 'points'"),
        (ROOM + "others:\n  - {motion: recorded, number: 3, tracks: one.csv}\n" + TASK, 6, "that of the tracks, 1"),
        ("ground: {bounds: [6, 0, 0, 4]}\n" + TASK, 4, "x0 < x1 and y0 < y1"),
        (ROOM + "others:\n  - {motion: paper}\n" + TASK, 6, "use stop-move-stop"),
        ("ground: {map: none.yaml}\n" + TASK, 4, "must be a file that can be read"),
        (ROOM + "task: {start: [9, 1, 0], goal: [5, 1]}\n", 5, "start clear of the ground"),
        (ROOM + "task: {start: [1, 1, 0], goal: [5, 1], start_speed: 5}\n", 5, "within the robot's top speed"),
    ],
)
def test_what_a_case_cannot_be_made_of_is_said_with_file_line_and_remedy(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "secret.csv").write_text("root:x:0:0\n")
    (tmp_path / "one.csv").write_text("agent,t,x,y\na,0,3,3\n")
    path = tmp_path / "own.yaml"
    path.write_text(HEAD + text)
    with pytest.raises(BadWorld, match=words) as refused:
        check_world(str(path), 2, 1, lambda done, total: None)
    assert refused.value.where.startswith(f"{path}:{line}") and refused.value.remedy
    assert "root:x" not in str(refused.value)


def test_a_world_is_another_one_when_the_picture_of_its_map_changes(tmp_path: Path) -> None:
    cells = np.full((20, 30), 254, np.uint8)
    (tmp_path / "lab.yaml").write_text("image: lab.png\nresolution: 0.2\norigin: [0, 0, 0]\n")
    digests = []
    for wall in (0, 25):
        cells[10, wall] = 0
        Image.fromarray(cells).save(tmp_path / "lab.png")
        parse_world.cache_clear()  # as in another command
        digests.append(_cases(tmp_path, "ground: {map: lab.yaml}\n" + TASK).world.digest)
    assert digests[0] != digests[1]


def test_a_map_that_the_robot_can_leave_is_refused_and_bounds_close_it(tmp_path: Path) -> None:
    cells = np.full((20, 30), 254, np.uint8)  # 6 m x 4 m
    cells[[0, -1]], cells[:, [0, -1]] = 0, 0
    (tmp_path / "lab.yaml").write_text("image: lab.png\nresolution: 0.2\norigin: [0, 0, 0]\n")
    for gap, words in ((0, ""), (1, ""), (4, "the robot can leave it")):  # a gap of 0.2 m is too narrow for it
        cells[10 : 10 + gap, -1] = 254
        Image.fromarray(cells).save(tmp_path / "lab.png")
        for bounds in ("", ", bounds: [-1, -1, 7, 5]"):
            path = tmp_path / f"own{gap}{len(bounds)}.yaml"
            path.write_text(f"{HEAD}ground: {{map: lab.yaml{bounds}}}\n{TASK}")
            parse_world.cache_clear()  # as in another command, which reads the picture again
            staging._fixed.cache_clear()
            staging._leaves.cache_clear()
            if words and not bounds:
                with pytest.raises(BadWorld, match=words) as refused:
                    check_world(str(path), 2, 1, lambda done, total: None)
                assert refused.value.where.startswith(f"{path}:4") and "give bounds" in refused.value.remedy
            else:
                assert check_world(str(path), 2, 1, lambda done, total: None).passed


def test_what_nobody_can_solve_is_inconclusive_unless_the_robot_touches_something(tmp_path: Path) -> None:
    cases = _cases(tmp_path, "ground: {bounds: [0, 0, 6, 4], walls: [[3, 0, 3, 4]]}\n" + TASK)
    for planner, outcome in (("stand-still", Outcome.BLOCKED), ("straight-ahead", Outcome.COLLIDED)):
        study = NavigationStudy(planner, cases, Scenario(time_limit=60.0))
        facts = study(0, 1)
        assert outcomes(facts).tolist() == [outcome]
        again, *_ = study.track(0)
        assert again["goal_gap"][0] == facts["goal_gap"][0], "a replay gives the same facts"
    said = list(lines(check_world(str(tmp_path / "own.yaml"), 2, 1, lambda done, total: None)))[2]
    assert re.match(rf"error: {tmp_path}/own.yaml:\d+: task, goal: .* none can in 2 cases: 0, 1; widen the way", said)
    assert "no robot of this size" in explain(NavigationStudy("stand-still", cases, Scenario(time_limit=60.0))(0, 1)[0])


def test_a_body_beside_its_place_is_no_proof_that_a_gap_is_too_narrow() -> None:
    box = np.array([[0.2, -0.05], [0.2, 0.05], [0.1, 0.05], [0.1, -0.05]])
    assert _inner_radius(box, 0.3) < 0.0 < _inner_radius(box - [0.15, 0.0], 0.3)


def test_people_who_cross_an_area_make_it_harder_to_survive_there(tmp_path: Path) -> None:
    alone = survived_worlds(_cases(tmp_path, ROOM + TASK), np.arange(1))
    text = "others:\n  - {motion: waypoints, points: [[1, 3], [5, 3]], speed: 0.5, radius: 0.3}\n"
    (tmp_path / "b").mkdir()
    crossed = survived_worlds(_cases(tmp_path / "b", ROOM + text + TASK), np.arange(2))
    assert alone.tolist() == [1.0]
    assert 0.3 < crossed[0] < 0.9 and crossed[0] == crossed[1]


def test_own_measures_are_formulas_or_python_and_pass_rules_read_both(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def last(run):\n    return run.track['x'][-1]\n")
    text = f"half: time / 2; last: {tmp_path}/mine.py:last"
    asked = read_requirements("", "half > 9 and last < 1.1", text)
    cases = _cases(tmp_path, ROOM + TASK)
    facts = NavigationStudy("stand-still", cases, Scenario(time_limit=60.0), requirements=asked)(0, 2)
    own = own_values(facts, asked)
    assert own["half"].tolist() == [10.0, 10.0] and own["last"] == pytest.approx([1.0, 1.0])
    assert [str(one) for one in verdicts(facts, asked)] == ["fail", "fail"]


def test_a_measure_that_raises_stops_the_run_and_is_not_the_planners_failure(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("def bad(run):\n    return 1 / 0\n")
    asked = read_requirements("", "", f"bad: {tmp_path}/mine.py:bad")
    study = NavigationStudy("stand-still", _cases(tmp_path, ROOM + TASK), Scenario(time_limit=60.0), requirements=asked)
    with pytest.raises(BadMeasure, match=r"measure 'bad' of case 0: .*ZeroDivisionError.*mine.py:2"):
        study(0, 1)


@pytest.mark.parametrize(
    "deed, how",
    [
        ("import os; os._exit(0)", "its process ended with exit code 0"),
        ("raise SystemExit(0)", "raised SystemExit: 0"),
        ("import itertools; sum(itertools.repeat(0))", "did not come to an end"),
        ("import numpy; numpy.hypot = None", "changed its process: numpy.hypot was replaced"),
    ],
)
def test_what_a_measure_does_to_its_process_is_not_the_planners_failure(deed: str, how: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(f"def bad(run):\n    {deed}\n")
    asked = read_requirements("", "", f"bad: {tmp_path}/mine.py:bad")
    cases, quick = _cases(tmp_path, ROOM + TASK), Scenario(time_limit=1.0, call_timeout=0.1)
    with pytest.raises(BadMeasure, match=f"^measure 'bad' of case 0: .*{re.escape(how)}"):
        NavigationStudy("stand-still", cases, quick, requirements=asked)(0, 1)


def test_the_battery_gives_a_planner_what_it_needs() -> None:
    seen = sensed(observation(standard_task(), (0.0, 0.0), [(1.0, 0.0)]), ("scan", "map", "path"))
    assert seen.scan is not None and seen.map is not None and seen.path is not None
    assert seen.scan.ranges.min() == pytest.approx(0.9)
    assert sensed(observation(standard_task(), (0.0, 0.0)), ()).scan is None

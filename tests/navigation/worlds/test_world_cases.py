"""Cases of worlds: their ground, who moves in it, what the robot meets, and that they are always the same."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.arena.solvability import SOLVABLE, UNSOLVABLE
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.facts import NEVER
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.protocol import Answer, Observation
from parcours_navigation.study.case_parameters import world_cases
from parcours_navigation.study.study import NavigationStudy
from parcours_navigation.worlds import solving
from parcours_navigation.worlds.family import WorldCases
from parcours_navigation.worlds.file import BadWorld, find_world, parse_world
from parcours_navigation.worlds.solving import solve_worlds, ways

HERE = Path(__file__).parent
HEAD = "parcours: world/1\nname: yard\n"


def _cases(text: str, seed: int = 1) -> WorldCases:
    return WorldCases(seed, parse_world(HEAD + text, "yard.yaml", HERE))


def _run(planner: object, cases: WorldCases, n: int = 1) -> np.ndarray:
    return NavigationStudy(planner, cases, Scenario(time_limit=3600.0)).run(np.arange(n))


def ahead(observation: Observation) -> Answer:
    return 0.25, 0.0


def test_a_wall_stops_the_robot_and_is_a_contact_of_its_own() -> None:
    cases = _cases("ground: {walls: [[2, -1, 2, 1]]}\ntask: {start: [0, 0, 0], goal: [4, 0], time_limit: 20 s}\n")
    facts = _run(ahead, cases)[0]
    assert facts["x"] == pytest.approx(2.0 - 0.125, abs=2e-6)
    assert (facts["n_robot_contacts"], facts["n_obstacle_contacts"], facts["t_goal"]) == (1, 0, NEVER)
    # 0.125 s and 0.016 m to speed up, the rest at 0.25 m/s
    assert facts["t_robot_contact"] * 1e-9 == pytest.approx(0.25 + (1.875 - 0.03125) / 0.25, abs=0.01)
    assert facts["min_clearance"] == 0.0


def test_the_robot_may_leave_the_wall_that_it_touched_and_touch_it_again() -> None:
    def back_and_forth(observation: Observation) -> Answer:
        return (0.25 if observation.time % 12.0 < 8.0 else -0.25), 0.0

    text = "ground: {walls: [[1, -1, 1, 1]]}\ntask: {start: [0, 0, 0], goal: [4, 0], time_limit: 24 s}\n"
    assert _run(back_and_forth, _cases(text))[0]["n_robot_contacts"] == 2


def test_a_case_ends_with_a_contact_if_it_is_to() -> None:
    text = "ground: {walls: [[1, -1, 1, 1]]}\ntask: {start: [0, 0, 0], goal: [4, 0], ends_on_contact: true}\n"
    facts = _run(ahead, _cases(text))[0]
    assert facts["t_end"] == pytest.approx(facts["t_contact"], abs=2e7)


def test_a_case_ends_when_the_robot_has_stood_for_long_or_left_a_box_if_it_is_to() -> None:
    head = "task: {start: [0, 0, 0], goal: [4, 0], time_limit: 20 s, "
    cases = _cases(head + "ends_at_rest: 3 s}\n")
    stands = _run(lambda observation: (0.25 if observation.time < 2.0 else 0.0, 0.0), cases)[0]
    assert stands["t_end"] == pytest.approx(stands["t_last_moving"] + 3e9, abs=2e7)
    assert 2e9 < stands["t_last_moving"] < 3e9
    leaves = _run(ahead, _cases(head + "ends_outside: [-1, -1, 1, 1]}\n"))[0]
    assert leaves["x"] == pytest.approx(1.0, abs=0.003) and leaves["t_goal"] == NEVER
    stays = _run(ahead, _cases(head + "ends_at_rest: 3 s, ends_outside: [-1, -1, 5, 1]}\n"))[0]
    assert stays["t_goal"] != NEVER


def test_a_footprint_turns_into_a_wall_that_its_disc_would_be_clear_of() -> None:
    def turn(observation: Observation) -> Answer:
        return 0.0, 0.5

    robot = "robot: {radius: 0.6, footprint: [[0.5, -0.1], [0.5, 0.1], [-0.5, 0.1], [-0.5, -0.1]]}\n"
    text = robot + "ground: {walls: [[-2, 0.3, 2, 0.3]]}\ntask: {start: [0, 0, 0], goal: [4, 0], time_limit: 9 s}\n"
    facts = _run(turn, _cases(text))[0]
    assert facts["n_robot_contacts"] == 1
    # the corner (0.5, 0.1) is at height 0.5 sin a + 0.1 cos a = 0.3
    assert facts["heading"] == pytest.approx(0.4293, abs=0.01)


def test_goals_are_reached_in_turn_and_shown_one_after_the_other() -> None:
    seen: list[tuple[float, float]] = []

    def there(observation: Observation) -> Answer:
        if observation.task.goal not in seen:
            seen.append(observation.task.goal)
        gx, gy = observation.task.goal
        turn = np.arctan2(gy - observation.robot[1], gx - observation.robot[0]) - observation.robot[2]
        error = float((turn + np.pi) % (2 * np.pi) - np.pi)
        return (0.25 if abs(error) < 0.3 else 0.0), 2.0 * error

    facts = _run(there, _cases("task: {start: [0, 0, 0], goals: [[1, 0], [1, 1], [0, 1]]}\n"))[0]
    assert seen == [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    assert facts["t_goal"] != NEVER and facts["travelled"] > 2.2


def test_a_goal_with_a_heading_is_reached_when_the_robot_looks_that_way() -> None:
    def arrive(observation: Observation) -> Answer:
        return (0.25, 0.0) if observation.robot[0] < 0.95 else (0.0, 0.5)

    text = "task: {start: [0, 0, 0], goal: [1, 0], heading: 90 deg, heading_tolerance: 5 deg}\n"
    facts = _run(arrive, _cases(text))[0]
    assert facts["t_goal"] != NEVER and abs(facts["heading"] - np.pi / 2) < np.radians(5.1)


def test_senses_are_limited_and_declared() -> None:
    seen: list[Observation] = []

    def look(observation: Observation) -> Answer:
        if not seen:
            seen.append(Observation(0.0, observation.robot.copy(), observation.obstacles.copy(), observation.task,
                                    observation.scan, observation.map, observation.path))  # fmt: skip
            assert observation.scan is not None
            ranges.extend(observation.scan.ranges.tolist())
        return 0.0, 0.0

    ranges: list[float] = []
    text = """
ground: {walls: [[3, -2, 3, 2]]}
others:
  - {motion: constant-velocity, number: 3, radius: 0.2, speed: 0, places: [[2, 0], [4, 0.5], [-2, 0]]}
sensing: {others: {reach: 5 m, field_of_view: 180 deg, occlusion: true}, scan: {beams: 4, reach: 6}, map: 0.5}
task: {start: [0, 0, 0], goal: [1, 1], path: [[0, 0], [1, 1]], time_limit: 1 s}
"""
    _run(look, _cases(text))
    assert seen[0].obstacles[:, :2].tolist() == [[2.0, 0.0]]  # one behind the wall, one behind the robot
    assert seen[0].map is not None and seen[0].map.cells.max() == 100
    assert seen[0].path is not None and seen[0].path.tolist() == [[0.0, 0.0], [1.0, 1.0]]
    beams = dict(zip((-135, -45, 45, 135), ranges, strict=True))
    assert (beams[-135] == np.inf and beams[-45] == np.inf) or beams[-45] == pytest.approx(3 * np.sqrt(2))


def test_beams_run_counter_clockwise_from_where_the_first_one_is_said_to_point() -> None:
    seen: list[list[float]] = []

    def look(observation: Observation) -> Answer:
        assert observation.scan is not None
        seen.append(observation.scan.ranges.tolist())
        return 0.0, 0.0

    text = """
ground: {walls: [[3, -9, 3, 9], [-9, 2, 9, 2]]}
sensing: {scan: {beams: 4, reach: 6, first_beam: 0 deg}}
task: {start: [0, 0, 0], goal: [1, 1], time_limit: 1 s}
"""
    _run(look, _cases(text))
    assert seen[0] == pytest.approx([3.0, 2.0, np.inf, np.inf])


def test_detections_come_late_noisy_and_not_at_all_as_told() -> None:
    rows: list[np.ndarray] = []

    def look(observation: Observation) -> Answer:
        rows.append(observation.obstacles.copy())
        return 0.0, 0.0

    body = "others:\n  - {motion: constant-velocity, number: 1, radius: 0.2, speed: 1, heading: 0, places: [[2, 0]]}\n"
    task = "task: {start: [0, 0, 0], goal: [1, 1], time_limit: 5 s}\n"
    _run(look, _cases(body + "sensing: {others: {late: 0.2 s}}\n" + task))
    exact = np.array([row[0, 0] for row in rows])
    assert exact[4:] == pytest.approx(2.0 + 0.05 * np.arange(len(exact) - 4), abs=0.011)
    rows.clear()
    _run(look, _cases(body + "sensing: {others: {dropped: 0.5, position_noise: 0.1}}\n" + task))
    counts = np.array([len(row) for row in rows])
    assert 0.3 < counts.mean() < 0.7
    noise = [row[0, 0] - (2.0 + 0.05 * k) for k, row in enumerate(rows) if len(row)]
    assert 0.05 < np.std(noise) < 0.15


def test_odometry_drifts_while_the_truth_does_not() -> None:
    believed: list[float] = []

    def drive(observation: Observation) -> Answer:
        believed.append(float(observation.robot[0]))
        return 0.25, 0.0

    text = "robot: {odometry: {way_scale: 0.1}}\ntask: {start: [0, 0, 0], goal: [9, 0], time_limit: 10 s}\n"
    facts = _run(drive, _cases(text))[0]
    assert believed[-1] == pytest.approx(1.1 * (facts["x"] - 0.25 * 0.05), rel=1e-3)


def test_the_papers_world_is_the_papers_cases_bit_for_bit() -> None:
    cases = world_cases({"world": "paper"}, 3)
    assert cases == SystemCases(3)
    ours = NavigationStudy(ahead, cases).run(np.arange(9))
    assert ours.tobytes() == NavigationStudy(ahead, SystemCases(3)).run(np.arange(9)).tobytes()


@pytest.mark.parametrize("name", ["corridor-people", "doorway", "roundabout"])
def test_the_same_case_has_the_same_bits_alone_and_among_others(name: str) -> None:
    study = NavigationStudy("dwa", WorldCases(5, find_world(name)), Scenario(time_limit=3.0))
    together = study.run(np.arange(4))
    assert study.run(np.array([2])).tobytes() == together[2:3].tobytes()
    other = NavigationStudy("dwa", WorldCases(6, find_world(name)), Scenario(time_limit=3.0)).run(np.arange(4))
    assert name == "roundabout" or other.tobytes() != together.tobytes()


def test_a_robot_in_a_wall_and_a_goal_in_one_are_refused_by_case() -> None:
    with pytest.raises(BadWorld, match=r"case 0: task, start: the robot must start clear"):
        _cases("ground: {discs: [[0, 0, 1]]}\ntask: {start: [0, 0, 0], goal: [3, 0]}\n").staged([0], 0.05)
    with pytest.raises(BadWorld, match=r"case 0: task, goal: a goal must lie on free ground"):
        _cases("ground: {discs: [[3, 0, 1]]}\ntask: {start: [0, 0, 0], goal: [3, 0]}\n").staged([0], 0.05)


def test_what_no_robot_can_solve_is_said_to_be_so() -> None:
    task = "task: {start: [0, 0, 0], goal: [4, 0], time_limit: TIME s}\n"
    walled = "ground: {polygons: [[[2, -1], [2.1, -1], [2.1, 1], [2, 1]]], bounds: [-1, -1, 5, 1]}\n"
    gap = "ground: {polygons: [[[2, -1], [2.1, -1], [2.1, 0.4], [2, 0.4]]], bounds: [-1, -1, 5, 1]}\n"
    answers = [
        int(solve_worlds(_cases(ground + task.replace("TIME", time)), np.arange(1))["answer"][0])
        for ground, time in ((walled, "60"), (gap, "60"), (gap, "5"), ("", "60"))
    ]
    assert answers == [UNSOLVABLE, SOLVABLE, UNSOLVABLE, SOLVABLE]


def test_a_goal_too_far_as_the_crow_flies_needs_no_look_at_the_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solving, "ways", lambda ground, *rest: ways(np.zeros(0), *rest) if not len(ground) else 1 / 0)
    text = (
        "robot: {radius: 0.2, speed: 1 m/s}\nground: {discs: [[2, 2, 0.1]]}\n"
        "task: {start: [0, 0, 0], goal: [4, 0], tolerance: 0.2, time_limit: TIME s}\n"
    )
    [found] = solve_worlds(_cases(text.replace("TIME", "3.7")), np.arange(1))
    assert (found["answer"], found["earliest_outer"]) == (UNSOLVABLE, np.inf)
    with pytest.raises(ZeroDivisionError):
        solve_worlds(_cases(text.replace("TIME", "3.9")), np.arange(1))


def test_every_number_of_a_world_may_be_an_input_drawn_in_pairs_and_triples() -> None:
    ground = (
        "bounds: [-1, -1, 10, 6], walls: [[4, 0, 4, 3]], polygons: [[[6, 4], [7, 4], [7, 5]]], discs: [[7, 2, 0.3]]"
    )
    drift = "way_scale: 0.01, turn_scale: 0.01, way_noise: 0.01, turn_noise: 0.01, turn_noise_way: 0.01"
    robot = f"kind: differential, radius: 0.2, speed: 0.8, track_width: 0.35, wheel_speed: 1.1, odometry: {{{drift}}}"
    people = "motion: social-force, number: 2, radius: 0.25, speed: 1.2, yields: 0.8, start: [0, 1.5], drawn_goals: 3"
    carts = "motion: stop-move-stop, number: 1, radius: 0.1, waits: [1, 2], speed: [0.1, 0.5], announced: 0.5"
    seen = (
        "reach: 5, field_of_view: 3, position_noise: 0.02, velocity_noise: 0.02, dropped: 0.05, late: 0.05, false: 0.5"
    )
    laser = "beams: 90, reach: 8, field_of_view: 3, first_beam: 0.1, noise: 0.01, dropped: 0.01"
    task = "start: [1, 1, 0.5], goal: [9, 1], tolerance: 0.3, time_limit: 20, heading: 0.5, heading_tolerance: 0.3"
    text = (
        f"ground: {{{ground}}}\nrobot: {{{robot}, wheel_acceleration: 2, delay: 0.02}}\n"
        f"others:\n  - {{{people}}}\n  - {{{carts}}}\n"
        f"sensing: {{others: {{{seen}}}, scan: {{{laser}}}, map: 0.1}}\ntask: {{{task}}}\n"
    )
    inputs: list[str] = []

    def named(found: re.Match[str]) -> str:
        value = float(found[2])
        whole = found[1] in ("number: ", "drawn_goals: ", "beams: ")
        step = 1.0 if whole else 0.01 * abs(value) + 0.001
        kind = ", kind: integer" if whole else ""
        edges = [value, value + step, value + 2.0 * step]
        inputs.append(f'    q{len(inputs)}: {{unit: "1"{kind}, edges: {edges}}}\n')
        return f"{found[1]}q{len(inputs) - 1}"

    text = re.sub(r"((?:\w+: )?)(?<![\w.])(-?[0-9]+(?:\.[0-9]+)?)(?![\w.])", named, text)
    world = parse_world(f"{HEAD}{text}data:\n  parameters:\n{''.join(inputs)}", "all.yaml", HERE)
    assert len(inputs) > 60
    for combine in ("each_choice", "pairwise", "3-wise"):
        cases = WorldCases(1, world, criterion=combine)
        starts = {float(one.scene.robot["x"][0]) for one in cases.staged(range(4), 0.05)}
        assert len(starts) == 4, combine


def test_what_a_world_decides_cannot_be_set_beside_it() -> None:
    for setting in ({"robot_radius": 0.3}, {"obstacle_radius": 0.2}, {"protocol": "published"}):
        option = next(iter(setting)).replace("_", "-")
        with pytest.raises(BadRequest, match=f"--{option}: a world says how large"):
            world_cases({"world": "doorway", **setting}, 1)
    with pytest.raises(BadRequest, match="--combine: only a world"):
        world_cases({"combine": "pairwise"}, 1)


def test_a_planner_that_needs_what_the_world_does_not_give_is_refused_by_name() -> None:
    cases = _cases("task: {start: [0, 0, 0], goal: [3, 0]}\n")
    with pytest.raises(BadWorld, match="planner 'a-star': it needs map, but the world 'yard' gives neither"):
        cases.require(("map",), "a-star")
    _cases("sensing: {map: 0.1}\ntask: {start: [0, 0, 0], goal: [3, 0]}\n").require(("map",), "a-star")


def test_a_world_is_a_gymnasium_environment_with_its_scan_in_the_observation() -> None:
    from parcours_navigation.adapters.environment import CaseEnv

    env = CaseEnv(WorldCases(1, find_world("corridor-people")), n_obstacles=4)
    seen, info = env.reset(seed=3)
    assert seen.shape == env.observation_space.shape == (6 + 6 * 4 + 180,)
    assert (seen[-180:] > 0.0).all() and (seen[-180:] <= 1.0).all() and info["case"] == 3
    again = [env.step(np.array([0.5, 0.1], np.float32))[0] for _ in range(10)]
    env.reset(seed=3)
    assert all(np.array_equal(one, env.step(np.array([0.5, 0.1], np.float32))[0]) for one in again)

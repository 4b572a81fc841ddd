"""The host moves the world as planners command, shows them what is so, and is not fooled by them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits

from parcours.errors import BadRequest
from parcours_navigation.arena.obstacles import place_at
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.facts import NEVER, TRACK_PERIOD
from parcours_navigation.guests.scenario import Scenario
from parcours_navigation.outcomes import Outcome, outcomes
from parcours_navigation.protocol import HEADING, SPEED, Answer, Command, Limits, Observation, Task, Trajectory, X, Y
from parcours_navigation.stage import moving
from parcours_navigation.stage.tracking import reference
from parcours_navigation.study.study import NavigationStudy, study_of

CASES = SystemCases(1)


def run(planner: object, number: int = 0, **scenario: object) -> np.void:
    return NavigationStudy(planner, CASES, Scenario(**scenario))(number, 1)[0]  # type: ignore[arg-type, no-any-return]


class Notes:
    """Answers as told, and keeps what it was shown."""

    def __init__(self, answer: Callable[[Observation], Answer]) -> None:
        self.answer = answer
        self.tasks: list[Task] = []
        self.times: list[float] = []
        self.robots: list[list[float]] = []
        self.obstacles: list[list[list[float]]] = []

    def reset(self, task: Task) -> None:
        self.tasks.append(task)

    def observe(self, observation: Observation) -> Answer:
        self.times.append(observation.time)
        self.robots.append(observation.robot.tolist())
        self.obstacles.append(observation.obstacles.tolist())
        return self.answer(observation)


def stand(observation: Observation) -> Answer:
    return 0.0, 0.0


def silent(observation: Observation) -> Answer:
    return None


def test_the_libraries_of_a_planner_have_one_thread_while_it_is_asked() -> None:
    counts: set[int] = set()

    def count(observation: Observation) -> Answer:
        counts.update(library["num_threads"] for library in threadpool_info())
        return None

    with threadpool_limits(2):
        run(count)
        assert counts == {1} and {library["num_threads"] for library in threadpool_info()} == {2}


def test_a_planner_is_asked_every_period_from_the_begin_to_before_the_end() -> None:
    notes = Notes(stand)
    facts = run(notes, period=0.25)
    assert np.allclose(notes.times, np.arange(84) * 0.25)
    assert facts["n_planning_cycles"] == 84
    assert facts["t_end"] == 21_000_000_000


def test_a_planner_that_fails_at_once_finds_every_kernel_of_its_case_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    freeze = moving.freeze

    def noted(memory: np.ndarray, facts: np.void) -> None:
        done.append("kernel")
        freeze(memory, facts)

    monkeypatch.setattr(moving, "freeze", noted)

    def fails(observation: Observation) -> Answer:
        done.append("planner")
        raise OSError("no file can be opened any more")

    assert run(fails)["reason"].startswith(b"raised: OSError")
    assert done == ["kernel", "planner", "kernel"]


def test_a_period_that_does_not_divide_the_case_ends_with_it() -> None:
    facts = run(stand, period=0.08)
    assert facts["t_end"] == 21_000_000_000 and facts["n_planning_cycles"] == math.ceil(21.0 / 0.08)


def test_what_is_shown_is_where_robot_and_obstacles_are() -> None:
    notes = Notes(lambda observation: (0.1, 0.3))
    study = NavigationStudy(notes, CASES)
    facts, track, places = study.track(4)
    assert np.array_equal(track["time"], np.arange(len(track)) * TRACK_PERIOD)
    seen = np.array(notes.robots)
    for column, name in enumerate(("x", "y", "heading", "v", "w")):
        assert np.array_equal(seen[:, column], track[name][: len(seen)])
    obstacles = CASES.obstacles(np.array([4]))[0]
    for k, now in enumerate(track["time"][: len(seen)].tolist()):
        exact = [place_at(one, now) for one in obstacles]
        assert np.allclose(np.array(notes.obstacles[k])[:, :2], exact, atol=1e-12)
        assert np.array_equal(places[k], np.array(notes.obstacles[k])[:, :2])
    assert (np.array(notes.obstacles)[:, :, 5] == 0.1).all()
    assert facts["n_track"] == len(track)


def test_the_track_changes_no_bit_of_the_facts() -> None:
    study = NavigationStudy("straight-ahead", CASES)
    plain = study.run(np.arange(12))
    tracked = np.concatenate([study.track(number)[0] for number in range(12)])
    assert plain.tobytes() == tracked.tobytes()


def test_cases_do_not_depend_on_what_else_is_run() -> None:
    study = NavigationStudy("straight-ahead", CASES)
    together = study(0, 20)
    assert together[7:9].tobytes() == study(7, 2).tobytes()


def test_saying_nothing_keeps_the_robot_driving_as_it_began() -> None:
    facts = run(silent, 1)
    assert facts["feasible"] == 0
    assert outcomes(np.array([facts]))[0] in (Outcome.REACHED, Outcome.COLLIDED)
    assert facts["t_goal"] * 1e-9 == pytest.approx((math.hypot(2.0, 2.0) - 0.2) / 0.249, abs=0.02)


def test_a_robot_that_is_told_to_stand_brakes_and_stands() -> None:
    facts = run(stand)
    assert facts["travelled"] == pytest.approx(0.249**2 / 2.0, abs=0.002)
    assert facts["feasible"] == 1 and facts["t_goal"] == NEVER
    assert facts["t_last_moving"] <= 300_000_000


@given(st.tuples(st.floats(-1e300, 1e300), st.floats(-1e300, 1e300)))
@settings(max_examples=30)
def test_no_finite_command_takes_the_robot_beyond_its_limits(command: tuple[float, float]) -> None:
    _, track, _ = NavigationStudy(lambda observation: command, CASES, Scenario(time_limit=1.0)).track(0)
    assert (np.abs(track["v"]) <= 0.25).all() and (np.abs(track["w"]) <= math.pi / 2).all()
    assert (np.abs(np.diff(track["v"])) <= 1.0 * 0.05 + 1e-12).all()


@pytest.mark.parametrize(
    "answer",
    [
        (0.1, 0.0),
        Command(0.1, 0.0),
        [0.1, 0],
        np.array([0.1, 0.0]),
        (np.float64(0.1), 0),
        (np.float64(0.1), np.int8(0)),
    ],
)
def test_all_forms_of_a_pair_mean_the_same(answer: Answer) -> None:
    assert run(lambda observation: answer).tobytes() == run(lambda observation: (0.1, 0.0)).tobytes()


def test_the_end_at_the_goal_is_the_moment_it_was_reached() -> None:
    facts = NavigationStudy("straight-ahead", CASES)(0, 60)
    there = facts[outcomes(facts) == Outcome.REACHED]
    assert len(there) > 5
    assert (there["t_end"] == there["t_goal"]).all()
    assert ((there["to_goal"] > 0.19) & (there["to_goal"] < 0.2)).all()


def test_a_delayed_answer_takes_effect_that_much_later_to_the_tick() -> None:
    def turns(observation: Observation) -> Answer:
        return (0.249, 0.0) if observation.time < 1.0 else (0.0, 0.0)

    for delay in (0.0, 0.03, 0.05, 0.12, 1.0):
        _, track, _ = NavigationStudy(turns, CASES, Scenario(command_delay=delay)).track(0)
        braked = track["time"][track["v"] < 0.249 - 1e-9][0] * 1e-9
        assert braked == pytest.approx(math.floor((1.0 + delay) / 0.05 + 1e-9) * 0.05 + 0.05)
        assert track["x"][-1] == pytest.approx(math.sqrt(0.5) * (0.249 * (1.0 + delay) + 0.031), abs=0.001)


def test_a_planner_cannot_move_the_world_by_writing_into_what_it_sees() -> None:
    def vandal(observation: Observation) -> Answer:
        observation.robot[:] = observation.obstacles[:] = 7.0
        observation.time = -1.0
        observation.robot = np.zeros(2)
        observation.obstacles = np.zeros((0, 6))
        return 0.1, 0.2

    notes = Notes(vandal)
    facts = run(notes)
    assert facts.tobytes() == run(lambda observation: (0.1, 0.2)).tobytes()
    assert notes.times[1] == 0.05 and len(notes.robots[1]) == 5 and len(notes.obstacles[1]) == 3


def test_every_case_has_a_seed_of_its_own_that_replays() -> None:
    notes = Notes(stand)
    study = NavigationStudy(notes, CASES, Scenario(time_limit=0.05))
    study(0, 50)
    study(0, 50)
    seeds = [task.seed for task in notes.tasks]
    assert len(set(seeds)) == 50 and seeds[:50] == seeds[50:]
    assert all(0 <= seed < 2**63 for seed in seeds)
    NavigationStudy(notes, SystemCases(2), Scenario(time_limit=0.05))(0, 1)
    assert notes.tasks[-1].seed not in seeds


def test_the_task_is_what_the_scenario_says() -> None:
    notes = Notes(stand)
    limits = Limits(0.5, 1.0, 2.0, 3.0)
    scenario = Scenario(goal=(1.0, 1.5), goal_tolerance=0.1, limits=limits, period=0.1, start=(0.1, 0.0, 0.0))
    NavigationStudy(notes, CASES, scenario)(0, 1)
    task = notes.tasks[0]
    assert (task.goal, task.goal_tolerance, task.limits, task.period) == ((1.0, 1.5), 0.1, limits, 0.1)
    assert task.robot_radius == 0.125 and task.arena == 2.0
    assert notes.robots[0] == [0.1, 0.0, 0.0, 0.249, 0.0]


def arc(speed: float, yaw_rate: float, times: np.ndarray) -> np.ndarray:
    """Return poses on an arc from the robot's start, rows of (time, x, y, heading)."""
    heading = math.pi / 4 + yaw_rate * times
    if yaw_rate == 0.0:
        x, y = speed * times * math.cos(math.pi / 4), speed * times * math.sin(math.pi / 4)
    else:
        x = speed / yaw_rate * (np.sin(heading) - math.sin(math.pi / 4))
        y = -speed / yaw_rate * (np.cos(heading) - math.cos(math.pi / 4))
    return np.stack([times, x, y, heading], axis=1)


@pytest.mark.parametrize(("speed", "yaw_rate"), [(0.2, 0.0), (0.2, 0.5), (0.15, -0.8), (-0.2, 0.0), (-0.15, 0.4)])
def test_the_robot_follows_a_trajectory_within_a_centimetre(speed: float, yaw_rate: float) -> None:
    path = Trajectory(arc(speed, yaw_rate, np.arange(0.0, 10.0, 0.25)))
    start = (0.0, 0.0, math.pi / 4)
    study = NavigationStudy(lambda o: path, CASES, Scenario(start=start, start_speed=speed, time_limit=8.5))
    _, track, _ = study.track(0)
    late = track[track["time"] > 2_000_000_000]
    exact = arc(speed, yaw_rate, late["time"] * 1e-9)
    assert np.hypot(late["x"] - exact[:, 1], late["y"] - exact[:, 2]).max() < 0.01


def test_a_robot_beside_its_trajectory_comes_onto_it() -> None:
    path = Trajectory(arc(0.2, 0.0, np.array([0.0, 9.0])) + np.array([0.0, 0.05, -0.05, 0.0]))
    _, track, _ = NavigationStudy(lambda o: path, CASES, Scenario(time_limit=8.0)).track(0)
    place = reference(path.points, float(track["time"][-1]) * 1e-9)
    assert math.hypot(track["x"][-1] - place[0], track["y"][-1] - place[1]) < 0.005


def test_the_robot_stands_at_the_end_of_its_trajectory() -> None:
    path = Trajectory(arc(0.2, 0.0, np.array([0.0, 3.0])))
    _, track, _ = NavigationStudy(lambda o: path, CASES).track(0)
    assert math.hypot(track["x"][-1], track["y"][-1]) == pytest.approx(0.6, abs=0.015)
    assert (np.abs(track["v"][120:]) < 1e-3).all()


def test_a_newer_answer_replaces_a_trajectory() -> None:
    path = Trajectory(arc(0.2, 0.0, np.array([0.0, 9.0])))
    facts = run(lambda o: path if o.time < 2.0 else (0.0, 0.0))
    assert facts["travelled"] == pytest.approx(0.2 * 2.0 + 0.02, abs=0.01)


def test_watching_on_finds_who_arrives_late() -> None:
    def slow(observation: Observation) -> Answer:
        return 0.12, 0.0

    short, long = run(slow, 1), run(slow, 1, watched_on=10.0)
    assert short["t_goal_after"] == NEVER
    assert long["t_goal_after"] * 1e-9 == pytest.approx((math.hypot(2.0, 2.0) - 0.2) / 0.12, abs=0.1)
    assert long["moved_after"] == 1
    assert [short[name] for name in ("t_end", "x", "min_clearance")] == [
        long[n] for n in ("t_end", "x", "min_clearance")
    ]


@pytest.mark.parametrize(
    "wrong",
    [
        {"period": 0.0}, {"period": -0.05}, {"period": 0.005}, {"period": 0.055}, {"period": float("nan")},
        {"command_delay": -0.1}, {"command_delay": 0.015}, {"time_limit": 0.0}, {"time_limit": float("inf")},
        {"goal": (float("nan"), 2.0)}, {"goal_tolerance": 0.0}, {"start": (0.0, 0.0)}, {"start_speed": 0.3},
        {"arena": 0.0}, {"call_timeout": 0.0}, {"watched_on": -1.0}, {"period": 30.0}, {"period": "fast"},
        *({"limits": dataclasses.replace(Scenario().limits, **{name: value})}
          for name in ("speed", "yaw_rate", "acceleration", "yaw_acceleration") for value in (0.0, -1.0)),
    ],
    ids=str,
)  # fmt: skip
def test_a_scenario_out_of_range_is_refused_with_its_value(wrong: dict[str, object]) -> None:
    with pytest.raises(BadRequest, match=r"scenario, .*but is .*\[scenario-range\]"):
        Scenario(**wrong)  # type: ignore[arg-type]


def test_a_robot_that_does_not_fit_or_starts_in_an_obstacle_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"arena: the robot must fit in, whose diameter is 0.25 m, but is 0.2"):
        NavigationStudy(stand, CASES, Scenario(arena=0.2))
    with pytest.raises(BadRequest, match="radius-range"):
        NavigationStudy(stand, SystemCases(1, robot_radius=-0.1))
    first = CASES.obstacles(np.array([0]))[0][0]
    scenario = Scenario(start=(float(first["x0"]), float(first["y0"]), 0.0))
    with pytest.raises(BadRequest, match=r"clear of obstacles, but .* it is 0.225 m inside.*\[start-occupied\]"):
        NavigationStudy("stand-still", CASES, scenario)(0, 1)
    with pytest.raises(BadRequest, match="start-occupied"):
        NavigationStudy("stand-still", CASES, scenario).campaign(4)


def test_ramp_runs_in_its_own_loop_and_refuses_what_it_is_not_built_for() -> None:
    facts = study_of("ramp-guarded", CASES, Scenario(time_limit=5.0))(0, 2)
    assert (facts["t_end"] <= 6_000_000_000).all() and (facts["n_control_cycles"] > 0).all()
    with pytest.raises(BadRequest, match="planner-own-loop"):
        study_of("ramp-original", CASES, Scenario(period=0.1))


def test_a_blind_planner_arrives_where_nobody_is_in_its_way_and_one_that_stands_never() -> None:
    aims = outcomes(NavigationStudy("straight-ahead", CASES)(0, 60))
    assert set(aims.tolist()) == {Outcome.REACHED, Outcome.COLLIDED}
    stands = NavigationStudy("stand-still", CASES)(0, 60)
    assert set(outcomes(stands).tolist()) <= {Outcome.ASTRAY, Outcome.BLOCKED}


def test_a_turn_towards_the_goal_is_seen_in_the_next_observation() -> None:
    notes = Notes(lambda o: (0.0, 1.0))
    run(notes, time_limit=1.0)
    heading = np.array(notes.robots)[:, HEADING]
    assert heading[0] == pytest.approx(math.pi / 4) and heading[10] > heading[1] > heading[0]
    assert notes.robots[0][SPEED] == 0.249 and notes.robots[0][X] == notes.robots[0][Y] == 0.0

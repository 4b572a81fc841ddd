"""How the battery of checks is run: what is a planner, what ends it, what it says; and the shipped planners pass it."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.checking.battery import CHECKS, check_apart, report_lines, run_battery
from parcours_navigation.checking.remark import Level
from parcours_navigation.checking.subject import Subject, load_subject
from parcours_navigation.planners.baselines import StraightAhead as Sound
from parcours_navigation.protocol import Command, Observation, Trajectory, X, Y


def steer(observation: Observation) -> Command:
    """Drive straight at the goal."""
    return Sound().observe(observation)


class AnswersText:
    def observe(self, observation: Observation) -> object:
        return "go"


def test_a_plain_function_is_a_planner() -> None:
    report = run_battery(Subject("", lambda: steer), ["is_a_planner", "answers_in_form", "repeats_itself"])
    assert not report.findings


def test_commands_and_trajectories_of_the_same_way_are_driven_alike() -> None:
    class Plans(Sound):
        def observe(self, observation: Observation) -> object:  # type: ignore[override]
            x, y = (float(observation.robot[k]) for k in (X, Y))
            gx, gy = observation.task.goal
            way, angle = math.hypot(gx - x, gy - y), math.atan2(gy - y, gx - x)
            return Trajectory(
                np.array([[observation.time, x, y, angle], [observation.time + way / 0.2, gx, gy, angle]])
            )

    assert run_battery(Subject("", Plans), ["turns_towards_the_goal", "reaches_a_free_goal"]).passed


def test_a_planner_that_lives_on_its_scan_alone_passes_the_checks_of_memory() -> None:
    class Sees(Sound):
        needs = ("scan",)

        def observe(self, observation: Observation) -> Command:
            assert observation.scan is not None
            return Command(0.1, float(observation.scan.ranges.min()) - 1.0)

    made = ["repeats_itself", "forgets_the_last_case", "keeps_no_observation"]
    assert not run_battery(Subject("", Sees), made).findings


def test_a_planner_for_a_car_is_shown_the_robot_of_the_world_that_is_named(write: Callable[[str], str]) -> None:
    source = "def f(o):\n    assert o.task.robot.kind == 'car' and o.task.limits.speed == 1.5\n"
    name = write(f"{source}    return 0.1 / o.task.robot.wheelbase, 0.0\n")
    world = Path(name.partition(":")[0]).with_name("car.yaml")
    robot = "robot: {kind: car, speed: 1.5, wheelbase: 0.3, steering: 0.5, steering_rate: 2}\n"
    world.write_text(f"parcours: world/1\nname: car\ntask: {{start: [0, 0, 0], goal: [3, 0]}}\n{robot}")
    checks = ["answers_in_form", "same_in_own_process", "commands_in_units"]
    assert not [one for one in check_apart(name, checks, world=str(world)).findings if one.level is Level.ERROR]
    assert check_apart(name, checks).findings[0].level is Level.ERROR


def test_a_robot_that_a_world_draws_is_that_of_its_first_case(write: Callable[[str], str]) -> None:
    name = write("def f(o):\n    assert 0.5 <= o.task.limits.speed <= 0.6\n    return 0.1, 0.0\n")
    world = Path(name.partition(":")[0]).with_name("drawn.yaml")
    data = "data: {parameters: {top: {unit: m/s, edges: [0.5, 0.6]}}}\n"
    world.write_text(
        f"parcours: world/1\nname: drawn\nrobot: {{speed: top}}\ntask: {{start: [0, 0, 0], goal: [3, 0]}}\n{data}"
    )
    assert not check_apart(name, ["answers_in_form"], world=str(world)).findings


def test_a_planner_that_reads_a_scan_without_declaring_it_is_told_how() -> None:
    def scans(observation: Observation) -> object:
        return 0.1, observation.scan.ranges.min()  # type: ignore[union-attr]

    (finding,) = run_battery(Subject("", lambda: scans), ["answers_in_form"]).findings
    assert 'declare it: needs = ("scan",)' in finding.remedy
    (other,) = run_battery(Subject("", lambda: lambda observation: 1 / 0), ["answers_in_form"]).findings
    assert other.remedy == "make it answer, whatever it sees"


def test_an_error_at_a_gate_ends_the_battery_and_says_what_was_left() -> None:
    report = run_battery(Subject("", AnswersText))
    assert report.made == ("is_a_planner", "same_in_own_process", "answers_in_form")
    assert "reaches_a_free_goal" in report.left and not report.passed
    assert "not made since an earlier one failed: is_quiet" in report_lines(report)


def test_an_endless_loop_is_given_up_and_not_waited_for() -> None:
    class Hangs(Sound):
        def observe(self, observation: Observation) -> object:  # type: ignore[override]
            while True:
                pass

    begun = time.monotonic()
    report = run_battery(Subject("", Hangs), ["repeats_itself"], patience=0.2)
    assert [finding.slug for finding in report.findings] == ["unfinished"]
    assert time.monotonic() - begun < 30.0


def test_a_planner_that_never_answers_fails_at_the_first_check_that_waits_for_it() -> None:
    def hangs(observation: Observation) -> object:
        while True:
            pass

    report = run_battery(Subject("", lambda: hangs), patience=0.2)
    assert not report.passed and report.made[-1] == "answers_in_form"
    assert "reaches_a_free_goal" in report.left


def test_what_a_planner_raises_is_placed_in_its_source() -> None:
    class Raises(Sound):
        def observe(self, observation: Observation) -> object:  # type: ignore[override]
            raise ZeroDivisionError("no way")

    (finding,) = run_battery(Subject("", Raises), ["answers_in_form"]).findings
    assert finding.slug == "planner-raises"
    assert "ZeroDivisionError: no way (in observe, test_planner_check_battery.py:" in finding.seen


@pytest.mark.parametrize("check", ["answers_in_form", "survives_odd_scenes", "reaches_a_free_goal"])
def test_a_planner_that_exits_is_told_and_does_not_end_the_battery(check: str) -> None:
    class Exits(Sound):
        def observe(self, observation: Observation) -> object:  # type: ignore[override]
            raise SystemExit(0)

    (finding,) = run_battery(Subject("", Exits), [check]).findings
    assert finding.level is Level.ERROR and "SystemExit: 0" in finding.seen


def test_a_planner_that_raises_what_ctrl_c_raises_is_told_so_too(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("def mine(observation):\n    raise KeyboardInterrupt\n")
    (finding,) = check_apart(f"{path}:mine", ["answers_in_form"]).findings
    assert finding.level is Level.ERROR and "KeyboardInterrupt (in mine, mine.py:2)" in finding.seen


def test_patience_ends_in_the_middle_of_odd_scenes_too() -> None:
    class Hangs(Sound):
        def observe(self, observation: Observation) -> object:  # type: ignore[override]
            while True:
                pass

    (finding,) = run_battery(Subject("", Hangs), ["survives_odd_scenes"], patience=0.2).findings
    assert finding.slug == "unfinished"


def test_an_unknown_check_is_refused_with_the_known_ones() -> None:
    with pytest.raises(BadRequest, match=r"did you mean 'is_quiet'\?.*\[unknown-check\]"):
        run_battery(Subject("", Sound), ["is_quite"])


class TestPlannersByName:
    """The whole battery, which starts a process of its own."""

    @pytest.mark.parametrize("name", ["orca", "dwa", "mppi"])
    def test_the_shipped_planners_have_no_error(self, name: str) -> None:
        report = run_battery(load_subject(name))
        assert not [finding for finding in report.findings if finding.level is Level.ERROR]
        assert len(report.made) == len(CHECKS)

    def test_what_differs_or_dies_only_in_another_process_is_found(self, write: Callable[[str], str]) -> None:
        dies = write(
            "import os, multiprocessing as m\ndef f(o):\n    m.parent_process() and os._exit(3)\n    return 0, 0\n"
        )
        hashes = write("def f(o):\n    return 0.1, hash('salted by the process') % 1000 / 1000\n")
        found = [run_battery(load_subject(f), ["same_in_own_process"]).findings[0] for f in (dies, hashes)]
        assert [finding.slug for finding in found] == ["process-dies", "process-differs"]
        assert "exit code 3" in found[0].seen

    def test_a_planner_that_always_dies_is_found_before_it_is_asked_here(self, write: Callable[[str], str]) -> None:
        kills = write("import os\ndef f(o):\n    os._exit(7) if o.time > 0.2 else None\n    return 0.1, 0.0\n")
        report = run_battery(load_subject(kills))
        assert [finding.slug for finding in report.findings] == ["process-dies"]
        assert "exit code 7" in report.findings[0].seen and "answers_in_form" in report.left

    def test_an_answer_out_of_form_is_told_as_such_by_name_too(self, write: Callable[[str], str]) -> None:
        (finding,) = run_battery(load_subject(write("def f(o):\n    return 'go'\n"))).findings
        assert (finding.slug, finding.check) == ("answer-type", "answers_in_form")

    @pytest.mark.parametrize(
        ("source", "only", "slug", "seen"),
        [
            ("import os\ndef f(o):\n    os._exit(0)\n", ["is_quiet"], "process-dies", "in is_quiet: .* code 0"),
            ("import os\nos._exit(5)\n", None, "process-dies", "while it was loaded: .* code 5"),
            ("import itertools\nsum(itertools.repeat(0))\n", None, "process-hangs", "while it was loaded"),
        ],
    )
    def test_whatever_takes_the_checking_process_down_is_an_error(
        self, write: Callable[[str], str], source: str, only: list[str] | None, slug: str, seen: str
    ) -> None:
        report = check_apart(write(source), only, patience=1.0, grace=2.0 if slug == "process-hangs" else 60.0)
        (finding,) = report.findings
        assert finding.slug == slug and re.match(seen, finding.seen) and not report.passed
        assert report.left == tuple(only or CHECKS)

    def test_a_constructor_that_raises_is_a_finding_and_a_missing_name_is_a_refusal(
        self, write: Callable[[str], str]
    ) -> None:
        broken = write(
            "class f:\n    def __init__(self):\n        raise OSError('no map')\n    def observe(self, o): ...\n"
        )
        (finding,) = run_battery(load_subject(broken)).findings
        assert finding.slug == "planner-raises" and "no map" in finding.seen
        with pytest.raises(BadRequest, match=r"\[planner-missing\]"):
            load_subject("parcours_navigation.planners.orca:Orcs")
        with pytest.raises(BadRequest, match=r"\[planner-missing\]"):
            check_apart("parcours_navigation.planners.orca:Orcs")


@pytest.fixture
def write(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Return a function that writes a planner `f` into a file of its own, and names it."""

    def written(source: str) -> str:
        path = tmp_path_factory.mktemp("planner") / "mine.py"
        path.write_text(source)
        return f"{path}:f"

    return written

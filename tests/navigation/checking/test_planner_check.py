"""Planted faults of planners: each is found by the check that is there for it, and the shipped planners have none."""

from __future__ import annotations

import math
import random
import time

import numpy as np
import pytest

from parcours_navigation.checking.battery import CHECKS, GATES, run_battery
from parcours_navigation.checking.remark import Level
from parcours_navigation.checking.subject import Subject
from parcours_navigation.protocol import HEADING, Observation, Observations, Task, Trajectory, X, Y


def steer(observation: Observation) -> tuple[float, float]:
    """Turn to the goal and drive there, blind to obstacles; stop on it."""
    robot, task = observation.robot, observation.task
    dx, dy = task.goal[0] - robot[X], task.goal[1] - robot[Y]
    if math.hypot(dx, dy) < 0.1:
        return 0.0, 0.0
    gap = math.remainder(math.atan2(dy, dx) - robot[HEADING], 2.0 * math.pi)
    return max(0.0, 0.24 * math.cos(gap)), min(max(3.0 * gap, -1.5), 1.5)


class Sound:
    """Follows `steer`; the faulty ones below change one thing of it."""

    def reset(self, task: Task) -> None:
        pass

    def observe(self, observation: Observation) -> object:
        return steer(observation)


class Batched:
    def observe_batch(self, seen: Observations) -> np.ndarray:
        return np.stack([0.2 * np.ones(len(seen.cases)), 0.1 * seen.obstacles[:, 0, X]], axis=1)


class MixesRows(Batched):
    def observe_batch(self, seen: Observations) -> np.ndarray:
        return super().observe_batch(seen) - [0.0, 0.01] * seen.robots[:1, :2]


class RoundsBySize(Batched):
    def observe_batch(self, seen: Observations) -> np.ndarray:
        return super().observe_batch(seen) * (1.0 + 1e-15 * len(seen.cases))


class NeedsArguments(Sound):
    def __init__(self, gain: float) -> None:
        self.gain = gain


class WithoutObserve:
    def reset(self, task: Task) -> None:
        pass


class ObserveTakesTwo(Sound):
    def observe(self, observation: Observation, more: int) -> object:  # type: ignore[override]
        return 0.0, 0.0


class AnswersText(Sound):
    def observe(self, observation: Observation) -> object:
        return "go"


class AnswersThree(Sound):
    def observe(self, observation: Observation) -> object:
        return 0.1, 0.2, 0.3


class AnswersNan(Sound):
    def observe(self, observation: Observation) -> object:
        return math.nan, 0.0


class AnswersNothing(Sound):
    def observe(self, observation: Observation) -> object:
        return None


class TrajectoryBackInTime(Sound):
    def observe(self, observation: Observation) -> object:
        return Trajectory(np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]))


class Prints(Sound):
    def observe(self, observation: Observation) -> object:
        print("at", observation.time)  # noqa: T201
        return steer(observation)


class RollsClockDice(Sound):
    dice = random.Random()

    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return v * self.dice.uniform(0.9, 1.0), w


class RollsGlobalDice(Sound):
    def reset(self, task: Task) -> None:
        np.random.seed(task.seed)  # noqa: NPY002

    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return v * np.random.uniform(0.9, 1.0), w  # noqa: NPY002


class Remembers(Sound):
    def __init__(self) -> None:
        self.travelled = 0

    def observe(self, observation: Observation) -> object:
        self.travelled += 1
        v, w = steer(observation)
        return v / (1.0 + 0.01 * self.travelled), w


class WritesObservation(Sound):
    def observe(self, observation: Observation) -> object:
        answer = steer(observation)
        observation.obstacles[:, 5] += 0.05
        return answer


class KeepsArray(Sound):
    def reset(self, task: Task) -> None:
        self.before: np.ndarray | None = None

    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        if self.before is not None:
            v = min(v, 1.0 + 0.1 * float(observation.robot[X] - self.before[X]), 0.2)
            w += 0.5 * float(observation.robot[Y] - self.before[Y])
        self.before = observation.robot
        return v, w


class FearsFirstRow(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        if len(observation.obstacles):
            v *= min(1.0, math.hypot(*(observation.obstacles[0, :2] - observation.robot[:2])))
        return v, w


class NeedsAnObstacle(Sound):
    def observe(self, observation: Observation) -> object:
        observation.obstacles[:, 0].min()
        return steer(observation)


class NanAtTheGoal(Sound):
    def observe(self, observation: Observation) -> object:
        gap = observation.robot[:2] - np.asarray(observation.task.goal)
        with np.errstate(invalid="ignore"):
            unit = gap / np.hypot(*gap)
        v, w = steer(observation)
        return v + 0.0 * unit[0], w


class Slow(Sound):
    def observe(self, observation: Observation) -> object:
        if len(observation.obstacles) == 3 and observation.time > 0.85:
            time.sleep(0.06)
        return steer(observation)


class LeftIsRight(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return v, -w


class Degrees(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return v, math.degrees(w)


class Centimetres(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return 100.0 * v, w


class HeadingInDegrees(Sound):
    def observe(self, observation: Observation) -> object:
        seen = Observation(observation.time, observation.robot.copy(), observation.obstacles, observation.task)
        seen.robot[HEADING] = math.radians(seen.robot[HEADING])
        return steer(seen)


class WorldAxes(Sound):
    def observe(self, observation: Observation) -> object:
        gap = observation.task.goal[1] - observation.robot[Y]
        return 0.2, 0.5 * float(gap)


class PrefersLeft(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return v, w + 0.3


class NeverMoves(Sound):
    def observe(self, observation: Observation) -> object:
        return 0.0, 0.0


class Creeps(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        return 0.2 * v, w


class DrivesOn(Sound):
    def observe(self, observation: Observation) -> object:
        return 0.2, steer(observation)[1]


class WaitsBefore(Sound):
    def observe(self, observation: Observation) -> object:
        v, w = steer(observation)
        near = (np.hypot(*(observation.obstacles[:, :2] - observation.robot[:2]).T) < 0.4).any()
        return (0.0, 0.0) if near else (v, w)


PLANTED: dict[type, tuple[str, str, Level]] = {
    NeedsArguments: ("is_a_planner", "planner-raises", Level.ERROR),
    WithoutObserve: ("is_a_planner", "planner-shape", Level.ERROR),
    ObserveTakesTwo: ("is_a_planner", "planner-shape", Level.ERROR),
    AnswersText: ("answers_in_form", "answer-type", Level.ERROR),
    AnswersThree: ("answers_in_form", "answer-type", Level.ERROR),
    TrajectoryBackInTime: ("answers_in_form", "answer-type", Level.ERROR),
    AnswersNan: ("answers_in_form", "answer-finite", Level.ERROR),
    AnswersNothing: ("answers_in_form", "never-answers", Level.ERROR),
    Prints: ("is_quiet", "prints", Level.WARNING),
    RollsClockDice: ("repeats_itself", "nondeterministic", Level.ERROR),
    Remembers: ("forgets_the_last_case", "remembers", Level.ERROR),
    RollsGlobalDice: ("rolls_its_own_dice", "global-dice", Level.WARNING),
    WritesObservation: ("leaves_observations_alone", "changes-observation", Level.ERROR),
    KeepsArray: ("keeps_no_observation", "keeps-observation", Level.ERROR),
    FearsFirstRow: ("takes_obstacles_in_any_order", "obstacle-order", Level.WARNING),
    MixesRows: ("answers_batches_as_alone", "batch-differs", Level.ERROR),
    RoundsBySize: ("answers_batches_as_alone", "batch-bits", Level.WARNING),
    NeedsAnObstacle: ("survives_odd_scenes", "scene-raises", Level.ERROR),
    NanAtTheGoal: ("survives_odd_scenes", "answer-finite", Level.ERROR),
    Slow: ("decides_in_time", "too-slow", Level.ERROR),
    LeftIsRight: ("turns_towards_the_goal", "turns-away", Level.ERROR),
    Degrees: ("commands_in_units", "units", Level.ERROR),
    Centimetres: ("commands_in_units", "units", Level.ERROR),
    HeadingInDegrees: ("no_place_is_special", "frame", Level.ERROR),
    WorldAxes: ("no_place_is_special", "frame", Level.ERROR),
    PrefersLeft: ("left_is_as_good_as_right", "handed", Level.WARNING),
    NeverMoves: ("reaches_a_free_goal", "never-moves", Level.ERROR),
    Creeps: ("reaches_a_free_goal", "goal-missed", Level.ERROR),
    DrivesOn: ("reaches_a_free_goal", "drives-on", Level.WARNING),
    Sound: ("passes_a_standing_obstacle", "runs-into", Level.ERROR),
    WaitsBefore: ("passes_a_standing_obstacle", "held-up", Level.WARNING),
}
"""Planner with one fault -> the check that must find it, as what, how grave; that of `Sound` is to see no obstacles."""


@pytest.mark.parametrize("fault", PLANTED, ids=lambda fault: str(fault.__name__))
def test_a_planted_fault_is_found_by_the_check_that_is_there_for_it(fault: type) -> None:
    check, slug, level = PLANTED[fault]
    report = run_battery(Subject("", fault), [check])
    assert (slug, level) in {(finding.slug, finding.level) for finding in report.findings}
    assert report.passed == (level is not Level.ERROR)
    found = next(finding for finding in report.findings if finding.slug == slug)
    assert found.seen and found.remedy and found.check == check


@pytest.mark.parametrize("check", [name for name in CHECKS if name not in ("passes_a_standing_obstacle", *GATES)])
def test_no_check_complains_of_a_planner_without_its_fault(check: str) -> None:
    found = [f for f in run_battery(Subject("", Sound), [check]).findings if f.level is not Level.NOTE]
    assert not found


def test_every_check_is_shown_a_planner_that_it_must_complain_of() -> None:
    elsewhere = {"same_in_own_process"}
    assert {check for check, _, _ in PLANTED.values()} | elsewhere == set(CHECKS)

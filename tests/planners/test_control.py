"""Control in a loop with a simulated body: tracking converges where replaying does not; pause and resume."""

from __future__ import annotations

import math

import numpy as np
import pytest

from parcours.kernels import Record
from parcours_navigation.arena.robot import ROBOT, drive
from parcours_ramp.planner.control import COMMAND_PERIOD, CONTROL, command, follow, signal
from parcours_ramp.planner.messages import PATH, POSE, TRAJECTORY, one
from parcours_ramp.planner.parameters import Parameters, guarded, original
from parcours_ramp.planner.route import HYBRID, ROUTE
from parcours_ramp.planner.trajectory import pose_at, samples
from parcours_ramp.planner.trajectory_generator import generate

SECOND = 1_000_000_000


def planned(*knots: tuple[float, float]) -> Record:
    path, start, trajectory = one(PATH), one(POSE), one(TRAJECTORY)
    path.n = len(knots)
    for k, (x, y) in enumerate(knots):
        path.x[k], path.y[k] = x, y
    start.x, start.y = knots[0]
    start.heading = math.atan2(knots[1][1] - knots[0][1], knots[1][0] - knots[0][0])
    generate(path, start, HYBRID, guarded().record(), one(ROUTE), trajectory)
    return trajectory


class Loop:
    """Control and body, one command every period."""

    def __init__(self, parameters: Parameters, trajectory: Record, aside: float = 0.0, turned: float = 0.0) -> None:
        self.parameters, self.now = parameters.record(), 0
        self.control, self.pose = one(CONTROL), one(POSE)
        self.control.limit = np.inf
        self.robot = np.zeros(1, ROBOT).view(np.recarray)[0]
        begin = samples(trajectory)[0]
        robot, heading = self.robot, float(begin.heading)
        robot.x = begin.x - aside * math.sin(heading)
        robot.y = begin.y + aside * math.cos(heading)
        robot.heading = heading + turned
        robot.v_max, robot.w_max, robot.a_max, robot.alpha_max = 0.25, math.pi / 2, 1.0, 2 * math.pi / 3
        follow(self.control, trajectory, 0, self.parameters)
        self.commands: list[tuple[float, float]] = []
        self.gaps: list[float] = []
        self.aside: list[float] = []

    def run(self, seconds: float) -> Loop:
        expected = one(POSE)
        for _ in range(round(seconds * SECOND) // COMMAND_PERIOD):
            robot, pose = self.robot, self.pose
            pose.x, pose.y, pose.heading, pose.v, pose.w = robot.x, robot.y, robot.heading, robot.v, robot.w
            pose_at(self.control.trajectory, (self.now - self.control.begins) * 1e-9, expected)
            dx, dy = float(pose.x - expected.x), float(pose.y - expected.y)
            self.gaps.append(math.hypot(dx, dy))
            self.aside.append(abs(dy * math.cos(expected.heading) - dx * math.sin(expected.heading)))
            command(self.control, pose, self.now, self.parameters)
            robot.command_v, robot.command_w = self.control.command_v, self.control.command_w
            self.commands.append((float(robot.command_v), float(robot.command_w)))
            for _ in range(5):
                drive(robot, 0.01)
            self.now += COMMAND_PERIOD
        return self


STRAIGHT = ((0.0, 0.0), (1.6, 0.4))
CORNER = ((0.0, 0.0), (1.0, 0.1), (1.2, 1.2))


@pytest.mark.parametrize("knots", [STRAIGHT, CORNER], ids=["straight", "corner"])
def test_tracking_stays_with_the_plan_to_a_few_millimetres(knots: tuple[tuple[float, float], ...]) -> None:
    trajectory = planned(*knots)
    loop = Loop(guarded(), trajectory).run(float(trajectory.duration) + 2.0)
    assert max(loop.gaps) < 0.015
    assert loop.gaps[-1] < 0.006
    assert loop.robot.v == 0.0
    assert math.hypot(loop.robot.x - knots[-1][0], loop.robot.y - knots[-1][1]) < 0.03


@pytest.mark.parametrize("aside", [-0.04, 0.04])
def test_tracking_brings_a_displaced_robot_back_to_its_plan_and_replaying_does_not(aside: float) -> None:
    trajectory = planned(*STRAIGHT)
    lasts = float(trajectory.duration) - 0.8  # before it brakes
    tracked, replayed = (Loop(make(), trajectory, aside).run(lasts) for make in (guarded, original))
    assert tracked.aside[0] == pytest.approx(abs(aside))
    assert tracked.aside[-1] < 0.001
    assert tracked.gaps[-1] < 0.01  # the way back has cost time that nothing faster than top speed makes good
    assert replayed.aside[-1] > 0.03


def test_tracking_rights_a_wrong_heading_and_replaying_rights_it_too_late() -> None:
    trajectory = planned(*STRAIGHT)
    lasts = float(trajectory.duration) - 0.8  # before it brakes
    tracked, replayed = (Loop(make(), trajectory, turned=0.4).run(lasts) for make in (guarded, original))
    assert tracked.aside[-1] < 0.001
    assert replayed.aside[-1] > 0.03
    heading = samples(trajectory).heading[0]
    assert abs(tracked.robot.heading - heading) < 0.02
    assert abs(replayed.robot.heading - heading) < 0.1


def test_replaying_sends_the_plan_s_own_speeds() -> None:
    trajectory = planned(*STRAIGHT)
    loop = Loop(original(), trajectory).run(2.0)
    assert [v for v, _ in loop.commands[::2]] == [float(v) for v in samples(trajectory).v[1:21]]


@pytest.mark.parametrize("make", [original, guarded])
def test_the_end_of_the_plan_is_the_end_of_the_motion(make: type) -> None:
    trajectory = planned(*STRAIGHT)
    loop = Loop(make(), trajectory).run(float(trajectory.duration) + 2.0)
    assert loop.commands[-1][0] == 0.0
    assert loop.robot.v == 0.0
    assert math.hypot(loop.robot.x - 1.6, loop.robot.y - 0.4) < 0.03


def test_without_a_plan_the_robot_is_commanded_to_stand() -> None:
    control = one(CONTROL)
    control.command_v = 0.2
    command(control, one(POSE), 0, guarded().record())
    assert (control.command_v, control.command_w) == (0.0, 0.0)


def test_the_repaired_control_halts_at_once_and_the_published_one_at_the_next_point_of_its_plan() -> None:
    for make, halts_after in ((guarded, 0), (original, 1)):
        loop = Loop(make(), planned(*STRAIGHT)).run(2.05)
        signal(loop.control, True, loop.now - 20_000_000, loop.parameters)
        assert (loop.control.command_v == 0.0) == (make is guarded)  # not even until the next command
        loop.run(0.5)
        after = [v for v, _ in loop.commands[41:]]
        assert after.index(0.0) == halts_after
        assert not any(after[halts_after:])
        assert loop.robot.v == 0.0


@pytest.mark.parametrize("make", [original, guarded])
def test_after_a_pause_the_robot_goes_on_where_it_was_and_arrives_that_much_later(make: type) -> None:
    trajectory = planned(*STRAIGHT)
    loop = Loop(make(), trajectory).run(2.0)
    signal(loop.control, True, loop.now, loop.parameters)
    loop.run(3.0)
    x = float(loop.robot.x)
    signal(loop.control, False, loop.now, loop.parameters)
    loop.run(float(trajectory.duration) - 2.0 + 1.0)
    assert 0.2 < x < 0.6
    assert math.hypot(loop.robot.x - 1.6, loop.robot.y - 0.4) < 0.04
    assert loop.control.begins == pytest.approx(3.0 * SECOND, abs=0.11 * SECOND)


def test_the_published_control_counts_from_when_it_gets_a_plan_and_the_repaired_one_from_when_it_was_to_begin() -> None:
    trajectory = planned(*STRAIGHT)
    trajectory.begins = 5 * SECOND
    for make, begins in ((original, 7 * SECOND), (guarded, 5 * SECOND)):
        control = one(CONTROL)
        follow(control, trajectory, 7 * SECOND, make().record())
        assert control.begins == begins

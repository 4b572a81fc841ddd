"""Drives a planner through the simulated world, in a closed loop: its way, its commands, and what it touched."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.world import NEVER, WORLD, advance, begin
from parcours_navigation.checking.scenes import observation
from parcours_navigation.checking.subject import Subject
from parcours_navigation.protocol import Floats, Task


@dataclass(frozen=True, slots=True)
class Drive:
    """How a planner drove.

    Attributes:
        times: of the observations [s], shape (n,).
        states: robot then: x, y, heading, speed, yaw rate [m, m, rad, m/s, rad/s], shape (n, 5).
        commands: what was answered then: speed, yaw rate [m/s, rad/s], shape (n, 2).
        t_goal: when the goal was first reached [s]; NaN if never.
        touched: whether the robot closed the gap at a contact.
        travelled: length of the way [m].
    """

    times: Floats
    states: Floats
    commands: Floats
    t_goal: float
    touched: bool
    travelled: float


def drive(
    subject: Subject,
    task: Task,
    start: Sequence[float],
    standing: Sequence[tuple[float, float]] = (),
    *,
    seconds: float,
    beyond_goal: float = 0.0,
) -> Drive:
    """Return how a new planner drives from `start`, among obstacles of 0.1 m that stand.

    Args:
        subject, task: the planner, and what it is to do.
        start: x, y, heading of the robot, at rest [m, m, rad].
        standing: centres of the obstacles [m], shape (n, 2).
        seconds: how long, at most [s].
        beyond_goal: how long it is watched after it reached the goal [s].

    Raises:
        BadAnswer: an answer is not of the protocol's form.
    """
    world = np.zeros(1, WORLD).view(np.recarray)[0]
    obstacles = np.zeros(len(standing), OBSTACLE)
    for obstacle, (x, y) in zip(obstacles, standing, strict=True):
        obstacle["x0"], obstacle["y0"], obstacle["radius"] = x, y, 0.1
    robot, limits = world.robot, task.limits
    robot.x, robot.y, robot.heading = start
    robot.v_max, robot.w_max, robot.radius = limits.speed, limits.yaw_rate, task.robot_radius
    robot.a_max, robot.alpha_max = limits.acceleration, limits.yaw_acceleration
    (world.goal_x, world.goal_y), world.goal_tolerance = task.goal, task.goal_tolerance
    begin(world, obstacles)
    slot = subject.slot(task)
    times, states, commands = [], [], []
    until = seconds
    for k in range(math.ceil(seconds / task.period)):
        now = k * task.period
        if now >= until:
            break
        state = (robot.x, robot.y, robot.heading, robot.v, robot.w)
        command = slot.speeds(observation(task, state, standing, now))
        times.append(now)
        states.append(state)
        commands.append(command)
        robot.command_v, robot.command_w = command
        advance(world, obstacles, round((now + task.period) * 1e9))
        if world.t_goal != NEVER:
            until = min(until, world.t_goal * 1e-9 + beyond_goal)
    t_goal = world.t_goal * 1e-9 if world.t_goal != NEVER else math.nan
    touched = bool(world.n_robot_contacts + world.n_shared_contacts)
    return Drive(np.array(times), np.array(states), np.array(commands), t_goal, touched, float(world.travelled))

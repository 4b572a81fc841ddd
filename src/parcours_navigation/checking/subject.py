"""A planner under check: found by name as campaigns find it, asked in small situations, and driven in a closed loop."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NoReturn

import numpy as np

from parcours.errors import BadRequest
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.world import NEVER, WORLD, advance, begin
from parcours_navigation.checking.scenes import PERIOD, observation, sensed, standard_task
from parcours_navigation.guests.answers import read_answer
from parcours_navigation.guests.planners import (
    SHIPPED,
    STACKS,
    asked_alone,
    batch_of,
    is_stack,
    load_planner,
    module_name,
    source_of,
)
from parcours_navigation.protocol import HEADING, Floats, Observation, Task, X, Y
from parcours_navigation.robots.kinds import Body
from parcours_navigation.stage import tracking

_BODY = Body()

Speeds = tuple[float, float]
"""Forward speed [m/s] and yaw rate [rad/s]."""


@dataclass(frozen=True, slots=True)
class Subject:
    """The planner that is checked."""

    name: str  # under which another process finds it, "module:attribute" or a registry name; "" if none can
    # returns a new planner: an object with `reset` and `observe`, or a function of an observation
    make: Callable[[], object]
    body: Body = _BODY  # of the robot that it is shown

    def task(self, goal: tuple[float, float] = (2.0, 2.0), *, seed: int = 7, period: float = PERIOD) -> Task:
        """Return the standard task of the checks, for its robot."""
        return standard_task(goal, seed=seed, period=period, body=self.body)

    def slot(self, task: Task) -> AskedPlanner:
        """Return a new planner, reset to the task."""
        slot = AskedPlanner(self.make())
        slot.reset(task)
        return slot


class AskedPlanner:
    """One planner that is asked: remembers the speeds of its last answer, which `None` leaves as they are."""

    def __init__(self, planner: object) -> None:
        self._needs = tuple(getattr(planner, "needs", ()))
        planner = asked_alone(planner, batch_of("that is checked", planner))
        observe = getattr(planner, "observe", None)
        self._reset: Callable[[Task], object] | None = getattr(planner, "reset", None)
        self._observe: Callable[[Observation], object] = observe if callable(observe) else planner  # type: ignore[assignment]
        self._held: Speeds = (0.0, 0.0)
        self._followed: Floats | None = None

    def reset(self, task: Task) -> None:
        """Begin a case."""
        self._held, self._followed = (0.0, 0.0), None
        if self._reset is not None:
            self._reset(task)

    def answer(self, observation: Observation) -> object:
        """Return the planner's own answer, whatever it is."""
        return self._observe(sensed(observation, self._needs))

    def speeds(self, observation: Observation) -> Speeds:
        """Ask, and return the speeds that the answer means now; a trajectory is followed by the law of campaigns.

        Raises BadAnswer if the answer is not of the protocol's form.
        """
        answer = self.answer(observation)
        if answer is not None:
            v, w, self._followed, _ = read_answer(answer)
            self._held = v, w
        if self._followed is not None:
            x, y, heading = (float(observation.robot[k]) for k in (X, Y, HEADING))
            self._held = tracking.speeds(self._followed, observation.time, x, y, heading)
        return self._held


def replayed(
    subject: Subject, task: Task, observations: Iterable[Observation], slot: AskedPlanner | None = None
) -> list[Speeds]:
    """Return the speeds that a planner answers to observations, one after the other, after a reset to the task.

    With a slot, that planner is asked again instead of a new one.
    """
    if slot is None:
        slot = subject.slot(task)
    else:
        slot.reset(task)
    return [slot.speeds(seen) for seen in observations]


_ITS_OWN_FAULT = ("planner-raised", "planner-form")
"""Complaints of the loader that the battery reports as findings."""


def load_subject(name: str, body: Body = _BODY) -> Subject:
    """Return the subject of a check, to be shown a robot with this body.

    Its module or file is read once, the planner made again each time.
    `name` is a shipped planner's, "package.module:Name", "path/to/file.py:Name", or the file of a stack's binding.
    Raises BadRequest if it leads nowhere.

    >>> load_subject("stand-still").make() is load_subject("stand-still").make()
    False
    """
    source = source_of(name)
    try:
        load_planner(name, source)
    except BadRequest as complaint:
        if complaint.slug in _ITS_OWN_FAULT:
            return Subject(name, lambda complaint=complaint: _raise(complaint), body)  # type: ignore[misc]
        raise
    if is_stack(name):
        return Subject(name, partial(importlib.import_module(STACKS).StackPlanner, name), body)
    where, _, dotted = SHIPPED.get(name, name).rpartition(":")
    kept = sys.modules.get(module_name(source)) if source is not None else None
    found: object = kept if kept is not None else importlib.import_module(where)
    for part in dotted.split("."):
        found = getattr(found, part)
    return Subject(name, found if isinstance(found, type) else lambda: found, body)


def _raise(complaint: BadRequest) -> NoReturn:
    raise complaint


@dataclass(frozen=True, slots=True)
class Drive:
    """How a planner drove."""

    times: Floats  # of the observations [s], shape (n,)
    states: Floats  # robot then: x, y, heading, speed, yaw rate [m, m, rad, m/s, rad/s], shape (n, 5)
    commands: Floats  # what was answered then: speed, yaw rate [m/s, rad/s], shape (n, 2)
    t_goal: float  # when the goal was first reached [s]; NaN if never
    touched: bool  # whether the robot caused a collision
    travelled: float  # length of the way [m]


def drive(
    subject: Subject,
    task: Task,
    start: Sequence[float],
    standing: Sequence[tuple[float, float]] = (),
    *,
    seconds: float,
    beyond_goal: float = 0.0,
) -> Drive:
    """Return how a new planner drives, at most for some seconds, and `beyond_goal` [s] after it reached the goal.

    It starts at rest in `start` (x, y, heading) among obstacles of 0.1 m that stand in `standing` (x, y). Raises
    BadAnswer if an answer is not of the protocol's form.
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

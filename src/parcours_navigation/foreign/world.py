"""A numbered system case -> the simulated world of a foreign robot: what it is told, what drives it, and the facts.

The robot is the binding's; obstacles move as in the study of the paper (section VI), unforeseen by any planner. All is
a function of the events of the trace, so a recording is judged again by the same code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from parcours.run.binding.structure import System
from parcours.run.binding.worlds import body, odometry
from parcours_navigation.arena.observing import freeze_world
from parcours_navigation.arena.obstacles import motion_at, place_at
from parcours_navigation.arena.world import WORLD, advance, begin
from parcours_navigation.cases.family import Protocol, SystemCases
from parcours_navigation.facts import FACTS, NEVER, TRACK, TRACK_PERIOD

START = (0.0, 0.0, 0.25 * math.pi)
GOAL = (2.0, 2.0, 0.25 * math.pi)
"""Where the robot starts and shall go, x [m], y [m], heading [rad] (section VI-B)."""

LIMITS = {"radius": 0.2, "v_max": 0.33, "w_max": 0.5 * math.pi, "a_max": 1.0, "alpha_max": 2.0 * math.pi / 3.0}
"""What the robot is where the binding says nothing [m, m/s, rad/s, m/s2, rad/s2]."""

Values = dict[str, object]
Record: TypeAlias = Any
"""One entry of a numpy record array."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Which case: the campaign's seed, the case's number, and by which protocol.

    "empty" is a world without obstacles.
    """

    seed: int
    number: int
    protocol: Protocol | Literal["empty"] = "table-vii"

    @property
    def id(self) -> str:
        """The stable id of the case."""
        if self.protocol == "empty":
            return f"system/empty/{self.number}"
        return "system/" + SystemCases(self.seed, self.protocol).id(self.number).partition("/")[2]


class ForeignWorld:
    """Robot, obstacles and goal, driven by the commands of others.

    Args:
        system: the binding's section.
        scene: the case.
    """

    def __init__(self, system: System, scene: Scene) -> None:
        self._system = system
        limits = LIMITS | dict(system.robot)
        self._world: Record = np.zeros(1, WORLD).view(np.recarray)[0]
        robot = self._world.robot
        robot.x, robot.y, robot.heading = START
        for name, value in limits.items():
            setattr(robot, name, value)
        self._world.goal_x, self._world.goal_y = GOAL[:2]
        self._world.goal_tolerance = system.tolerance
        self._obstacles = _obstacles(scene, limits["radius"])
        begin(self._world, self._obstacles)
        self._until = round(system.duration * 1e9)
        self._hold = None if math.isinf(system.command.hold) else round(system.command.hold * 1e9)
        self._expires: int | None = None
        self._moved, self._halted, self._halted_since = NEVER, False, 0
        self._n_halts = self._halted_time = 0
        self._next_entry = 0
        self._track: list[tuple[float, ...]] = []
        self._places: list[list[float]] = []

    @property
    def is_over(self) -> bool:
        """Whether the goal is reached, or the time is over."""
        return bool(self._world.t_goal != NEVER or self._world.now >= self._until)

    def advance(self, now: int) -> None:
        """Go on to `now` [ns since the case began]; a command that has run out counts no more."""
        while self._next_entry <= now:
            self._go(self._next_entry)
            self._enter()
            self._next_entry += TRACK_PERIOD
        self._go(now)

    def _go(self, now: int) -> None:
        if self._expires is not None and self._expires <= now:
            advance(self._world, self._obstacles, min(self._expires, self._until))
            self._drive(0.0, 0.0)
            self._expires = None
        advance(self._world, self._obstacles, min(now, self._until))

    def _enter(self) -> None:
        robot = self._world.robot
        if abs(robot.v) > 0.01:
            self._moved = self._next_entry
        place = (float(robot[name]) for name in ("x", "y", "heading", "v", "w"))
        self._track.append((self._next_entry, *place, int(self._halted)))
        both = zip(self._obstacles["x"], self._obstacles["y"], strict=True)
        self._places.append([float(value) for pair in both for value in pair])

    def command(self, v: float, w: float, now: int) -> None:
        """Drive the robot with speed v [m/s] and yaw rate w [rad/s] from `now` [ns] on."""
        self.advance(now)
        self._drive(v, w)
        self._expires = None if self._hold is None else now + self._hold

    def _drive(self, v: float, w: float) -> None:
        robot = self._world.robot
        robot.command_v, robot.command_w = (value if math.isfinite(value) else 0.0 for value in (v, w))

    def alarm(self, is_on: bool, now: int) -> None:
        """Take note that the system says whether a collision is imminent."""
        if is_on != self._halted:
            self._halted = is_on
            self._n_halts += is_on
            self._halted_time += 0 if is_on else now - self._halted_since
            self._halted_since = now

    def values(self, now: int, wall: float) -> Values:
        """Return the names of the world with their values.

        Args:
            now: since the case began [ns].
            wall: since 1970 [s].
        """
        robot = self._world.robot
        x, y, heading = float(robot.x), float(robot.y), float(robot.heading)
        start = dict(zip(("start.x", "start.y", "start.heading"), START, strict=True))
        return {
            **body("robot", x, y, heading, float(robot.v), float(robot.w), float(robot.radius)),
            **odometry(start, x, y, heading), **start,
            **dict(zip(("goal.x", "goal.y", "goal.heading"), GOAL, strict=True)),
            "time": now * 1e-9, "wall_time": wall, "obstacles": len(self._obstacles),
        }  # fmt: skip

    def items(self, now: int) -> list[Mapping[str, object]]:
        """Return the names of each obstacle with their values."""
        found: list[Mapping[str, object]] = []
        for index in range(len(self._obstacles)):
            obstacle = self._obstacles[index]
            x, y = place_at(obstacle, min(now, self._until))
            heading, v, w = motion_at(obstacle, min(now, self._until))
            seen = body("obstacle", float(x), float(y), float(heading), float(v), float(w), float(obstacle.radius))
            found.append({**seen, "obstacle.index": index})
        return found

    def facts(self, scene: Scene) -> NDArray[np.void]:
        """Return the facts of the case as it stands, array of FACTS of shape (1,)."""
        facts = np.zeros(1, FACTS)
        freeze_world(self._world, self._obstacles, facts.view(np.recarray)[0])
        facts["number"], facts["t_goal_after"], facts["t_last_moving"] = scene.number, NEVER, self._moved
        end = int(facts["t_end"][0])
        facts["n_halts"], facts["halted"] = self._n_halts, self._halted
        facts["halted_time"] = self._halted_time + (end - self._halted_since if self._halted else 0)
        return facts

    def track(self) -> tuple[NDArray[np.void], NDArray[np.float64]]:
        """Return the robot's track, array of TRACK of shape (n,), and the obstacles' places, (n, n_obstacles, 2)."""
        places = np.array(self._places, float).reshape(len(self._places), -1, 2)
        return np.array(self._track, TRACK), places


def _obstacles(scene: Scene, radius: float) -> Record:
    protocol = "table-vii" if scene.protocol == "empty" else scene.protocol
    cases = SystemCases(scene.seed, protocol, min(radius, 0.5))
    found = cases.obstacles(np.array([scene.number]))[0]
    return (found[:0] if scene.protocol == "empty" else found).view(np.recarray)

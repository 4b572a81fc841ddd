"""The simulated world of a foreign robot: where it starts, what drives it, what is seen of it, the facts in the end.

The robot is the binding's; obstacles move as in the study of the paper (section VI), unforeseen by any planner. All is
a function of the events of the trace, so a recording is judged again by the same code.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from parcours.run.binding.structure import SystemEntry
from parcours.run.binding.worlds import body, odometry
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.robot import ROBOT
from parcours_navigation.arena.world import TICK
from parcours_navigation.cases.family import Protocol, SystemCases
from parcours_navigation.facts import FACTS, NEVER
from parcours_navigation.stage.memory import TIME, lay, observed, size_of
from parcours_navigation.stage.memory import Scene as Stage
from parcours_navigation.stage.moving import begin_case, freeze, goal_time, hold

Values = dict[str, object]

START = (0.0, 0.0, 0.25 * math.pi)
GOAL = (2.0, 2.0, 0.25 * math.pi)
"""The robot's start and goal, x [m], y [m], heading [rad] (section VI-B)."""

PLACES = {
    f"{end}.{name}": value
    for end, place in (("start", START), ("goal", GOAL))
    for name, value in zip(("x", "y", "heading"), place, strict=True)
}
"""The same by the names of formulas."""

LIMITS = {"radius": 0.2, "v_max": 0.33, "w_max": 0.5 * math.pi, "a_max": 1.0, "alpha_max": 2.0 * math.pi / 3.0}
"""What the robot is where the binding says nothing [m, m/s, rad/s, m/s2, rad/s2]."""


@dataclass(frozen=True, slots=True)
class CaseKey:
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

    def obstacles(self, radius: float) -> NDArray[np.void]:
        """Return the obstacles that a robot of some radius [m] meets, array of OBSTACLE, shape (n,)."""
        if self.protocol == "empty":
            return np.zeros(0, OBSTACLE)
        found = SystemCases(self.seed, self.protocol, min(radius, 0.5)).obstacles(np.array([self.number]))[0]
        return np.ascontiguousarray(found)


def robot_values(x: float, y: float, heading: float, v: float, w: float, radius: float) -> Values:
    """Return the names that speak of the robot, its start and its goal, with their values [m, rad, m/s, rad/s]."""
    return {**body("robot", x, y, heading, v, w, radius), **odometry(PLACES, x, y, heading), **PLACES}


class ForeignWorld:
    """Robot, obstacles and goal, driven by the commands of foreign nodes.

    Args:
        system: the binding's section.
        scene: the case.
    """

    def __init__(self, system: SystemEntry, scene: CaseKey) -> None:
        limits = LIMITS | dict(system.robot)
        obstacles = scene.obstacles(limits["radius"])
        self._scene, self._radius, self._n = scene, limits["radius"], len(obstacles)
        robot = np.zeros(1, ROBOT)
        robot[["x", "y", "heading"]] = START
        for name in ("v_max", "w_max", "a_max", "alpha_max", "radius"):
            robot[name] = limits[name]
        stage = Stage(obstacles, robot, np.array([[*GOAL[:2], np.nan]]), system.tolerance)
        self._memory = np.zeros(size_of(stage, 0))
        lay(self._memory, scene.number, 0.0, stage, 0)
        begin_case(self._memory)
        self._until = round(system.duration * 1e9) // TICK * TICK
        self._hold = None if math.isinf(system.command.hold) else round(system.command.hold * 1e9)
        self._command, self._expires = (0.0, 0.0), NEVER
        self._halted, self._halted_since, self._n_halts, self._halted_time = False, 0, 0, 0

    @property
    def is_over(self) -> bool:
        """Whether the goal is reached, or the time is over."""
        return bool(self._memory[TIME] >= self._until) or goal_time(self._memory) != NEVER

    def advance(self, now: int) -> None:
        """Go on to `now` [ns since the case began]; a command that has run out counts no more."""
        if NEVER != self._expires <= now:
            self._go(self._expires)
            self._command, self._expires = (0.0, 0.0), NEVER
        self._go(now)

    def _go(self, now: int) -> None:
        until = min(now, self._until) // TICK * TICK
        while self._memory[TIME] < until:  # it also returns when the goal is reached
            hold(self._memory, until, *self._command)

    def command(self, v: float, w: float, now: int) -> None:
        """Drive the robot with speed v [m/s] and yaw rate w [rad/s] from `now` [ns] on."""
        self.advance(now)
        self._command = (v if math.isfinite(v) else 0.0), (w if math.isfinite(w) else 0.0)
        self._expires = NEVER if self._hold is None else now + self._hold

    def alarm(self, is_on: bool, now: int) -> None:
        """Take note that the system says whether a collision is imminent."""
        if is_on != self._halted:
            self._halted = is_on
            self._n_halts += is_on
            self._halted_time += 0 if is_on else now - self._halted_since
            self._halted_since = now

    def values(self, now: int, wall: float) -> Values:
        """Return the names of the world with their values, as it stood at the last tick.

        Args:
            now: since the case began [ns].
            wall: since 1970 [s].
        """
        x, y, heading, v, w = observed(self._memory)[0].tolist()
        robot = robot_values(x, y, heading, v, w, self._radius)
        return {**robot, "time": now * 1e-9, "wall_time": wall, "obstacles": self._n}

    def items(self) -> list[Values]:
        """Return the names of each obstacle with their values, as it stood at the last tick."""
        obstacles = observed(self._memory)[1][: self._n]
        return [{**body("obstacle", *row), "obstacle.index": k} for k, row in enumerate(obstacles.tolist())]

    def facts(self) -> NDArray[np.void]:
        """Return the facts of the case as it stands, array of FACTS of shape (1,)."""
        facts = np.zeros(1, FACTS)
        freeze(self._memory, facts[0])
        end = int(facts["t_end"][0])
        facts["number"], facts["t_goal_after"], facts["n_halts"] = self._scene.number, NEVER, self._n_halts
        facts["halted"] = self._halted
        facts["halted_time"] = self._halted_time + (end - self._halted_since if self._halted else 0)
        return facts

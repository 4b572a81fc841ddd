"""What any planner is given and gives back: a task once, then an observation each period, answered by a command.

A planner is a class with `reset` and `observe`, or a plain function of an observation. It knows nothing of the test:
neither the obstacles' future nor the verdict. Units are metres, seconds,
radians; headings run counter-clockwise from x (REP 103).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

X, Y, HEADING, SPEED, YAW_RATE, RADIUS = range(6)
"""Columns of `Observation.robot` (the first five) and of each row of `Observation.obstacles` (all six)."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the robot can do: the world holds it to these, whatever is commanded."""

    speed: float  # top speed [m/s], forward and backward
    yaw_rate: float  # [rad/s], either way
    acceleration: float  # [m/s2], speeding up and braking
    yaw_acceleration: float  # [rad/s2]


@dataclass(frozen=True, slots=True)
class Robot:
    """How the robot moves and what shape it has. Whatever it is, a `Command` or a `Velocity` drives it."""

    kind: Literal["unicycle", "differential", "car", "holonomic"] = "unicycle"
    footprint: Floats | None = None  # convex polygon in its own frame [m], shape (n, 2); None for a disc
    track_width: float = 0.0  # between the wheels of a differential drive [m]
    wheelbase: float = 0.0  # between the axles of a car, whose place is that of the rear one [m]
    steering: float = 0.0  # greatest angle of a car's front wheels [rad]
    steering_rate: float = 0.0  # [rad/s]


@dataclass(frozen=True, slots=True)
class Scan:
    """A planar laser scan from the robot's place; beam k points to heading + first + k * step."""

    ranges: Floats  # [m], inf where nothing is in reach, shape (n_beams,)
    first: float  # [rad]
    step: float  # [rad]
    reach: float  # [m]


@dataclass(frozen=True, slots=True)
class Map:
    """The ground as an occupancy grid."""

    cells: NDArray[np.uint8]  # 0 free, 100 occupied, 255 unknown, as ROS has them; shape (rows, columns), y upwards
    resolution: float  # side of a cell [m]
    origin: tuple[float, float]  # lower left corner of cells[0, 0] [m]


@dataclass(frozen=True, slots=True)
class Task:
    """What is the same from the start to the end of one case."""

    goal: tuple[float, float]  # where to go, (x, y) [m]
    goal_tolerance: float  # as near as this counts as reached [m]
    robot_radius: float  # the robot is a disc [m]
    limits: Limits  # the robot's limits
    period: float  # time between two observations [s]
    arena: float  # obstacles begin in the square [0, arena]^2 [m]; nobody is held back at its border
    seed: int  # for planners that draw random numbers; differs from case to case, and replays with it
    robot: Robot = Robot()  # what kind of robot it is
    goal_heading: float | None = None  # which way to look there [rad]; None if any will do
    heading_tolerance: float = 0.0  # as near as this counts [rad]


@dataclass(slots=True)
class Observation:
    """What can be sensed now. The arrays are used again for the next observation: copy what is to be kept."""

    time: float  # since the case began [s]
    robot: Floats  # x, y, heading, speed, yaw rate [m, m, rad, m/s, rad/s], shape (5,)
    obstacles: Floats  # one row each: x, y, heading, speed, yaw rate, radius [m, m, rad, m/s, rad/s, m], shape (n, 6)
    task: Task  # the task, for planners that are plain functions
    scan: Scan | None = None  # None where the world gives none
    map: Map | None = None
    path: Floats | None = None  # a way to follow, points x, y [m], shape (n, 2)


@dataclass(slots=True)
class Observations:
    """What can be sensed now in each case of a batch. The arrays are the planner's own."""

    time: float  # since the cases began [s]
    robots: Floats  # a row as `Observation.robot` for each case that goes on, shape (n, 5)
    obstacles: Floats  # rows as `Observation.obstacles` for each, shape (n, n_obstacles, 6)
    cases: NDArray[np.int64]  # which cases of the batch these are: their places among the tasks, ascending, shape (n,)
    tasks: tuple[Task, ...]  # the task of each case of the batch, also of those that are over


class Command(NamedTuple):
    """Speeds to hold until the next command: forward [m/s] and yaw rate [rad/s]. A plain pair will do."""

    v: float
    w: float


class Velocity(NamedTuple):
    """Speeds of a holonomic robot in its own frame, ahead and to the left [m/s], and yaw rate [rad/s]; or a triple."""

    vx: float
    vy: float
    w: float


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Poses to be at, which the host's tracking controller follows until a newer answer replaces it."""

    # one row each: time since the case began, x, y, heading [s, m, m, rad], times increasing, shape (n, 4)
    points: Floats


Answer = Command | tuple[float, float] | Velocity | tuple[float, float, float] | Trajectory | None
"""What `observe` returns; None leaves what was commanded before."""


SENSES = ("scan", "map", "path")
"""What a planner may declare to need, in an attribute `needs`: a world that does not give it is refused by name."""


class Planner(Protocol):
    """A planner with a memory. One object serves many cases: `reset` comes before each.

    It may have an attribute `needs`, some of SENSES. One that decides for many cases at once has `observe_batch`, which
    takes Observations and returns a row v, w [m/s, rad/s] for each, shape (n, 2); and, if it remembers anything,
    `reset_batch`, which takes the tasks of a batch.
    """

    def reset(self, task: Task) -> None:
        """Forget the last case and begin this one."""

    def observe(self, observation: Observation) -> Answer:
        """Return what to do now."""

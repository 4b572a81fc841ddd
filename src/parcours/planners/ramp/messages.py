"""What RAMP's components exchange and keep: arrays with a documented layout (Fig. 6, the fields that are used).

Units are metres, seconds, radians; headings run counter-clockwise from x. Times of the clock are integer nanoseconds.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from parcours.kernels import Record, kernel

SAMPLE = 0.1
"""Time between two samples of a trajectory [s]."""

MAX_SAMPLES = 501
"""A trajectory is cut off after 50 s."""

MAX_KNOTS = 8
"""A path has at most seven knot points; a switch puts the state it starts from before them."""

MAX_POPULATION = 16

POSE = np.dtype([("x", "f8"), ("y", "f8"), ("heading", "f8"), ("v", "f8"), ("w", "f8")])
"""Where a body is and how it moves (MotionState): position [m], heading [rad], speed [m/s], yaw rate [rad/s]."""

PATH = np.dtype([("n", "i8"), ("x", "f8", (MAX_KNOTS,)), ("y", "f8", (MAX_KNOTS,))])
"""Knot points from start to goal [m] (Path)."""

TRAJECTORY = np.dtype(
    [
        ("id", "i8"),
        ("n", "i8"),  # samples, one every SAMPLE seconds; the first is the start
        ("x", "f8", (MAX_SAMPLES,)),
        ("y", "f8", (MAX_SAMPLES,)),
        ("heading", "f8", (MAX_SAMPLES,)),
        ("v", "f8", (MAX_SAMPLES,)),
        ("w", "f8", (MAX_SAMPLES,)),
        ("duration", "f8"),  # of the generated part [s]
        ("curve_end", "f8"),  # when its first corner is done [s]; 0 without a corner
        ("knot_time", "f8", (MAX_KNOTS,)),  # when each knot of its path is passed [s]; NO_COLLISION if never
        ("rest_length", "f8"),  # way from its end to the goal that is not generated [m]
        ("rest_turn", "f8"),  # turning on that way [rad]
        ("first_heading", "f8"),  # heading needed towards the next knot [rad]
        ("smooth", "i8"),  # 1 if it can be joined without stopping to rotate
        ("begins", "i8"),  # when it would begin [ns]
        ("feasible", "i8"),
        ("fitness", "f8"),
        ("t_collision", "f8"),  # first predicted collision, from its begin [s]; NO_COLLISION
    ]
)
"""A path with time, and what the evaluation says of it (RampTrajectory)."""

NO_COLLISION = 9999.0
"""The collision time of a trajectory that meets nobody [s]."""

MEMBER = np.dtype([("id", "i8"), ("path", PATH), ("trajectory", TRAJECTORY)])
"""A member of the population."""

OBSTACLE_STATE = np.dtype([("pose", POSE), ("radius", "f8")])
"""An obstacle as it was sensed (Obstacle); `pose.v` is its speed along its heading."""

HORIZON = 121
"""Samples of a predicted obstacle motion: 12 s."""

PREDICTION = np.dtype(
    [
        ("n", "i8"),
        ("x", "f8", (HORIZON,)),
        ("y", "f8", (HORIZON,)),
        ("speed", "f8"),
        ("radius", "f8"),
        ("stamp", "i8"),
    ]
)
"""Where an obstacle is expected to be, every SAMPLE seconds from `stamp` [ns]; it stays where the samples end."""

MODIFICATION = np.dtype(
    [("operator", "i8"), ("first", PATH), ("second", PATH), ("direction", "f8"), ("distance", "f8")]
)
"""One or two paths to modify by an operator; direction [rad] and distance [m] of the nearest obstacle (for `move`)."""


class Step(NamedTuple):
    """One transition of the model that a component has really taken, with the messages it sent.

    An empty transition is an action of the component that the model does not name.
    """

    transition: str
    sends: tuple[tuple[str, object], ...] = ()


class Tag(NamedTuple):
    """Which conversation of the planner a request belongs to; its response carries the same."""

    cycle: Literal["planning", "sensing", "control"]
    serial: int


class Obstacles(NamedTuple):
    """The obstacles as sensed at `stamp` [ns]; `states` is an array of OBSTACLE_STATE (ObstacleList, Odometry)."""

    stamp: int
    states: Record


class Report(NamedTuple):
    """The robot's state at `stamp` [ns]; `pose` is a POSE (the message of /update)."""

    stamp: int
    pose: Record


class TrajectoryRequest(NamedTuple):
    """Ways to generate, or obstacles to predict.

    `paths` is an array of PATH, `starts` of POSE, `kinds` of int64, all of shape (n,); if `obstacles` is given, one
    prediction an obstacle is wanted instead.
    """

    tag: Tag
    paths: Record = None
    starts: Record = None
    kinds: Record = None
    obstacles: Obstacles | None = None


class TrajectoryResponse(NamedTuple):
    """The answer to a TrajectoryRequest: an array of TRAJECTORY, or of PREDICTION."""

    tag: Tag
    trajectories: Record


class EvaluationRequest(NamedTuple):
    """Trajectories to evaluate against predicted obstacles (see `evaluate` for the fields).

    With `window` = (begins [ns], first sample, one past the last, margin [m], may leave) only the collision time of the
    one trajectory within the window is wanted.
    """

    tag: Tag
    trajectories: Record
    predictions: Record
    drift: tuple[float, float]
    heading: float
    halted: bool
    window: tuple[int, int, int, float, bool] | None = None


class EvaluationResponse(NamedTuple):
    """The answer to an EvaluationRequest: arrays of shape (n,)."""

    tag: Tag
    feasible: Record
    fitness: Record
    t_collision: Record


class ModificationRequest(NamedTuple):
    """One MODIFICATION to make."""

    tag: Tag
    modification: Record


class ModificationResponse(NamedTuple):
    """The modified paths, an array of PATH; empty if the operator was not applicable."""

    tag: Tag
    paths: Record


def one(kind: np.dtype[np.void]) -> Record:
    """Return a fresh record of the dtype, all zero, whose fields kernels and Python read by name.

    >>> float(one(POSE).x)
    0.0
    """
    return np.zeros(1, kind).view(np.recarray)[0]


def many(kind: np.dtype[np.void], n: int) -> Record:
    """Return an array of n fresh records of the dtype."""
    return np.zeros(n, kind).view(np.recarray)


@kernel
def copy_path(target: Record, source: Record) -> None:
    """Make the target PATH equal to the source."""
    target.n = source.n
    for i in range(source.n):
        target.x[i], target.y[i] = source.x[i], source.y[i]


@kernel
def copy_trajectory(target: Record, source: Record, first: int) -> None:
    """Make the target TRAJECTORY the source from its sample `first` on (0: all of it); times count from there."""
    n = max(source.n - first, 1)
    first = source.n - n
    target.id = source.id
    target.n = n
    for i in range(n):
        target.x[i] = source.x[first + i]
        target.y[i] = source.y[first + i]
        target.heading[i] = source.heading[first + i]
        target.v[i] = source.v[first + i]
        target.w[i] = source.w[first + i]
    target.duration = max(source.duration - first * SAMPLE, 0.0)
    target.curve_end = max(source.curve_end - first * SAMPLE, 0.0)
    for k in range(MAX_KNOTS):
        passed = source.knot_time[k]
        target.knot_time[k] = passed if passed >= NO_COLLISION else passed - first * SAMPLE
    target.rest_length, target.rest_turn = source.rest_length, source.rest_turn
    target.first_heading = source.first_heading
    target.smooth = source.smooth
    target.begins = source.begins + first * 100_000_000
    target.feasible, target.fitness = source.feasible, source.fitness
    target.t_collision = source.t_collision


@kernel
def pose_at(trajectory: Record, seconds: float, pose: Record) -> None:
    """Set the POSE to where the trajectory is `seconds` after its begin (its ends beyond them)."""
    place = min(max(seconds / SAMPLE, 0.0), float(trajectory.n - 1))
    i = min(int(place), max(trajectory.n - 2, 0))
    j = min(i + 1, trajectory.n - 1)
    share = place - i
    pose.x = trajectory.x[i] + share * (trajectory.x[j] - trajectory.x[i])
    pose.y = trajectory.y[i] + share * (trajectory.y[j] - trajectory.y[i])
    turn = trajectory.heading[j] - trajectory.heading[i]
    turn -= 6.283185307179586 * np.floor((turn + 3.141592653589793) / 6.283185307179586)
    pose.heading = trajectory.heading[i] + share * turn
    pose.v = trajectory.v[i] + share * (trajectory.v[j] - trajectory.v[i])
    pose.w = trajectory.w[i] + share * (trajectory.w[j] - trajectory.w[i])

"""What RAMP's components exchange and keep: arrays with a documented layout (Fig. 6, the fields that are used).

Units are metres, seconds, radians; headings run counter-clockwise from x. Times of the clock are integer nanoseconds.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from parcours.kernels import Record, kernel

SAMPLE = 0.1  # Time between two samples of a trajectory [s]
MAX_SAMPLES = 501  # A trajectory is cut off after 50 s
MAX_KNOTS = 8  # A path has at most seven knot points; a switch puts the state it starts from before them

MAX_POPULATION = 16

POSE = np.dtype([("x", "f8"), ("y", "f8"), ("heading", "f8"), ("v", "f8"), ("w", "f8")])
"""Where a body is and how it moves (MotionState): position [m], heading [rad], speed [m/s], yaw rate [rad/s]."""

PATH = np.dtype([("n", "i8"), ("x", "f8", (MAX_KNOTS,)), ("y", "f8", (MAX_KNOTS,))])
"""Knot points from start to goal [m] (Path)."""

LINE, CURVE, TURN = 0, 1, 2  # Kinds of piece: a straight, a rounded corner, a turn on the spot

MAX_PIECES = 3 * MAX_KNOTS + 4

PIECE = np.dtype(
    [
        ("kind", "i8"),
        ("x", "f8"),  # where it begins [m]
        ("y", "f8"),
        ("heading", "f8"),  # its heading there [rad], and that angle's sine and cosine
        ("s", "f8"),
        ("c", "f8"),
        ("length", "f8"),  # [m], or [rad] for a turn
        ("leg", "f8"),  # of a curve [m]
        ("angle", "f8"),  # turned by a curve or turn [rad]
        ("to_s", "f8"),  # sine and cosine of its heading at the end of a curve
        ("to_c", "f8"),
        ("half_s", "f8"),  # sine and cosine of half the angle
        ("half_c", "f8"),
        ("per_way", "f8"),  # 2 half_s / (leg half_c^2): from way to what `slope_at` takes [1/m]
        ("per_slope", "f8"),  # half_c / (2 half_s): from slope to the curve's parameter
        ("v0", "f8"),  # speed at its begin [m/s], or [rad/s] for a turn
        ("peak", "f8"),  # its greatest speed
        ("rate", "f8"),  # the limit by which it speeds up and slows down [m/s2], or [rad/s2]
        ("up", "f8"),  # how long it speeds up, holds and slows down [s]
        ("hold", "f8"),
        ("down", "f8"),
        ("end", "f8"),  # when it ends, from the begin of the first piece [s]
    ]
)  # A piece of a trajectory with its speed profile

MAX_LEGS = 3 * MAX_PIECES

LEG = np.dtype(
    [
        ("begin", "f8"),  # [s], counted as PIECE.end
        ("end", "f8"),
        ("x", "f8"),  # where it begins [m]
        ("y", "f8"),
        ("dx", "f8"),  # how far it leads [m]
        ("dy", "f8"),
        ("per_square", "f8"),  # 1 / (dx^2 + dy^2); 0 where it leads nowhere
        ("stray", "f8"),  # how far the robot is at most from where uniform motion would have it [m]
    ]
)  # A stretch of a trajectory that is nearly uniform motion

TRAJECTORY = np.dtype(
    [
        ("id", "i8"),
        ("n", "i8"),  # samples, one every SAMPLE seconds and the end; the first is the start
        ("n_pieces", "i8"),
        ("pieces", PIECE, (MAX_PIECES,)),
        ("n_legs", "i8"),
        ("legs", LEG, (MAX_LEGS,)),  # the same way in outline; times count as those of the pieces
        ("skipped", "f8"),  # how long before the begin the first piece would have begun [s]
        ("duration", "f8"),  # of the generated part [s]
        ("curve_end", "f8"),  # when its first corner is done [s]; 0 without a corner
        ("knot_time", "f8", (MAX_KNOTS,)),  # when each knot of its path is passed [s]; NO_COLLISION if never
        ("rest_length", "f8"),  # way from its end to the goal that is not generated [m]
        ("rest_turn", "f8"),  # turning on that way [rad]
        ("first_heading", "f8"),  # heading needed towards the next knot [rad]
        ("smooth", "i8"),  # 1 if it can be joined without stopping to rotate
        ("begins", "i8"),  # when it would begin [ns]
        ("lag", "i8"),  # the lag that this takes into account [ns]
        ("feasible", "i8"),
        ("fitness", "f8"),
        ("t_collision", "f8"),  # first predicted collision, from its begin [s]; NO_COLLISION
        ("epoch", "i8"),  # the epoch in which obstacles were looked at last; 0 for none
        ("valid_until", "i8"),  # the sample up to which it was found to pass them
        ("slack", "f8"),  # by how much they and it may come nearer at least until it meets one of them [m]
        ("changed", "f8"),  # how much the epoch had changed then [m]
        ("drift_x", "f8"),  # the drift with which that was found [m]
        ("drift_y", "f8"),
    ]
)  # A path with time, and what the evaluation says of it (RampTrajectory); `trajectory.samples` gives its samples

NO_COLLISION = 9999.0  # The collision time of a trajectory that meets nobody [s]

MEMBER = np.dtype([("id", "i8"), ("path", PATH), ("trajectory", TRAJECTORY), ("switches", "i8")])
"""A member of the population; `switches` is 1 while it is not known when it can be joined (working memory)."""

OBSTACLE_STATE = np.dtype([("pose", POSE), ("radius", "f8")])
"""An obstacle as it was sensed (Obstacle); `pose.v` is its speed along its heading."""

HORIZON = 121  # Samples of a predicted obstacle motion: 12 s

PREDICTION = np.dtype(
    [
        ("n", "i8"),
        ("x", "f8", (HORIZON,)),
        ("y", "f8", (HORIZON,)),
        ("heading", "f8"),  # at the first sample [rad], and that angle's sine and cosine where it moves
        ("s", "f8"),
        ("c", "f8"),
        ("speed", "f8"),  # along its heading [m/s]; 0 if it stands
        ("turn", "f8"),  # yaw rate [rad/s]
        ("straight", "f8"),  # for how long it may be taken to move uniformly [s]
        ("bend", "f8"),  # and how far it is then off at most, by the square of that time [m/s2]
        ("radius", "f8"),
        ("stamp", "i8"),
    ]
)  # Where an obstacle is expected to be, every SAMPLE seconds from `stamp` [ns]; it stays where the samples end

MODIFICATION = np.dtype(
    [("operator", "i8"), ("first", PATH), ("second", PATH), ("direction", "f8"), ("distance", "f8")]
)  # One or two paths to modify by an operator; direction [rad] and distance [m] of the nearest obstacle (for `move`)


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
    """The robot's state at `stamp` [ns] (the message of /update).

    `pose` is a POSE; `lag` is by how much the motion is behind its plan because its speed was limited [ns], in all.
    """

    stamp: int
    pose: Record
    lag: int = 0


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

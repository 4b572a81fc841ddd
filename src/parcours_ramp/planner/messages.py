"""What RAMP's components exchange and keep: arrays with a documented layout (Fig. 6, the fields that are used).

Units are metres, seconds, radians; headings run counter-clockwise from x. Times of the clock are integer nanoseconds.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from parcours.kernels import Record, kernel
from parcours.run.port import StepReport

SAMPLE = 0.1  # Time between two samples of a trajectory [s]
MAX_SAMPLES = 501  # A trajectory is cut off after 50 s
MAX_KNOTS = 8  # A path has at most seven knot points; a switch puts the state it starts from before them

MAX_POPULATION = 16


def fields(kind: str, names: str, *shape: int) -> list[tuple[str, str, tuple[int, ...]]]:
    """Return fields of one kind ("f8", "i8", ...) and shape for a record layout, in the order of their names."""
    return [(name, kind, shape) for name in names.split()]


POSE = np.dtype(fields("f8", "x y heading v w"))
"""Where a body is and how it moves (MotionState): position [m], heading [rad], speed [m/s], yaw rate [rad/s]."""

PATH = np.dtype([("n", "i8"), *fields("f8", "x y", MAX_KNOTS)])
"""Knot points from start to goal [m] (Path)."""

LINE, CURVE, TURN = 0, 1, 2  # Kinds of piece: a straight, a rounded corner, a turn on the spot

MAX_PIECES = 3 * MAX_KNOTS + 4

PIECE = np.dtype(
    [
        ("kind", "i8"),
        *fields("f8", "x y heading s c"),  # where it begins [m], its heading there [rad], and that angle's sine, cosine
        *fields(
            "f8", "length leg angle"
        ),  # [m], or [rad] for a turn; leg of a curve [m]; angle of a curve or turn [rad]
        *fields(
            "f8", "to_s to_c half_s half_c"
        ),  # sine and cosine of a curve's heading at its end, and of half its angle
        *fields("f8", "per_way per_slope"),  # 2 half_s / (leg half_c^2) [1/m] and half_c / (2 half_s), for `slope_at`
        *fields("f8", "v0 peak rate"),  # speed at its start, its greatest [m/s], and the limit of its change [m/s2]
        *fields(
            "f8", "up hold down end"
        ),  # how long it speeds up, holds, slows down; end from the first piece's begin [s]
    ]
)  # A piece of a trajectory with its speed profile

MAX_LEGS = 3 * MAX_PIECES

LEG = np.dtype(
    [
        *fields(
            "f8", "begin end x y dx dy"
        ),  # from when to when [s], as PIECE.end; where it begins and how far it leads [m]
        *fields("f8", "per_square stray"),  # 1 / (dx^2 + dy^2), or 0; how far uniform motion is off at most [m]
    ]
)  # A stretch of a trajectory that is nearly uniform motion

TRAJECTORY = np.dtype(
    [
        *fields("i8", "id n n_pieces"),  # n samples, one every SAMPLE seconds and the end; the first is the start
        ("pieces", PIECE, (MAX_PIECES,)),
        ("n_legs", "i8"),
        ("legs", LEG, (MAX_LEGS,)),  # the same way in outline; times count as those of the pieces
        *fields("f8", "skipped duration"),  # how long before the start the first piece would have begun; its length [s]
        ("curve_end", "f8"),  # when its first corner is done [s]; 0 without a corner
        ("knot_time", "f8", (MAX_KNOTS,)),  # when each knot of its path is passed [s]; NO_COLLISION if never
        *fields("f8", "rest_length rest_turn"),  # way from its end to the goal that is not generated [m], [rad]
        ("first_heading", "f8"),  # heading needed towards the next knot [rad]
        *fields(
            "i8", "smooth begins lag"
        ),  # 1 if joined without a stop; when it would begin, and the lag it allows for [ns]
        ("feasible", "i8"),
        *fields("f8", "fitness t_collision"),  # first predicted collision, from its start [s]; NO_COLLISION
        # What the last look at the obstacles leaves known (see `known_up_to`):
        ("epoch", "i8"),  # the number of the EPOCH in which that was; 0 for none
        *fields("i8", "looked met_at"),  # the sample up to which it looked; at which somebody is met, no less if nobody
        *fields("i8", "valid_until sure_until"),  # ... up to which all are passed by far; up to which all are predicted
        ("slack", "f8"),  # by how much the two may come nearer until `valid_until` [m]
        ("tight", "f8"),  # how far off they may be while all that was found up to `looked` is found again [m]
        ("later", "f8"),  # how far off obstacles may be after `sure_until` [m]
        *fields("f8", "changed strayed drift_x drift_y"),  # of the EPOCH, and the drift, with which that was found [m]
    ]
)  # A path with time, and what the evaluation says of it (RampTrajectory); `trajectory.samples` gives its samples

EPOCH = np.dtype(
    [
        ("number", "i8"),  # another one whenever an obstacle does what was not predicted; 0 if none is known
        ("changed", "f8"),  # by how much predictions have changed since, at most [m]
        ("strayed", "f8"),  # the same, but for the ends of their ways [m]
        ("ahead", "f8"),  # by how much these have strayed from the planner's own, if others made them [m]
        ("fastest", "f8"),  # the greatest speed predicted [m/s]
        ("stamp", "i8"),  # when the last ones were made [ns]
    ]
)  # What has become of the predictions of all obstacles while these do what was predicted

NO_COLLISION = 9999.0  # The collision time of a trajectory that meets nobody [s]

MEMBER = np.dtype(
    [
        ("id", "i8"),
        ("path", PATH),
        ("trajectory", TRAJECTORY),
        ("switches", "i8"),  # 1 while it is not known when it can be joined (working memory)
        ("put_off", "i8"),  # 1 if it has yet to be evaluated, with this drift [m] and heading of the robot [rad]
        *fields("f8", "drift_x drift_y heading"),
    ]
)  # A member of the population

OBSTACLE_STATE = np.dtype([("pose", POSE), ("radius", "f8")])
"""An obstacle as it was sensed (Obstacle); `pose.v` is its speed along its heading."""

HORIZON = 121  # Samples of a predicted obstacle motion: 12 s

PREDICTION = np.dtype(
    [
        ("n", "i8"),
        *fields("f8", "x y", HORIZON),
        *fields("f8", "heading s c"),  # at the first sample [rad], and that angle's sine and cosine where it moves
        *fields("f8", "speed turn"),  # along its heading, 0 if it stands [m/s]; yaw rate [rad/s]
        *fields(
            "f8", "straight bend"
        ),  # how long it may be taken for uniform [s]; it is then off by bend * time^2 [m/s2]
        ("radius", "f8"),
        ("stamp", "i8"),
    ]
)  # Where an obstacle is expected to be, every SAMPLE seconds from `stamp` [ns]; it stays where the samples end

# One or two paths to modify by an operator; where the nearest obstacle is (for `move`) [rad], [m].
MODIFICATION = np.dtype([("operator", "i8"), ("first", PATH), ("second", PATH), *fields("f8", "direction distance")])


class PlannerStep(NamedTuple):
    """One transition of the model that a component has really taken, with the messages it sent.

    An empty transition is an action of the component that the model does not name. `reported` are the variables and
    operations of the model that go with it.
    """

    transition: str
    sends: tuple[tuple[str, object], ...] = ()
    reported: StepReport | None = None


def reporting(transition: str, *sends: tuple[str, object], operation: str = "", **variables: object) -> PlannerStep:
    """Return a step with what its component reports."""
    return PlannerStep(transition, sends, StepReport(variables, (operation,) if operation else ()))


class Tag(NamedTuple):
    """Which conversation of the planner a request belongs to; its response carries the same."""

    cycle: Literal["planning", "sensing", "control"]
    serial: int


class Obstacles(NamedTuple):
    """The obstacles as sensed at `stamp` [ns]; `states` is an array of OBSTACLE_STATE (ObstacleList, Odometry)."""

    stamp: int
    states: Record


class StateReport(NamedTuple):
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
    """Return a fresh record of the dtype, all zero, whose fields kernels and Python read by name."""
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

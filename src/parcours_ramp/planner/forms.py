"""The flat form of RAMP's messages: per channel a list of typed fields, and how arrays of records fill them.

From the forms come messages between processes, typed messages of ROS and the schemas of recordings.
"""

from __future__ import annotations

from typing import Any, Literal

from parcours_ramp.planner.flat import CountedPart, FormField, Part, RecordLayout, columns
from parcours_ramp.planner.messages import (
    HORIZON,
    LEG,
    MAX_KNOTS,
    MAX_LEGS,
    MAX_PIECES,
    MAX_POPULATION,
    MAX_SAMPLES,
    OBSTACLE_STATE,
    PATH,
    PIECE,
    POSE,
    PREDICTION,
    TRAJECTORY,
)

MOST_OBSTACLES = 1000  # More obstacles, or predictions, are not taken in one message


def _part(kind: Any, sort: Literal["floats", "ints"], name: str, of: str, doc: str, *, endless: bool = False) -> Part:
    places = columns(kind, *of.split())
    return Part(FormField(name, sort, doc, len(places), endless), places)


def _words(kind: Any) -> int:
    return len(columns(kind, *kind.names))


def _begin(kind: Any, name: str) -> int:
    return int(columns(kind, name)[0])


TRAJECTORIES = RecordLayout(
    TRAJECTORY,
    ((0, MAX_SAMPLES), (0, MAX_PIECES), (0, MAX_LEGS)),
    MAX_POPULATION,
    _part(TRAJECTORY, "ints", "trajectory_counts", "n n_pieces n_legs", "samples, pieces and legs of each trajectory"),
    _part(TRAJECTORY, "ints", "trajectory_numbers",
          "id smooth begins lag feasible epoch looked met_at valid_until sure_until",
          "id, smooth (1 or 0), begins [ns], lag [ns], feasible (1 or 0), epoch, looked, met_at, valid_until and "
          "sure_until [samples]"),
    _part(TRAJECTORY, "floats", "trajectory_values",
          "skipped duration curve_end rest_length rest_turn first_heading fitness t_collision "
          "changed strayed drift_x drift_y",
          "skipped [s], duration [s], curve end [s], rest length [m], rest turn [rad], first heading [rad], fitness, "
          "time of collision [s], changed [m], strayed [m], drift x [m], drift y [m]"),
    _part(TRAJECTORY, "floats", "trajectory_slacks", "slack tight later",
          "by how much they may come nearer up to valid_until, up to looked, after sure_until [m]", endless=True),
    _part(TRAJECTORY, "floats", "knot_times", "knot_time", "when each knot is passed [s], 9999 for never"),
    CountedPart(FormField("piece_kinds", "ints",
                          "0 straight, 1 curve, 2 turn on the spot; all pieces of all trajectories"),
                1, _begin(TRAJECTORY, "pieces"), MAX_PIECES, _words(PIECE)),
    CountedPart(FormField("pieces", "floats", ", ".join((PIECE.names or ())[1:]) + " of each piece", _words(PIECE) - 1),
                1, _begin(TRAJECTORY, "pieces"), MAX_PIECES, _words(PIECE), 1),
    CountedPart(FormField("legs", "floats", ", ".join(LEG.names or ()) + " of each leg", _words(LEG)),
                2, _begin(TRAJECTORY, "legs"), MAX_LEGS, _words(LEG)),
)  # fmt: skip

PREDICTIONS = RecordLayout(
    PREDICTION,
    ((0, HORIZON),),
    MOST_OBSTACLES,
    _part(PREDICTION, "ints", "prediction_counts", "n", "samples of each prediction, one every 0.1 s"),
    _part(PREDICTION, "ints", "prediction_stamps", "stamp", "when the first sample is [ns]"),
    _part(PREDICTION, "floats", "prediction_values", "heading s c speed turn bend radius",
          "heading [rad], its sine and cosine, speed [m/s], yaw rate [rad/s], bend [m/s2], radius [m]"),
    _part(PREDICTION, "floats", "prediction_straights", "straight", "for how long it is nearly uniform [s]",
          endless=True),
    CountedPart(FormField("prediction_x", "floats", "all samples of all predictions [m]"),
                0, _begin(PREDICTION, "x"), HORIZON),
    CountedPart(FormField("prediction_y", "floats", "all samples of all predictions [m]"),
                0, _begin(PREDICTION, "y"), HORIZON),
)  # fmt: skip

PATHS = RecordLayout(
    PATH, ((0, MAX_KNOTS),), MAX_POPULATION, _part(PATH, "ints", "path_counts", "n", "knot points of each path"),
    CountedPart(FormField("path_x", "floats", "all knot points of all paths [m]"), 0, _begin(PATH, "x"), MAX_KNOTS),
    CountedPart(FormField("path_y", "floats", "all knot points of all paths [m]"), 0, _begin(PATH, "y"), MAX_KNOTS),
)  # fmt: skip

_POSES = ("x [m]", "y [m]", "heading [rad]", "forward speed [m/s]", "yaw rate [rad/s]")
POSE_FIELDS = tuple(FormField(name, "float", doc) for name, doc in zip(POSE.names or (), _POSES, strict=True))
_STAMP = FormField("stamp", "int", "when it was sensed [ns]")
STATES = FormField("states", "floats", f"{', '.join(_POSES)}, radius [m] of each obstacle", _words(OBSTACLE_STATE))
_TAG = (
    FormField("cycle", "int", "the cycle of the planner that asks: 0 planning, 1 sensing, 2 control"),
    FormField("serial", "int", "the number of its conversation"),
)
_OBSTACLES = (_STAMP, STATES)
_REPORT = (_STAMP, *POSE_FIELDS, FormField("lag", "int", "by how much the motion is behind its plan [ns]"))
_FOR_OBSTACLES = FormField("for_obstacles", "bool", "whether obstacles are to be predicted; then there are no paths")
_STARTS = FormField("starts", "floats", f"{', '.join(_POSES)} from which each path is entered", _words(POSE))
_KINDS = FormField("kinds", "ints", "0 hybrid, 1 holonomic, 2 transition; of each path")

FORMS: dict[str, tuple[FormField, ...]] = {
    "odometry": _OBSTACLES,
    "obstacles": _OBSTACLES,
    "trajectory_request": (*_TAG, _FOR_OBSTACLES, *PATHS.fields, _STARTS, _KINDS, *_OBSTACLES),
    "trajectory_response": (*_TAG, _FOR_OBSTACLES, *TRAJECTORIES.fields, *PREDICTIONS.fields),
    "evaluation_request": (
        *_TAG, *TRAJECTORIES.fields, *PREDICTIONS.fields,
        FormField("drift_x", "float", "to be added to planned positions [m]"),
        FormField("drift_y", "float", "to be added to planned positions [m]"),
        FormField("heading", "float", "of the robot now [rad]"),
        FormField("halted", "bool", "whether the robot is stopped for imminent collision"),
        FormField("windowed", "bool",
                  "whether only the collision time within the window is wanted; else the window is 0"),
        FormField("window_begins", "int", "when the trajectory begins [ns]"),
        FormField("window_first", "int", "first sample to look at"),
        FormField("window_last", "int", "one past the last sample to look at"),
        FormField("window_margin", "float", "to be kept from obstacles [m]"),
        FormField("window_may_leave", "bool", "whether the robot may leave an obstacle that it is too near to"),
    ),
    "evaluation_response": (
        *_TAG,
        FormField("feasible", "ints", "1 or 0, of each trajectory"),
        FormField("fitness", "floats", "1 / cost of each trajectory"),
        FormField("t_collision", "floats", "first collision of each trajectory [s]; 9999 for none"),
    ),
    "modification_request": (
        *_TAG, FormField("operator", "int", "0 insert, 1 delete, 2 change, 3 swap, 4 crossover, 5 move"),
        *PATHS.fields,
        FormField("direction", "float", "to the nearest obstacle [rad]"),
        FormField("distance", "float", "to the nearest obstacle [m]"),
    ),
    "modification_response": (*_TAG, *PATHS.fields),
    "best_trajectory": TRAJECTORIES.fields,
    "update": _REPORT,
    "imminent_collision": (FormField("imminent", "bool", "whether the robot is to halt"),),
    "speed_limit": (FormField("limit", "float", "how fast the robot may drive [m/s]", endless=True),),
    "pose": _REPORT,
    "cmd_vel": (FormField("v", "float", "forward speed [m/s]"), FormField("w", "float", "yaw rate [rad/s]")),
}  # fmt: skip
"""The fields of every channel's messages, in order. Paths, predictions and trajectories are counted field by field."""

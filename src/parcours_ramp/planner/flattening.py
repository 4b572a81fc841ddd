"""The messages of RAMP into the values of their flat forms, and back, bit by bit.

Records travel without what lies beyond their counts: a trajectory with the pieces and legs that it has, a path with its
knots, a prediction with its samples. No component reads beyond a count, and what comes back is zero there. What comes
from outside is refused where it could make compiled code read beyond an array, or run without end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from parcours.errors import require_known
from parcours_ramp.planner import messages
from parcours_ramp.planner.flat import Given, refusal
from parcours_ramp.planner.forms import FORMS, MOST_OBSTACLES, PATHS, POSE_FIELDS, PREDICTIONS, STATES, TRAJECTORIES
from parcours_ramp.planner.path_modification import CROSSOVER, OPERATORS
from parcours_ramp.planner.route import HYBRID, TRANSITION

SHORTEST_STRAIGHT = 1e-3
"""The least time for which a predicted motion may be taken for uniform [s]: an evaluation goes on by steps of it."""

LATEST_SAMPLE = 10**9  # No evaluation looks at a later sample: three years

CYCLES: tuple[Literal["planning", "sensing", "control"], ...] = ("planning", "sensing", "control")

_PAYLOADS: dict[str, type | tuple[type, ...]] = {
    "odometry": messages.Obstacles,
    "obstacles": messages.Obstacles,
    "trajectory_request": messages.TrajectoryRequest,
    "trajectory_response": messages.TrajectoryResponse,
    "evaluation_request": messages.EvaluationRequest,
    "evaluation_response": messages.EvaluationResponse,
    "modification_request": messages.ModificationRequest,
    "modification_response": messages.ModificationResponse,
    "best_trajectory": np.void,
    "update": messages.StateReport,
    "imminent_collision": bool,
    "speed_limit": float,
    "pose": messages.StateReport,
    "cmd_vel": tuple,
}


def flatten(channel: str, payload: object) -> tuple[object, ...]:
    """Return the values of a payload in the order of its channel's form; arrays have one dimension and are contiguous.

    Args:
        payload: what RAMP's components send there (see `messages`).

    Raises BadRequest: the channel is unknown, or the payload is not one of its.
    """
    require_known(channel, tuple(FORMS), "channel of RAMP", slug="wire-channel")
    if not isinstance(payload, _PAYLOADS[channel]):
        raise refusal(channel, "", f"carries {_PAYLOADS[channel]}, but {payload!r:.60} was given", "wire-payload")
    match payload:
        case messages.Obstacles(stamp, states):
            return int(stamp), _flat(channel, "states", messages.OBSTACLE_STATE, states)
        case messages.StateReport(stamp, pose, lag):
            return int(stamp), *_flat(channel, "x", messages.POSE, pose).tolist(), int(lag)
        case bool():
            return (payload,)
        case float():
            return (float(payload),)
        case np.void():
            return TRAJECTORIES.flatten(channel, payload)
        case (float(v), float(w)):
            return float(v), float(w)
        case (messages.Tag(cycle, serial), *_) if cycle in CYCLES:
            return CYCLES.index(cycle), int(serial), *_flat_conversation(channel, payload)
    raise refusal(channel, "", f"its parts must be of their types, but {payload!r:.60} was given", "wire-payload")


def _flat_conversation(channel: str, payload: object) -> tuple[object, ...]:
    """Return the values after the tag."""
    match payload:
        case messages.TrajectoryRequest(_, None, None, None, messages.Obstacles(stamp, states)):
            nothing = *PATHS.flatten(channel, messages.many(messages.PATH, 0)), np.zeros(0), np.zeros(0, np.int64)
            return True, *nothing, int(stamp), _flat(channel, "states", messages.OBSTACLE_STATE, states)
        case messages.TrajectoryRequest(_, paths, starts, kinds, None):
            asked = *PATHS.flatten(channel, paths), _flat(channel, "starts", messages.POSE, starts), _ints(kinds)
            return False, *asked, 0, np.zeros(0)
        case messages.TrajectoryResponse(_, answer):
            of_obstacles = np.ascontiguousarray(answer).itemsize == messages.PREDICTION.itemsize
            trajectories, predictions = messages.many(messages.TRAJECTORY, 0), messages.many(messages.PREDICTION, 0)
            if of_obstacles:
                predictions = answer
            else:
                trajectories = answer
            return (
                of_obstacles, *TRAJECTORIES.flatten(channel, trajectories), *PREDICTIONS.flatten(channel, predictions),
            )  # fmt: skip
        case messages.EvaluationRequest(_, trajectories, predictions, (dx, dy), heading, halted, window):
            begins, first, last, margin, may_leave = window or (0, 0, 0, 0.0, False)
            return (
                *TRAJECTORIES.flatten(channel, trajectories), *PREDICTIONS.flatten(channel, predictions),
                float(dx), float(dy), float(heading), bool(halted),
                window is not None, int(begins), int(first), int(last), float(margin), bool(may_leave),
            )  # fmt: skip
        case messages.EvaluationResponse(_, feasible, fitness, t_collision):
            return _ints(feasible), _floats(fitness), _floats(t_collision)
        case messages.ModificationRequest(_, modification):
            paths = messages.many(messages.PATH, 2)
            paths[0], paths[1] = modification.first, modification.second
            operator, direction, distance = (modification[name] for name in ("operator", "direction", "distance"))
            return int(operator), *PATHS.flatten(channel, paths), float(direction), float(distance)
        case messages.ModificationResponse(_, paths):
            return PATHS.flatten(channel, paths)
    raise refusal(channel, "", "it wants either paths or obstacles, but both or neither were given", "wire-payload")


def _floats(values: object) -> NDArray[np.float64]:
    return np.ascontiguousarray(values, np.float64)


def _ints(values: object) -> NDArray[np.int64]:
    return np.ascontiguousarray(values, np.int64)


def _flat(channel: str, field: str, kind: Any, records: object) -> NDArray[np.float64]:
    """Return the numbers of records that hold floats only, or of one such record."""
    table = np.array(records, ndmin=1, order="C")
    if table.itemsize != kind.itemsize:
        raise refusal(channel, field, f"takes records of {kind.itemsize} bytes, but {records!r:.60} was given",
               "wire-payload")  # fmt: skip
    return table.view(np.float64)


def restore(channel: str, values: Sequence[object]) -> Any:
    """Return the payload that `flatten` made the values from; nothing of it lies in the memory of the values.

    Args:
        values: in the order of the form; arrays may be other sequences of numbers, too.

    Raises BadRequest: the channel is unknown, or the values are not what its form says.
    """
    require_known(channel, tuple(FORMS), "channel of RAMP", slug="wire-channel")
    given = Given(channel, FORMS[channel], values)
    if "cycle" in given:
        given.within("cycle", 0, len(CYCLES) - 1)
        return _RESTORE[channel](given, messages.Tag(CYCLES[given["cycle"]], given["serial"]))
    if "states" in given:
        return _obstacles(given)
    if "lag" in given:
        pose = _records(messages.POSE, np.array([given[field.name] for field in POSE_FIELDS]), 1)[0]
        return messages.StateReport(given["stamp"], pose, given["lag"])
    if channel == "best_trajectory":
        given.as_many("trajectory_counts", 1, "trajectory")
        return TRAJECTORIES.restore(given)[0]
    flat = tuple(given[field.name] for field in FORMS[channel])
    return flat if channel == "cmd_vel" else flat[0]


def _records(kind: Any, numbers: NDArray[np.float64], n: int) -> Any:
    records = messages.many(kind, n)
    np.asarray(records).view(np.float64)[:] = numbers
    return records


def _obstacles(given: Given) -> messages.Obstacles:
    n = given["states"].size // STATES.width
    given.within("states", 0, MOST_OBSTACLES, n, slug="wire-counts")
    return messages.Obstacles(given["stamp"], _records(messages.OBSTACLE_STATE, given["states"], n))


def _paths(given: Given) -> Any:
    """Return the paths, each of two knots at least."""
    given.all_within("path_counts", 2, messages.MAX_KNOTS, given["path_counts"], "wire-counts")
    return PATHS.restore(given)


def _predictions(given: Given) -> Any:
    """Return the predictions; those that move go on by steps worth the name."""
    predictions = PREDICTIONS.restore(given)
    straights = given["prediction_straights"][given["prediction_counts"] > 1]
    if np.count_nonzero(straights < SHORTEST_STRAIGHT):
        rule = f"must be at least {SHORTEST_STRAIGHT} s where an obstacle moves, but {straights.min()} s was given"
        given.refuse("prediction_straights", rule, "wire-range")
    return predictions


def _trajectory_request(given: Given, tag: messages.Tag) -> messages.TrajectoryRequest:
    if given["for_obstacles"]:
        for name in ("path_counts", "starts", "kinds"):
            given.as_many(name, 0, "paths with for_obstacles")
        return messages.TrajectoryRequest(tag, obstacles=_obstacles(given))
    given.within("stamp", 0, 0)
    given.as_many("states", 0, "obstacles without for_obstacles")
    paths = _paths(given)
    given.as_many("starts", len(paths), "path_counts")
    given.as_many("kinds", len(paths), "path_counts")
    given.all_within("kinds", HYBRID, TRANSITION, given["kinds"], "wire-range")
    return messages.TrajectoryRequest(
        tag, paths, _records(messages.POSE, given["starts"], len(paths)), given["kinds"].copy()
    )


def _trajectory_response(given: Given, tag: messages.Tag) -> messages.TrajectoryResponse:
    trajectories, predictions = TRAJECTORIES.restore(given), _predictions(given)
    wanted, other = (predictions, trajectories) if given["for_obstacles"] else (trajectories, predictions)
    if len(other):
        rule = f"must agree with what is sent, but is {given['for_obstacles']} and {len(other)} of the others are there"
        given.refuse("for_obstacles", rule, "wire-counts")
    return messages.TrajectoryResponse(tag, wanted)


def _evaluation_request(given: Given, tag: messages.Tag) -> messages.EvaluationRequest:
    begins, first, last, margin, may_leave = window = tuple(
        given[f"window_{name}"] for name in ("begins", "first", "last", "margin", "may_leave")
    )
    if given["windowed"]:
        given.within("window_first", 0, LATEST_SAMPLE)
        given.within("window_last", first, first + messages.MAX_SAMPLES)
    elif any(window):
        given.refuse("windowed", f"must be true with a window, but it is false with {window}", "wire-range")
    return messages.EvaluationRequest(
        tag, TRAJECTORIES.restore(given), _predictions(given), (given["drift_x"], given["drift_y"]), given["heading"],
        given["halted"], (begins, first, last, margin, may_leave) if given["windowed"] else None,
    )  # fmt: skip


def _evaluation_response(given: Given, tag: messages.Tag) -> messages.EvaluationResponse:
    n = given["feasible"].size
    given.within("feasible", 0, messages.MAX_POPULATION, n, slug="wire-counts")
    given.as_many("fitness", n, "values of feasible")
    given.as_many("t_collision", n, "values of feasible")
    return messages.EvaluationResponse(tag, *(given[name].copy() for name in ("feasible", "fitness", "t_collision")))


def _modification_request(given: Given, tag: messages.Tag) -> messages.ModificationRequest:
    given.within("operator", 0, len(OPERATORS) - 1)
    given.as_many("path_counts", 2, "paths")
    parents = 2 if given["operator"] == CROSSOVER else 1
    given.all_within("path_counts", 2, messages.MAX_KNOTS, given["path_counts"][:parents], "wire-counts")
    modification, paths = messages.one(messages.MODIFICATION), PATHS.restore(given)
    modification.first, modification.second = paths[0], paths[1]
    for name in ("operator", "direction", "distance"):
        modification[name] = given[name]
    return messages.ModificationRequest(tag, modification)


_RESTORE: dict[str, Callable[[Given, messages.Tag], object]] = {
    "trajectory_request": _trajectory_request,
    "trajectory_response": _trajectory_response,
    "evaluation_request": _evaluation_request,
    "evaluation_response": _evaluation_response,
    "modification_request": _modification_request,
    "modification_response": lambda given, tag: messages.ModificationResponse(tag, _paths(given)),
}

"""RAMP's payloads as messages of the model: plain mappings from the fields that components/model.yaml declares.

Numbers that only the kernels pass on among themselves (pieces, slacks, epochs) are left out. A trajectory is shown in
its published form, a state every 0.1 s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from parcours.errors import BadRequest
from parcours.kernels import Record, kernel
from parcours_ramp.planner import messages
from parcours_ramp.planner.messages import LEG, POSE, SAMPLE
from parcours_ramp.planner.path_modification import CROSSOVER, OPERATORS
from parcours_ramp.planner.route import HOLONOMIC, HYBRID
from parcours_ramp.planner.trajectory import pose_at

_WAYS = {HYBRID: "hybrid", HOLONOMIC: "holonomic"}  # any other is a transition
_POSE_FIELDS = tuple(POSE.names or ())
_REALS = ("duration", "skipped", "curve_end", "rest_length", "rest_turn", "first_heading", "fitness", "t_collision")
_LEG_FIELDS = tuple(LEG.names or ())


def message_of(channel: str, payload: object) -> Mapping[str, object] | None:
    """Return a payload as the model's message; None of channels that the model does not have.

    Raises BadRequest: the payload is not one of the channel.
    """
    view = _VIEWS.get(channel)
    if view is None:
        return None
    try:
        return view(payload)
    except (AttributeError, TypeError, ValueError, IndexError, KeyError) as error:
        rule = f"it must be a payload of {channel!r}, but is {payload!r:.60} ({error})"
        raise BadRequest(f"message on {channel!r}", rule, slug="message-fields") from error


def _state(pose: Record) -> dict[str, object]:
    return dict(zip(_POSE_FIELDS, pose.item() if hasattr(pose, "item") else pose, strict=True))


def _path(path: Record) -> dict[str, object]:
    n = int(path["n"])
    pairs = zip(path["x"][:n].tolist(), path["y"][:n].tolist(), strict=True)
    return {"points": [{"x": x, "y": y} for x, y in pairs]}


@kernel
def _sample(trajectory: Record, pose: Record, samples: Any) -> None:
    for i in range(len(samples)):
        pose_at(trajectory, min(i * SAMPLE, trajectory.duration), pose)
        samples[i, 0], samples[i, 1], samples[i, 2] = pose.x, pose.y, pose.heading
        samples[i, 3], samples[i, 4] = pose.v, pose.w


def _trajectory(one: Record) -> dict[str, object]:
    samples = np.zeros((int(one["n"]), len(_POSE_FIELDS)))
    if len(samples):
        _sample(one, messages.one(POSE), samples)
    return {
        "id": int(one["id"]),
        "points": [dict(zip(_POSE_FIELDS, row, strict=True)) for row in samples.tolist()],
        "knot_times": one["knot_time"].tolist(),
        **{name: float(one[name]) for name in _REALS},
        "smooth": bool(one["smooth"]),
        "feasible": bool(one["feasible"]),
        "begins": float(one["begins"]) * 1e-9,
        "legs": [dict(zip(_LEG_FIELDS, leg, strict=False)) for leg in _legs(one)],
    }


def _legs(one: Record) -> list[list[float]]:
    legs = one["legs"][: int(one["n_legs"])]
    return np.stack([legs[name] for name in _LEG_FIELDS], axis=1).tolist() if len(legs) else []


def _prediction(one: Record) -> dict[str, object]:
    n = int(one["n"])
    pairs = zip(one["x"][:n].tolist(), one["y"][:n].tolist(), strict=True)
    numbers = {name: float(one[name]) for name in ("heading", "speed", "turn", "radius", "straight", "bend")}
    return {"points": [{"x": x, "y": y} for x, y in pairs], **numbers, "stamp": float(one["stamp"]) * 1e-9}


def _obstacles(payload: Any) -> dict[str, object]:
    states = [{**_state(one.pose), "radius": float(one.radius)} for one in payload.states]
    return {"stamp": payload.stamp * 1e-9, "obstacles": states}


def _tag(payload: Any) -> dict[str, object]:
    return {"cycle": str(payload.tag.cycle), "serial": int(payload.tag.serial)}


def _trajectory_request(payload: Any) -> dict[str, object]:
    obstacles = payload.obstacles
    ways = () if obstacles is not None else range(len(payload.paths))
    return {
        **_tag(payload),
        "paths": [_path(payload.paths[k]) for k in ways],
        "starts": [_state(payload.starts[k]) for k in ways],
        "kinds": [_WAYS.get(int(payload.kinds[k]), "transition") for k in ways],
        "obstacles": _obstacles(obstacles)["obstacles"] if obstacles is not None else [],
        "stamp": obstacles.stamp * 1e-9 if obstacles is not None else 0.0,
    }


def _trajectory_response(payload: Any) -> dict[str, object]:
    answer = np.atleast_1d(payload.trajectories)
    is_prediction = "speed" in (answer.dtype.names or ())
    return {
        **_tag(payload),
        "trajectories": [] if is_prediction else [_trajectory(one) for one in answer],
        "predictions": [_prediction(one) for one in answer] if is_prediction else [],
    }


def _evaluation_request(payload: Any) -> dict[str, object]:
    drift_x, drift_y = payload.drift
    begins, first, last, margin, may_leave = payload.window or (0, 0, 0, 0.0, False)
    return {
        **_tag(payload),
        "trajectories": [_trajectory(one) for one in payload.trajectories],
        "predictions": [_prediction(one) for one in payload.predictions],
        "drift_x": float(drift_x),
        "drift_y": float(drift_y),
        "heading": float(payload.heading),
        "halted": bool(payload.halted),
        "windowed": payload.window is not None,
        "window": {
            "begins": begins * 1e-9,
            "first": int(first),
            "last": int(last),
            "margin": float(margin),
            "may_leave": bool(may_leave),
        },
    }


def _evaluation_response(payload: Any) -> dict[str, object]:
    return {
        **_tag(payload),
        "feasible": [bool(one) for one in payload.feasible],
        "fitness": [float(one) for one in payload.fitness],
        "t_collision": [float(one) for one in payload.t_collision],
    }


def _modification_request(payload: Any) -> dict[str, object]:
    asked = payload.modification
    operator = int(asked["operator"])
    second = _path(asked["second"]) if operator == CROSSOVER else {"points": []}
    return {
        **_tag(payload),
        "operator": OPERATORS[operator],
        "first": _path(asked["first"]),
        "second": second,
        "direction": float(asked["direction"]),
        "distance": float(asked["distance"]),
    }


def _modification_response(payload: Any) -> dict[str, object]:
    return {**_tag(payload), "paths": [_path(one) for one in payload.paths]}


def _report(payload: Any) -> dict[str, object]:
    return {"stamp": payload.stamp * 1e-9, **_state(payload.pose), "lag": payload.lag * 1e-9}


_VIEWS: dict[str, Callable[[Any], dict[str, object]]] = {
    "odometry": _obstacles,
    "obstacles": _obstacles,
    "trajectory_request": _trajectory_request,
    "trajectory_response": _trajectory_response,
    "evaluation_request": _evaluation_request,
    "evaluation_response": _evaluation_response,
    "modification_request": _modification_request,
    "modification_response": _modification_response,
    "best_trajectory": _trajectory,
    "update": _report,
    "pose": _report,
    "imminent_collision": lambda imminent: {"imminent": bool(imminent)},
    "speed_limit": lambda limit: {"limit": float(limit)},
    "cmd_vel": lambda command: {"v": float(command[0]), "w": float(command[1])},
}

"""Metamorphic relations of RAMP's services: what is asked is changed, and what is answered must change so, or stay."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from parcours.study.components.references import Relation
from parcours_ramp.components.references.numbers import told, wrapped
from parcours_ramp.planner.messages import PREDICTION, EvaluationRequest, TrajectoryRequest, many

_FAR = 50.0  # [m]
_HOUR = 3_600_000_000_000  # [ns]
_SENSING = "sensing"  # In this cycle the tester asks for ways, and the planner never does

Message = Mapping[str, Any]


@functools.cache
def relations() -> tuple[Relation, ...]:
    """Return the relations of RAMP's component study."""
    named = {
        "an hour later, with one more obstacle far away": ("crowded", "unchanged", "evaluation_response"),
        "mirrored ways": ("mirrored", "mirrored_answer", "trajectory_response"),
    }
    return tuple(
        Relation(name, f"{__name__}:{change}", f"{__name__}:{expect}", Path(), 1e-7, (channel,))
        for name, (change, expect, channel) in named.items()
    )


def crowded(channel: str, payload: object) -> object:
    """Let all be an hour later; turn the order of the predicted obstacles round, and add one far away."""
    if not isinstance(payload, EvaluationRequest) or not len(payload.predictions):
        return payload
    n, trajectories = len(payload.predictions), payload.trajectories.copy()
    predictions = many(PREDICTION, n + 1)
    predictions[0] = payload.predictions[0]
    predictions[0].x += _FAR
    for k in range(n):
        predictions[n - k] = payload.predictions[k]
    trajectories["begins"] += _HOUR
    predictions["stamp"] += _HOUR
    window = payload.window and (payload.window[0] + _HOUR, *payload.window[1:])
    return payload._replace(trajectories=trajectories, predictions=predictions, window=window)


def unchanged(channel: str, message: object) -> object:
    """All is as before."""
    return message


def mirrored(channel: str, payload: object) -> object:
    """Exchange x and y of the ways that are asked for."""
    if not isinstance(payload, TrajectoryRequest) or payload.obstacles is not None:
        return payload
    paths, starts = payload.paths.copy(), payload.starts.copy()
    for one, other in ((paths, payload.paths), (starts, payload.starts)):
        one["x"], one["y"] = other["y"], other["x"]
    starts["w"] = -payload.starts["w"]
    starts["heading"] = [wrapped(math.pi / 2 - heading) for heading in payload.starts["heading"].tolist()]
    return payload._replace(paths=paths, starts=starts)


def mirrored_answer(channel: str, message: object) -> object:
    """Exchange x and y of the trajectories that answer; everything else is left open."""
    if channel != "trajectory_response" or not isinstance(message, Mapping) or message["cycle"] != _SENSING:
        return None
    return {"trajectories": [_mirrored(one) for one in message["trajectories"]]}


def _mirrored(one: Message) -> Message:
    points = [
        {"x": s["y"], "y": s["x"], "heading": _turned(s["heading"]), "v": s["v"], "w": -s["w"]} for s in one["points"]
    ]
    # Its outline is left open: where rounding decides, the same way has a leg more. The reference judges it.
    return {**one, "points": points, "legs": None, "first_heading": _turned(one["first_heading"])}


def _turned(heading: float) -> float | None:
    return told(wrapped(math.pi / 2 - heading))

"""Trajectory Evaluation once more: every trajectory against every obstacle, at every sample and between any two."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from parcours_ramp.components.references.numbers import NEVER, SAMPLE, Numbers, Places, wrapped

_AWAY = 0.15  # By at least this share of the way that both move, what leaves gets away
_OPEN = 1e-7  # Where a distance is so near its limit, rounding decides [m]

Message = Mapping[str, Any]


class Evaluation:
    """Answers evaluation requests.

    Args:
        numbers: those that differ from `Numbers`, by name.
    """

    def __init__(self, numbers: Mapping[str, object] | None = None) -> None:
        self._numbers = Numbers.of(numbers)

    def __call__(self, request: Message) -> Message:
        """Return the answer to an EvaluationRequest of the model."""
        found = [evaluated(one, request, self._numbers) for one in request["trajectories"]]
        feasible, fitness, times = zip(*found, strict=True) if found else ((), (), ())
        return {
            "cycle": request["cycle"], "serial": request["serial"],
            "feasible": list(feasible), "fitness": list(fitness), "t_collision": list(times),
        }  # fmt: skip


def evaluated(one: Message, request: Message, n: Numbers) -> tuple[object, ...]:
    """Return feasible, fitness, and when the trajectory first meets anybody [s]; None for what rounding decides."""
    if request["windowed"]:
        window = request["window"]
        time = first_meeting(
            one, request, window["begins"], window["first"], window["last"], window["margin"], window["may_leave"], n
        )
        return one["feasible"], one["fitness"], time
    time = first_meeting(one, request, one["begins"], 0, len(one["points"]), n.plan_margin, n.may_leave, n)
    if time is None:
        return None, None, None
    turn = abs(wrapped(one["first_heading"] - request["heading"]))
    cost = one["duration"] + one["rest_length"] / n.estimate_v + one["rest_turn"] / n.estimate_w + turn / math.pi
    must_stop = not one["smooth"] and not request["halted"]
    if time < NEVER:
        cost += n.q_collision / time if time > 0 else n.q_collision
    if must_stop:
        cost += n.q_orientation * max(turn, 0.1) / math.pi
    return time == NEVER and not must_stop, 1 / max(cost, 1.0), time


def first_meeting(
    one: Message, request: Message, begins: float, first: int, last: int, margin: float, may_leave: bool, n: Numbers
) -> float | None:
    """Return when any obstacle is met, at samples `first` to `last` - 1 [s]; NEVER; None where rounding decides."""
    if last <= first:
        return NEVER
    points = one["points"]
    at = np.array([complex(s["x"], s["y"]) for s in points]) + complex(request["drift_x"], request["drift_y"])
    samples, hits = np.arange(first, last + 1), []
    for obstacle in request["predictions"]:
        where = np.array([complex(s["x"], s["y"]) for s in obstacle["points"]])
        place, known = samples + (begins - obstacle["stamp"]) / SAMPLE, np.arange(len(where))
        there = np.interp(place, known, where.real) + 1j * np.interp(place, known, where.imag)
        gaps = there - at[np.minimum(samples, len(at) - 1)]
        hit = meets(gaps, n.robot_radius + obstacle["radius"] + margin, may_leave)
        if hit is None:
            return None
        hits.append(first + hit)
    return min(hits) * SAMPLE if min(hits, default=last) < last else NEVER


def meets(gaps: Places, reach: float, may_leave: bool) -> int | None:
    """Return the first sample at which two bodies are, or have just come, within reach; n if there is none.

    Args:
        gaps: from one body to the other at each of n samples and one more, complex, shape (n + 1,) [m].
        may_leave: whether they may begin within reach, as long as they leave.
    """
    n, distance, steps = len(gaps) - 1, abs(gaps), np.diff(gaps)
    moved = abs(steps)
    share = np.clip(-(gaps[:-1].conj() * steps).real / np.where(moved > 0, moved, 1.0) ** 2, 0.0, 1.0)
    nearest = np.concatenate([distance[:1], abs(gaps[:-1] + share * steps)])
    k = 0
    while may_leave and k < n and distance[k] < reach - _OPEN:
        gain = distance[k + 1] - distance[k] - _AWAY * moved[k] + 1e-6
        if abs(gain) < 1e-9:
            return None
        if gain < 0:
            return k
        k += 1
        nearest[k] = distance[k]
    later = nearest[k:n]
    hits = np.flatnonzero(later < reach)
    end = int(hits[0]) if len(hits) else len(later)
    return None if np.any(abs(later[: end + 1] - reach) < _OPEN) else k + end

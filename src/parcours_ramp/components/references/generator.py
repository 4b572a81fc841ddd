"""The Trajectory Generator once more: a request -> the trajectories and predictions that must be answered."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from parcours_ramp.components.references.numbers import (
    KNOTS,
    LONGEST,
    NEVER,
    SAMPLE,
    Floats,
    Numbers,
    Profile,
    RoundingDecidesError,
    told,
    unit,
    wrapped,
)
from parcours_ramp.components.references.path_reference import Piece, Way, plan, profiles

_SLIGHT = 0.004  # What is off uniform motion by less needs no leg of its own [m]
_OPEN = 1e-9  # Below this, rounding decides [s], [m]

Message = Mapping[str, Any]


class Generator:
    """Answers trajectory requests.

    Args:
        numbers: those that differ from `Numbers`, by name.
    """

    def __init__(self, numbers: Mapping[str, object] | None = None) -> None:
        self._numbers = Numbers.of(numbers)

    def __call__(self, request: Message) -> Message:
        """Return the answer to a TrajectoryRequest of the model."""
        asked = zip(request["paths"], request["starts"], request["kinds"], strict=True)
        return {
            "cycle": request["cycle"],
            "serial": request["serial"],
            "trajectories": [trajectory(*one, self._numbers) for one in asked],
            "predictions": [prediction(one, request["stamp"]) for one in request["obstacles"]],
        }


def prediction(obstacle: Message, stamp: float) -> Message:
    """Return where an obstacle is expected: where it is, on a line for 12 s, or on an arc for pi rad or 5 s."""
    v, w, heading = obstacle["v"], obstacle["w"], obstacle["heading"]
    at = complex(obstacle["x"], obstacle["y"])
    stands, turns = abs(v) < 0.01, abs(w) >= 0.01
    n = 1 if stands else int(min(math.pi / abs(w), 5.0) / SAMPLE) + 1 if turns else 121
    places = [at]
    for time in (k * SAMPLE for k in range(1, n)):
        chord = v * time * (math.sin(w * time / 2) / (w * time / 2) if turns else 1.0)
        places.append(at + chord * unit(heading + (w * time / 2 if turns else 0.0)))
    bend = abs(v * w) / 8 if turns and not stands else 0.0
    straight = math.sqrt(0.04 / bend) if bend else math.inf
    return {
        "points": _points(places), "heading": heading, "speed": 0.0 if stands else v, "turn": w,
        "radius": obstacle["radius"], "stamp": stamp, "bend": bend, "straight": straight,
    }  # fmt: skip


def _points(places: list[complex]) -> list[Message]:
    return [{"x": one.real, "y": one.imag} for one in places]


def trajectory(path: Message, start: Message, kind: str, n: Numbers) -> Message | None:
    """Return the RampTrajectory along a path from a state; None where rounding decides."""
    knots = [complex(one["x"], one["y"]) for one in path["points"]]
    try:
        way = plan(knots, complex(start["x"], start["y"]), start["heading"], start["v"], kind, n)
    except RoundingDecidesError:
        return None
    driven = profiles(way, n)
    ends = list(itertools.accumulate(one.lasts for one in driven))
    duration = min(ends[-1], LONGEST)
    knot_times, passed = [0.0] + [NEVER] * (KNOTS - 1), 0
    for piece, end in zip(way.pieces, ends, strict=True):
        for knot in range(passed + 1, piece.knot + 1):
            knot_times[knot] = end
        passed = max(passed, piece.knot)
    corners = (end for piece, end in zip(way.pieces, ends, strict=True) if piece.kind == "corner" and piece.knot)
    return {
        "id": 0,
        "points": states(way, driven, ends, duration),
        "knot_times": knot_times,
        "duration": duration,
        "skipped": 0.0,
        "curve_end": next(corners, 0.0),
        "rest_length": way.rest_length + max(ends[-1] - LONGEST, 0.0) * n.estimate_v,
        "rest_turn": way.rest_turn,
        "first_heading": told(way.first_heading),
        "fitness": 0.0,
        "t_collision": NEVER,
        "smooth": way.smooth,
        "feasible": False,
        "begins": 0.0,
        "legs": legs(way, driven, ends),
    }


def states(way: Way, driven: list[Profile], ends: list[float], duration: float) -> list[Message] | None:
    """Return the state every 0.1 s and at the end; None where rounding decides how many there are."""
    samples = duration / SAMPLE
    if duration < LONGEST and 0 < abs(samples - round(samples)) < _OPEN:
        return None
    times = np.array([*(k * SAMPLE for k in range(math.ceil(samples))), duration])
    rows: list[Message] = []
    begins = [0.0, *ends[:-1]]
    for i, (piece, profile) in enumerate(zip(way.pieces, driven, strict=True)):
        until = math.inf if i == len(ends) - 1 else ends[i]
        here = times[(times >= begins[i]) & (times < until)]
        if len(here):
            made, speed = profile.at(here - begins[i])
            rows += _states(piece, made, speed)
    for end in ends[:-1]:  # where a piece ends at a sample, rounding decides which one it is on
        for k in np.flatnonzero(abs(times - end) < _OPEN):
            rows[k] = {**rows[k], "heading": None, "w": None}
    if ends[-1] < LONGEST:
        rows[-1] = {**rows[-1], "v": 0.0, "w": 0.0}
    return rows


def _states(piece: Piece, made: Floats, speed: Floats) -> list[Message]:
    """Return the states on a piece after ways of shape (n,) at speeds of shape (n,)."""
    rest = np.zeros(len(made))
    if piece.kind == "spin":
        side = math.copysign(1.0, piece.turn)
        turned = piece.heading + side * made
        return [_state(piece.at, told(wrapped(h)), 0.0, w) for h, w in zip(turned, side * speed, strict=True)]
    if piece.kind == "straight":
        places = piece.at + made * piece.towards
        return [_state(z, told(piece.heading), v, w) for z, v, w in zip(places, speed, rest, strict=True)]
    corner = piece.at + piece.arm * piece.towards
    u = place_on_corner(piece, made)
    places = (1 - u) ** 2 * piece.at + 2 * u * (1 - u) * corner + u**2 * piece.end
    slopes = 2 * piece.arm * ((1 - u) * piece.towards + u * piece.leaving)
    bends = 2 * piece.arm * (piece.leaving - piece.towards)
    turning = speed * (slopes.conj() * bends).imag / abs(slopes) ** 3
    headings = [told(cmath.phase(one)) for one in slopes]
    return [_state(*one) for one in zip(places, headings, speed, turning, strict=True)]


def _state(z: complex, heading: float | None, v: float, w: float) -> Message:
    return {"x": z.real, "y": z.imag, "heading": heading, "v": v, "w": w}


def place_on_corner(piece: Piece, made: Floats) -> Floats:
    """Return the parameter u, 0 to 1, of the curve after ways [m], by halving the interval that it lies in."""
    s, c = math.sin(abs(piece.turn) / 2), math.cos(piece.turn / 2)
    wanted = (made - piece.length / 2) * 2 * s / (piece.arm * c**2)
    low, high = np.full(len(made), -s / c), np.full(len(made), s / c)
    for _ in range(50):
        x = (low + high) / 2
        short = x * np.sqrt(1 + x**2) + np.arcsinh(x) < wanted
        low, high = np.where(short, x, low), np.where(short, high, x)
    u: Floats = (low + high) / 2 * c / s / 2 + 0.5
    return u


def legs(way: Way, driven: list[Profile], ends: list[float]) -> list[Message] | None:
    """Return the outline: stretches of nearly uniform motion; None where rounding decides how many there are."""
    found: list[Message] = []
    for piece, profile, end in zip(way.pieces, driven, ends, strict=True):
        begin, lasts = end - profile.lasts, profile.lasts
        if piece.kind == "spin":
            found.append(_leg(begin, end, piece.at, 0j, 0.0))
        elif piece.kind == "corner":
            middle = (piece.at + 2 * (piece.at + piece.arm * piece.towards) + piece.end) / 4
            sharpest = math.sin(abs(piece.turn) / 2) / (piece.arm * math.cos(piece.turn / 2) ** 2)
            stray = profile.v0**2 * sharpest * (lasts / 2) ** 2 / 8
            found.append(_leg(begin, begin + lasts / 2, piece.at, middle - piece.at, stray))
            found.append(_leg(begin + lasts / 2, end, middle, piece.end - middle, stray))
        else:
            lags = (profile.peak - profile.v0) * profile.up / 2, profile.rate * profile.down**2 / 2
            if any(abs(lag - _SLIGHT) < _OPEN for lag in lags):
                return None
            up = profile.up if lags[0] > _SLIGHT else 0.0
            down = profile.down if lags[1] > _SLIGHT else 0.0
            held = lasts - up - down
            if up + down > 0 and abs(held) < _OPEN:
                return None
            way_up, way_down = (profile.v0 + profile.peak) / 2 * up, profile.peak * down - profile.rate * down**2 / 2
            one, two = piece.at + way_up * piece.towards, piece.at + (piece.length - way_down) * piece.towards
            if up:
                found.append(_leg(begin, begin + up, piece.at, one - piece.at, profile.rate * up**2 / 8))
            found.append(_leg(begin + up, end - down, one, two - one, sum(lag for lag in lags if lag <= _SLIGHT)))
            if down:
                found.append(_leg(end - down, end, two, way_down * piece.towards, profile.rate * down**2 / 8))
    return found


def _leg(begin: float, end: float, at: complex, by: complex, stray: float) -> Message:
    per_square = 0.0 if not by else 1 / abs(by) ** 2 if abs(by) > 1e-6 else None
    return {
        "begin": begin, "end": end, "x": at.real, "y": at.imag, "dx": by.real, "dy": by.imag, "per_square": per_square,
        "stray": stray,
    }  # fmt: skip

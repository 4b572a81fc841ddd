"""A path and the state it starts from -> straights, corners and spins, and how fast each is driven (docs/ramp.md)."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from parcours_ramp.components.references.numbers import SAMPLE, Numbers, Profile, RoundingDecidesError, unit, wrapped

NEAR = 0.01  # [m], [rad], [m/s]
GENTLE = 0.3  # Up to here a change of heading needs no stop [rad]
SLOW = 0.4  # A corner must allow for this share of the top speed
_OPEN = 1e-6  # The direction to what is nearer than this is a matter of rounding [m]
SHORTEST = 0.1  # ... and have segments of this length [m]


@dataclass(slots=True)
class Piece:
    """A straight along `towards`, a corner from there to `leaving` by a Bezier curve with two arms, or a spin."""

    kind: Literal["straight", "corner", "spin"]
    at: complex
    heading: float
    towards: complex
    length: float  # [m]; [rad] of a spin
    cap: float  # [m/s]
    arm: float = 0.0  # [m]
    turn: float = 0.0  # [rad], to the left
    leaving: complex = 0j
    knot: int = 0  # that its end passes

    @property
    def end(self) -> complex:
        """Where it ends."""
        if self.kind == "corner":
            return self.at + self.arm * (self.towards + self.leaving)
        return self.at + (self.length * self.towards if self.kind == "straight" else 0.0)


@dataclass(slots=True)
class Way:
    """The pieces of a way, and its attributes."""

    first_heading: float
    pieces: list[Piece] = field(default_factory=list)
    smooth: bool = True
    rest_length: float = 0.0
    rest_turn: float = 0.0
    v0: float = 0.0

    def straight(self, at: complex, heading: float, towards: complex, length: float, n: Numbers) -> None:
        """Go straight on."""
        self.pieces.append(Piece("straight", at, heading, towards, length, n.v_max))

    def spin(self, at: complex, heading: float, turn: float) -> None:
        """Turn on the spot. Raises UndecidedError: by half a turn, to either side."""
        if math.pi - abs(turn) < 1e-7:
            raise RoundingDecidesError
        self.pieces.append(Piece("spin", at, heading, unit(heading), abs(turn), 0.0, turn=turn))

    def corner(self, at: complex, heading: float, towards: complex, arm: float, turn: float, leaving: complex,
               speed: float) -> complex:  # fmt: skip
        """Round a corner, and return where it ends."""
        length = corner_length(arm, turn)
        self.pieces.append(Piece("corner", at, heading, towards, length, speed, arm, turn, leaving))
        return self.pieces[-1].end


def corner_rate(turn: float, n: Numbers) -> float:
    """Return how fast a corner may be driven for each metre of its arms [1/s] (the table of docs/ramp.md)."""
    s, c = math.sin(abs(turn) / 2), math.cos(turn / 2)
    if c <= 1e-6:
        return 0.0
    if s <= 1e-9:
        return math.inf
    x = min(s / c, math.sqrt(0.2))
    sharpest, at_its_ends = s / c**2, s * c
    climb = 3 * s**2 * c**2 * x / (c * math.sqrt(1 + x**2)) ** 6
    a_sample = n.alpha_max * SAMPLE * (1 - 1 / 8)
    return min(n.w_max / sharpest, a_sample / at_its_ends, math.sqrt(n.alpha_max / climb))


def corner_length(arm: float, turn: float) -> float:
    """Return the length of a corner [m]."""
    s, c = math.sin(abs(turn) / 2), math.cos(turn / 2)
    if s <= 1e-6:
        return 2 * arm
    x = s / c
    return arm * c**2 / s * (x * math.sqrt(1 + x**2) + math.asinh(x))


def rounded(before: float, after: float, turn: float, v: float, early: bool, n: Numbers) -> tuple[float, float]:
    """Return arm [m] and speed [m/s] of the corner between two segments; (0, 0) if it cannot be rounded.

    Of the shorter segment 85, 80 ... 10 % stay straight, or 10, 15 ... 85 % if `early`: the first at which 80 % of the
    top speed are possible, else the fastest.
    """
    shorter = min(before, after)
    if abs(shorter - SHORTEST) < _OPEN:  # switches come at such distances before a knot: rounding decides
        raise RoundingDecidesError
    if shorter < SHORTEST:
        return 0.0, 0.0
    shares = [0.10 + 0.05 * k for k in range(16)]
    tried = []
    for share in shares if early else shares[::-1]:
        arm = (1 - share) * shorter
        speed = min(n.v_max, arm * corner_rate(turn, n))
        can_slow_down = v**2 - speed**2 <= 2 * n.a_max * (before - arm)
        if speed >= SLOW * n.v_max and can_slow_down:
            tried.append((arm, speed))
    fast = [one for one in tried if one[1] >= 0.8 * n.v_max]
    return fast[0] if fast else max(tried, key=lambda one: one[1], default=(0.0, 0.0))


def lay(knots: list[complex], start: complex, heading: float, speed: float, kind: str, stop_first: bool,
        n: Numbers) -> Way | None:  # fmt: skip
    """Return the way of one kind; None if there is none. Raises UndecidedError."""
    v = speed if speed >= NEAR else 0.0
    last = len(knots) - 1
    k = next((k for k in range(1, last) if abs(knots[k] - start) >= NEAR), last)
    to = knots[k] - start
    if abs(to) < NEAR:
        way = Way(heading, v0=v)
        way.straight(start, heading, unit(heading), 0.0, n)
        return way if v == 0 and can_be_driven(way, n) else None
    way = Way(cmath.phase(to), v0=v)
    at, turn = start, wrapped(cmath.phase(to) - heading)
    if v > 0 and stop_first:
        braking = v**2 / (2 * n.a_max)
        way.straight(at, heading, unit(heading), braking, n)
        way.smooth = False
        at = at + braking * unit(heading)
        to = knots[k] - at
        if abs(to) < _OPEN:  # it looks for a knot that it has come to rest on
            raise RoundingDecidesError
        turn = wrapped(cmath.phase(to) - heading)
        way.spin(at, heading, turn)
        heading = wrapped(heading + turn)
    elif v > 0 and abs(turn) > GENTLE:
        return None
    elif v == 0 or abs(turn) <= NEAR:
        if abs(turn) > NEAR:
            way.spin(at, heading, turn)
        heading = way.first_heading
    else:
        arm = min(0.3, 0.4 * abs(to))
        to = to - arm * unit(heading)
        turn = wrapped(cmath.phase(to) - heading)
        fastest = min(n.v_max, arm * corner_rate(turn, n))
        if fastest < v or v < SLOW * n.v_max:
            return None
        at = way.corner(at, heading, unit(heading), arm, turn, to / abs(to), fastest)
        to = to / abs(to) * (abs(to) - arm)
        heading = wrapped(heading + turn)
    return way if follow(way, knots, k, at, to, heading, kind, n) and can_be_driven(way, n) else None


def follow(way: Way, knots: list[complex], k: int, at: complex, to: complex, heading: float, kind: str,
           n: Numbers) -> bool:  # fmt: skip
    """Lay the way on from `at` to knot k and all others, as far as it is generated; return whether that is possible."""
    last, first, roundings = len(knots) - 1, True, 2 if kind == "transition" else 1
    before = abs(to)
    towards = to / before if before >= NEAR else unit(heading)
    while True:
        here = knots[k]
        following = next((j for j in range(k + 1, last + 1) if abs(knots[j] - here) >= NEAR), None)
        if following is None:
            way.straight(at, heading, towards, before, n)
            way.pieces[-1].knot = last
            return True
        after = abs(knots[following] - here)
        leaving = (knots[following] - here) / after
        turn = cmath.phase(leaving * towards.conjugate())
        arm = speed = 0.0
        if kind != "holonomic" and abs(turn) > NEAR and roundings > 0:
            roundings -= 1
            early = first and kind == "transition"
            arm, speed = rounded(before, after, turn, way.v0 if first else 0.0, early, n)
            if not arm and (first or abs(turn) > GENTLE):
                return False
        elif kind != "holonomic" and NEAR < abs(turn) <= GENTLE:
            arm = min(0.3, 0.4 * min(before, after))
            speed = min(n.v_max, arm * corner_rate(turn, n))
            if speed < 0.2 * n.v_max:
                arm = 0.0
        way.straight(at, heading, towards, before - arm, n)
        at = here
        if arm:
            at = way.corner(here - arm * towards, heading, towards, arm, turn, leaving, speed)
        way.pieces[-1].knot = k
        if not arm and abs(turn) > NEAR:
            if kind != "holonomic":
                estimate(way, knots[k:], heading)
                return True
            way.spin(here, heading, turn)
        first = False
        heading, towards, before, k = wrapped(heading + turn), leaving, after - arm, following


def estimate(way: Way, knots: list[complex], heading: float) -> None:
    """Note length and turning of what is not generated."""
    for one, other in pairwise(knots):
        if abs(other - one) >= NEAR:
            way.rest_length += abs(other - one)
            way.rest_turn += abs(wrapped(cmath.phase(other - one) - heading))
            heading = cmath.phase(other - one)


def speeds(way: Way, n: Numbers) -> list[float]:
    """Return the greatest speeds at the start of each piece and at the end, if the way may begin as fast as it likes.

    Energies (v^2 / 2) are compared: on a straight they change by no more than acceleration times way.
    """
    caps = [piece.cap for piece in way.pieces]
    energies = [min(pair) ** 2 / 2 for pair in zip([caps[0], *caps], [*caps, 0.0], strict=True)]
    for i in range(len(caps) - 1, -1, -1):
        gain = n.a_max * way.pieces[i].length if way.pieces[i].kind == "straight" else 0.0
        energies[i] = min(energies[i], energies[i + 1] + gain)
    return [math.sqrt(2 * energy) for energy in energies]


def can_be_driven(way: Way, n: Numbers) -> bool:
    """Return whether the speed at its start can be slowed down as the way demands."""
    return way.v0 <= speeds(way, n)[0] + 1e-9


def profiles(way: Way, n: Numbers) -> list[Profile]:
    """Return how each piece is driven."""
    v = speeds(way, n)
    v[0], found = way.v0, []
    for i, piece in enumerate(way.pieces):
        if piece.kind == "spin":
            v[i + 1] = 0.0
            found.append(Profile.over(piece.length, 0.0, 0.0, n.w_max, n.alpha_max))
            continue
        gain = 2 * n.a_max * piece.length if piece.kind == "straight" else 0.0
        v[i + 1] = min(v[i + 1], math.sqrt(v[i] ** 2 + gain))
        cap = piece.cap if piece.kind == "straight" else v[i]
        found.append(Profile.over(piece.length, v[i], v[i + 1], cap, n.a_max))
    return found


def plan(knots: list[complex], start: complex, heading: float, speed: float, kind: str, n: Numbers) -> Way:
    """Return the way that is driven: the kind asked for, else with stops at knots, else with a stop at once.

    One that stands at its goal, or is too near to stop, brakes and stays. Raises UndecidedError.
    """
    otherwise = "holonomic" if kind == "holonomic" else "hybrid"
    tries = [(kind, False), ("holonomic", False), (otherwise, True), ("holonomic", True)]
    for attempt, (tried, stop_first) in enumerate(tries):
        way = lay(knots, start, heading, speed, tried, stop_first, n)
        if way is not None:
            if kind == "transition" and attempt == 1:
                way.smooth = False
            return way
    way = Way(heading, v0=speed)
    way.straight(start, heading, unit(heading), speed**2 / (2 * n.a_max), n)
    way.pieces[0].knot = len(knots) - 1
    return way

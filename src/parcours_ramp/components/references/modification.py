"""Path Modification once more, with the random numbers that it draws: they follow from seed and case."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from parcours.streams import starts, uniforms
from parcours.suite import Case
from parcours_ramp.components.references.numbers import Numbers, unit

_PURPOSE = 2  # Of its stream
_TRIES = 64
_LONGEST = 5  # Knots from which on nothing is inserted; a child of a crossover has one more, and its goal
_CLEARANCE = 0.275  # That an escape keeps from where the obstacle is [m], beside the robot's radius

Message = Mapping[str, Any]
Knots = list[complex]


class Modification:
    """Answers modification requests, one after the other.

    Args:
        case: of whose seed and number the random numbers are.
        numbers: those that differ from `Numbers`, by name.
    """

    def __init__(self, case: Case, numbers: Mapping[str, object] | None = None) -> None:
        self._numbers, self._drawn = Numbers.of(numbers), 0
        self._stream = starts(case.seed, np.array([case.number]), _PURPOSE)

    def __call__(self, request: Message) -> Message:
        """Return the answer to a ModificationRequest of the model."""
        first, second = (
            [complex(one["x"], one["y"]) for one in request[name]["points"]] for name in ("first", "second")
        )
        paths = self._modified(request, first, second)
        points = ([{"x": z.real, "y": z.imag} for z in path] for path in paths)
        return {"cycle": request["cycle"], "serial": request["serial"], "paths": [{"points": one} for one in points]}

    def _uniform(self) -> float:
        self._drawn += 1
        return float(uniforms(self._stream, self._drawn - 1, 1)[0, 0])

    def _between(self, low: float, high: float) -> float:
        return low + (high - low) * self._uniform()

    def _one_of(self, choices: Sequence[int]) -> int:
        return choices[min(int(self._uniform() * len(choices)), len(choices) - 1)]

    def _modified(self, request: Message, first: Knots, second: Knots) -> list[Knots]:
        operator, inner = request["operator"], range(1, len(first) - 1)
        if operator == "insert":
            if len(first) >= _LONGEST:
                return []
            new = self._far_from(first)
            place = self._one_of(range(1, len(first)))
            return [[*first[:place], new, *first[place:]]]
        if operator == "swap":
            if len(inner) < 2:
                return []
            one = self._one_of(inner)
            other = self._one_of([k for k in inner if k != one])
            return [_with(_with(first, one, first[other]), other, first[one])]
        if operator == "crossover":
            cut, other = self._one_of(range(len(first) - 1)), self._one_of(range(len(second) - 1))
            return [_child(first[: cut + 1], second[other + 1 :]), _child(second[: other + 1], first[cut + 1 :])]
        if operator == "move":
            new = self._escape(first[0], request["direction"], request["distance"])
            return [_with(first, 1, new) if inner else [first[0], new, first[1]]]
        if not inner:
            return []
        k = self._one_of(inner)
        if operator == "delete":
            return [first[:k] + first[k + 1 :]]
        return [_with(first, k, self._far_from(first[:k] + first[k + 1 :]))]

    def _far_from(self, knots: Knots) -> complex:
        """Return a point of the arena far from all knots, or the last one tried."""
        n = self._numbers
        for _ in range(_TRIES):
            point = complex(self._between(0.0, n.arena), self._between(0.0, n.arena))
            if all(abs(point - knot) >= n.operator_distance for knot in knots):
                break
        return point

    def _escape(self, start: complex, direction: float, distance: float) -> complex:
        """Return where to go from the start of a path, beside the obstacle in that direction, within the arena.

        The way lies between the point at 45 degrees on the ring around the obstacle, on a side drawn, and right across.
        """
        side = self._one_of((1, -1))
        ring = _CLEARANCE + self._numbers.robot_radius
        if distance < ring:
            turn, share = self._between(math.pi / 2, math.pi), 0.5
        else:
            beside = distance - ring * unit(-side * math.pi / 4)
            turn, share = self._between(min(abs(cmath.phase(beside)), math.pi / 2), math.pi / 2), 1.0
        to = start + share * self._between(0.8, 1.6) * unit(direction + side * turn)
        return complex(*(min(max(one, 0.0), self._numbers.arena) for one in (to.real, to.imag)))


def _with(knots: Knots, k: int, point: complex) -> Knots:
    return [*knots[:k], point, *knots[k + 1 :]]


def _child(head: Knots, tail: Knots) -> Knots:
    """Return a path of the head and the tail, without the last knots before the goal if it is too long."""
    return head + tail[: max(_LONGEST + 1 - len(head), 0)][: len(tail) - 1] + tail[-1:]

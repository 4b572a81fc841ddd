"""Path Modification: one or two paths and an operator -> modified paths (component 5)."""

from __future__ import annotations

import numpy as np

from parcours.elementary import PI, atan2, sin_cos
from parcours.kernels import Record, kernel
from parcours.streams import Stream, below, between, start
from parcours_ramp.planner.messages import PATH, ModificationRequest, ModificationResponse, copy_path, many
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.service import Service

INSERT, DELETE, CHANGE, SWAP, CROSSOVER, MOVE = range(6)  # The operators

OPERATORS = ("insert", "delete", "change", "swap", "crossover", "move")

LONGEST_FOR_INSERT = 5  # A path of this many knots is not lengthened
MODIFIER_STREAM = np.uint64(2)  # Purpose of the random stream of this component

_ESCAPE_CLEARANCE = 0.275
_TRIES = 64


@kernel
def applies(operator: int, n: int) -> bool:
    """Return whether the operator changes a path of n knots (crossover: two paths of any length)."""
    if operator == INSERT:
        return n < LONGEST_FOR_INSERT
    if operator == SWAP:
        return n > 3
    if operator in (DELETE, CHANGE):
        return n > 2
    return n >= 2


@kernel
def far_point(path: Record, skip: int, distance: float, arena: float, stream: Stream) -> tuple[float, float]:
    """Return a random point of the arena [m] `distance` away from all knots but `skip` (the last try if none is)."""
    x = y = 0.0
    for _ in range(_TRIES):
        x, y = between(stream, 0.0, arena), between(stream, 0.0, arena)
        near = False
        for i in range(path.n):
            if i != skip and (path.x[i] - x) ** 2 + (path.y[i] - y) ** 2 < distance * distance:
                near = True
        if not near:
            break
    return x, y


@kernel
def insert_knot(path: Record, place: int, x: float, y: float) -> None:
    """Put the point (x, y) before the path's knot `place`."""
    for i in range(path.n, place, -1):
        path.x[i], path.y[i] = path.x[i - 1], path.y[i - 1]
    path.x[place], path.y[place] = x, y
    path.n += 1


@kernel
def remove_knot(path: Record, place: int) -> None:
    """Take the knot `place` out of the path."""
    for i in range(place, path.n - 1):
        path.x[i], path.y[i] = path.x[i + 1], path.y[i + 1]
    path.n -= 1


@kernel
def _escape(request: Record, parameters: Record, stream: Stream) -> tuple[float, float]:
    """Return a point beside the nearest obstacle, from the start of the path, sideways and never behind it [m]."""
    side = 1.0 if below(stream, 2) == 0 else -1.0
    direction, distance = request.direction, request.distance
    ring = _ESCAPE_CLEARANCE + parameters.robot_radius
    if distance < ring:
        heading = direction + side * between(stream, 0.5 * PI, PI)
        length = between(stream, 0.8, 1.6) * 0.5
    else:
        facing_s, facing_c = sin_cos(direction + PI - side * 0.25 * PI)
        to_s, to_c = sin_cos(direction)
        ring_x = distance * to_c + ring * facing_c
        ring_y = distance * to_s + ring * facing_s
        least = abs(atan2(ring_y * to_c - ring_x * to_s, ring_x * to_c + ring_y * to_s))
        heading = direction + side * between(stream, min(least, 0.5 * PI), 0.5 * PI)
        length = between(stream, 0.8, 1.6)
    s, c = sin_cos(heading)
    x = min(max(request.first.x[0] + length * c, 0.0), parameters.arena)
    y = min(max(request.first.y[0] + length * s, 0.0), parameters.arena)
    return x, y


@kernel
def _cross(head: Record, tail: Record, cut: int, from_: int, child: Record) -> None:
    """Make the child of the head's knots up to `cut` and the tail's knots after `from_`."""
    copy_path(child, head)
    child.n = cut + 1
    for i in range(from_ + 1, tail.n):
        if child.n < LONGEST_FOR_INSERT + 1 or i == tail.n - 1:
            child.x[child.n], child.y[child.n] = tail.x[i], tail.y[i]
            child.n += 1


@kernel
def modify(request: Record, parameters: Record, stream: Stream, one: Record, two: Record) -> int:
    """Apply the operator of a MODIFICATION; return how many of the PATHs it made (0: not applicable)."""
    operator, n = request.operator, request.first.n
    if not applies(operator, n):
        return 0
    copy_path(one, request.first)
    if operator == INSERT:
        x, y = far_point(one, -1, parameters.operator_distance, parameters.arena, stream)
        insert_knot(one, 1 + below(stream, n - 1), x, y)
    elif operator == DELETE:
        remove_knot(one, 1 + below(stream, n - 2))
    elif operator == CHANGE:
        k = 1 + below(stream, n - 2)
        one.x[k], one.y[k] = far_point(one, k, parameters.operator_distance, parameters.arena, stream)
    elif operator == SWAP:
        i = 1 + below(stream, n - 2)
        j = 1 + below(stream, n - 3)
        if j >= i:
            j += 1
        x, y = one.x[i], one.y[i]
        one.x[i], one.y[i] = one.x[j], one.y[j]
        one.x[j], one.y[j] = x, y
    elif operator == CROSSOVER:
        cut_one, cut_two = below(stream, n - 1), below(stream, request.second.n - 1)
        _cross(request.first, request.second, cut_one, cut_two, one)
        _cross(request.second, request.first, cut_two, cut_one, two)
        return 2
    else:
        x, y = _escape(request, parameters, stream)
        if n > 2:
            one.x[1], one.y[1] = x, y
        else:
            insert_knot(one, 1, x, y)
    return 1


class PathModification(Service):
    """The component: answers modification requests from a random stream of its own."""

    name = "PathModification"
    machine, takes, gives = 5, ModificationRequest, "modification_response"

    def __init__(self, parameters: Parameters, seed: int, case: int) -> None:
        self._parameters = parameters.record()
        self._origin = (np.uint64(seed), np.uint64(case), MODIFIER_STREAM)
        self._stream = np.zeros(1, np.uint64)
        self.reset()

    def reset(self) -> None:
        """Begin the random stream again."""
        start(self._stream, *self._origin)

    def answer(self, request: ModificationRequest) -> ModificationResponse:
        """Return the modified paths."""
        made = many(PATH, 2)
        n = modify(request.modification, self._parameters, self._stream, made[0], made[1])
        return ModificationResponse(request.tag, made[:n])

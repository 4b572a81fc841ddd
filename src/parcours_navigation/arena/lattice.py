"""A lattice over the world, and sets of its points as bits: grow them by a step in time, take discs out.

A set is an array of 64-bit words, one bit a point: shape (WORDS + 2, ROWS + 2 * EDGE), point (column, row) being bit
column % 64 of word [1 + column // 64, EDGE + row]. The frame of zeros round it lets a step look at all neighbours
without asking where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel

Bits = NDArray[np.uint64]

WORDS, ROWS, EDGE = 4, 256, 5
"""Words a row, rows, and rows of zeros before and after them."""

Box = tuple[int, int, int, int]
"""Words and rows of a set, as its indices: the first word, one after the last, the first row, one after the last."""

EVERYWHERE: Box = (1, WORDS + 1, EDGE, EDGE + ROWS)
"""The frame left out."""

REACH = 4.242640687119285
"""How many spacings a robot at top speed covers in one step: sqrt(18), so that it reaches (3, 3) exactly."""

SHADOW = 0.78
"""A point within SHADOW spacings of a lattice point is, after one step at any speed up to v_max, within SHADOW
spacings of one of those that `grow_outer` adds: each point within REACH + SHADOW of the origin is within SHADOW of a
lattice point (i, j) with i*i + j*j <= 26. (A test checks this.)"""

LATTICE = np.dtype(
    [
        ("spacing", "f8"),  # between neighbouring points [m]
        ("step", "f8"),  # [s]: v_max * step = REACH * spacing
        ("n_steps", "i8"),  # steps that fit into the time limit
        ("limit", "f8"),  # [s]
        ("x0", "f8"),  # where point (0, 0) lies [m]
        ("y0", "f8"),
        ("column", "i8"),  # of the start, which is a point
        ("row", "i8"),
        ("start_x", "f8"),  # [m]
        ("start_y", "f8"),
        ("goal_x", "f8"),
        ("goal_y", "f8"),
        ("tolerance", "f8"),  # [m]
        ("v_max", "f8"),  # [m/s]
        ("robot_radius", "f8"),  # [m]
    ]
)
"""The task and the lattice laid over it."""


@dataclass(frozen=True, slots=True)
class Lattice:
    """A lattice, and what follows from the task alone, shared by all cases of it."""

    record: Record  # of dtype LATTICE
    near: Bits  # points from which the goal may be entered within one step
    edge: Bits  # points at which a robot that left the lattice's square may come back
    # for each step the points that could lie on a way to the goal were there no obstacles, shape (n_steps + 1, ...)
    caps: Bits


def lay_points(
    start: tuple[float, float],
    goal: tuple[float, float],
    tolerance: float,
    limit: float,
    v_max: float,
    robot_radius: float,
    margin: float = 0.5,
) -> Record:
    """Return the LATTICE over the square around start and goal [m]; the start becomes a lattice point.

    The square reaches beyond both by `margin` [m]; the other arguments are those of `solvability.solve`.

    >>> lattice = lay_points((0.0, 0.0), (2.0, 2.0), 0.2, 21.0, 0.25, 0.125)
    >>> round(float(lattice.spacing), 4), round(float(lattice.step), 3), int(lattice.n_steps)
    (0.0118, 0.2, 105)
    """
    side = max(abs(goal[0] - start[0]), abs(goal[1] - start[1])) + 2.0 * margin
    record = np.zeros(1, LATTICE).view(np.recarray)[0]
    record.spacing = spacing = side / (ROWS - 1)
    record.step = step = REACH * spacing / v_max
    record.limit, record.n_steps = limit, int(limit / step)
    record.start_x, record.start_y = start
    record.goal_x, record.goal_y = goal
    record.column = round((start[0] - 0.5 * (start[0] + goal[0] - side)) / spacing)
    record.row = round((start[1] - 0.5 * (start[1] + goal[1] - side)) / spacing)
    record.x0, record.y0 = start[0] - record.column * spacing, start[1] - record.row * spacing
    record.tolerance, record.v_max, record.robot_radius = tolerance, v_max, robot_radius
    return record


def _distances(lattice: Record, x: float, y: float) -> NDArray[np.float64]:
    """Return how far each point [row, column] is from (x, y) [m]."""
    axis = np.arange(ROWS) * lattice.spacing
    far: NDArray[np.float64] = np.hypot(lattice.x0 + axis[None, :] - x, lattice.y0 + axis[:, None] - y)
    return far


def near_goal(lattice: Record) -> Bits:
    """Return the points from which, or from whose neighbourhood, the goal may be entered within one step."""
    reach = lattice.tolerance + lattice.v_max * lattice.step + SHADOW * lattice.spacing + 1e-9
    return as_bits(_distances(lattice, lattice.goal_x, lattice.goal_y) <= reach)


def lay_lattice(record: Record) -> Lattice:
    """Return a LATTICE with the sets that follow from the task alone."""
    from_start = _distances(record, record.start_x, record.start_y)
    to_goal = _distances(record, record.goal_x, record.goal_y)
    slack = SHADOW * record.spacing + 1e-9
    inside = np.zeros((ROWS, ROWS), bool)
    inside[6:-6, 6:-6] = True
    caps = np.zeros((record.n_steps + 1, WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    for k in range(record.n_steps + 1):
        gone, left = record.v_max * record.step * k, record.v_max * (record.limit - record.step * k)
        caps[k] = as_bits((from_start <= gone + slack) & (to_goal <= left + record.tolerance + slack))
    return Lattice(record, near_goal(record), as_bits(~inside), caps)


def as_bits(points: NDArray[np.bool_]) -> Bits:
    """Return a set given as truth values [row, column], shape (ROWS, ROWS), as bits."""
    packed = np.packbits(points, axis=1, bitorder="little").view("<u8")
    bits = np.zeros((WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    bits[1:-1, EDGE:-EDGE] = packed.T
    return bits


def as_points(bits: Bits) -> NDArray[np.bool_]:
    """Return a set as truth values [row, column], the inverse of `as_bits`."""
    packed = np.ascontiguousarray(bits[1:-1, EDGE:-EDGE].T).astype("<u8").view(np.uint8)
    return np.unpackbits(packed, axis=1, bitorder="little").astype(bool)


@kernel
def has(bits: Record, column: int, row: int) -> bool:
    """Return whether the point is in the set."""
    word = bits[1 + (column >> 6), EDGE + row]
    return bool((word >> np.uint64(column & 63)) & np.uint64(1))


@kernel
def put(bits: Record, column: int, row: int) -> None:
    """Add the point to the set."""
    bits[1 + (column >> 6), EDGE + row] |= np.uint64(1) << np.uint64(column & 63)


@kernel
def reached_box(lattice: Record, k: int) -> Box:
    """Return what holds all points within EDGE * k columns and rows of the start: in k steps no set grows out of it."""
    reach, most = EDGE * k, 64 * WORDS - 1
    first, last = max(lattice.column - reach, 0) >> 6, min(lattice.column + reach, most) >> 6
    return 1 + first, 2 + last, EDGE + max(lattice.row - reach, 0), EDGE + min(lattice.row + reach + 1, ROWS)


@kernel
def _widen(bits: Record, h1: Record, h3: Record, h4: Record, h5: Record, box: Box) -> None:
    """Write each row of the set widened by 1, 3, 4 and 5 columns either way: all that rows of the box ask for."""
    u = np.uint64
    y = max(box[2] - EDGE, EDGE)
    for w in range(box[0], box[1]):
        before, here, after = bits[w - 1, y:], bits[w, y:], bits[w + 1, y:]
        o1, o3, o4, o5 = h1[w, y:], h3[w, y:], h4[w, y:], h5[w, y:]
        for j in range(min(box[3] + EDGE, EDGE + ROWS) - y):
            b, a, c = before[j], here[j], after[j]
            s = a | (a << u(1)) | (b >> u(63)) | (a >> u(1)) | (c << u(63))
            o1[j] = s
            s |= (a << u(2)) | (b >> u(62)) | (a >> u(2)) | (c << u(62))
            s |= (a << u(3)) | (b >> u(61)) | (a >> u(3)) | (c << u(61))
            o3[j] = s
            s |= (a << u(4)) | (b >> u(60)) | (a >> u(4)) | (c << u(60))
            o4[j] = s
            o5[j] = s | (a << u(5)) | (b >> u(59)) | (a >> u(5)) | (c << u(59))


@kernel
def grow_inner(bits: Record, wide: Record, box: Box) -> None:
    """Replace the set by all points within REACH spacings of it: each was reached at v_max or less.

    `wide` is working memory: four sets with empty frames, shape (4, WORDS + 2, ROWS + 2 * EDGE). Outside the box the
    set is empty, and stays so.
    """
    _widen(bits, wide[0], wide[1], wide[2], wide[3], box)
    y = box[2] - EDGE
    for w in range(box[0], box[1]):
        out, h1, h3, h4 = bits[w, box[2] :], wide[0, w, y:], wide[1, w, y:], wide[2, w, y:]
        for j in range(box[3] - box[2]):  # the row of the same place is j + EDGE in h1 to h4
            out[j] = (
                (h4[j + 5] | h4[j + 4] | h4[j + 6])
                | (h3[j + 3] | h3[j + 7] | h3[j + 2] | h3[j + 8])
                | (h1[j + 1] | h1[j + 9])
            )


@kernel
def grow_outer(bits: Record, wide: Record, box: Box) -> None:
    """Replace the set by all points within sqrt(26) spacings of it: no robot's shadow is lost (see SHADOW).

    The other arguments are those of `grow_inner`.
    """
    _widen(bits, wide[0], wide[1], wide[2], wide[3], box)
    y = box[2] - EDGE
    for w in range(box[0], box[1]):
        out = bits[w, box[2] :]
        h1, h3, h4, h5 = wide[0, w, y:], wide[1, w, y:], wide[2, w, y:], wide[3, w, y:]
        for j in range(box[3] - box[2]):
            out[j] = (
                (h5[j + 5] | h5[j + 4] | h5[j + 6])
                | (h4[j + 3] | h4[j + 7] | h4[j + 2] | h4[j + 8])
                | (h3[j + 1] | h3[j + 9])
                | (h1[j] | h1[j + 10])
            )


@kernel
def take_disc(bits: Record, lattice: Record, x: float, y: float, radius: float) -> None:
    """Take the points within `radius` [m] of (x, y) [m] out of the set."""
    u = np.uint64
    h = lattice.spacing
    x, y, radius = (x - lattice.x0) / h, (y - lattice.y0) / h, radius / h
    for row in range(max(int(np.ceil(y - radius)), 0), min(int(np.floor(y + radius)), ROWS - 1) + 1):
        half = np.sqrt(max(radius * radius - (row - y) * (row - y), 0.0))
        first = max(int(np.ceil(x - half)), 0)
        last = min(int(np.floor(x + half)), 64 * WORDS - 1)
        for w in range(first >> 6, (last >> 6) + 1):
            mask = ~u(0)
            if w == first >> 6:
                mask &= ~u(0) << u(first & 63)
            if w == last >> 6:
                mask &= ~u(0) >> u(63 - (last & 63))
            bits[1 + w, EDGE + row] &= ~mask

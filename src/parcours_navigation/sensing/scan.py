"""A planar laser scan: how far each beam goes until it meets the ground or a disc.

beams  0 1 2 3 4 5 6 7        A shape is seen under an angle: only the beams in between can meet it, and where each
        ╲ ╲ ╲│╱ ╱ ╱           does is one division. Shapes are taken in rings of buckets round the sensor, so walls
      ━━━━╲━╲│╱━━━            behind walls are not even looked at: once the next ring is farther away than the end
           ╲ ● sensor         of the longest beam, all is seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from parcours.elementary import TAU, atan2, sin_cos
from parcours.kernels import Record, heap_kernel, kernel
from parcours_navigation.ground.clearance import at_least, first_ring, last_ring, ring_columns, ring_gap, ring_rows
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.ground.packing import (
    BOTTOM,
    CELL,
    COLUMNS,
    HEAD,
    LEFT,
    ROWS,
    SEGMENTS,
    SHAPES,
    STRIDE,
    bucket,
    column_of,
    row_of,
)
from parcours_navigation.ground.shapes import point_to_segment

MOST_BEAMS = 4096
"""Beams of one scan at most."""

_BEAM_ERROR = 1e-9
"""Rounding of an angle, in beams: a beam that passes an end of a wall by no more still meets it."""


@dataclass(frozen=True, slots=True)
class Beams:
    """The beams of a planar laser: beam k points to heading + first + k * step.

    Raises:
        BadGround: there are too few or too many, they overlap, or the reach is not above 0.

    >>> Beams(360).step == TAU / 360
    True
    """

    n: int
    first: float = -0.5 * TAU  # [rad]
    step: float = 0.0  # [rad]; 0: evenly all round
    reach: float = 10.0  # [m]

    def __post_init__(self) -> None:
        if not 1 <= self.n <= MOST_BEAMS:
            rule = f"a scan has from 1 to {MOST_BEAMS} beams, but {self.n} were asked for"
            raise BadGround("scan", rule, "take fewer", slug="scan-beams")
        if self.step == 0.0:
            object.__setattr__(self, "step", TAU / self.n)
        if not (self.step > 0.0 and (self.n - 1) * self.step <= TAU * (1.0 + 1e-9) and abs(self.first) <= TAU):
            rule = "steps must be above 0 and the beams at most one turn, from an angle within one turn, but they are "
            raise BadGround(
                "scan", f"{rule}{self.n} beams from {self.first:g} by {self.step:g} rad", slug="scan-angles"
            )
        if not 0.0 < self.reach < np.inf:
            rule = f"the reach must be above 0 m and finite, but is {self.reach} m"
            raise BadGround("scan", rule, slug="scan-reach")


@kernel
def _between(low: float, high: float, turn: float, n: int) -> tuple[int, int]:
    """Return the beams from `low` to `high`, counted in beams and shifted by `turn`, as (begin, end)."""
    low, high = low + turn - _BEAM_ERROR, high + turn + _BEAM_ERROR
    if high < 0.0 or low > n - 1.0:
        return 0, 0
    return int(np.ceil(max(low, 0.0))), int(np.floor(min(high, n - 1.0))) + 1


@kernel
def _meet_wall(ax: float, ay: float, bx: float, by: float, cosines: Record, sines: Record, ranges: Record) -> None:
    """Shorten beams to where they meet the segment ab, seen from the sensor [m]."""
    ex, ey = bx - ax, by - ay
    far = ax * ey - ay * ex
    # By rounding, a beam may pass an end of the wall, and meet its line far off.
    least = np.sqrt(point_to_segment(0.0, 0.0, ax, ay, bx, by))
    most = np.sqrt(max(ax * ax + ay * ay, bx * bx + by * by))
    for k in range(len(ranges)):
        distance = min(max(far / (cosines[k] * ey - sines[k] * ex), least), most)
        ranges[k] = distance if distance < ranges[k] else ranges[k]


@kernel
def _see_wall(ax: float, ay: float, bx: float, by: float, base: float, per: float, rays: Record) -> None:
    """Shorten the beams that meet the segment ab, seen from the sensor [m].

    The rows of `rays` are the beams' cosines, sines and ranges; beam 0 points to `base` [rad], `per` beams to a radian.
    """
    turned, ahead = ax * by - ay * bx, ax * bx + ay * by
    if turned == 0.0 and ahead <= 0.0:  # the sensor is on the wall
        rays[2] = 0.0
        return
    if turned < 0.0:  # a is to be on the right
        ax, ay, bx, by, turned = bx, by, ax, ay, -turned
    low = (atan2(ay, ax) - base) * per
    high = low + atan2(turned, ahead) * per
    nearer = np.sqrt(min(ax * ax + ay * ay, bx * bx + by * by))
    for turn in range(-1, 2):
        begin, end = _between(low, high, turn * TAU * per, rays.shape[1])
        if turned == 0.0:  # seen end on: its nearer end is what a beam meets
            for k in range(begin, end):
                rays[2, k] = min(rays[2, k], nearer)
        elif begin < end:
            _meet_wall(ax, ay, bx, by, rays[0, begin:end], rays[1, begin:end], rays[2, begin:end])


@kernel
def _see_disc(x: float, y: float, radius: float, base: float, per: float, rays: Record) -> None:
    """Shorten the beams that meet a disc, seen from the sensor [m]; all to 0 if the sensor is in it.

    Other arguments as of `_see_wall`.
    """
    free = x * x + y * y - radius * radius
    if free <= 0.0:
        rays[2] = 0.0
        return
    middle = (atan2(y, x) - base) * per
    half = atan2(radius, np.sqrt(free)) * per
    for turn in range(-1, 2):
        begin, end = _between(middle - half, middle + half, turn * TAU * per, rays.shape[1])
        for k in range(begin, end):
            c, s = rays[0, k], rays[1, k]
            along, across = c * x + s * y, c * y - s * x
            distance = along - np.sqrt(max(radius * radius - across * across, 0.0))
            rays[2, k] = min(rays[2, k], distance)


@heap_kernel
def _directions(angle: float, step: float, cosines: Record, sines: Record) -> None:
    """Write the directions of the beams: each is the sum of two angles out of two short tables."""
    n = len(cosines)
    fine = np.empty((16, 2))
    for j in range(16):
        fine[j, 0], fine[j, 1] = sin_cos(j * step)
    for i in range(0, n, 16):
        s, c = sin_cos(angle + i * step)
        for j in range(min(16, n - i)):
            cosines[i + j] = c * fine[j, 1] - s * fine[j, 0]
            sines[i + j] = s * fine[j, 1] + c * fine[j, 0]


@heap_kernel
def scan(
    packed: Record, discs: Record, x: float, y: float, heading: float, first: float, step: float, reach: float,
    ranges: Record,
) -> None:  # fmt: skip
    """Fill the ranges of a laser scan [m]; inf where nothing is in reach, 0 where the sensor is in a disc or on a wall.

    Args:
        packed: what `Ground.pack` returns.
        discs: bodies that move, x, y, radius [m], shape (m, 3).
        x: where the sensor is [m].
        y: [m].
        heading: [rad].
        first: beam 0 points to heading + first [rad].
        step: angle from beam to beam, above 0; all of them within one turn [rad].
        reach: [m].
        ranges: filled, shape (n_beams,), 1 to MOST_BEAMS.
    """
    per = 1.0 / step
    angle = heading + first
    base = angle - TAU * np.floor(angle / TAU + 0.5)  # in [-pi, pi), where bearings are
    rays = np.empty((3, len(ranges)))
    _directions(base, step, rays[0], rays[1])
    rays[2] = reach
    for i in range(len(discs)):
        dx, dy, radius = discs[i, 0] - x, discs[i, 1] - y, discs[i, 2]
        if dx * dx + dy * dy < (reach + radius) * (reach + radius):
            _see_disc(dx, dy, radius, base, per, rays)
    if len(packed) > 0:
        _see_ground(packed, x, y, base, per, rays)
    for k in range(len(ranges)):
        ranges[k] = rays[2, k] if rays[2, k] < reach else np.inf


@heap_kernel
def _see_ground(packed: Record, x: float, y: float, base: float, per: float, rays: Record) -> None:
    """Shorten the beams that meet the ground, ring by ring; arguments as of `_see_wall`."""
    right, top = packed[LEFT] + packed[COLUMNS] * packed[CELL], packed[BOTTOM] + packed[ROWS] * packed[CELL]
    qx, qy = min(max(x, packed[LEFT]), right), min(max(y, packed[BOTTOM]), top)
    away = np.sqrt((x - qx) * (x - qx) + (y - qy) * (y - qy))
    column, row = column_of(packed, qx), row_of(packed, qy)
    n_segments, columns, longest = int(packed[SEGMENTS]), int(packed[COLUMNS]), 0
    seen = np.zeros(int(packed[SHAPES]), np.uint8)
    for ring in range(first_ring(packed, at_least(packed, x, y) - away), last_ring(packed, column, row) + 1):
        gap = max(ring_gap(packed, qx, qy, column, row, ring), away)
        while longest < rays.shape[1] and rays[2, longest] <= gap:  # beams only get shorter: those before stay so
            longest += 1
        if longest == rays.shape[1]:
            break
        low, high = ring_rows(packed, row, ring)
        for r in range(low, high):
            c, final, between = ring_columns(packed, column, row, ring, r)
            while c <= final:
                begin, end = bucket(packed, r * columns + c)
                c += between
                for j in range(begin, end):
                    i = int(packed[j])
                    if seen[i]:
                        continue
                    seen[i] = 1
                    at = HEAD + STRIDE * i
                    ax, ay, bx, by = packed[at], packed[at + 1], packed[at + 2], packed[at + 3]
                    if i < n_segments:
                        _see_wall(ax - x, ay - y, bx - x, by - y, base, per, rays)
                    else:
                        _see_disc(ax - x, ay - y, bx, base, per, rays)

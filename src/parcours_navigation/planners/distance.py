"""An occupancy grid into signed distances to what is occupied, and lookups of them with their gradient.

Exact Euclidean distances from the centres of cells to the nearest occupied square, by the lower envelope of parabolas:
Felzenszwalb, Huttenlocher, Distance transforms of sampled functions (Theory of Computing 8, 2012), on parabolas that
stand on the edges of cells instead of their centres.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import heap_kernel, kernel
from parcours_navigation.protocol import Floats, Map

OCCUPIED, UNKNOWN = 65, 255
"""Cells from the first on, but for unknown ones, count as occupied: the threshold of ROS's map_server."""

FAR = 1e3
"""The distance where nothing is occupied, and the greatest one [m]."""

MOST_CELLS = 160_000
"""Grids of more cells are made coarser before they are searched."""

_SHARE = 0.7
"""Interpolated distances change by at most 1 / _SHARE for each metre."""

Cells = NDArray[np.uint8]


@kernel
def _envelope(heights: Floats, tops: NDArray[np.int64], starts: Floats) -> int:
    """Return how many parabolas make the lower envelope; parabola k stands at k - 1/2 on heights[k]."""
    n = 0
    for k in range(len(heights)):
        if heights[k] == np.inf:
            continue
        start = -np.inf
        while n > 0:
            j = tops[n - 1]
            start = 0.5 * ((heights[k] - heights[j]) / (k - j) + (k + j - 1.0))
            if start > starts[n - 1]:
                break
            n -= 1
        if n == 0:
            start = -np.inf
        tops[n], starts[n] = k, start
        n += 1
    return n


@heap_kernel
def _to_squares(cells: Cells, wanted: bool, out: Floats) -> None:
    """Fill in the distance [cells] from each centre to the nearest square that is occupied (or free, if not wanted)."""
    #    a square q    its two edges carry parabolas of one height g: outside of q one of them is the distance to q,
    #     \  ___  /    squared, inside both are above it, where it is g itself
    #      \|   |/
    n_rows, n_columns = cells.shape
    for j in range(n_columns):  # down and up each column: the squares of vertical distances
        last = -np.inf
        for i in range(n_rows):
            if (OCCUPIED <= cells[i, j] < UNKNOWN) == wanted:
                last = float(i)
            out[i, j] = i - last
        last = np.inf
        for i in range(n_rows - 1, -1, -1):
            if (OCCUPIED <= cells[i, j] < UNKNOWN) == wanted:
                last = float(i)
            steps = min(out[i, j], last - i)
            out[i, j] = 0.0 if steps == 0.0 else (steps - 0.5) * (steps - 0.5)
    heights, starts = np.empty(n_columns + 1), np.empty(n_columns + 1)
    tops = np.empty(n_columns + 1, np.int64)
    for i in range(n_rows):
        heights[0], heights[n_columns] = out[i, 0], out[i, n_columns - 1]
        for j in range(1, n_columns):
            heights[j] = min(out[i, j - 1], out[i, j])
        n = _envelope(heights, tops, starts)
        at = 0
        for j in range(n_columns):
            least = out[i, j]
            if n > 0:
                while at + 1 < n and starts[at + 1] <= j:
                    at += 1
                aside = j - (tops[at] - 0.5)
                least = min(least, aside * aside + heights[tops[at]])
            out[i, j] = np.sqrt(least)


@heap_kernel
def signed_distances(cells: Cells, resolution: float, out: Floats) -> None:
    """Fill in the distance [m] from the centre of each cell to what is occupied, negative inside; shape as `cells`.

    Distances are exact and at most FAR; where nothing is occupied all are FAR, where all is, -FAR.
    """
    inside = np.empty(cells.shape)
    _to_squares(cells, True, out)
    _to_squares(cells, False, inside)
    for i in range(cells.shape[0]):
        for j in range(cells.shape[1]):
            if out[i, j] > 0.0:
                out[i, j] = min(out[i, j] * resolution, FAR)
            else:
                out[i, j] = -min(inside[i, j] * resolution, FAR)


@kernel
def look(distances: Floats, frame: Floats, x: float, y: float) -> tuple[float, float, float]:
    """Return (d, gx, gy): the distance to walls at (x, y) [m], negative in them, and its gradient.

    Bilinear between the centres of cells; outside of the grid, as at the nearest place in it. `frame` is the place of
    the centre of cell [0, 0], x and y, and the side of a cell [m], shape (3,); without any cell it is FAR everywhere.

    >>> field, frame = np.array([[0.0, 1.0], [0.0, 1.0]]), np.array([0.0, 0.0, 1.0])
    >>> look(field, frame, 0.25, 0.5)
    (0.25, 1.0, 0.0)
    """
    n_rows, n_columns = distances.shape
    if n_rows == 0 or n_columns == 0:
        return FAR, 0.0, 0.0
    u = min(max((x - frame[0]) / frame[2], 0.0), n_columns - 1.0)
    v = min(max((y - frame[1]) / frame[2], 0.0), n_rows - 1.0)
    j, i = min(int(u), max(n_columns - 2, 0)), min(int(v), max(n_rows - 2, 0))
    right, up = min(j + 1, n_columns - 1), min(i + 1, n_rows - 1)
    a, b = u - j, v - i
    d00, d01, d10, d11 = distances[i, j], distances[i, right], distances[up, j], distances[up, right]
    low, high = d00 + a * (d01 - d00), d10 + a * (d11 - d10)
    gx = ((1.0 - b) * (d01 - d00) + b * (d11 - d10)) / frame[2]
    return low + b * (high - low), gx, (high - low) / frame[2]


@kernel
def is_clear(distances: Floats, frame: Floats, x0: float, y0: float, x1: float, y1: float, radius: float) -> bool:
    """Return whether a disc of that radius [m] touches no wall on the straight way from (x0, y0) to (x1, y1) [m].

    It moves on by a share of the room it has, at least by a quarter of a cell.
    """
    if distances.size == 0:
        return True
    length = np.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
    at = 0.0
    while at < length:
        share = at / length
        room = look(distances, frame, x0 + share * (x1 - x0), y0 + share * (y1 - y0))[0] - radius
        if room < 0.0:
            return False
        at += max(_SHARE * room, 0.25 * frame[2])
    return bool(look(distances, frame, x1, y1)[0] >= radius)


@dataclass(frozen=True, slots=True)
class Walls:
    """What a planner keeps of a map."""

    distances: Floats  # to what is occupied, from the centres of cells [m], shape (rows, columns)
    frame: Floats  # x, y of the centre of cell [0, 0] and the side of a cell [m], shape (3,)
    faces: Floats  # occupied squares with a free neighbour: x, y of the centre and half the side [m], shape (n, 3)
    of: Map = field(repr=False)  # the map itself, a copy


NO_WALLS = Walls(
    np.empty((0, 0)), np.array([0.0, 0.0, 1.0]), np.empty((0, 3)), Map(np.empty((0, 0), np.uint8), 1.0, (0.0, 0.0))
)
"""What is known where no map is given."""


def walls_of(ground: Map | None, before: Walls = NO_WALLS) -> Walls:
    """Return the walls of a map; those known before, if they are of the same one.

    A map of more than MOST_CELLS is made coarser: a cell is occupied if one of those it replaces is.

    >>> walls = walls_of(Map(np.array([[0, 0, 100]], np.uint8), 0.1, (0.0, 0.0)))
    >>> walls.distances.round(3).tolist(), walls.faces.round(3).tolist()
    ([[0.15, 0.05, -0.05]], [[0.25, 0.05, 0.05]])
    """
    if ground is None or ground.cells.size == 0:
        return NO_WALLS
    old = before.of
    is_placed = ground.resolution == old.resolution and tuple(ground.origin) == tuple(old.origin)
    if is_placed and ground.cells.shape == old.cells.shape and np.array_equal(ground.cells, old.cells):
        return before
    kept = Map(ground.cells.copy(), ground.resolution, (float(ground.origin[0]), float(ground.origin[1])))
    cells = (kept.cells >= OCCUPIED) & (kept.cells < UNKNOWN)
    times = max(int(np.ceil(np.sqrt(cells.size / MOST_CELLS))), 1)
    if times > 1:
        rows, columns = (-(-n // times) * times for n in cells.shape)
        padded = np.zeros((rows, columns), bool)
        padded[: cells.shape[0], : cells.shape[1]] = cells
        cells = np.asarray(padded.reshape(rows // times, times, columns // times, times).any(axis=(1, 3)), bool)
    side = kept.resolution * times
    frame = np.array([kept.origin[0] + 0.5 * side, kept.origin[1] + 0.5 * side, side])
    distances = np.empty(cells.shape)
    signed_distances(np.ascontiguousarray(cells * np.uint8(100)), side, distances)
    inner = np.pad(cells, 1, constant_values=False)
    inner = inner[:-2, 1:-1] & inner[2:, 1:-1] & inner[1:-1, :-2] & inner[1:-1, 2:]
    rows_of, columns_of = np.nonzero(cells & ~inner)
    half = np.full(len(rows_of), 0.5 * side)
    faces = np.column_stack([frame[0] + columns_of * side, frame[1] + rows_of * side, half])
    return Walls(distances, frame, faces, kept)

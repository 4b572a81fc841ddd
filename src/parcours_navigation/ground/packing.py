"""Packs walls, edges of solid bodies and discs into one array of numbers, with buckets and a coarse distance field.

┌────┬────┬────┬────┐   The grid covers everything and a rim of empty cells. A cell knows
│    │    │    │    │     - its bucket: the segments and discs that pass through it,
├────┼──━━┿━━━━┿━━  │     - its field: the clearance of its middle, from which that of any
│    │   ┃│▒▒▒▒│▒┃  │       other point differs by at most the distance between the two,
├────┼───╂┼────┼─╂──┤     - its depth: how many solid bodies cover it; UNEVEN where an
│    │   ┗┿━━━━┿━┛  │       edge passes through it.
├────┼────┼────┼────┤
│    │    │    │    │   ▒ solid lies to the left of an edge: outlines run counter-clockwise,
└────┴────┴────┴────┘     bounds clockwise, for what is outside of them is solid.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, heap_kernel, kernel

Floats = NDArray[np.float64]

SOLID, SEGMENTS, SHAPES, LEFT, BOTTOM, CELL, COLUMNS, ROWS, FIELD, DEPTH, STARTS, ITEMS, OUTSIDE, SLACK = range(14)
"""What the first numbers are: how many edges of solids, segments (these edges, then walls), and shapes (segments, then
discs); the grid's lower left corner and the side of a cell [m], its columns and rows; where field, depths, starts of
buckets and their items begin; the depth outside of the grid; how much rounding may cost [m]."""

HEAD = 16
"""Where the shapes begin, STRIDE numbers each: x0, y0, x1, y1 of a segment [m]; x, y, radius of a disc [m]."""

STRIDE = 4

UNEVEN = -1.0

LEAST_CELLS, MOST_CELLS = 256, 65536
"""Bounds on the number of cells, of which there are about eight for each shape."""

_RIM = 1.25
"""Cells between the shapes and the edge of the grid."""

_PADDING = 1e-6
"""A shape as near as this to a cell, in cells, lies in its bucket: rounding cannot lose it."""


@kernel
def column_of(packed: Record, x: float) -> int:
    """Return the column of the grid in which x [m] lies; the first or last for what is beside the grid."""
    return int(min(max(np.floor((x - packed[LEFT]) / packed[CELL]), 0.0), packed[COLUMNS] - 1.0))


@kernel
def row_of(packed: Record, y: float) -> int:
    """Return the row of the grid in which y [m] lies; the first or last for what is above or below."""
    return int(min(max(np.floor((y - packed[BOTTOM]) / packed[CELL]), 0.0), packed[ROWS] - 1.0))


@kernel
def bucket(packed: Record, cell: int) -> tuple[int, int]:
    """Return where the items of a cell's bucket begin and end in the array; an item is the number of a shape."""
    at, items = int(packed[STARTS]) + cell, int(packed[ITEMS])
    return items + int(packed[at]), items + int(packed[at + 1])


@kernel
def _spread(packed: Record, counts: Record, items: Record, write: bool) -> None:
    """Count the items of each cell, or write them where `counts` says."""
    columns, cell = int(packed[COLUMNS]), packed[CELL]
    padding = _PADDING * cell
    n_segments = int(packed[SEGMENTS])
    for i in range(int(packed[SHAPES])):
        at = HEAD + STRIDE * i
        x0, y0, x1, y1 = packed[at], packed[at + 1], packed[at + 2], packed[at + 3]
        if i >= n_segments:
            low, high = y0 - x1, y0 + x1
        else:
            low, high = min(y0, y1), max(y0, y1)
        for row in range(row_of(packed, low - padding), row_of(packed, high + padding) + 1):
            floor = packed[BOTTOM] + row * cell - padding
            ceiling = floor + cell + 2.0 * padding
            if i >= n_segments:  # how wide the disc is where it is widest within the row
                off = max(max(floor - y0, y0 - ceiling), 0.0)
                half = np.sqrt(max(x1 * x1 - off * off, 0.0))
                left, right = x0 - half, x0 + half
            else:
                left, right = min(x0, x1), max(x0, x1)
                if y0 != y1:  # only the part within the row
                    slope = (x1 - x0) / (y1 - y0)
                    a = x0 + slope * (min(max(floor, low), high) - y0)
                    b = x0 + slope * (min(max(ceiling, low), high) - y0)
                    left, right = max(left, min(a, b)), min(right, max(a, b))
            for column in range(column_of(packed, left - padding), column_of(packed, right + padding) + 1):
                c = row * columns + column
                if write:
                    items[int(counts[c])] = i
                counts[c] += 1


@heap_kernel
def _depths(packed: Record, depth: Record) -> None:
    """Write how many solid bodies cover each cell that no edge of a solid passes through, row by row from the right."""
    columns, rows, n_solid = int(packed[COLUMNS]), int(packed[ROWS]), int(packed[SOLID])
    turns = np.zeros(columns + 1)
    for row in range(rows):
        y = packed[BOTTOM] + (row + 0.5) * packed[CELL]
        turns[:] = 0.0
        for i in range(n_solid):
            at = HEAD + STRIDE * i
            y0, y1 = packed[at + 1], packed[at + 3]
            if (y0 <= y) != (y1 <= y):
                x = packed[at] + (y - y0) / (y1 - y0) * (packed[at + 2] - packed[at])
                turns[column_of(packed, x)] += 1.0 if y1 > y0 else -1.0
        covered = packed[OUTSIDE]
        for column in range(columns - 1, -1, -1):
            covered += turns[column]
            cell = row * columns + column
            depth[cell] = covered
            begin, end = bucket(packed, cell)
            for k in range(begin, end):
                if packed[k] < n_solid:
                    depth[cell] = UNEVEN


def _grid(segments: Floats, discs: Floats) -> tuple[float, float, float, int, int]:
    """Return (left, bottom, side of a cell, columns, rows) of a grid that suits the shapes."""
    x = np.concatenate([segments[:, 0], segments[:, 2], discs[:, 0] - discs[:, 2], discs[:, 0] + discs[:, 2]])
    y = np.concatenate([segments[:, 1], segments[:, 3], discs[:, 1] - discs[:, 2], discs[:, 1] + discs[:, 2]])
    width, height = float(x.max() - x.min()), float(y.max() - y.min())
    wanted = min(max(8 * (len(segments) + len(discs)), LEAST_CELLS), MOST_CELLS)
    cell = max(np.sqrt(width * height / wanted), max(width, height) / wanted, 1e-6 * float(np.abs([x, y]).max()), 1e-9)
    long = np.abs(segments[:, 2:] - segments[:, :2]).sum(axis=1)

    def items(cell: float) -> float:
        return math.fsum(long / cell + 2.0) + math.fsum((2.0 * discs[:, 2] / cell + 2.0) ** 2)  # whatever the machine

    while items(cell) > 16.0 * wanted + 9.0 * (len(segments) + len(discs)):  # long walls and large discs fill buckets
        cell *= 1.25
    columns, rows = (int(np.ceil(side / cell + 2.0 * _RIM)) for side in (width, height))
    return float(x.min()) - _RIM * cell, float(y.min()) - _RIM * cell, float(cell), columns, rows


def pack(solid: Floats, walls: Floats, discs: Floats, outside: bool = False) -> Floats:
    """Return the packed ground; an array of length 0 if there is nothing.

    Args:
        solid: edges of solid bodies, which lie to their left, x0, y0, x1, y1 [m], shape (n, 4).
        walls: other segments, likewise.
        discs: x, y, radius [m], shape (m, 3).
        outside: whether all that lies outside of the solid bodies' common outline is solid, too: there are bounds.

    >>> len(pack(np.empty((0, 4)), np.empty((0, 4)), np.empty((0, 3))))
    0
    """
    from parcours_navigation.ground.clearance import fill_field

    segments = np.concatenate([solid, walls])
    n = len(segments) + len(discs)
    if n == 0:
        return np.empty(0)
    left, bottom, cell, columns, rows = _grid(segments, discs)
    cells = columns * rows
    field = HEAD + STRIDE * n
    depth, starts, items = field + cells, field + 2 * cells, field + 3 * cells + 1
    head = np.zeros(items)
    extent = max(abs(left), abs(bottom), abs(left + columns * cell), abs(bottom + rows * cell))
    head[:14] = (
        len(solid), len(segments), n, left, bottom, cell, columns, rows, field, depth, starts, items, outside,
        1e-14 * extent,
    )  # fmt: skip
    head[HEAD : HEAD + STRIDE * len(segments)] = segments.ravel()
    head[HEAD + STRIDE * len(segments) : field].reshape(-1, STRIDE)[:, :3] = discs
    counts = np.zeros(cells)
    _spread(head, counts, head[:0], False)
    ends = np.cumsum(counts)
    head[starts] = 0.0
    head[starts + 1 : starts + cells + 1] = ends
    packed = np.concatenate([head, np.zeros(int(ends[-1]))])
    _spread(packed, ends - counts, packed[items:], True)
    _depths(packed, packed[depth : depth + cells])
    fill_field(packed, packed[field : field + cells])
    return packed

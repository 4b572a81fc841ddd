"""Occupied cells of a grid as edges of solid bodies, with runs on one line joined; and a ground as cells.

▒▒▒▒▒▒        ┏━━━━━┓      An edge lies where an occupied cell meets one that is not; ▒ is to its left.
▒▒▒▒▒▒  ──►   ┃     ┃      Edges of neighbours on one line, that have ▒ on the same side, become one: a grid
▒▒            ┃ ┏━━━┛      of 400 x 400 cells has a few hundred of them, not tens of thousands.
▒▒            ┗━┛
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours_navigation.ground.clearance import at_least, clearance
from parcours_navigation.ground.footprint import footprint_least
from parcours_navigation.ground.outlines import BadGround
from parcours_navigation.protocol import Map

Floats = NDArray[np.float64]

FREE, OCCUPIED, UNKNOWN = 0, 100, 255
"""What a cell of a map says, as ROS has it, but for UNKNOWN, which ROS writes as -1."""

MOST_CELLS = 4_000_000
"""Cells of a map at most: 2000 x 2000."""

_SHRUNK = 1e-6
"""A cell is occupied by what it has in it, not by what only touches its border: it is shrunk by this share."""


def edges(occupied: NDArray[np.bool_], resolution: float, origin: tuple[float, float]) -> Floats:
    """Return the edges of the occupied cells, which lie to their left, x0, y0, x1, y1 [m], shape (n, 4).

    Args:
        occupied: [row, column], rows upwards, shape (rows, columns).
        resolution: side of a cell [m].
        origin: lower left corner of cell [0, 0] [m].

    >>> edges(np.array([[True, True]]), 0.5, (0.0, 0.0)).tolist()
    [[0.0, 0.0, 1.0, 0.0], [1.0, 0.5, 0.0, 0.5], [0.0, 0.5, 0.0, 0.0], [1.0, 0.0, 1.0, 0.5]]
    """
    framed = np.pad(occupied, 1)
    found = []
    for flat in (framed, framed.T):  # lines along x, then along y
        above, below = flat[1:], flat[:-1]
        for has, turned in ((above & ~below, flat is not framed), (below & ~above, flat is framed)):
            # has[line, k]: whether the edge of cell k - 1 on this line is one, with the occupied cell on the same side
            steps = np.diff(has.astype(np.int8), axis=1)
            line, begin = np.nonzero(steps == 1)
            end = np.nonzero(steps == -1)[1]
            first, last = (end, begin) if turned else (begin, end)
            along, across = (0, 1) if flat is framed else (1, 0)
            rows = np.empty((len(line), 4))
            rows[:, along], rows[:, across] = first, line
            rows[:, 2 + along], rows[:, 2 + across] = last, line
            found.append(rows)
    joined: Floats = np.concatenate(found) * resolution + np.array([*origin, *origin])
    return joined


def require_cells(columns: int, rows: int, where: str) -> None:
    """Raise BadGround if a grid has too many cells."""
    if columns * rows > MOST_CELLS:
        rule = f"a map has at most {MOST_CELLS} cells, but this one would have {columns} x {rows}"
        raise BadGround(where, rule, "take a coarser resolution or cut the map", slug="map-size")


def rasterise(
    packed: Floats, resolution: float, area: Floats, rim: int = 0, origin: tuple[float, float] | None = None
) -> Map:
    """Return the packed ground as a map: a cell is occupied if any of the ground lies in it, else free.

    Args:
        packed: what `Ground.pack` returns.
        resolution: side of a cell [m].
        area: what is covered at least, from its lower left corner, x0, y0, x1, y1 [m], shape (4,).
        rim: this many rows and columns more, on all sides.
        origin: lower left corner of the area, if its own is not meant [m].

    Raises:
        BadGround: the resolution is not above 0, or there would be too many cells.
    """
    if not 0.0 < resolution < np.inf:
        rule = f"the side of a cell must be above 0 m, but is {resolution} m"
        raise BadGround("resolution", rule, slug="map-resolution")
    across, up = (float(side) / resolution for side in area[2:] - area[:2])
    if not across * up <= MOST_CELLS:  # also where that overflows
        require_cells(int(min(across, 1e9)) + 1, int(min(up, 1e9)) + 1, "rasterise")
    columns, rows = (max(int(np.ceil(side - 1e-9)), 1) + 2 * rim for side in (across, up))
    require_cells(columns, rows, "rasterise")
    x0, y0 = float(area[0]) - rim * resolution, float(area[1]) - rim * resolution
    cells = np.zeros((rows, columns), np.uint8)
    half = 0.5 * resolution * (1.0 - _SHRUNK)
    square = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    _fill(packed, square, x0, y0, resolution, cells)
    return Map(cells, float(resolution), (x0, y0))


@kernel
def _fill(packed: Record, square: Record, x0: float, y0: float, side: float, cells: Record) -> None:
    """Mark each cell in which some of the ground lies."""
    reach = square[2, 0] * 1.4142135623730951
    for row in range(cells.shape[0]):
        for column in range(cells.shape[1]):
            x, y = x0 + (column + 0.5) * side, y0 + (row + 0.5) * side
            if at_least(packed, x, y) > reach:
                continue
            near = clearance(packed, x, y)
            if near <= 0.0 or (near <= reach and footprint_least(packed, square, x, y, 0.0, x, y, 0.0, 0.0) <= 0.0):
                cells[row, column] = 100

"""The ground: walls, solid bodies, discs, occupied cells and bounds, as data that cases share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from parcours.kernels import Record, kernel
from parcours_navigation.ground.cells import OCCUPIED, UNKNOWN, edges, rasterise, require_cells
from parcours_navigation.ground.clearance import clearance
from parcours_navigation.ground.outlines import BadGround, bounds_of, faults, outline, table
from parcours_navigation.ground.packing import Floats, pack
from parcours_navigation.protocol import Map

MARGIN = 1.0
"""How far a map reaches beyond a ground without bounds [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What stands in the world for good. Arrays are read-only; `lay_ground` makes one of what is given.

    Solid bodies may overlap. With bounds, all that lies outside of them counts as solid.

    >>> hall = lay_ground(segments=[[0, 0, 4, 0]], discs=[[2, 2, 0.5]])
    >>> hall.clearance([[1.0, 1.0], [2.0, 2.0]]).round(3).tolist()
    [0.914, -0.5]
    """

    segments: Floats  # walls x0, y0, x1, y1 [m], shape (n, 4)
    discs: Floats  # x, y, radius [m], shape (m, 3)
    solids: tuple[Floats, ...]  # outlines of solid bodies, counter-clockwise [m], each of shape (k, 2)
    bounds: Floats | None  # x0, y0, x1, y1 [m], shape (4,)
    cells: Map | None  # occupied cells are solid

    def solid_edges(self) -> Floats:
        """Return the edges of solid bodies, cells and bounds, solid to their left, x0, y0, x1, y1 [m], shape (n, 4)."""
        found = [np.hstack([corners, np.roll(corners, -1, axis=0)]) for corners in self.solids]
        if self.bounds is not None:
            x0, y0, x1, y1 = self.bounds
            found.append(np.array([[x0, y0, x0, y1], [x0, y1, x1, y1], [x1, y1, x1, y0], [x1, y0, x0, y0]]))
        if self.cells is not None:
            found.append(edges(self.cells.cells == OCCUPIED, self.cells.resolution, self.cells.origin))
        return np.concatenate(found) if found else np.empty((0, 4))

    def pack(self) -> Floats:
        """Return the ground as kernels take it: one array of numbers, of length 0 where there is nothing."""
        return pack(self.solid_edges(), self.segments, self.discs, self.bounds is not None)

    def clearance(self, points: ArrayLike) -> Floats:
        """Return how far each point, shape (n, 2), is from what is nearest [m], negative inside, shape (n,)."""
        places = table(points, 2, "points")
        found = np.empty(len(places))
        _clearances(self.pack(), places, found)
        return found

    def occupied(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return whether each point, shape (n, 2), is on a wall, in something solid or out of bounds, shape (n,)."""
        return self.clearance(points) <= 0.0

    def extent(self) -> Floats | None:
        """Return what the ground takes up, x0, y0, x1, y1 [m], shape (4,): the bounds, if it has some."""
        if self.bounds is not None:
            return self.bounds
        edge, disc = np.concatenate([self.solid_edges(), self.segments]), self.discs
        low = np.concatenate([edge[:, :2], edge[:, 2:], disc[:, :2] - disc[:, 2:]])
        high = np.concatenate([edge[:, :2], edge[:, 2:], disc[:, :2] + disc[:, 2:]])
        return np.concatenate([low.min(axis=0), high.max(axis=0)]) if len(low) else None

    def rasterise(self, resolution: float, area: ArrayLike | None = None) -> Map:
        """Return the ground as a map: a cell is occupied if any of the ground lies in it, else free.

        Args:
            resolution: side of a cell [m].
            area: what is covered at least, x0, y0, x1, y1 [m]. If None: the bounds and one rim of occupied cells
                beyond; or the cells of the map that the ground was read from; or the ground's extent and MARGIN.

        Raises:
            BadGround: the resolution is not above 0, or there would be too many cells.
        """
        if area is not None:
            return rasterise(self.pack(), resolution, bounds_of(area, "area"))
        if self.bounds is not None:
            return rasterise(self.pack(), resolution, self.bounds, rim=1)
        if self.cells is not None:
            rows, columns = self.cells.cells.shape
            x0, y0 = self.cells.origin
            side = self.cells.resolution
            return rasterise(self.pack(), resolution, np.array([x0, y0, x0 + columns * side, y0 + rows * side]))
        extent = self.extent()
        covered = np.zeros(4) if extent is None else extent
        return rasterise(self.pack(), resolution, covered + MARGIN * np.array([-1.0, -1.0, 1.0, 1.0]))


def lay_ground(
    segments: ArrayLike = (), discs: ArrayLike = (), solids: Sequence[ArrayLike] = (), bounds: ArrayLike | None = None,
    cells: Map | None = None,
) -> Ground:  # fmt: skip
    """Return the ground of these parts, checked.

    Args:
        segments: walls x0, y0, x1, y1 [m], shape (n, 4).
        discs: x, y, radius [m], shape (m, 3).
        solids: outlines of solid bodies, corners in order, either way round [m], each of shape (k, 2).
        bounds: x0, y0, x1, y1 [m], or None.
        cells: a map whose occupied cells are solid, or None.

    Raises:
        BadGround: a part is no good: the message names it by its number, from 1.
    """
    walls, columns = table(segments, 4, "walls"), table(discs, 3, "discs")
    for fault in faults(walls, columns):
        raise fault
    outlines = tuple(outline(corners, f"polygon {i}") for i, corners in enumerate(solids, 1))
    return Ground(walls, columns, outlines, None if bounds is None else bounds_of(bounds), cells)


def ground_of(map_: Map, unknown_is_solid: bool = False) -> Ground:
    """Return the ground whose solid bodies are the occupied cells of a map.

    Args:
        map_: an occupancy grid.
        unknown_is_solid: whether unknown cells are occupied.

    Raises:
        BadGround: its resolution or origin is no good, or it has too many cells.

    >>> wall = Map(np.array([[0, 100], [0, 100]], np.uint8), 0.5, (0.0, 0.0))
    >>> len(ground_of(wall).solid_edges())
    4
    """
    if not 0.0 < map_.resolution < np.inf:
        rule = f"the side of a cell must be above 0 m, but is {map_.resolution} m"
        raise BadGround("map", rule, slug="map-resolution")
    require_cells(map_.cells.shape[1], map_.cells.shape[0], "map")
    corner = np.array([*map_.origin, *map_.origin])
    table([corner + np.array([0, 0, *map_.cells.shape[::-1]]) * map_.resolution], 4, "map")
    cells = map_.cells
    if unknown_is_solid:
        cells = np.where(cells == UNKNOWN, np.uint8(OCCUPIED), cells)
    return Ground(np.empty((0, 4)), np.empty((0, 3)), (), None, Map(cells, map_.resolution, map_.origin))


@kernel
def _clearances(packed: Record, points: Record, found: Record) -> None:
    """Write the clearance of each point."""
    for i in range(len(points)):
        found[i] = clearance(packed, points[i, 0], points[i, 1])

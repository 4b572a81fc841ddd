"""Who is near: bodies in the cells of a grid, and the nearest few of one of them.

What is found is defined without the grid: of the bodies nearer than `reach`, the nearest few, by distance and, where
that is equal, by number. So neither cell size nor order of insertion changes a bit of what is done with them.

    ┌──┬──┬──┬──┬──┐      Rings of cells round the body's own are searched from the inside out. What lies beyond ring k
    │2 │2 │2 │2 │2 │      is at least k cells away: once as many as are wanted are nearer than that, or k cells are
    ├──┼──┼──┼──┼──┤      more than `reach`, the search ends. Cells are kept in a hash table, so the plane has no edge.
    │2 │1 │1 │1 │2 │
    ├──┼──┼──┼──┼──┤
    │2 │1 │ o│1 │2 │
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import kernel
from parcours_navigation.protocol import Floats

Integers = NDArray[np.int64]

FEW = 32
"""Up to this many bodies are searched one by one."""

_P, _Q = 73856093, 19349663


@kernel
def table_size(n: int) -> int:
    """Return the size of the hash table for n bodies: a power of two, at least twice as many."""
    size = 16
    while size < 2 * n:
        size *= 2
    return size


@kernel
def fill_grid(bodies: Floats, cell: float, heads: Integers, cells: Integers) -> None:
    """Sort bodies, rows that begin with x, y [m], into square cells of side `cell` [m].

    `heads` is the hash table, shape (table_size(n),); `cells` receives column, row and successor of each body, shape
    (n, 3).
    """
    heads[:] = -1
    mask = len(heads) - 1
    for i in range(len(bodies)):
        column, row = int(np.floor(bodies[i, 0] / cell)), int(np.floor(bodies[i, 1] / cell))
        key = ((column * _P) ^ (row * _Q)) & mask
        cells[i, 0], cells[i, 1], cells[i, 2] = column, row, heads[key]
        heads[key] = i


@kernel
def _consider(bodies: Floats, i: int, j: int, most: int, n: int, reach: float, found: Integers, squares: Floats) -> int:
    """Add body j to the n nearest found so far if it belongs there; return how many there are then."""
    dx, dy = bodies[j, 0] - bodies[i, 0], bodies[j, 1] - bodies[i, 1]
    square = dx * dx + dy * dy
    if j == i or square >= reach * reach:
        return n
    if n == most:
        if square > squares[n - 1] or (square == squares[n - 1] and j > found[n - 1]):
            return n
        n -= 1
    k = n
    while k > 0 and (squares[k - 1] > square or (squares[k - 1] == square and found[k - 1] > j)):
        squares[k], found[k] = squares[k - 1], found[k - 1]
        k -= 1
    squares[k], found[k] = square, j
    return n + 1


@kernel
def nearest_bodies(
    bodies: Floats,
    cell: float,
    heads: Integers,
    cells: Integers,
    i: int,
    reach: float,
    most: int,
    found: Integers,
    squares: Floats,
) -> int:
    """Return how many of the `most` bodies nearest to body i are nearer than `reach` [m], and fill in which.

    `found` receives their numbers, nearest first, `squares` the squares of their distances [m2]; both hold at least
    `most` entries. The grid is that of `fill_grid`.
    """
    n = 0
    if most <= 0:
        return 0
    if len(bodies) <= FEW:
        for j in range(len(bodies)):
            n = _consider(bodies, i, j, most, n, reach, found, squares)
        return n
    mask = len(heads) - 1
    ring = 0
    while ring == 0 or (ring - 1) * cell < reach:
        if n == most and squares[n - 1] < (ring - 1) * (ring - 1) * cell * cell:
            break
        for row in range(cells[i, 1] - ring, cells[i, 1] + ring + 1):
            is_edge = row == cells[i, 1] - ring or row == cells[i, 1] + ring
            step = 1 if is_edge or ring == 0 else 2 * ring
            for column in range(cells[i, 0] - ring, cells[i, 0] + ring + 1, step):
                j = heads[((column * _P) ^ (row * _Q)) & mask]
                while j >= 0:
                    if cells[j, 0] == column and cells[j, 1] == row:
                        n = _consider(bodies, i, j, most, n, reach, found, squares)
                    j = cells[j, 2]
        ring += 1
    return n

"""The cheapest way over a grid by A*, which keeps off walls where there is room.

Hart, Nilsson, Raphael, A formal basis for the heuristic determination of minimum cost paths (IEEE Transactions on
Systems Science and Cybernetics 4(2), 1968), on eight neighbours with the octile distance, which never overestimates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import heap_kernel, kernel
from parcours_navigation.planners.distance import is_clear
from parcours_navigation.protocol import Floats

_DIAGONAL = 1.4142135623730951
_NEVER = 1e18

Ints = NDArray[np.int64]


@kernel
def octile(di: int, dj: int) -> float:
    """Return the length [cells] of the shortest way between cells this many rows and columns apart.

    >>> octile(3, 0), round(octile(-1, 3), 6)
    (3.0, 3.414214)
    """
    a, b = abs(di), abs(dj)
    return max(a, b) + (_DIAGONAL - 1.0) * min(a, b)


@kernel
def _before(costs: Floats, keys: Floats, a: int, b: int) -> bool:
    """Return whether cell a is taken before b: the lesser key, then the farther from the start, then the lesser index.

    So the order never depends on how a heap happens to lie.
    """
    if keys[a] != keys[b]:
        return bool(keys[a] < keys[b])
    if costs[a] != costs[b]:
        return bool(costs[a] > costs[b])
    return a < b


@kernel
def _rise(heap: Ints, places: Ints, costs: Floats, keys: Floats, at: int) -> None:
    cell = heap[at]
    while at > 0:
        above = (at - 1) // 2
        if not _before(costs, keys, cell, heap[above]):
            break
        heap[at] = heap[above]
        places[heap[at]] = at
        at = above
    heap[at] = cell
    places[cell] = at


@kernel
def _sink(heap: Ints, places: Ints, costs: Floats, keys: Floats, n: int) -> None:
    cell, at = heap[0], 0
    while 2 * at + 1 < n:
        below = 2 * at + 1
        if below + 1 < n and _before(costs, keys, heap[below + 1], heap[below]):
            below += 1
        if not _before(costs, keys, heap[below], cell):
            break
        heap[at] = heap[below]
        places[heap[at]] = at
        at = below
    heap[at] = cell
    places[cell] = at


@heap_kernel
def edge_cost(room: Floats, a: int, b: int, length: float, radius: float, soft: float, weight: float) -> float:
    """Return what the step from cell a to b costs, infinite if the robot must not take it; cells by flat index.

    `room` is the distance to walls at each cell [m]. The robot may be where it is at least `radius`, and where it is
    less it may go to where there is more. A step costs its `length` [m], and up to 1 + `weight` times that where there
    is less than `soft` [m] beyond the radius.
    """
    cells = room.ravel()
    here, there = cells[a], cells[b]
    if there < radius and not (here < radius and there > here):
        return float(np.inf)
    narrow = max(1.0 - (here - radius) / soft, 0.0) + max(1.0 - (there - radius) / soft, 0.0)
    return float(length * (1.0 + 0.5 * weight * min(narrow, 2.0)))


@heap_kernel
def search(
    room: Floats, side: float, radius: float, soft: float, weight: float, start: int, goal: int, way: Ints
) -> tuple[int, bool, float]:
    """Return (n, reached, cost) of the cheapest way from cell `start` to `goal`, flat indices, and fill in its n cells.

    If the goal cannot be reached, the way leads to the cell nearest to it that can. For `room`, `radius`, `soft`,
    `weight` see `edge_cost`; cells have a `side` [m]. No cell is looked at twice, so work is bounded by their number.
    `way` has the shape (n_cells,).
    """
    n_rows, n_columns = room.shape
    n_cells = n_rows * n_columns
    goal_i, goal_j = goal // n_columns, goal % n_columns
    costs, keys = np.full(n_cells, _NEVER), np.full(n_cells, _NEVER)
    parents, places = np.full(n_cells, -1, np.int64), np.full(n_cells, -1, np.int64)
    is_done = np.zeros(n_cells, np.uint8)
    heap = np.empty(n_cells, np.int64)
    costs[start] = 0.0
    keys[start] = side * octile(start // n_columns - goal_i, start % n_columns - goal_j)
    heap[0], places[start], n = start, 0, 1
    best, best_left = start, keys[start]
    while n > 0:
        cell = heap[0]
        n -= 1
        if n > 0:
            heap[0] = heap[n]
            _sink(heap, places, costs, keys, n)
        is_done[cell] = 1
        i, j = cell // n_columns, cell % n_columns
        left = side * octile(i - goal_i, j - goal_j)
        if left < best_left:
            best, best_left = cell, left
        if cell == goal:
            break
        for k in range(9):
            di, dj = k // 3 - 1, k % 3 - 1
            a, b = i + di, j + dj
            if k == 4 or a < 0 or a >= n_rows or b < 0 or b >= n_columns:
                continue
            to = a * n_columns + b
            if is_done[to]:
                continue
            length = side * (_DIAGONAL if di != 0 and dj != 0 else 1.0)
            cost = costs[cell] + edge_cost(room, cell, to, length, radius, soft, weight)
            if cost < costs[to]:
                costs[to], parents[to] = cost, cell
                keys[to] = cost + side * octile(a - goal_i, b - goal_j)
                if places[to] < 0:
                    heap[n], places[to] = to, n
                    n += 1
                _rise(heap, places, costs, keys, places[to])
    length, cell = 0, best
    while cell >= 0:
        way[length] = cell
        length += 1
        cell = parents[cell]
    for k in range(length // 2):
        way[k], way[length - 1 - k] = way[length - 1 - k], way[k]
    return length, best == goal, float(costs[best])


@kernel
def stand_in(room: Floats, frame: Floats, x: float, y: float, radius: float, reach: float) -> None:
    """Take a standing disc for a wall too: lessen the `room` of cells within `reach` [m] of its edge.

    `frame` is that of `distance.look`.
    """
    n_rows, n_columns = room.shape
    span = radius + reach
    first_i, last_i = int(np.floor((y - span - frame[1]) / frame[2])), int(np.ceil((y + span - frame[1]) / frame[2]))
    first_j, last_j = int(np.floor((x - span - frame[0]) / frame[2])), int(np.ceil((x + span - frame[0]) / frame[2]))
    for i in range(max(first_i, 0), min(last_i, n_rows - 1) + 1):
        for j in range(max(first_j, 0), min(last_j, n_columns - 1) + 1):
            dx, dy = frame[0] + j * frame[2] - x, frame[1] + i * frame[2] - y
            room[i, j] = min(room[i, j], np.sqrt(dx * dx + dy * dy) - radius)


@kernel
def along(
    points: Floats, first: int, x: float, y: float, lookahead: float, distances: Floats, frame: Floats, radius: float
) -> tuple[int, float, int, float]:
    """Return (nearest, off, ahead, left): where a robot at (x, y) [m] is on a way, and which of its points to head for.

    `nearest` is the point of the way nearest to it from `first` on, within twice `lookahead` [m] along the way, `off`
    its distance [m]; `ahead` the last point within `lookahead` that a disc of `radius` [m] can reach in a straight line
    (else the one after the nearest), `left` the way from there to its end [m]. `points` has the shape (n, 2), n > 0.
    """
    n = len(points)
    nearest, off, gone = first, np.inf, 0.0
    for k in range(first, n):
        if k > first:
            dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
            gone += np.sqrt(dx * dx + dy * dy)
        dx, dy = points[k, 0] - x, points[k, 1] - y
        far = np.sqrt(dx * dx + dy * dy)
        if far < off:
            nearest, off = k, far
        if gone > 2.0 * lookahead + off:
            break
    last, gone = nearest, 0.0
    while last + 1 < n and gone < lookahead:
        dx, dy = points[last + 1, 0] - points[last, 0], points[last + 1, 1] - points[last, 1]
        gone += np.sqrt(dx * dx + dy * dy)
        last += 1
    ahead = last
    while ahead > nearest + 1:
        if is_clear(distances, frame, x, y, points[ahead, 0], points[ahead, 1], radius):
            break
        ahead -= 1
    left = 0.0
    for k in range(ahead, n - 1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        left += np.sqrt(dx * dx + dy * dy)
    return nearest, float(off), ahead, float(left)

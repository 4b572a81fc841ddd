"""Can a case of a world be solved at all? Only what the ground says of it: who gives way, or may, decides nothing.

UNSOLVABLE is certain: no body of the robot's inner radius gets through the ground, even if nobody else were there, or
not in time. SOLVABLE is certain, too: nobody else is there, and a disc of the outer radius gets through in time on a
way that was found. What lies between is UNDECIDED.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import kernel
from parcours_navigation.arena.solvability import SOLVABILITY, SOLVABLE, UNDECIDED, UNSOLVABLE
from parcours_navigation.ground.clearance import clearance
from parcours_navigation.ground.packing import BOTTOM, CELL, COLUMNS, LEFT, ROWS
from parcours_navigation.stage.memory import Scene
from parcours_navigation.worlds.family import WorldCases

_MOST_POINTS = 1_000_000
_DIAGONAL = 1.4142135623730951


def solve_worlds(
    cases: WorldCases, numbers: NDArray[np.int64], progress: Callable[[int, int], None] = lambda done, total: None,
    limit: float = np.inf,
) -> NDArray[np.void]:  # fmt: skip
    """Return what is known of the cases within their time limit, or a shorter one [s]; array of SOLVABILITY, (n,)."""
    found = np.zeros(len(numbers), SOLVABILITY)
    for k, number in enumerate(numbers.tolist()):
        [staged] = cases.staged([number], 0.05)
        scene, within = staged.scene, min(staged.end, limit)
        speed = float(scene.robot["v_max"][0])
        shortest, certain = _lengths(scene, np.zeros(0))
        if shortest / speed <= within:  # else it is too far even as the crow flies: no need to look at the ground
            shortest, certain = _lengths(scene, scene.ground)
        earliest = shortest / speed
        found[k]["earliest_outer"], found[k]["earliest_inner"] = earliest, np.inf
        found[k]["answer"] = UNDECIDED
        if earliest > within:
            found[k]["answer"], found[k]["earliest_outer"] = UNSOLVABLE, np.inf
        elif not len(scene.obstacles) and certain / speed <= within and np.isnan(scene.goals[-1, 2]):
            found[k]["answer"], found[k]["earliest_inner"] = SOLVABLE, certain / speed
        progress(k + 1, len(numbers))
    return found


def _lengths(scene: Scene, ground: NDArray[np.float64]) -> tuple[float, float]:
    """Return what `ways` does, from goal to goal on this ground [m]."""
    radius = float(scene.robot["radius"][0])
    inner = _inner_radius(scene.corners, radius)
    x, y = float(scene.robot["x"][0]), float(scene.robot["y"][0])
    shortest = certain = 0.0
    for k, (goal_x, goal_y) in enumerate(scene.goals[:, :2].tolist()):
        low, high = ways(ground, x, y, goal_x, goal_y, scene.tolerance, radius, inner)
        shortest, certain = shortest + low, certain + high
        x, y = goal_x, goal_y
        shortest -= scene.tolerance if k < len(scene.goals) - 1 else 0.0
    return max(shortest, 0.0), certain


def _inner_radius(corners: NDArray[np.float64], radius: float) -> float:
    """Return the radius of a disc around the body's place that it covers whichever way it looks [m].

    Negative where its place lies outside of it: then nothing of the place is in the way of a wall.
    """
    if not len(corners):
        return radius
    following = np.roll(corners, -1, axis=0)
    edge = following - corners
    across = (corners[:, 0] * edge[:, 1] - corners[:, 1] * edge[:, 0]) / np.hypot(edge[:, 0], edge[:, 1])
    return float(across.min())


def ways(
    packed: NDArray[np.float64], x: float, y: float, goal_x: float, goal_y: float, tolerance: float, outer: float,
    inner: float,
) -> tuple[float, float]:  # fmt: skip
    """Return (a length that no way undercuts, the length of a way for a disc) up to `tolerance` of a goal [m].

    `outer` is the disc's radius, `inner` what fits into the body whichever way it looks [m]. inf where there is none.

    >>> ways(np.zeros(0), 0.0, 0.0, 3.0, 4.0, 0.5, 0.2, 0.2)
    (4.5, 4.5)
    """
    from scipy.ndimage import label

    straight = max(float(np.hypot(goal_x - x, goal_y - y)) - tolerance, 0.0)
    if not len(packed):
        return straight, straight
    if inner <= 0.0:
        return straight, float("inf")
    left, bottom, right, top = _extent(packed, x, y, goal_x, goal_y)
    step = max(0.25 * max(inner, 0.02), float(np.sqrt((right - left) * (top - bottom) / _MOST_POINTS)))
    columns, rows = int((right - left) / step) + 2, int((top - bottom) / step) + 2
    gaps = np.zeros((rows, columns))
    _gaps(packed, left, bottom, step, gaps)
    first, last = ((round((v - bottom) / step), round((u - left) / step)) for u, v in ((x, y), (goal_x, goal_y)))
    # The nearest point of the lattice is within step / sqrt(2) of the body, and clearance changes no faster than place:
    # one who gets through leads a shadow over these points, from one to a neighbour.
    shadows, _ = label(gaps > inner - 0.5 * _DIAGONAL * step, np.ones((3, 3)))
    reach = int(np.ceil(tolerance / step)) + 1
    around = shadows[max(last[0] - reach, 0) : last[0] + reach + 1, max(last[1] - reach, 0) : last[1] + reach + 1]
    if not shadows[first] or not (around == shadows[first]).any():
        return float("inf"), float("inf")
    found = _shortest(gaps > outer + 0.5 * _DIAGONAL * step, step, first, last)
    return straight, found + 2.0 * _DIAGONAL * step


def _extent(packed: NDArray[np.float64], *places: float) -> tuple[float, float, float, float]:
    """Return a box around the ground and the places, x, y each [m]."""
    width, height = packed[COLUMNS] * packed[CELL], packed[ROWS] * packed[CELL]
    xs, ys = (
        (*places[::2], packed[LEFT], packed[LEFT] + width),
        (*places[1::2], packed[BOTTOM], packed[BOTTOM] + height),
    )
    return min(xs) - 1.0, min(ys) - 1.0, max(xs) + 1.0, max(ys) + 1.0


@kernel
def _gaps(packed: NDArray[np.float64], left: float, bottom: float, step: float, gaps: NDArray[np.float64]) -> None:
    """Fill in the clearance of each point of a lattice."""
    for row in range(gaps.shape[0]):
        for column in range(gaps.shape[1]):
            gaps[row, column] = clearance(packed, left + column * step, bottom + row * step)


def _shortest(free: NDArray[np.bool_], step: float, first: tuple[int, int], last: tuple[int, int]) -> float:
    """Return the length of the shortest way over free points of a lattice, in eight directions [m]; inf without any."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    rows, columns = free.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    parts = []
    for down, aside, length in ((0, 1, 1.0), (1, 0, 1.0), (1, 1, _DIAGONAL), (1, -1, _DIAGONAL)):
        a = (slice(0, rows - down), slice(max(-aside, 0), columns - max(aside, 0)))
        b = (slice(down, rows), slice(max(aside, 0), columns + min(aside, 0)))
        both = free[a] & free[b]
        parts.append((index[a][both], index[b][both], np.full(int(both.sum()), length * step)))
    one, two, lengths = (np.concatenate(column) for column in zip(*parts, strict=True))
    if not (free[first] and free[last]):
        return float("inf")
    graph = coo_array((lengths, (one, two)), shape=(rows * columns, rows * columns)).tocsr()
    return float(dijkstra(graph, directed=False, indices=index[first])[index[last]])

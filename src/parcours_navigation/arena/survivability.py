"""How hard a case is: how long a robot that only stands somewhere would survive among its obstacles.

After Shi, Chen, Serra Gomez, Wu and Alonso-Mora, Evaluating Dynamic Environment Difficulty for Obstacle Avoidance
Benchmarking, 2024 (arXiv 2404.14848): a virtual robot at rest is put on sampled places, and the time until a moving
obstacle hits it is taken. Here places are a fixed grid and times are exact. More survival is an easier case.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.elementary import PI, TAU, atan2, sin_cos
from parcours.errors import BadRequest
from parcours.kernels import Record, kernel

SURVIVABILITY = np.dtype(
    [
        ("survived", "f8"),  # mean over the places of the time survived, as a share of the limit, in [0, 1]
        ("hit", "f8"),  # share of the places that are hit within the limit
        ("places", "i8"),  # places counted: those that no obstacle covers at time 0
    ]
)
"""What is known of one case; `survived` and `hit` are nan where every place is covered."""

_FLAT = 1e-9
"""A yaw rate below this [rad/s] counts as zero, as in `arena.obstacles`."""


def survivability(
    obstacles: Record, *, robot_radius: float = 0.125, arena: float = 2.0, limit: float = 21.0, places: int = 16
) -> NDArray[np.void]:
    """Return how long standing robots survive in each case, array of SURVIVABILITY, shape (n,).

    Args:
        obstacles: array of OBSTACLE, shape (n, n_obstacles); only what is given of their motion is read.
        robot_radius: [m].
        arena: robots stand in the middles of places x places equal squares that fill [0, arena]^2 [m].
        limit: time watched from time 0 [s].
        places: squares along one side.

    Raises:
        BadRequest: a length or time is not above 0, or not finite; or there are no places.

    >>> from parcours_navigation.arena.obstacles import OBSTACLE
    >>> float(survivability(np.zeros((1, 0), OBSTACLE))["survived"][0])
    1.0
    """
    for name, value in {"robot_radius": robot_radius, "arena": arena, "limit": limit, "places": places}.items():
        if not 0.0 < value < 1e6:
            rule = f"it must be above 0 and below 1e6, but is {value}"
            raise BadRequest(f"survivability, {name}", rule, slug="solvability-range")
    middles = (np.arange(places) + 0.5) * (arena / places)
    found = np.zeros(len(obstacles), SURVIVABILITY)
    _survive_all(obstacles, middles, robot_radius, limit, found)
    return found


@kernel
def time_to_hit(obstacle: Record, robot_radius: float, x: float, y: float) -> float:
    """Return when the obstacle first comes within reach of a disc that stands in (x, y) [m], in [s].

    0 if it does so from the first, inf if it never does. Exact but for rounding: a time off by what the obstacle needs
    for less than 1e-6 m.
    """
    reach = robot_radius + obstacle.radius
    dx, dy = x - obstacle.x0, y - obstacle.y0
    square = dx * dx + dy * dy
    if square <= reach * reach:
        return 0.0
    lasts = (obstacle.stop - obstacle.start) * 1e-9
    if lasts <= 0.0 or obstacle.speed <= 0.0 or np.sqrt(square) > reach + obstacle.speed * lasts:
        return np.inf
    s, c = sin_cos(obstacle.heading0)
    if abs(obstacle.turn) < _FLAT:
        along, across = dx * c + dy * s, dy * c - dx * s
        if along <= 0.0 or abs(across) > reach:
            return np.inf
        after = (along - np.sqrt(reach * reach - across * across)) / obstacle.speed
    else:
        after = _time_on_arc(obstacle, reach, dx, dy, s, c)
    return float(obstacle.start * 1e-9 + after) if after <= lasts else np.inf


@kernel
def _time_on_arc(obstacle: Record, reach: float, dx: float, dy: float, s: float, c: float) -> float:
    """Return after how much of its motion [s] the turning obstacle first comes within `reach` [m] of its (dx, dy).

    Seen from the centre of the arc the obstacle goes round at the yaw rate; it is within reach while its bearing is
    within `half` of the place's: with r and d the distances of both from the centre, reach^2 = (d - r)^2 + 4 d r
    sin^2(half / 2).
    """
    signed = obstacle.speed / obstacle.turn
    r = abs(signed)
    px, py = dx + signed * s, dy - signed * c  # the place, from the centre
    d = np.sqrt(px * px + py * py)
    if abs(d - r) > reach:
        return np.inf
    share = (reach * reach - (d - r) * (d - r)) / (4.0 * d * r) if d > 0.0 else 1.0
    half = 2.0 * atan2(np.sqrt(share), np.sqrt(max(1.0 - share, 0.0))) if share < 1.0 else PI
    ox, oy = signed * s, -signed * c  # the obstacle, from the centre
    ahead = atan2(ox * py - oy * px, ox * px + oy * py)
    if obstacle.turn < 0.0:
        ahead = -ahead
    until = ahead - half
    if until < 0.0:  # it is leaving, or, by a rounding error, has just arrived
        until = until + TAU if ahead < 0.0 else 0.0
    return float(until / abs(obstacle.turn))


@kernel
def _survive_all(obstacles: Record, middles: Record, robot_radius: float, limit: float, found: Record) -> None:
    """Fill `found` case by case."""
    for k in range(len(found)):
        case, out = obstacles[k], found[k]
        total, hit, counted = 0.0, 0, 0
        for x in middles:
            for y in middles:
                first = np.inf
                for i in range(len(case)):
                    first = min(first, time_to_hit(case[i], robot_radius, x, y))
                if first == 0.0:
                    continue
                counted += 1
                total += min(first, limit) / limit
                hit += 1 if first <= limit else 0
        out.places = counted
        out.survived = total / counted if counted > 0 else np.nan
        out.hit = hit / counted if counted > 0 else np.nan

"""Could any robot of this size and speed have reached the goal without contact?

Two sets of places are grown through space and time, over a lattice (`arena.lattice`). The inner one holds only points
that a disc of top speed v_max certainly reaches without contact; the outer one misses none. Where they disagree the
answer is UNDECIDED. The disc may move in any direction at once, so UNSOLVABLE holds for every robot of that size and
speed, and SOLVABLE only for discs. docs/solvability.md has the errors.

    time of arrival   0 ────────┤ outer ├──── truth ────┤ inner ├────── limit
                        nobody has arrived          a disc certainly has
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.kernels import Record, kernel
from parcours_navigation.arena.lattice import EDGE, ROWS, WORDS, lay_lattice, lay_points
from parcours_navigation.arena.obstacles import place_at
from parcours_navigation.arena.reachable import earliest_inner, earliest_outer, leg_is_free, nanoseconds

_ALONE = 64  # fewer cases are not worth a second thread

UNSOLVABLE, UNDECIDED, SOLVABLE = 0, 1, 2
"""What `answer` may be."""

SOLVABILITY = np.dtype(
    [
        ("answer", "i8"),  # UNSOLVABLE, UNDECIDED or SOLVABLE
        ("earliest_outer", "f8"),  # nobody arrives before this [s]; inf where UNSOLVABLE
        ("earliest_inner", "f8"),  # somebody has arrived by this [s]; inf unless SOLVABLE
    ]
)
"""What is known of one case."""


def solve(
    obstacles: Record,
    *,
    start: tuple[float, float] = (0.0, 0.0),
    goal: tuple[float, float] = (2.0, 2.0),
    tolerance: float = 0.2,
    limit: float = 21.0,
    v_max: float = 0.25,
    robot_radius: float = 0.125,
    margin: float = 0.5,
    inner: bool = True,
) -> NDArray[np.void]:
    """Return for each case whether it can be solved and how early, array of SOLVABILITY, shape (n,).

    Args:
        obstacles: array of OBSTACLE, shape (n, n_obstacles); only what is given of their motion is read.
        start: the robot's centre at time 0 [m].
        goal: [m].
        tolerance: nearer to the goal than this counts as reached [m].
        limit: time allowed from time 0 [s].
        v_max: the robot's top speed [m/s].
        robot_radius: [m].
        margin: of the lattice's square beyond start and goal [m]; inner robots stay within it, outer ones need not.
        inner: whether the inner set is grown, which takes half of the time; without it, what is neither unsolvable nor
            solved by the straight way is undecided.

    Raises:
        BadRequest: a length, speed or time is not above 0, or not finite.

    A world without obstacles is crossed in a straight line:

    >>> from parcours_navigation.arena.obstacles import OBSTACLE
    >>> found = solve(np.zeros((1, 0), OBSTACLE), goal=(1.0, 0.0))[0]
    >>> int(found["answer"]) == SOLVABLE, round(float(found["earliest_outer"]), 6)
    (True, 3.2)
    """
    given = {"tolerance": tolerance, "limit": limit, "v_max": v_max, "robot_radius": robot_radius, "margin": margin}
    for name, value in given.items():
        if not 0.0 < value < 1e6:
            rule = f"it must be above 0 and below 1e6, but is {value}"
            raise BadRequest(f"solvability, {name}", rule, slug="solvability-range")
    lattice = lay_lattice(lay_points(start, goal, tolerance, limit, v_max, robot_radius, margin))
    found = np.zeros(len(obstacles), SOLVABILITY)
    half = max(-(-len(found) // 2), _ALONE)

    def fill(first: int) -> None:
        part = slice(first, first + half)
        bits = np.zeros((WORDS + 2, ROWS + 2 * EDGE), np.uint64)
        wide = np.zeros((4, *bits.shape), np.uint64)
        near, edge, caps = lattice.near, lattice.edge, lattice.caps
        _solve_all(obstacles[part], lattice.record, near, edge, caps, inner, bits, wide, found[part])

    with ThreadPoolExecutor(2) as halves:  # kernels let go of Python
        list(halves.map(fill, range(0, len(found), half)))
    return found


def shortest_way(start: tuple[float, float], goal: tuple[float, float], tolerance: float) -> float:
    """Return a length [m] that no way to the goal undercuts: the straight line up to the tolerance.

    >>> shortest_way((0.0, 0.0), (3.0, 4.0), 0.5)
    4.5
    """
    return max(float(np.hypot(goal[0] - start[0], goal[1] - start[1])) - tolerance, 0.0)


@kernel
def _starts_in_contact(obstacles: Record, lattice: Record) -> bool:
    """Return whether the robot touches an obstacle at time 0."""
    for i in range(len(obstacles)):
        x, y = place_at(obstacles[i], 0)
        dx, dy = x - lattice.start_x, y - lattice.start_y
        if np.sqrt(dx * dx + dy * dy) <= lattice.robot_radius + obstacles[i].radius:
            return True
    return False


@kernel
def _solve_all(
    obstacles: Record, lattice: Record, near: Record, edge: Record, caps: Record, inner: bool,
    bits: Record, wide: Record, found: Record,
) -> None:  # fmt: skip
    """Fill `found` case by case; `bits` and `wide` are room for sets of places."""
    dx, dy = lattice.goal_x - lattice.start_x, lattice.goal_y - lattice.start_y
    far = np.sqrt(dx * dx + dy * dy)
    straight = max(far - lattice.tolerance, 0.0) / lattice.v_max
    share = lattice.v_max / far if straight > 0.0 else 0.0
    piece = nanoseconds(0.5 * lattice.step)
    for c in range(len(found)):
        case, out = obstacles[c], found[c]
        out.answer, out.earliest_outer, out.earliest_inner = UNSOLVABLE, np.inf, np.inf
        if straight > lattice.limit or _starts_in_contact(case, lattice):
            continue
        end = nanoseconds(straight)
        if leg_is_free(
            case, lattice.robot_radius, lattice.start_x, lattice.start_y, share * dx, share * dy, 0, end, piece
        ):
            out.answer, out.earliest_outer, out.earliest_inner = SOLVABLE, straight, straight
            continue
        outer = earliest_outer(case, lattice, near, edge, caps, bits, wide)
        if outer == np.inf:
            continue
        out.answer, out.earliest_outer = UNDECIDED, max(outer, straight)
        if not inner:
            continue
        by = earliest_inner(case, lattice, near, bits, wide)
        if by < np.inf:
            out.answer, out.earliest_inner = SOLVABLE, by

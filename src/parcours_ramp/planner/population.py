"""The population: members side by side, which of them is best, and whether a candidate may join.

Admission follows the published rules, with bounded search for a victim: never the best, never a feasible one for an
infeasible candidate. The worse of two drawn victims goes.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours.streams import Stream, below
from parcours_ramp.planner.messages import copy_path
from parcours_ramp.planner.trajectory import copy_trajectory

SAME_PATH = 0.05  # Paths whose knots all lie within this distance of each other are one [m]


@kernel
def best_member(members: Record, n: int) -> int:
    """Return the index of the fittest of the first n members; the first of equals."""
    best = 0
    for i in range(1, n):
        if members[i].trajectory.fitness > members[best].trajectory.fitness:
            best = i
    return best


@kernel
def is_same(one: Record, two: Record) -> bool:
    """Return whether two PATHs have the same knots, but for SAME_PATH; their starts do not count."""
    if one.n != two.n:
        return False
    for i in range(1, one.n):
        if (one.x[i] - two.x[i]) ** 2 + (one.y[i] - two.y[i]) ** 2 > SAME_PATH * SAME_PATH:
            return False
    return True


@kernel
def copy_member(target: Record, source: Record) -> None:
    """Make the target MEMBER equal to the source."""
    target.id = source.id
    target.put_off, target.heading = source.put_off, source.heading
    target.drift_x, target.drift_y = source.drift_x, source.drift_y
    copy_path(target.path, source.path)
    copy_trajectory(target.trajectory, source.trajectory, 0)


@kernel
def has_path(members: Record, n: int, path: Record) -> bool:
    """Return whether one of the first n members has this PATH already."""
    found = False
    for i in range(n):
        found = found or is_same(members[i].path, path)
    return found


@kernel
def may_join(members: Record, n: int, feasible: int, parameters: Record) -> bool:
    """Return whether a candidate with a new path may join the first n members.

    An infeasible one may not join a full population of feasible members.
    """
    may = n < parameters.population or feasible == 1
    for i in range(n):
        may = may or members[i].trajectory.feasible == 0
    return bool(may)


@kernel
def draw_victims(members: Record, n: int, best: int, feasible: int, stream: Stream) -> tuple[int, int]:
    """Draw two of the members that a candidate may replace, perhaps one twice; -1 for each that is not found."""
    first = -1
    for _ in range(4 * n):
        i = below(stream, n)
        if i == best or (feasible == 0 and members[i].trajectory.feasible == 1):
            continue
        if first >= 0:
            return first, i
        first = i
    return first, -1

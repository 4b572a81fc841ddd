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
    copy_path(target.path, source.path)
    copy_trajectory(target.trajectory, source.trajectory, 0)


@kernel
def offer(members: Record, n: int, candidate: Record, parameters: Record, stream: Stream) -> int:
    """Admit the candidate MEMBER if the rules allow; return the number of members afterwards.

    Args:
        members: array of MEMBER, the first n of which are in use.
    """
    any_infeasible = False
    for i in range(n):
        if is_same(members[i].path, candidate.path):
            return n
        any_infeasible = any_infeasible or members[i].trajectory.feasible == 0
    if n < parameters.population:
        copy_member(members[n], candidate)
        return n + 1
    if candidate.trajectory.feasible == 0 and not any_infeasible:
        return n
    best = best_member(members, n)
    victim = -1
    seen = 0
    for _ in range(4 * n):
        i = below(stream, n)
        if i == best or (candidate.trajectory.feasible == 0 and members[i].trajectory.feasible == 1):
            continue
        if victim < 0 or members[i].trajectory.fitness < members[victim].trajectory.fitness:
            victim = i
        seen += 1
        if seen == 2:
            break
    if victim >= 0:
        copy_member(members[victim], candidate)
    return n

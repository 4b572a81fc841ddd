"""From what the robot is doing to a member of the population: the way to switch, and the earliest time to do so.

Members begin where the robot will be after the longest control period (the anchor). A switch leaves the present motion
earlier, at a multiple of 0.1 s, and rounds the joint at the anchor. The next control cycle comes at the least, over all
members, of the latest time at which each can be joined smoothly (published).
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import MAX_KNOTS, SAMPLE
from parcours_ramp.planner.parameters import ORIGINAL
from parcours_ramp.planner.route import ENTERED, IMPOSSIBLE, LAID, NEVER, TRANSITION, enter, go_on, is_near
from parcours_ramp.planner.trajectory import pose_at
from parcours_ramp.planner.trajectory_generator import generate

EARLIEST = 0.2  # No switch comes earlier than this after a control cycle [s]


@kernel
def switch_path(path: Record, pose: Record, kind: int, out: Record) -> None:
    """Set `out` to the PATH as entered from the state `pose`: for a switch, the pose comes before the path's anchor."""
    more = 1 if kind == TRANSITION and path.n < MAX_KNOTS else 0
    out.n = path.n + more
    for i in range(path.n):
        out.x[i + more], out.y[i + more] = path.x[i], path.y[i]
    out.x[0], out.y[0] = pose.x, pose.y


@kernel
def take_up(planner: Record, trajectory: Record, kind: int) -> None:
    """Date a TRAJECTORY generated for a member from the planner's next switch, counting knots as the member does."""
    if kind == TRANSITION:
        for k in range(1, MAX_KNOTS):
            trajectory.knot_time[k - 1] = trajectory.knot_time[k]
    trajectory.begins = planner.t_next


@kernel
def generate_from_switch(planner: Record, path: Record, kind: int, trajectory: Record, parameters: Record) -> None:
    """Fill the TRAJECTORY that a member with this PATH would follow from the planner's next switch on."""
    switch_path(path, planner.switch, kind, planner.work_path)
    generate(planner.work_path, planner.switch, kind, parameters, planner.route, trajectory)
    take_up(planner, trajectory, kind)


@kernel
def may_leave_at(planner: Record, k: int, parameters: Record) -> bool:
    """Set planner.switch to sample k of moving_on; return whether another trajectory may begin there.

    A way begins without turning. The guarded schedule leaves the present one only where the robot turns so slowly that
    it can cease to within a sample; the published one leaves it anywhere.
    """
    pose_at(planner.moving_on, k * SAMPLE, planner.switch)
    return bool(parameters.schedule == ORIGINAL or abs(planner.switch.w) <= parameters.alpha_max * SAMPLE)


@kernel
def first_possible(planner: Record) -> int:
    """Return the earliest sample of moving_on at which another trajectory may begin."""
    elapsed = int((planner.t_control - planner.moving_on.begins) * 1e-9 / SAMPLE + 0.999)
    return elapsed + int(EARLIEST / SAMPLE + 0.5)


@kernel
def latest_switch(planner: Record, parameters: Record) -> int:
    """Return the last sample of moving_on within the longest period at which another trajectory may begin."""
    longest = int(parameters.control_period / SAMPLE + 0.5)
    for k in range(longest, first_possible(planner) - 1, -1):
        if may_leave_at(planner, k, parameters):
            return k
    return longest


@kernel
def earliest_switch(planner: Record, followed: int, latest: int, parameters: Record) -> int:
    """Return the sample of moving_on at which the next control cycle comes; the latest if nothing can switch earlier.

    Args:
        followed: the index of the member that moving_on comes from, which needs no switch.
    """
    route, switch = planner.route, planner.switch
    earliest = latest
    for i in range(planner.n):
        planner.members[i].switches = 1 if i != followed else 0
    for k in range(latest - 1, first_possible(planner) - 1, -1):
        if not may_leave_at(planner, k, parameters):
            continue
        entered, is_shared = IMPOSSIBLE, False
        for i in range(planner.n):
            member = planner.members[i]
            path = member.path
            if member.switches == 0:
                continue
            if not is_shared or path.n == MAX_KNOTS:
                entered = enter(path, 0 if path.n < MAX_KNOTS else 1, switch, NEVER, parameters, route)
                # Paths begin at one anchor: if all lead to it first, all are entered alike.
                is_shared = path.n < MAX_KNOTS and not is_near(path, 0, switch.x, switch.y)
            laid = go_on(path, switch.v, TRANSITION, parameters, route) if entered == ENTERED else entered
            if laid == LAID:
                member.switches = 0
                earliest = k
    return earliest

"""From what the robot is doing to a member of the population: the way to switch, and the earliest time to do so.

Members begin where the robot will be after the longest control period (the anchor). A switch leaves the present motion
earlier, at a multiple of 0.1 s, and rounds the joint at the anchor. The next control cycle comes at the least, over all
members, of the latest time at which each can be joined smoothly (published).
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours.planners.ramp.messages import MAX_KNOTS, SAMPLE, copy_path
from parcours.planners.ramp.path_modification import insert_knot
from parcours.planners.ramp.route import TRANSITION, can_switch
from parcours.planners.ramp.trajectory import pose_at
from parcours.planners.ramp.trajectory_generator import generate

EARLIEST = 0.2
"""No switch comes earlier than this after a control cycle [s]."""


@kernel
def switch_path(path: Record, pose: Record, kind: int, out: Record) -> None:
    """Set `out` to the PATH as entered from the state `pose`: for a switch, the pose comes before the path's anchor."""
    copy_path(out, path)
    if kind == TRANSITION and out.n < MAX_KNOTS:
        insert_knot(out, 0, pose.x, pose.y)
    else:
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
def earliest_switch(planner: Record, followed: int, parameters: Record) -> int:
    """Return the sample of moving_on at which the next control cycle comes; the longest period if nothing can switch.

    Args:
        planner: PLANNER with anchor and moving_on set.
        followed: the index of the member that moving_on comes from, which needs no switch.
        parameters: PARAMETERS.
    """
    longest = int(parameters.control_period / SAMPLE + 0.5)
    elapsed = int((planner.t_control - planner.moving_on.begins) * 1e-9 / SAMPLE + 0.999)
    earliest = longest
    for i in range(planner.n):
        if i == followed:
            continue
        for k in range(longest - 1, elapsed + int(EARLIEST / SAMPLE + 0.5) - 1, -1):
            pose_at(planner.moving_on, k * SAMPLE, planner.switch)
            switch_path(planner.members[i].path, planner.switch, TRANSITION, planner.work_path)
            if can_switch(planner.work_path, planner.switch, parameters, planner.route):
                earliest = min(earliest, k)
                break
    return earliest

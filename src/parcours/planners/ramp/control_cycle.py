"""The control cycle: commit to the best member, and re-anchor the population where the robot will be at the next one."""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours.planners.ramp.guard import evaluate_moving_on, is_imminent
from parcours.planners.ramp.messages import SAMPLE, copy_trajectory, pose_at
from parcours.planners.ramp.path_modification import remove_knot
from parcours.planners.ramp.planning_cycle import MOVING
from parcours.planners.ramp.population import best_member
from parcours.planners.ramp.route import HYBRID, TRANSITION
from parcours.planners.ramp.sensing_cycle import evaluate_population
from parcours.planners.ramp.switching import earliest_switch, generate_from_switch
from parcours.planners.ramp.trajectory_generator import generate

DRAGGED = 0.01
"""A trajectory that was dragged farther than this [m] is generated anew rather than continued."""


@kernel
def is_at_rest(planner: Record) -> bool:
    """Return whether the robot stands, by its last report."""
    return abs(planner.latest.v) < MOVING and abs(planner.latest.w) < MOVING


@kernel
def commit(planner: Record, now: int, parameters: Record) -> int:
    """Make the best member's trajectory what the robot is told to do (moving_on); return the member's index.

    The published system counts its times from now; the guarded one from when it was planned to begin, unless the robot
    stands and begins now.
    """
    best = best_member(planner.members, planner.n)
    member = planner.members[best]
    if member.id != planner.followed:
        planner.n_switches += 1
        planner.followed = member.id
    copy_trajectory(planner.moving_on, member.trajectory, 0)
    for i in range(planner.moving_on.n):
        planner.moving_on.x[i] += planner.drift_x
        planner.moving_on.y[i] += planner.drift_y
    planner.dragged = 1 if max(abs(planner.drift_x), abs(planner.drift_y)) > DRAGGED else 0
    if parameters.schedule == 0 or planner.halted or planner.moving_on.begins > now:
        planner.moving_on.begins = now
    planner.t_control = now
    planner.t_next = now + int(parameters.control_period * 1e9)
    planner.drift_x = planner.drift_y = 0.0
    return best


@kernel
def re_anchor_halted(planner: Record, now: int, parameters: Record) -> None:
    """Let every member begin, at rest, where the robot stands (reset start)."""
    period = parameters.halted_period if parameters.schedule == 1 else parameters.control_period
    planner.t_next = now + int(period * 1e9)
    if not is_at_rest(planner):
        return
    planner.rested = 1
    planner.anchor = planner.latest
    planner.anchor.v = planner.anchor.w = 0.0
    planner.switch = planner.anchor
    planner.switch_kind = HYBRID
    for i in range(planner.n):
        member = planner.members[i]
        member.path.x[0], member.path.y[0] = planner.anchor.x, planner.anchor.y
        generate_from_switch(planner, member.path, member.trajectory, parameters)
        member.trajectory.id = member.id


@kernel
def re_anchor(planner: Record, best: int, now: int, parameters: Record) -> None:
    """Let every member begin where moving_on leads, and set the time of the next control cycle (adaptation)."""
    moving_on = planner.moving_on
    longest = int(parameters.control_period / SAMPLE + 0.5)
    pose_at(moving_on, longest * SAMPLE, planner.anchor)
    path = planner.members[best].path
    while path.n > 2 and moving_on.knot_time[1] <= longest * SAMPLE:
        remove_knot(path, 1)
        for k in range(1, len(moving_on.knot_time) - 1):
            moving_on.knot_time[k] = moving_on.knot_time[k + 1]
    for i in range(planner.n):
        planner.members[i].path.x[0], planner.members[i].path.y[0] = planner.anchor.x, planner.anchor.y
    at = earliest_switch(planner, best, parameters)
    planner.t_next = moving_on.begins + at * 100_000_000
    planner.switch_kind = HYBRID if at == longest else TRANSITION
    pose_at(moving_on, at * SAMPLE, planner.switch)
    goes_on = moving_on.curve_end > at * SAMPLE or moving_on.rest_length == 0.0
    for i in range(planner.n):
        member = planner.members[i]
        if i == best and goes_on and not planner.dragged and at < moving_on.n:
            copy_trajectory(member.trajectory, moving_on, at)
            member.trajectory.begins = planner.t_next
        elif i == best:
            generate(path, planner.switch, HYBRID, parameters, planner.route, member.trajectory)
            member.trajectory.begins = planner.t_next
        else:
            generate_from_switch(planner, member.path, member.trajectory, parameters)
        member.trajectory.id = member.id


@kernel
def control_cycle(planner: Record, predictions: Record, now: int, parameters: Record) -> None:
    """Run one whole control cycle. Afterwards moving_on is what to publish and t_next says when the next one is due.

    The guarded schedule resumes only with a trajectory that begins at rest where the robot stands.
    """
    best = commit(planner, now, parameters)
    evaluate_moving_on(planner, predictions, now, parameters)
    starts_at_rest = planner.rested == 1 or parameters.schedule == 0
    if planner.halted and starts_at_rest and not is_imminent(planner, now, parameters):
        planner.halted = 0
    if planner.halted:
        re_anchor_halted(planner, now, parameters)
    else:
        planner.rested = 0
        re_anchor(planner, best, now, parameters)
    evaluate_population(planner, predictions, parameters)

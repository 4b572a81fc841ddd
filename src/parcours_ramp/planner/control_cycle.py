"""The control cycle: commit to the best member, and re-anchor the population where the robot will be next time."""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.guard import evaluate_moving_on, is_imminent
from parcours_ramp.planner.late_evaluation import catch_up_with_best
from parcours_ramp.planner.messages import SAMPLE
from parcours_ramp.planner.parameters import GUARDED, ORIGINAL
from parcours_ramp.planner.path_modification import remove_knot
from parcours_ramp.planner.planning_cycle import MOVING
from parcours_ramp.planner.population import best_member
from parcours_ramp.planner.route import HYBRID, TRANSITION
from parcours_ramp.planner.sensing_cycle import evaluate_population
from parcours_ramp.planner.switching import earliest_switch, generate_from_switch, latest_switch
from parcours_ramp.planner.trajectory import copy_trajectory, pose_at, shift

DRAGGED = 0.01  # A trajectory that was dragged farther than this [m] is generated again rather than continued


@kernel
def is_at_rest(planner: Record) -> bool:
    """Return whether the robot stands, by its last report."""
    return bool(abs(planner.latest.v) < MOVING and abs(planner.latest.w) < MOVING)


@kernel
def commit(planner: Record, now: int, parameters: Record) -> int:
    """Make the best member's trajectory what the robot is to do (moving_on); return the member's index.

    The published system counts its times from now; the guarded one from when it was planned to begin, unless the robot
    stands and begins now.
    """
    best = best_member(planner.members, planner.n)
    member = planner.members[best]
    if member.id != planner.followed:
        planner.n_switches += 1
        planner.followed = member.id
    copy_trajectory(planner.moving_on, member.trajectory, 0)
    planner.moving_on.epoch = 0  # its slack was found for the margin of plans
    planner.moving_on.lag = planner.lag
    shift(planner.moving_on, planner.drift_x, planner.drift_y)
    planner.dragged = 1 if max(abs(planner.drift_x), abs(planner.drift_y)) > DRAGGED else 0
    if parameters.schedule == ORIGINAL or planner.halted or planner.moving_on.begins > now:
        planner.moving_on.begins = now
    planner.t_control = now
    planner.t_next = now + int(parameters.control_period * 1e9)
    planner.drift_x = planner.drift_y = 0.0
    return best


@kernel
def clears(planner: Record, now: int, parameters: Record) -> bool:
    """Return whether the halt ends with this control cycle.

    The guarded schedule resumes only with a trajectory that begins at rest where the robot stands.
    """
    starts_at_rest = planner.rested == 1 or parameters.schedule == ORIGINAL
    return planner.halted == 1 and starts_at_rest and not is_imminent(planner, now, parameters)


@kernel
def rest(planner: Record, now: int, parameters: Record) -> bool:
    """Let every member begin, at rest, where the robot stands (reset start); return False while it still moves."""
    period = parameters.halted_period if parameters.schedule == GUARDED else parameters.control_period
    planner.t_next = now + int(period * 1e9)
    if not is_at_rest(planner):
        return False
    planner.rested = 1
    planner.anchor = planner.latest
    planner.anchor.v = planner.anchor.w = 0.0
    planner.switch = planner.anchor
    planner.switch_kind = HYBRID
    _begin_paths_at_anchor(planner)
    return True


@kernel
def re_anchor(planner: Record, best: int, parameters: Record) -> bool:
    """Let every member begin where moving_on leads, and set the time of the next control cycle (adaptation).

    Returns:
        Whether the best member goes on with what is left of moving_on. The others, and the best if it does not, need
        new trajectories from the switch.
    """
    moving_on = planner.moving_on
    planner.rested = 0
    latest = latest_switch(planner, parameters)
    pose_at(moving_on, latest * SAMPLE, planner.anchor)
    path = planner.members[best].path
    while path.n > 2 and moving_on.knot_time[1] <= latest * SAMPLE:
        remove_knot(path, 1)
        for k in range(1, len(moving_on.knot_time) - 1):
            moving_on.knot_time[k] = moving_on.knot_time[k + 1]
    _begin_paths_at_anchor(planner)
    at = earliest_switch(planner, best, latest, parameters)
    planner.t_next = moving_on.begins + at * 100_000_000
    planner.switch_kind = HYBRID if at == latest else TRANSITION
    pose_at(moving_on, at * SAMPLE, planner.switch)
    is_complete = moving_on.curve_end > at * SAMPLE or moving_on.rest_length == 0.0
    if not is_complete or planner.dragged or at >= moving_on.n:
        return False
    copy_trajectory(planner.members[best].trajectory, moving_on, at)
    planner.members[best].trajectory.begins = planner.t_next
    planner.members[best].trajectory.epoch = 0  # its slack was found for the guard's margin
    return True


@kernel
def _begin_paths_at_anchor(planner: Record) -> None:
    for i in range(planner.n):
        planner.members[i].path.x[0], planner.members[i].path.y[0] = planner.anchor.x, planner.anchor.y


@kernel
def entry_kind(planner: Record, i: int, best: int) -> int:
    """Return the kind of way by which member i is entered: the best one needs no switch."""
    return HYBRID if i == best else int(planner.switch_kind)


@kernel
def adapt(planner: Record, best: int, now: int, parameters: Record) -> tuple[bool, int]:
    """Decide on the halt and re-anchor the population.

    Returns:
        (whether the members need new trajectories, the index of the one that goes on without; -1 for none).
    """
    if clears(planner, now, parameters):
        planner.halted = 0
    if planner.halted:
        return rest(planner, now, parameters), -1
    goes_on = re_anchor(planner, best, parameters)
    return True, best if goes_on else -1


@kernel
def control_cycle(planner: Record, predictions: Record, now: int, parameters: Record) -> bool:
    """Run one whole control cycle. Afterwards moving_on is what to publish and t_next says when the next one is due.

    Returns:
        Whether new trajectories were generated.
    """
    catch_up_with_best(planner, predictions, parameters)
    best = commit(planner, now, parameters)
    evaluate_moving_on(planner, predictions, now, planner.epoch, parameters)
    adapted, kept = adapt(planner, best, now, parameters)
    for i in range(planner.n):
        if adapted and i != kept:
            member = planner.members[i]
            generate_from_switch(planner, member.path, entry_kind(planner, i, best), member.trajectory, parameters)
            member.trajectory.id = member.id
    evaluate_population(planner, predictions, parameters)
    return adapted

"""The planning cycle, 20 times a second: correct for what the robot really did, then try to better the population.

The steps are kernels of their own because in the component form messages to Path Modification, Trajectory Generator and
Trajectory Evaluation pass between them; the compiled form calls them in a row.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours.streams import Stream, below
from parcours_ramp.planner.late_evaluation import catch_up_with_best, evaluate_member, is_fitter
from parcours_ramp.planner.messages import copy_path
from parcours_ramp.planner.parameters import ORIGINAL
from parcours_ramp.planner.path_modification import CROSSOVER, MOVE, OPERATORS, applies, modify
from parcours_ramp.planner.population import best_member, copy_member, draw_victims, has_path, may_join
from parcours_ramp.planner.switching import generate_from_switch
from parcours_ramp.planner.trajectory import place_at

TURNING = 0.1  # Above this yaw rate [rad/s] a moving robot's error is not corrected for
MOVING = 0.01  # Above this speed the robot moves [m/s]

N_OPERATORS = len(OPERATORS)


@kernel
def compensate(planner: Record, parameters: Record) -> None:
    """Drag the plans onto the robot: drift = measured minus planned position at the last report (error compensation).

    The published system leaves it while the robot turns as it moves.
    """
    if planner.halted or planner.moving_on.n == 0 or planner.t_latest < planner.moving_on.begins:
        return
    turns = abs(planner.latest.w) > TURNING and abs(planner.latest.v) > MOVING
    if turns and parameters.schedule == ORIGINAL:
        return
    x, y = place_at(planner.moving_on, (planner.t_latest - planner.moving_on.begins) * 1e-9)
    planner.drift_x, planner.drift_y = planner.latest.x - x, planner.latest.y - y


@kernel
def choose_modification(planner: Record) -> None:
    """Choose operator and parents into planner.request; while halted always `move` on the best path.

    The operator is drawn among those that change the drawn path.
    """
    request = planner.request
    request.direction, request.distance = planner.near_direction, planner.near_distance
    if planner.halted and planner.knows_obstacles:
        request.operator = MOVE
        copy_path(request.first, planner.members[best_member(planner.members, planner.n)].path)
        return
    first = below(planner.stream, planner.n)
    copy_path(request.first, planner.members[first].path)
    n_choices = 0
    for operator in range(N_OPERATORS):
        if _can(planner, operator, request.first.n):
            n_choices += 1
    choice = below(planner.stream, n_choices)
    for operator in range(N_OPERATORS):
        if _can(planner, operator, request.first.n):
            if choice == 0:
                request.operator = operator
            choice -= 1
    if request.operator == CROSSOVER:
        second = below(planner.stream, planner.n - 1)
        if second >= first:
            second += 1
        copy_path(request.second, planner.members[second].path)


@kernel
def _can(planner: Record, operator: int, n: int) -> bool:
    """Return whether the operator can be asked for on a path of n knots."""
    if operator == CROSSOVER and planner.n < 2:
        return False
    if operator == MOVE and not planner.knows_obstacles:
        return False
    return applies(operator, n)


@kernel
def set_candidate(planner: Record, path: Record) -> None:
    """Make the PATH the candidate's, anchored where the population is."""
    copy_path(planner.candidate.path, path)
    planner.candidate.path.x[0], planner.candidate.path.y[0] = planner.anchor.x, planner.anchor.y
    planner.candidate.id = planner.next_id
    planner.next_id += 1


@kernel
def is_known(planner: Record) -> bool:
    """Return whether a member has the candidate's path: then it may not join, whatever its trajectory."""
    return bool(has_path(planner.members, planner.n, planner.candidate.path))


@kernel
def offer_candidate(planner: Record, predictions: Record, parameters: Record) -> None:
    """Let the evaluated candidate, whose path no member has, join the population if the rules allow.

    Args:
        predictions: array of PREDICTION; of length 0 if no evaluation was put off.
    """
    members, n, candidate = planner.members, planner.n, planner.candidate
    if not may_join(members, n, candidate.trajectory.feasible, parameters):
        return
    candidate.trajectory.id = candidate.id
    if n < parameters.population:
        copy_member(members[n], candidate)
        planner.n = n + 1
        return
    best = catch_up_with_best(planner, predictions, parameters)
    victim, other = draw_victims(members, n, best, candidate.trajectory.feasible, planner.stream)
    if other not in (-1, victim) and is_fitter(planner, members[victim], members[other], predictions, parameters):
        victim = other
    if victim >= 0:
        copy_member(members[victim], candidate)


@kernel
def planning_cycle(
    planner: Record, predictions: Record, parameters: Record, modifier: Stream, one: Record, two: Record
) -> int:
    """Run one whole planning cycle; return how many candidates it made.

    Args:
        predictions: array of PREDICTION, one an obstacle (of length 0 before the first message).
    """
    compensate(planner, parameters)
    if planner.halted:
        catch_up_with_best(planner, predictions, parameters)
    choose_modification(planner)
    n = modify(planner.request, parameters, modifier, one, two)
    for k in range(n):
        set_candidate(planner, one if k == 0 else two)
        if is_known(planner):
            continue
        trajectory = planner.candidate.trajectory
        generate_from_switch(planner, planner.candidate.path, planner.switch_kind, trajectory, parameters)
        evaluate_member(planner, planner.candidate, predictions, parameters)
        offer_candidate(planner, predictions, parameters)
    return int(n)

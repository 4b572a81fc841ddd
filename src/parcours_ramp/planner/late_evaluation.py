"""Evaluations that are put off until their result is needed: those of members that are infeasible in any case.

A moving robot cannot follow a trajectory that it cannot join without a stop. Only a search for collisions tells how bad
such a member is, but most are replaced, or evaluated again, before that matters; until then its fitness is the greatest
that it can be. What was put off is done before predictions, or the times at which trajectories begin, change.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.population import best_member
from parcours_ramp.planner.trajectory_evaluation import assume, evaluate


@kernel
def evaluate_member(planner: Record, member: Record, predictions: Record, parameters: Record) -> None:
    """Evaluate the MEMBER, or put that off if it is infeasible in any case."""
    trajectory, heading, halted = member.trajectory, planner.latest.heading, planner.halted == 1
    member.put_off = 0
    epoch, drift_x, drift_y = planner.epoch, planner.drift_x, planner.drift_y
    if trajectory.smooth == 0 and not halted and epoch.number > 0:
        member.put_off = 1
        member.drift_x, member.drift_y, member.heading = drift_x, drift_y, heading
        assume(trajectory, heading, parameters)
        return
    evaluate(trajectory, predictions, epoch, drift_x, drift_y, heading, halted, parameters)


@kernel
def catch_up(planner: Record, member: Record, predictions: Record, parameters: Record) -> None:
    """If the evaluation of the MEMBER was put off, evaluate it now, with the drift and heading of then."""
    if member.put_off == 0:
        return
    member.put_off = 0
    evaluate(
        member.trajectory, predictions, planner.epoch, member.drift_x, member.drift_y, member.heading, False, parameters
    )


@kernel
def catch_up_with_all(planner: Record, predictions: Record, parameters: Record) -> None:
    """Evaluate all members whose evaluation was put off."""
    for i in range(planner.n):
        catch_up(planner, planner.members[i], predictions, parameters)


@kernel
def catch_up_with_best(planner: Record, predictions: Record, parameters: Record) -> int:
    """Return the index of the fittest member, after evaluating those that were put off and might be it."""
    best = best_member(planner.members, planner.n)
    while planner.members[best].put_off == 1:
        catch_up(planner, planner.members[best], predictions, parameters)
        best = best_member(planner.members, planner.n)
    return int(best)


@kernel
def is_fitter(planner: Record, one: Record, two: Record, predictions: Record, parameters: Record) -> bool:
    """Return whether one MEMBER is fitter than another, after evaluating what was put off as far as that matters."""
    if one.trajectory.fitness > two.trajectory.fitness:
        catch_up(planner, one, predictions, parameters)
    if one.trajectory.fitness <= two.trajectory.fitness:
        catch_up(planner, two, predictions, parameters)
    if one.trajectory.fitness > two.trajectory.fitness:
        catch_up(planner, one, predictions, parameters)
    return bool(one.trajectory.fitness > two.trajectory.fitness)

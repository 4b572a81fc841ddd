"""Evaluations that are put off until their result is needed: those of members that are infeasible in any case.

A moving robot cannot follow a trajectory that it cannot join without a stop. Only a search for collisions tells how bad
such a member is, but most are replaced, or evaluated again, before that matters. What was put off is done before
predictions, or the times at which trajectories begin, change.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.population import best_member
from parcours_ramp.planner.trajectory_evaluation import evaluate, fitness_limit


@kernel
def evaluate_member(planner: Record, member: Record, predictions: Record, parameters: Record) -> None:
    """Evaluate the MEMBER, or put that off if it is infeasible in any case."""
    trajectory, heading, halted = member.trajectory, planner.latest.heading, planner.halted == 1
    member.put_off = 0
    if trajectory.smooth == 0 and not halted and planner.epoch > 0:
        member.put_off = 1
        member.drift_x, member.drift_y, member.heading = planner.drift_x, planner.drift_y, heading
        trajectory.feasible, trajectory.fitness = 0, 0.0
        return
    evaluate(
        trajectory, predictions, planner.epoch, planner.changed, planner.drift_x, planner.drift_y, heading, halted,
        parameters,
    )  # fmt: skip


@kernel
def catch_up(planner: Record, member: Record, predictions: Record, parameters: Record) -> None:
    """If the evaluation of the MEMBER was put off, evaluate it now, with the drift and heading of then."""
    if member.put_off == 0:
        return
    member.put_off = 0
    evaluate(
        member.trajectory, predictions, planner.epoch, planner.changed, member.drift_x, member.drift_y, member.heading,
        False, parameters,
    )  # fmt: skip


@kernel
def catch_up_with_all(planner: Record, predictions: Record, parameters: Record) -> None:
    """Evaluate all members whose evaluation was put off."""
    for i in range(planner.n):
        catch_up(planner, planner.members[i], predictions, parameters)


@kernel
def catch_up_with_best(planner: Record, predictions: Record, parameters: Record) -> int:
    """Return the index of the fittest member; if one that was put off might be it, evaluate all of them first."""
    best = best_member(planner.members, planner.n)
    if planner.members[best].trajectory.fitness > fitness_limit(parameters):
        return int(best)
    catch_up_with_all(planner, predictions, parameters)
    return int(best_member(planner.members, planner.n))

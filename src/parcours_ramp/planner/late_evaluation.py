"""Evaluations that are put off until somebody asks: those of members that are infeasible, whomever they meet.

A moving robot cannot follow a trajectory that it cannot join without a stop. How bad such a member is, only a look at
the obstacles tells; but most are replaced, or evaluated again, before anybody asks. Before predictions or the times of
trajectories change, members are caught up with.
"""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.population import best_member
from parcours_ramp.planner.trajectory_evaluation import evaluate, fittest_stop


@kernel
def evaluate_member(planner: Record, member: Record, predictions: Record, parameters: Record) -> None:
    """Evaluate the MEMBER, or put that off."""
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
    """Evaluate the MEMBER as it would have been evaluated when that was put off, if it was."""
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
    """Evaluate all members if one that was put off might be the fittest, and return the index of the one that is."""
    best = best_member(planner.members, planner.n)
    if planner.members[best].trajectory.fitness > fittest_stop(parameters):
        return int(best)
    catch_up_with_all(planner, predictions, parameters)
    return int(best_member(planner.members, planner.n))

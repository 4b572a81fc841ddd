"""Trajectory Evaluation: a trajectory and predicted obstacles -> feasible or not, and how fit (component 3)."""

from __future__ import annotations

import numpy as np

from parcours.elementary import PI, wrap
from parcours.kernels import Record, kernel
from parcours_ramp.planner.collision import collision_time, earliest_collision
from parcours_ramp.planner.messages import NO_COLLISION, SAMPLE, EvaluationRequest, EvaluationResponse
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.service import Service

MODEST_TURN = 0.1  # Least angle an orientation penalty counts [rad]


@kernel
def passes_up_to(trajectory: Record, epoch: int, changed: float, drift_x: float, drift_y: float) -> int:
    """Return up to which sample the slack that was left at the last look makes it sure that nobody is met."""
    if epoch == 0 or trajectory.epoch != epoch:
        return 0
    dx, dy = drift_x - trajectory.drift_x, drift_y - trajectory.drift_y
    moved = np.sqrt(dx * dx + dy * dy) + changed - trajectory.changed
    return int(trajectory.valid_until) if moved < trajectory.slack else 0


@kernel
def remember(
    trajectory: Record, epoch: int, changed: float, drift_x: float, drift_y: float, slack: float, valid_until: int
) -> None:
    """Keep what a look at all samples from the first on has found, for `passes_up_to`."""
    trajectory.epoch, trajectory.changed, trajectory.drift_x, trajectory.drift_y = epoch, changed, drift_x, drift_y
    trajectory.slack, trajectory.valid_until = slack, max(valid_until, 0)


@kernel
def _first_meeting(
    trajectory: Record, predictions: Record, epoch: int, changed: float, drift_x: float, drift_y: float,
    parameters: Record,
) -> float:  # fmt: skip
    """Return when the trajectory first meets any obstacle [s]; looks only at what the last look leaves open."""
    first = passes_up_to(trajectory, epoch, changed, drift_x, drift_y)
    if first >= trajectory.n:
        return NO_COLLISION
    # It most likely meets again what it met at the last look, so look no farther than that at first.
    likely = max(int(min(trajectory.t_collision / SAMPLE, float(trajectory.n))), first) + 2
    for last in (min(likely, trajectory.n), trajectory.n):
        earliest, slack, valid_until = earliest_collision(
            trajectory, trajectory.begins, first, last, predictions, drift_x, drift_y, parameters.plan_margin,
            bool(parameters.may_leave) and first == 0, parameters,
        )  # fmt: skip
        if earliest < last or last == trajectory.n:
            break
    if first == 0:
        remember(trajectory, epoch, changed, drift_x, drift_y, slack, valid_until)
    return earliest * SAMPLE if earliest < trajectory.n else NO_COLLISION


@kernel
def fitness_limit(parameters: Record) -> float:
    """Return the greatest fitness that a trajectory can have if a moving robot must stop to join it."""
    return float(1.0 / max(parameters.q_orientation * MODEST_TURN / PI, 1.0))


@kernel
def evaluate(
    trajectory: Record, predictions: Record, epoch: int, changed: float, drift_x: float, drift_y: float, heading: float,
    halted: bool, parameters: Record,
) -> None:  # fmt: skip
    """Set feasible, fitness and t_collision of the trajectory.

    Feasible: no collision at samples or between them, and joined without a stop while the robot moves. The fitness is
    1 / cost; the cost of a feasible trajectory is its time plus the share of a half turn to its first heading, the rest
    of the way at the estimated speeds. Infeasible ones come after all feasible ones, by time to collision; one
    at once costs as much as one in 1 s (published).

    Args:
        epoch: a number that changes whenever an obstacle does what was not predicted; 0 if unknown.
        changed: by how much predictions have changed since, at most [m].
        drift_x: correction of planned towards measured position [m].
        heading: the robot's heading now [rad].
        halted: whether the robot is stopped for imminent collision; then orientation costs nothing.
    """
    t = _first_meeting(trajectory, predictions, epoch, changed, drift_x, drift_y, parameters)
    angle = abs(wrap(trajectory.first_heading - heading))
    cost = (
        trajectory.duration
        + trajectory.rest_length / parameters.estimate_v
        + trajectory.rest_turn / parameters.estimate_w
        + angle / PI
    )
    must_stop = trajectory.smooth == 0 and not halted
    if t < NO_COLLISION:
        cost += parameters.q_collision / (max(t, SAMPLE) if t > 0.0 else 1.0)
    if must_stop:
        cost += parameters.q_orientation * max(angle, MODEST_TURN) / PI
    trajectory.t_collision = t
    trajectory.feasible = 1 if t >= NO_COLLISION and not must_stop else 0
    trajectory.fitness = 1.0 / max(cost, 1.0)


class TrajectoryEvaluation(Service):
    """The component: answers evaluation requests, one at a time, and keeps nothing in between."""

    name = "TrajectoryEvaluation"
    machine, takes, gives = 3, EvaluationRequest, "evaluation_response"

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters.record()

    def answer(self, request: EvaluationRequest) -> EvaluationResponse:
        """Return what `evaluate` finds, or the collision time within the window alone."""
        trajectories, predictions = request.trajectories.copy(), request.predictions
        drift_x, drift_y = request.drift
        for k in range(len(trajectories)):
            if request.window is None:
                evaluate(
                    trajectories[k], predictions, 0, 0.0, drift_x, drift_y, request.heading, request.halted,
                    self._parameters,
                )  # fmt: skip
                continue
            begins, first, last, margin, may_leave = request.window
            trajectories[k].t_collision = collision_time(
                trajectories[k], begins, first, last, predictions, drift_x, drift_y, margin, may_leave, self._parameters
            )
        return EvaluationResponse(
            request.tag, trajectories.feasible.copy(), trajectories.fitness.copy(), trajectories.t_collision.copy()
        )

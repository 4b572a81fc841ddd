"""Trajectory Evaluation: a trajectory and predicted obstacles -> feasible or not, and how fit (component 3)."""

from __future__ import annotations

import numpy as np

from parcours.elementary import PI, wrap
from parcours.kernels import Record, kernel
from parcours_ramp.planner.collision import collision_time, earliest_collision
from parcours_ramp.planner.messages import (
    EPOCH,
    MAX_SAMPLES,
    NO_COLLISION,
    SAMPLE,
    EvaluationRequest,
    EvaluationResponse,
    one,
)
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.prediction import predicted_until
from parcours_ramp.planner.service import Service

MODEST_TURN = 0.1  # Least angle an orientation penalty counts [rad]


@kernel
def _moved(trajectory: Record, drift_x: float, drift_y: float) -> float:
    """Return by how much the robot's drift has changed since the last look [m]."""
    dx, dy = drift_x - trajectory.drift_x, drift_y - trajectory.drift_y
    return float(np.sqrt(dx * dx + dy * dy))


@kernel
def _strayed(trajectory: Record, begins: int, epoch: Record) -> float:
    """Return by how much predictions have changed since the last look, but for the ends of their ways [m].

    A prediction tells nothing of the time before it was made, when the obstacle was elsewhere.
    """
    return float(epoch.strayed - trajectory.strayed + epoch.fastest * max(epoch.stamp - begins, 0) * 1e-9)


@kernel
def known_up_to(
    trajectory: Record, begins: int, epoch: Record, drift_x: float, drift_y: float, late: float = 0.0
) -> int:
    """Return up to which sample a look would surely find what the last look did: nobody is met before `met_at`.

    Args:
        begins: when the first sample that matters is reached [ns].
        epoch: EPOCH of the predictions.
        late: how far obstacles may be along at every sample since the last look [m].
    """
    if epoch.number == 0 or trajectory.epoch != epoch.number:
        return 0
    moved = _moved(trajectory, drift_x, drift_y) + late
    strayed = moved + _strayed(trajectory, begins, epoch)
    if strayed >= trajectory.slack:
        return 0
    up_to = trajectory.looked if strayed < trajectory.tight else trajectory.valid_until
    if moved + epoch.changed - trajectory.changed < trajectory.later:
        return int(up_to)
    return int(min(up_to, trajectory.sure_until))


@kernel
def remember(
    trajectory: Record, begins: int, looked: int, found: tuple[int, int, float, float, float], predictions: Record,
    epoch: Record, drift_x: float, drift_y: float,
) -> None:  # fmt: skip
    """Keep, for `known_up_to`, what `earliest_collision` has found in a look from the first sample that matters on.

    Args:
        begins: when sample 0 was taken to be reached [ns].
        looked: up to which sample it looked.
    """
    trajectory.looked = looked
    trajectory.met_at, valid_until, trajectory.slack, trajectory.tight, trajectory.later = found
    trajectory.valid_until = max(valid_until, 0)
    trajectory.epoch, trajectory.drift_x, trajectory.drift_y = epoch.number, drift_x, drift_y
    # Where others have looked ahead of the planner, its own next predictions may go back on that.
    trajectory.changed, trajectory.strayed = epoch.changed - 2.0 * epoch.ahead, epoch.strayed - 2.0 * epoch.ahead
    until = 1.0 * MAX_SAMPLES
    for k in range(len(predictions)):
        until = min(until, predicted_until(predictions[k], begins))
    trajectory.sure_until = int(max(until, 0.0))


@kernel
def _first_meeting(
    trajectory: Record, predictions: Record, epoch: Record, drift_x: float, drift_y: float, parameters: Record
) -> float:
    """Return when the trajectory first meets any obstacle [s]; looks only at what the last look leaves open."""
    begins, n = trajectory.begins, trajectory.n
    first = known_up_to(trajectory, begins, epoch, drift_x, drift_y)
    if trajectory.met_at < first:
        return float(trajectory.met_at * SAMPLE)
    if first >= n:
        return NO_COLLISION
    # It most likely meets again what it met at the last look, so look no farther than that at first.
    likely = max(int(min(trajectory.t_collision / SAMPLE, float(n))), first) + 2
    may_leave = bool(parameters.may_leave) and first == 0
    for last in (min(likely, n), n):
        found = earliest_collision(
            trajectory, begins, first, last, predictions, drift_x, drift_y, parameters.plan_margin, may_leave,
            parameters,
        )  # fmt: skip
        if found[0] < last or last == n:
            break
    if first == 0:
        remember(trajectory, begins, n, found, predictions, epoch, drift_x, drift_y)
    else:  # what was known before still holds as far as it did
        trajectory.looked, trajectory.met_at = n, found[0]
        moved = _moved(trajectory, drift_x, drift_y)
        tight = trajectory.slack if first <= trajectory.valid_until else trajectory.tight
        later = np.inf if first <= trajectory.sure_until else trajectory.later
        trajectory.valid_until = min(trajectory.valid_until, first)
        trajectory.tight = min(tight, found[3] - moved)
        trajectory.later = min(later, found[4] - moved + epoch.changed - trajectory.changed)
    return found[0] * SAMPLE if found[0] < n else NO_COLLISION


@kernel
def _fitness(trajectory: Record, heading: float, must_stop: bool, t: float, parameters: Record) -> float:
    """Return the fitness of a trajectory that meets somebody after t [s], NO_COLLISION if nobody."""
    angle = abs(wrap(trajectory.first_heading - heading))
    cost = (
        trajectory.duration
        + trajectory.rest_length / parameters.estimate_v
        + trajectory.rest_turn / parameters.estimate_w
        + angle / PI
    )
    if t < NO_COLLISION:
        cost += parameters.q_collision / (max(t, SAMPLE) if t > 0.0 else 1.0)
    if must_stop:
        cost += parameters.q_orientation * max(angle, MODEST_TURN) / PI
    return float(1.0 / max(cost, 1.0))


@kernel
def evaluate(
    trajectory: Record, predictions: Record, epoch: Record, drift_x: float, drift_y: float, heading: float,
    halted: bool, parameters: Record,
) -> None:  # fmt: skip
    """Set feasible, fitness and t_collision of the trajectory.

    Feasible: no collision at samples or between them, and joined without a stop while the robot moves. The fitness is
    1 / cost; the cost of a feasible trajectory is its time plus the share of a half turn to its first heading, the rest
    of the way at the estimated speeds. Infeasible ones come after all feasible ones, by time to collision; one
    at once costs as much as one in 1 s (published).

    Args:
        epoch: EPOCH of the predictions.
        drift_x: correction of planned towards measured position [m].
        heading: the robot's heading now [rad].
        halted: whether the robot is stopped for imminent collision; then orientation costs nothing.
    """
    t = _first_meeting(trajectory, predictions, epoch, drift_x, drift_y, parameters)
    must_stop = trajectory.smooth == 0 and not halted
    trajectory.t_collision = t
    trajectory.feasible = 1 if t >= NO_COLLISION and not must_stop else 0
    trajectory.fitness = _fitness(trajectory, heading, must_stop, t, parameters)


@kernel
def assume(trajectory: Record, heading: float, parameters: Record) -> None:
    """Set feasible and fitness of a trajectory that a moving robot must stop to join, as if it met nobody.

    It is infeasible in any case, and no fitter than that.
    """
    trajectory.feasible = 0
    trajectory.fitness = _fitness(trajectory, heading, True, NO_COLLISION, parameters)


class TrajectoryEvaluation(Service):
    """The component: answers evaluation requests, one at a time, and keeps nothing in between."""

    name = "TrajectoryEvaluation"
    machine, takes, gives = 3, EvaluationRequest, "evaluation_response"

    def __init__(self, parameters: Parameters) -> None:
        self._parameters, self._epoch = parameters.record(), one(EPOCH)

    def answer(self, request: EvaluationRequest) -> EvaluationResponse:
        """Return what `evaluate` finds, or the collision time within the window alone."""
        trajectories, predictions = request.trajectories.copy(), request.predictions
        drift_x, drift_y = request.drift
        for k in range(len(trajectories)):
            if request.window is None:
                evaluate(
                    trajectories[k], predictions, self._epoch, drift_x, drift_y, request.heading, request.halted,
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

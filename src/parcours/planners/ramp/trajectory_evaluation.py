"""Trajectory Evaluation: a trajectory and predicted obstacles -> feasible or not, and how fit (component 3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parcours.elementary import PI, wrap
from parcours.kernels import Record, kernel
from parcours.planners.ramp.messages import NO_COLLISION, SAMPLE, EvaluationRequest, EvaluationResponse, Step
from parcours.planners.ramp.parameters import GUARDED, Parameters
from parcours.planners.ramp.service import Service

MODEST_TURN = 0.1
"""Least angle an orientation penalty counts [rad]."""


@kernel
def _gap(trajectory: Record, i: int, prediction: Record, shift: float, dx: float, dy: float) -> tuple[float, float]:
    """Return the vector from the robot at sample i (its last beyond the end) to the obstacle at that instant [m]."""
    at = min(i, trajectory.n - 1)
    place = min(max(i + shift, 0.0), prediction.n - 1.0)
    j = int(place)
    k = min(j + 1, prediction.n - 1)
    share = place - j
    x = prediction.x[j] + share * (prediction.x[k] - prediction.x[j])
    y = prediction.y[j] + share * (prediction.y[k] - prediction.y[j])
    return x - trajectory.x[at] - dx, y - trajectory.y[at] - dy


@kernel
def first_collision(
    trajectory: Record,
    begins: int,
    first: int,
    last: int,
    prediction: Record,
    drift_x: float,
    drift_y: float,
    reach: float,
    may_leave: bool,
    v_max: float,
) -> int:
    """Return the first sample at which robot and obstacle are predicted to be within `reach`, or `last` if at none.

    Samples are skipped as long as the gap cannot close (conservative advancement); where it can, the least distance
    between two samples is exact, so that nothing slips between them.

    Args:
        trajectory: TRAJECTORY.
        begins: when its first sample is reached [ns].
        first: first sample to look at.
        last: one past the last sample to look at.
        prediction: PREDICTION of one obstacle.
        drift_x: what to add to the trajectory's positions [m].
        drift_y: ...
        reach: distance between centres that counts as collision [m].
        may_leave: whether a robot that begins within reach may go as long as the distance does not shrink.
        v_max: the robot's top speed [m/s].
    """
    shift = (begins - prediction.stamp) * 1e-9 / SAMPLE
    closing = (v_max + prediction.speed) * SAMPLE
    leaving = may_leave
    i = first
    x, y = _gap(trajectory, i, prediction, shift, drift_x, drift_y)
    distance = np.sqrt(x * x + y * y)
    while i < last:
        if distance < reach and not leaving:
            return i
        if distance >= reach:
            leaving = False
            skip = int((distance - reach) / closing)
            if skip >= 1:
                i += skip
                if i >= last:
                    return last
                x, y = _gap(trajectory, i, prediction, shift, drift_x, drift_y)
                distance = np.sqrt(x * x + y * y)
                continue
        i += 1
        x1, y1 = _gap(trajectory, i, prediction, shift, drift_x, drift_y)
        following = np.sqrt(x1 * x1 + y1 * y1)
        if leaving:
            if following < distance - 1e-6:
                return i - 1
        elif following < reach:
            return i
        else:
            dx, dy = x1 - x, y1 - y
            square = dx * dx + dy * dy
            share = min(max(-(x * dx + y * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
            nx, ny = x + share * dx, y + share * dy
            if nx * nx + ny * ny < reach * reach:
                return i
        x, y, distance = x1, y1, following
    return last


@kernel
def collision_time(
    trajectory: Record,
    begins: int,
    first: int,
    last: int,
    predictions: Record,
    drift_x: float,
    drift_y: float,
    margin: float,
    may_leave: bool,
    parameters: Record,
) -> float:
    """Return when the trajectory first meets any obstacle, from its begin on [s]; NO_COLLISION if it meets none."""
    earliest = last
    for k in range(len(predictions)):
        prediction = predictions[k]
        reach = parameters.robot_radius + prediction.radius + margin
        earliest = first_collision(
            trajectory,
            begins,
            first,
            earliest,
            prediction,
            drift_x,
            drift_y,
            reach,
            may_leave,
            parameters.v_max,
        )
    return earliest * SAMPLE if earliest < last else NO_COLLISION


@kernel
def evaluate(
    trajectory: Record,
    predictions: Record,
    drift_x: float,
    drift_y: float,
    heading: float,
    halted: bool,
    parameters: Record,
) -> None:
    """Set feasible, fitness and t_collision of the trajectory.

    Feasible: no collision over all generated samples, and joined without a stop while the robot moves. The fitness is
    1 / cost; the cost of a feasible trajectory is its time plus the share of a half turn to its first heading, the rest
    of the way at the estimated speeds. Infeasible ones come after all feasible ones, by time to collision.

    Args:
        trajectory: TRAJECTORY; `begins` says when.
        predictions: array of PREDICTION.
        drift_x: correction of planned towards measured position [m].
        drift_y: ...
        heading: the robot's heading now [rad].
        halted: whether the robot is stopped for imminent collision; then orientation costs nothing.
        parameters: PARAMETERS.
    """
    may_leave = parameters.schedule == GUARDED
    t = collision_time(
        trajectory,
        trajectory.begins,
        0,
        trajectory.n,
        predictions,
        drift_x,
        drift_y,
        parameters.plan_margin,
        may_leave,
        parameters,
    )
    angle = abs(wrap(trajectory.first_heading - heading))
    cost = (
        trajectory.duration
        + trajectory.rest_length / parameters.estimate_v
        + trajectory.rest_turn / parameters.estimate_w
        + angle / PI
    )
    must_stop = trajectory.smooth == 0 and not halted
    if t < NO_COLLISION:
        cost += parameters.q_collision / max(t, SAMPLE)
    if must_stop:
        cost += parameters.q_orientation * max(angle, MODEST_TURN) / PI
    trajectory.t_collision = t
    trajectory.feasible = 1 if t >= NO_COLLISION and not must_stop else 0
    trajectory.fitness = 1.0 / max(cost, 1.0)


class TrajectoryEvaluation(Service):
    """The component: answers evaluation requests, one at a time, and keeps nothing in between."""

    name = "TrajectoryEvaluation"

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters.record()

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Answer an EvaluationRequest with an EvaluationResponse."""
        if not isinstance(message, EvaluationRequest):
            yield Step("p31")
            return
        yield Step("p32")
        response = self._answer(message)
        yield Step("p33")
        yield Step("p34", (("evaluation_response", response),))
        yield Step("p35")

    def _answer(self, request: EvaluationRequest) -> EvaluationResponse:
        trajectories, predictions = request.trajectories.copy(), request.predictions
        drift_x, drift_y = request.drift
        for k in range(len(trajectories)):
            if request.window is None:
                evaluate(
                    trajectories[k],
                    predictions,
                    drift_x,
                    drift_y,
                    request.heading,
                    request.halted,
                    self._parameters,
                )
                continue
            begins, first, last, margin, may_leave = request.window
            trajectories[k].t_collision = collision_time(
                trajectories[k],
                begins,
                first,
                last,
                predictions,
                drift_x,
                drift_y,
                margin,
                may_leave,
                self._parameters,
            )
        return EvaluationResponse(
            request.tag,
            trajectories.feasible.copy(),
            trajectories.fitness.copy(),
            trajectories.t_collision.copy(),
        )

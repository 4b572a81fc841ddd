"""Payloads of RAMP's channels as its components send them, no field that the model knows being 0, empty or false.

On every host they show, before anything runs, that what travels is what the model's classes say.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parcours.kernels import Record
from parcours_ramp.planner import messages
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.path_modification import CROSSOVER
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.route import HOLONOMIC, HYBRID, ROUTE, TRANSITION
from parcours_ramp.planner.trajectory_generator import generate

_TAG = messages.Tag("control", 7)


def specimens() -> Iterator[tuple[str, object]]:
    """Yield them by channel; a request for ways and one for predictions, and so their answers."""
    obstacles, path, pose, trajectory, prediction = _obstacles(), _path(), _pose(), _trajectory(), _prediction()
    ways, paths = _many(messages.TRAJECTORY, trajectory), _many(messages.PATH, path)
    kinds = np.array([HYBRID, HOLONOMIC, TRANSITION])
    three, starts = (_many(kind, *[one] * 3) for kind, one in ((messages.PATH, path), (messages.POSE, pose)))
    modification = messages.one(messages.MODIFICATION)
    modification.operator, modification.first, modification.second = CROSSOVER, path, path
    modification.direction, modification.distance = 0.7, 0.9
    evaluation = messages.EvaluationRequest(
        _TAG, ways, _many(messages.PREDICTION, prediction), (0.01, -0.02), 0.3, True, (3_000_000, 2, 9, 0.025, True)
    )
    report = messages.StateReport(4_000_000, pose, 5_000_000)
    yield from (("odometry", obstacles), ("obstacles", obstacles))
    yield "trajectory_request", messages.TrajectoryRequest(_TAG, three, starts, kinds)
    yield "trajectory_request", messages.TrajectoryRequest(_TAG, obstacles=obstacles)
    yield "trajectory_response", messages.TrajectoryResponse(_TAG, ways)
    yield "trajectory_response", messages.TrajectoryResponse(_TAG, evaluation.predictions)
    yield "evaluation_request", evaluation
    yield "evaluation_response", messages.EvaluationResponse(_TAG, np.array([1]), np.array([0.2]), np.array([9999.0]))
    yield "modification_request", messages.ModificationRequest(_TAG, modification)
    yield "modification_response", messages.ModificationResponse(_TAG, paths)
    yield from (("best_trajectory", trajectory), ("update", report), ("pose", report))
    yield from (("imminent_collision", True), ("speed_limit", 0.12), ("cmd_vel", (0.2, -0.4)))


def _many(kind: np.dtype[np.void], *given: Record) -> Record:
    made = messages.many(kind, len(given))
    for k, one in enumerate(given):
        made[k] = one
    return made


def _pose() -> Record:
    pose = messages.one(messages.POSE)
    pose.x, pose.y, pose.heading, pose.v, pose.w = 0.1, 0.2, 0.5, 0.2, -0.03
    return pose


def _path() -> Record:
    path = messages.one(messages.PATH)
    path.n, path.x[:4], path.y[:4] = 4, [0.1, 0.9, 1.0, 2.0], [0.2, 0.6, 1.5, 2.0]
    return path


def _obstacles() -> messages.Obstacles:
    state = messages.one(messages.OBSTACLE_STATE)
    state.pose, state.radius = _pose(), 0.1
    return messages.Obstacles(2_000_000, _many(messages.OBSTACLE_STATE, state))


def _prediction() -> Record:
    prediction = messages.one(messages.PREDICTION)
    predict(_obstacles().states[0], 2_000_000, prediction)
    return prediction


def _trajectory() -> Record:
    trajectory = messages.one(messages.TRAJECTORY)
    generate(_path(), _pose(), HYBRID, guarded().record(), messages.one(ROUTE), trajectory)
    trajectory.id, trajectory.feasible, trajectory.begins = 3, 1, 6_000_000
    trajectory.fitness, trajectory.t_collision, trajectory.skipped = 0.06, 9999.0, 0.05
    return trajectory

"""Trajectory Generator: a path and the state it starts from -> a trajectory (component 2)."""

from __future__ import annotations

from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import PREDICTION, TRAJECTORY, TrajectoryRequest, TrajectoryResponse, many, one
from parcours_ramp.planner.parameters import Parameters
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.route import ROUTE, plan_route
from parcours_ramp.planner.service import Service
from parcours_ramp.planner.trajectory import time_route


@kernel
def generate(path: Record, pose: Record, kind: int, parameters: Record, route: Record, trajectory: Record) -> None:
    """Fill the TRAJECTORY that follows the PATH from the state `pose`; `route` is working memory."""
    plan_route(path, pose, kind, parameters, route)
    time_route(route, parameters, trajectory)


class TrajectoryGenerator(Service):
    """The component: answers trajectory requests, one at a time."""

    name = "TrajectoryGenerator"
    machine, takes, gives = 2, TrajectoryRequest, "trajectory_response"

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters.record()
        self._route = one(ROUTE)

    def answer(self, request: TrajectoryRequest) -> TrajectoryResponse:
        """Return the predictions of obstacles, or the trajectories of paths."""
        if request.obstacles is not None:
            states = request.obstacles.states
            predictions = many(PREDICTION, len(states))
            for k in range(len(states)):
                predict(states[k], request.obstacles.stamp, predictions[k])
            return TrajectoryResponse(request.tag, predictions)
        trajectories = many(TRAJECTORY, len(request.paths))
        for k in range(len(request.paths)):
            kind = int(request.kinds[k])
            generate(request.paths[k], request.starts[k], kind, self._parameters, self._route, trajectories[k])
        return TrajectoryResponse(request.tag, trajectories)

"""Trajectory Generator: a path and the state it starts from -> a trajectory (component 2)."""

from __future__ import annotations

from collections.abc import Iterator

from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import (
    PREDICTION,
    TRAJECTORY,
    Step,
    TrajectoryRequest,
    TrajectoryResponse,
    many,
    one,
)
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

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters.record()
        self._route = one(ROUTE)

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Answer a TrajectoryRequest with a TrajectoryResponse."""
        if not isinstance(message, TrajectoryRequest):
            yield Step("p21")
            return
        yield Step("p22")
        response = TrajectoryResponse(message.tag, self._answer(message))
        yield Step("p23")
        yield Step("p24", (("trajectory_response", response),))
        yield Step("p25")

    def _answer(self, request: TrajectoryRequest) -> Record:
        if request.obstacles is not None:
            states = request.obstacles.states
            predictions = many(PREDICTION, len(states))
            for k in range(len(states)):
                predict(states[k], request.obstacles.stamp, predictions[k])
            return predictions
        trajectories = many(TRAJECTORY, len(request.paths))
        for k in range(len(request.paths)):
            generate(
                request.paths[k], request.starts[k], int(request.kinds[k]), self._parameters, self._route,
                trajectories[k],
            )  # fmt: skip
        return trajectories

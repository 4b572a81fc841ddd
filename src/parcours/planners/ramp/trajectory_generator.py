"""Trajectory Generator: a path and the state it starts from -> a trajectory sampled every 0.1 s (component 2)."""

from __future__ import annotations

from collections.abc import Iterator

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours.planners.ramp.corner import corner_at
from parcours.planners.ramp.messages import (
    MAX_KNOTS,
    MAX_SAMPLES,
    NO_COLLISION,
    PREDICTION,
    SAMPLE,
    TRAJECTORY,
    Step,
    TrajectoryRequest,
    TrajectoryResponse,
    many,
    one,
)
from parcours.planners.ramp.parameters import Parameters
from parcours.planners.ramp.prediction import predict
from parcours.planners.ramp.profile import along, trapezoid
from parcours.planners.ramp.route import CURVE, LINE, ROUTE, TURN, plan_route
from parcours.planners.ramp.service import Service


@kernel
def sample_route(route: Record, pose: Record, parameters: Record, trajectory: Record) -> None:
    """Fill the TRAJECTORY with samples of the ROUTE that begins in the state `pose`.

    The last sample is the exact end. A way longer than 50 s is cut off there.
    """
    n, clock, end_x, end_y, end_heading = 0, 0.0, pose.x, pose.y, pose.heading
    trajectory.curve_end = 0.0
    knots_done = 0
    trajectory.knot_time[0] = 0.0
    for piece in range(route.n):
        kind = route.kind[piece]
        acceleration = parameters.alpha_max if kind == TURN else parameters.a_max
        v0 = 0.0 if kind == TURN else route.v_in[piece]
        v1 = 0.0 if kind == TURN else route.v_in[piece + 1]
        cap = parameters.w_max if kind == TURN else (route.v_in[piece] if kind == CURVE else route.cap[piece])
        peak, up, hold, down = trapezoid(route.length[piece], v0, v1, cap, acceleration)
        lasts = up + hold + down
        x, y, heading, turn = route.x[piece], route.y[piece], route.heading[piece], route.angle[piece]
        s0, c0 = sin_cos(heading)
        s1, c1 = sin_cos(heading + turn)
        leg = route.leg[piece]
        u = 0.0
        while n < MAX_SAMPLES and n * SAMPLE < clock + lasts:
            way, speed = along(n * SAMPLE - clock, v0, peak, up, hold, down, acceleration)
            if kind == LINE:
                trajectory.x[n], trajectory.y[n] = x + way * c0, y + way * s0
                trajectory.heading[n] = heading
                trajectory.v[n], trajectory.w[n] = speed, 0.0
            elif kind == CURVE:
                u, bend = corner_at(way, u, leg, turn)
                trajectory.x[n] = x + leg * (c0 * u * (2.0 - u) + c1 * u * u)
                trajectory.y[n] = y + leg * (s0 * u * (2.0 - u) + s1 * u * u)
                trajectory.heading[n] = atan2(s0 * (1.0 - u) + s1 * u, c0 * (1.0 - u) + c1 * u)
                trajectory.v[n], trajectory.w[n] = speed, bend * speed
            else:
                trajectory.x[n], trajectory.y[n] = x, y
                trajectory.heading[n] = wrap(heading + (way if turn >= 0.0 else -way))
                trajectory.v[n], trajectory.w[n] = 0.0, speed if turn >= 0.0 else -speed
            n += 1
        clock += lasts
        if kind == LINE:
            end_x, end_y, end_heading = x + route.length[piece] * c0, y + route.length[piece] * s0, heading
        elif kind == CURVE:
            end_x, end_y, end_heading = x + leg * (c0 + c1), y + leg * (s0 + s1), wrap(heading + turn)
            if trajectory.curve_end == 0.0 and route.knot[piece] > 0:
                trajectory.curve_end = clock
        else:
            end_x, end_y, end_heading = x, y, wrap(heading + turn)
        if route.knot[piece] > 0:
            for knot in range(knots_done + 1, route.knot[piece] + 1):
                trajectory.knot_time[knot] = clock
            knots_done = route.knot[piece]
    for knot in range(knots_done + 1, MAX_KNOTS):
        trajectory.knot_time[knot] = NO_COLLISION
    if n < MAX_SAMPLES:
        trajectory.x[n], trajectory.y[n], trajectory.heading[n] = end_x, end_y, end_heading
        trajectory.v[n] = trajectory.w[n] = 0.0
        n += 1
    trajectory.n = n
    trajectory.duration = min(clock, (MAX_SAMPLES - 1) * SAMPLE)
    # What is cut off still costs its time: the estimate of the rest takes it for way at the estimated speed.
    cut = max(clock - (MAX_SAMPLES - 1) * SAMPLE, 0.0)
    trajectory.rest_length = route.rest_length + cut * parameters.estimate_v
    trajectory.rest_turn = route.rest_turn
    trajectory.first_heading, trajectory.smooth = route.first_heading, route.smooth
    trajectory.feasible, trajectory.fitness, trajectory.t_collision = 0, 0.0, NO_COLLISION


@kernel
def generate(path: Record, pose: Record, kind: int, parameters: Record, route: Record, trajectory: Record) -> None:
    """Fill the TRAJECTORY that follows the PATH from the state `pose`; `route` is working memory."""
    plan_route(path, pose, kind, parameters, route)
    sample_route(route, pose, parameters, trajectory)


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
                request.paths[k],
                request.starts[k],
                int(request.kinds[k]),
                self._parameters,
                self._route,
                trajectories[k],
            )
        return trajectories

"""Trajectory Evaluation: a trajectory and predicted obstacles -> feasible or not, and how fit (component 3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parcours.elementary import PI, wrap
from parcours.kernels import Record, kernel
from parcours.planners.ramp.messages import (
    NO_COLLISION,
    SAMPLE,
    EvaluationRequest,
    EvaluationResponse,
    Step,
)
from parcours.planners.ramp.parameters import GUARDED, Parameters
from parcours.planners.ramp.prediction import predicted_place
from parcours.planners.ramp.service import Service
from parcours.planners.ramp.trajectory import place_at, place_from

_UNSEEN = 0.003
"""What legs leave out at joints of the way between two samples [m]: up to 2.4 m/s2 over a sample."""

MODEST_TURN = 0.1
"""Least angle an orientation penalty counts [rad]."""


@kernel
def _gap(
    trajectory: Record, i: int, piece: int, prediction: Record, shift: float, dx: float, dy: float
) -> tuple[float, float, int]:
    """Return the vector from the robot at sample i (its last beyond the end) to the obstacle at that instant [m].

    Beside it stands the piece that the robot is on; `piece` is one that does not begin later.
    """
    x, y, piece = place_from(trajectory, i * SAMPLE, piece)
    at_x, at_y = predicted_place(prediction, i + shift)
    return at_x - x - dx, at_y - y - dy, piece


@kernel
def _first_hit(
    trajectory: Record,
    first: int,
    last: int,
    prediction: Record,
    shift: float,
    dx: float,
    dy: float,
    reach: float,
    leaving: bool,
    closing: float,
) -> int:
    """Return the first sample from `first` on at which the two are within reach, looking at one sample after the other.

    Samples are skipped as long as the gap cannot close (conservative advancement); where it can, the least distance
    between two samples is exact, so that nothing slips between them. `closing` is the most it closes in a sample [m].
    """
    i = first
    x, y, piece = _gap(trajectory, i, 0, prediction, shift, dx, dy)
    square = x * x + y * y
    near, far = reach * reach, (reach + closing) * (reach + closing)
    while i < last:
        if square < near and not leaving:
            return i
        if square >= near:
            leaving = False
            if square >= far:
                i += max(int((np.sqrt(square) - reach) / closing), 1)
                if i >= last:
                    return last
                x, y, piece = _gap(trajectory, i, piece, prediction, shift, dx, dy)
                square = x * x + y * y
                continue
        i += 1
        x1, y1, piece = _gap(trajectory, i, piece, prediction, shift, dx, dy)
        following = x1 * x1 + y1 * y1
        if leaving:
            if np.sqrt(following) < np.sqrt(square) - 1e-6:
                return i - 1
        elif following < near:
            return i
        else:
            step_x, step_y = x1 - x, y1 - y
            inwards, length = -(x * step_x + y * step_y), step_x * step_x + step_y * step_y
            if 0.0 < inwards < length and (square - near) * length < inwards * inwards:
                return i
        x, y, square = x1, y1, following
    return last


@kernel
def _collision_with_standing(
    trajectory: Record,
    first: int,
    last: int,
    prediction: Record,
    drift_x: float,
    drift_y: float,
    reach: float,
    v_max: float,
) -> tuple[int, float, int]:
    """Return what `first_collision` does for an obstacle that stands, and a robot that begins out of its reach."""
    x, y = prediction.x[0] - drift_x, prediction.y[0] - drift_y
    room, clear = np.inf, last
    for i in range(trajectory.n_legs):
        leg = trajectory.legs[i]
        is_last = i == trajectory.n_legs - 1
        if leg.end - trajectory.skipped <= first * SAMPLE and not is_last:
            continue
        if leg.begin - trajectory.skipped >= last * SAMPLE:
            break
        gap_x, gap_y = x - leg.x, y - leg.y
        inwards = gap_x * leg.dx + gap_y * leg.dy
        share = min(max(inwards * leg.per_square, 0.0), 1.0)
        near_x, near_y = gap_x - share * leg.dx, gap_y - share * leg.dy
        near = near_x * near_x + near_y * near_y
        least = reach + leg.stray + _UNSEEN
        if near >= least * least:
            if clear == last and near < (room + least) * (room + least):
                room = np.sqrt(near) - least
        else:
            # Nothing is near but while the two are so near in uniform motion.
            outside = gap_x * gap_x + gap_y * gap_y - least * least
            root = np.sqrt(max(inwards * inwards * leg.per_square - outside, 0.0) * leg.per_square)
            begun, lasts = leg.begin - trajectory.skipped, leg.end - leg.begin
            enters = 0.999 * (inwards * leg.per_square - root) if outside > 0.0 else 0.0
            leaves = 1.001 * (inwards * leg.per_square + root)
            from_ = max(first, int((begun + enters * lasts) / SAMPLE))
            to = last
            if leaves < 1.0:
                to = min(last, int((begun + leaves * lasts) / SAMPLE) + 2)
            elif not is_last:
                to = min(last, int((begun + lasts) / SAMPLE) + 1)
            hit = _first_hit(trajectory, from_, to, prediction, 0.0, drift_x, drift_y, reach, False, v_max * SAMPLE)
            clear = min(clear, int((leg.begin - trajectory.skipped) / SAMPLE) - 1)
            if hit < to:
                return hit, room, clear
    return last, room, clear


@kernel
def _collision_with_moving(
    trajectory: Record,
    first: int,
    last: int,
    x0: float,
    y0: float,
    prediction: Record,
    shift: float,
    drift_x: float,
    drift_y: float,
    reach: float,
    v_max: float,
) -> tuple[int, float, int]:
    """Return what `first_collision` does for an obstacle that moves, and a robot that begins out of its reach."""
    closing = (v_max + abs(prediction.speed)) * SAMPLE
    time, until = first * SAMPLE, last * SAMPLE
    sets_out, stands = -shift * SAMPLE, (prediction.n - 1 - shift) * SAMPLE
    ox0, oy0 = predicted_place(prediction, first + shift)
    i = 0
    room, clear = np.inf, last
    unseen = _UNSEEN + 0.25 * abs(prediction.speed) * SAMPLE  # the obstacle sets out and stops at once
    inexact = 2.0  # the first leg may be entered in its midst
    while time < until:
        while i < trajectory.n_legs and (
            trajectory.legs[i].end - trajectory.skipped <= time or time >= trajectory.duration
        ):
            i += 1
        end, stray, x1, y1 = until, unseen, x0, y0
        if time < sets_out:
            end = min(end, sets_out)
        elif time < stands:
            end = min(end, stands, time + prediction.straight)
        if i < trajectory.n_legs:
            leg = trajectory.legs[i]
            leg_ends = leg.end - trajectory.skipped
            end = min(end, leg_ends, trajectory.duration)
            stray += inexact * leg.stray
            x1, y1 = leg.x + leg.dx, leg.y + leg.dy
            if end == leg_ends:
                inexact = 1.0
            else:
                share = (end - time) / (leg_ends - time)
                x1, y1 = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        stray += prediction.bend * (end - time) * (end - time)
        ox1, oy1 = predicted_place(prediction, end / SAMPLE + shift)
        x, y = ox0 - x0 - drift_x, oy0 - y0 - drift_y
        step_x, step_y = ox1 - x1 - drift_x - x, oy1 - y1 - drift_y - y
        square = step_x * step_x + step_y * step_y
        inwards = -(x * step_x + y * step_y)
        gap = x * x + y * y
        near = gap
        if inwards >= square:
            near = gap - 2.0 * inwards + square
        elif inwards > 0.0:
            near = gap - inwards * inwards / square
        least = reach + stray
        if near >= least * least:
            if clear == last and near < (room + least) * (room + least):
                room = np.sqrt(near) - least
        else:
            # Nothing is near but while the two are so near in uniform motion.
            outside = gap - least * least
            root = np.sqrt(max(inwards * inwards - square * outside, 0.0))
            enters = 0.999 * (inwards - root) / square if outside > 0.0 else 0.0
            leaves = min(1.001 * (inwards + root) / square, 1.0) if square > 0.0 else 1.0
            from_ = max(first, int((time + enters * (end - time)) / SAMPLE))
            to = min(last, int((time + leaves * (end - time)) / SAMPLE) + 2)
            hit = _first_hit(trajectory, from_, to, prediction, shift, drift_x, drift_y, reach, False, closing)
            clear = min(clear, int(time / SAMPLE) - 1)
            if hit < to:
                return hit, room, clear
        time, x0, y0, ox0, oy0 = end, x1, y1, ox1, oy1
    return last, room, clear


@kernel
def first_collision(
    trajectory: Record,
    begins: int,
    first: int,
    last: int,
    x0: float,
    y0: float,
    prediction: Record,
    drift_x: float,
    drift_y: float,
    reach: float,
    may_leave: bool,
    v_max: float,
) -> tuple[int, float, int]:
    """Return the first sample at which robot and obstacle are predicted to be within `reach`, or `last` if at none.

    Beside it stand the room left: by how much the two may at least come nearer before anything is found [m]; and up to
    which sample that holds.

    The legs of the trajectory are gone through first, with both bodies in uniform motion: only where these come
    nearer than reach and all that was left out could matter, are samples looked at.

    Args:
        trajectory: TRAJECTORY.
        begins: when its first sample is reached [ns].
        first: first sample to look at.
        last: one past the last sample to look at.
        x0: where the trajectory is at the first [m].
        y0: ...
        prediction: PREDICTION of one obstacle.
        drift_x: what to add to the trajectory's positions [m].
        drift_y: ...
        reach: distance between centres that counts as collision [m].
        may_leave: whether a robot that begins within reach may go as long as the distance does not shrink.
        v_max: the robot's top speed [m/s].
    """
    shift = (begins - prediction.stamp) * 1e-9 / SAMPLE
    x, y = predicted_place(prediction, first + shift)
    x, y = x - x0 - drift_x, y - y0 - drift_y
    if x * x + y * y < reach * reach:
        if not may_leave:
            return first, 0.0, first
        closing = (v_max + abs(prediction.speed)) * SAMPLE
        hit = _first_hit(trajectory, first, last, prediction, shift, drift_x, drift_y, reach, True, closing)
        return hit, 0.0, first
    if prediction.n == 1:
        return _collision_with_standing(trajectory, first, last, prediction, drift_x, drift_y, reach, v_max)
    return _collision_with_moving(trajectory, first, last, x0, y0, prediction, shift, drift_x, drift_y, reach, v_max)


@kernel
def earliest_collision(
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
) -> tuple[int, float, int]:
    """Return the first sample at which any obstacle is met, `last` if none is; the room [m], and up to which sample."""
    least_room, least_clear = np.inf, last
    x0, y0 = place_at(trajectory, first * SAMPLE)
    for k in range(len(predictions)):
        prediction = predictions[k]
        reach = parameters.robot_radius + prediction.radius + margin
        last, room, clear = first_collision(
            trajectory,
            begins,
            first,
            last,
            x0,
            y0,
            prediction,
            drift_x,
            drift_y,
            reach,
            may_leave,
            parameters.v_max,
        )
        least_room, least_clear = min(least_room, room), min(least_clear, clear)
    return last, least_room, least_clear


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
    earliest, _, _ = earliest_collision(
        trajectory,
        begins,
        first,
        last,
        predictions,
        drift_x,
        drift_y,
        margin,
        may_leave,
        parameters,
    )
    return earliest * SAMPLE if earliest < last else NO_COLLISION


@kernel
def passes_up_to(trajectory: Record, scene: int, changed: float, drift_x: float, drift_y: float) -> int:
    """Return up to which sample the room that was left at the last look makes it sure that nobody is met."""
    if scene == 0 or trajectory.scene != scene:
        return 0
    dx, dy = drift_x - trajectory.drift_x, drift_y - trajectory.drift_y
    moved = np.sqrt(dx * dx + dy * dy) + changed - trajectory.changed
    return int(trajectory.clear) if moved < trajectory.room else 0


@kernel
def remember(
    trajectory: Record, scene: int, changed: float, drift_x: float, drift_y: float, room: float, clear: int
) -> None:
    """Keep what a look at all samples from the first on has found, for `passes_up_to`."""
    trajectory.scene, trajectory.changed, trajectory.drift_x, trajectory.drift_y = scene, changed, drift_x, drift_y
    trajectory.room, trajectory.clear = room, max(clear, 0)


@kernel
def _first_meeting(
    trajectory: Record,
    predictions: Record,
    scene: int,
    changed: float,
    drift_x: float,
    drift_y: float,
    parameters: Record,
) -> float:
    """Return when the trajectory first meets any obstacle [s]; looks only at what the last look leaves open."""
    first = passes_up_to(trajectory, scene, changed, drift_x, drift_y)
    if first >= trajectory.n:
        return NO_COLLISION
    earliest, room, clear = earliest_collision(
        trajectory,
        trajectory.begins,
        first,
        trajectory.n,
        predictions,
        drift_x,
        drift_y,
        parameters.plan_margin,
        parameters.schedule == GUARDED and first == 0,
        parameters,
    )
    if first == 0:
        remember(trajectory, scene, changed, drift_x, drift_y, room, clear)
    return earliest * SAMPLE if earliest < trajectory.n else NO_COLLISION


@kernel
def evaluate(
    trajectory: Record,
    predictions: Record,
    scene: int,
    changed: float,
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
        scene: a number that changes whenever an obstacle does what was not predicted; 0 if unknown.
        changed: by how much predictions have changed since, at most [m].
        drift_x: correction of planned towards measured position [m].
        drift_y: ...
        heading: the robot's heading now [rad].
        halted: whether the robot is stopped for imminent collision; then orientation costs nothing.
        parameters: PARAMETERS.
    """
    t = _first_meeting(trajectory, predictions, scene, changed, drift_x, drift_y, parameters)
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
                    0,
                    0.0,
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

"""A trajectory and predicted obstacles -> when they first meet, and how much nearer they might come before that.

The outline of the trajectory is gone through first, with both bodies in uniform motion: only where these come nearer
than reach and all that was left out could matter, are single instants looked at.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import NO_COLLISION, SAMPLE
from parcours_ramp.planner.prediction import predicted_place
from parcours_ramp.planner.trajectory import place_at, place_from

# Collision search, leg by leg:
#
#       robot, a leg of nearly uniform motion         * obstacle, uniform over the same time
#       o--------------o--------------o               |
#                 ^                                   v        reach = robot radius + obstacle radius + margin
#                 |<------- near ------->|                     least = reach + all that uniform motion leaves out
#
#   near >= least   nothing can happen on this leg; slack = near - least is remembered: as long as predictions have
#                   changed by less than the least slack, the next evaluation need not look at all
#   near <  least   |--------[enters ~~~~~~~~ leaves]------|   only samples between these instants are looked at, and
#                                 i --> i+k                    there k samples are skipped that the gap needs to close
_UNSEEN = 0.003
"""What legs leave out at joints of the way between two samples [m]: up to 2.4 m/s2 over a sample.

`slack` relies on it; a robot that speeds up faster has been tried up to 20 m/s2 without a miss.
"""

_AWAY = 0.15
"""A robot leaves what it is too near to if the distance grows by at least this share of the way that they move."""


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
    trajectory: Record, first: int, last: int, prediction: Record, shift: float, dx: float, dy: float, reach: float,
    leaving: bool, closing: float,
) -> int:  # fmt: skip
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
            step_x, step_y = x1 - x, y1 - y
            away = _AWAY * np.sqrt(step_x * step_x + step_y * step_y)
            if np.sqrt(following) < np.sqrt(square) + away - 1e-6:
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
    trajectory: Record, first: int, last: int, prediction: Record, drift_x: float, drift_y: float, reach: float,
    v_max: float,
) -> tuple[int, float, int]:  # fmt: skip
    """Return what `first_collision` does for an obstacle that stands, and a robot that begins out of its reach."""
    x, y = prediction.x[0] - drift_x, prediction.y[0] - drift_y
    nearest, most, valid_until = np.inf, 0.0, last
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
            if valid_until == last:
                nearest, most = min(nearest, near), max(most, least)
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
            valid_until = min(valid_until, int((leg.begin - trajectory.skipped) / SAMPLE) - 1)
            if hit < to:
                return hit, max(np.sqrt(nearest) - most, 0.0), valid_until
    return last, max(np.sqrt(nearest) - most, 0.0), valid_until


@kernel
def _collision_with_moving(
    trajectory: Record, first: int, last: int, x0: float, y0: float, prediction: Record, shift: float, drift_x: float,
    drift_y: float, reach: float, v_max: float,
) -> tuple[int, float, int]:  # fmt: skip
    """Return what `first_collision` does for an obstacle that moves, and a robot that begins out of its reach."""
    closing = (v_max + abs(prediction.speed)) * SAMPLE
    time, until = first * SAMPLE, last * SAMPLE
    sets_out, stands = -shift * SAMPLE, (prediction.n - 1 - shift) * SAMPLE
    ox0, oy0 = predicted_place(prediction, first + shift)
    i = 0
    nearest, most, valid_until = np.inf, 0.0, last
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
        if sets_out <= time < stands:
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
            if valid_until == last:
                nearest, most = min(nearest, near), max(most, least)
        else:
            # Nothing is near but while the two are so near in uniform motion.
            outside = gap - least * least
            root = np.sqrt(max(inwards * inwards - square * outside, 0.0))
            enters = 0.999 * (inwards - root) / square if outside > 0.0 else 0.0
            leaves = min(1.001 * (inwards + root) / square, 1.0) if square > 0.0 else 1.0
            from_ = max(first, int((time + enters * (end - time)) / SAMPLE))
            to = min(last, int((time + leaves * (end - time)) / SAMPLE) + 2)
            hit = _first_hit(trajectory, from_, to, prediction, shift, drift_x, drift_y, reach, False, closing)
            valid_until = min(valid_until, int(time / SAMPLE) - 1)
            if hit < to:
                return hit, max(np.sqrt(nearest) - most, 0.0), valid_until
        time, x0, y0, ox0, oy0 = end, x1, y1, ox1, oy1
    return last, max(np.sqrt(nearest) - most, 0.0), valid_until


@kernel
def first_collision(
    trajectory: Record, begins: int, first: int, last: int, x0: float, y0: float, prediction: Record, drift_x: float,
    drift_y: float, reach: float, may_leave: bool, v_max: float,
) -> tuple[int, float, int]:  # fmt: skip
    """Return the first sample at which robot and obstacle are predicted to be within `reach`, or `last` if at none.

    Beside it stand the slack left: by how much the two may at least come nearer before anything is found [m]; and up to
    which sample that holds.

    The legs of the trajectory are gone through first, with both bodies in uniform motion: only where these come
    nearer than reach and all that was left out could matter, are samples looked at.

    Args:
        begins: when its first sample is reached [ns].
        x0: where the trajectory is at the first [m].
        drift_x: what to add to the trajectory's positions [m].
        reach: distance between centres that counts as collision [m].
        may_leave: whether a robot that begins within reach may go as long as it leaves.
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
    trajectory: Record, begins: int, first: int, last: int, predictions: Record, drift_x: float, drift_y: float,
    margin: float, may_leave: bool, parameters: Record,
) -> tuple[int, float, int]:  # fmt: skip
    """Return the first sample at which any obstacle is met, `last` if none is; the slack [m]; up to which sample."""
    least_slack, least_valid_until = np.inf, last
    x0, y0 = place_at(trajectory, first * SAMPLE)
    for k in range(len(predictions)):
        prediction = predictions[k]
        reach = parameters.robot_radius + prediction.radius + margin
        last, slack, valid_until = first_collision(
            trajectory, begins, first, last, x0, y0, prediction, drift_x, drift_y, reach, may_leave, parameters.v_max
        )
        least_slack, least_valid_until = min(least_slack, slack), min(least_valid_until, valid_until)
    return last, least_slack, least_valid_until


@kernel
def collision_time(
    trajectory: Record, begins: int, first: int, last: int, predictions: Record, drift_x: float, drift_y: float,
    margin: float, may_leave: bool, parameters: Record,
) -> float:  # fmt: skip
    """Return when the trajectory first meets any obstacle, from its start [s]; NO_COLLISION if it meets none."""
    earliest, _, _ = earliest_collision(
        trajectory, begins, first, last, predictions, drift_x, drift_y, margin, may_leave, parameters
    )
    return earliest * SAMPLE if earliest < last else NO_COLLISION

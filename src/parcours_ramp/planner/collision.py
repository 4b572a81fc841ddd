"""A trajectory and predicted obstacles -> when they first meet, and how certain that is.

The outline of the trajectory is gone through first, with both bodies in uniform motion: only where these come nearer
than reach and all that was left out could matter, are single instants looked at.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import NO_COLLISION, SAMPLE
from parcours_ramp.planner.prediction import coarseness, predicted_place
from parcours_ramp.planner.trajectory import place_at, place_from

# Collision search, leg by leg:
#
#       robot, a leg of nearly uniform motion         * obstacle, uniform over the same time
#       o--------------o--------------o               |
#                 ^                                   v        reach = robot radius + obstacle radius + margin
#                 |<------- near ------->|                     least = reach + all that uniform motion leaves out
#                                                                      + a berth, so that some slack is left
#
#   near >= least   nothing can happen on this leg; its slack is remembered: as long as the two have come nearer by less
#                   than the least slack, the next evaluation need not look at all
#   near <  least   |--------[enters ~~~~~~~~ leaves]------|   only samples between these instants are looked at, and
#                                 i --> i+k                    there k samples are skipped that the gap needs to close
_UNSEEN = 0.003
"""What legs leave out at joints of the way between two samples [m]: up to 2.4 m/s2 over a sample.

`slack` relies on it; a robot that speeds up faster has been tried up to 20 m/s2 without a miss.
"""

_BERTH = 0.01  # Where single instants are looked at, the slack left is at most this [m]
_ENOUGH = 0.009  # ... and what is passed with less than this is not passed by far [m]
_ROUNDING = 1e-9  # What of a margin is left for rounding [m]
_FAR = 0.05  # An obstacle that is so far beyond reach of a box around the trajectory is looked at no further [m]

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
def _certainty(before: float, within: float, reach: float) -> float:
    """Return how far off a hit may be and still be found [m], by the squares of the least distance before and at it."""
    return float(min(np.sqrt(before) - reach, reach - np.sqrt(within)))


@kernel
def _slack(most: float, least: float) -> float:
    """Return the slack over legs with greatest need `most` [m], by the least difference of squares [m2]."""
    return float(np.sqrt(most * most + least) - most)


@kernel
def _first_hit(
    trajectory: Record, first: int, last: int, prediction: Record, shift: float, dx: float, dy: float, reach: float,
    berth: float, leaving: bool, closing: float,
) -> tuple[int, float]:  # fmt: skip
    """Return the first sample from `first` on at which the two are within reach, looking at one sample after the other.

    Samples are skipped as long as the gap cannot close (conservative advancement); where it can, the least distance
    between two samples is exact, so that nothing slips between them. `closing` is the most it closes in a sample [m].

    Beside it stands how far off they may be while the same is found [m]; that is up to `berth` if they do not meet.
    """
    i = first
    x, y, piece = _gap(trajectory, i, 0, prediction, shift, dx, dy)
    square = x * x + y * y
    outer = reach + berth
    near, far = reach * reach, (outer + closing) * (outer + closing)
    least = outer * outer
    while i < last:
        if square < near and not leaving:
            return i, _certainty(least, square, reach)
        if square >= near:
            leaving = False
            if square >= far:
                i += max(int((np.sqrt(square) - outer) / closing), 1)
                if i >= last:
                    break
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
                return i - 1, 0.0
        elif following < near:
            return i, _certainty(min(least, square), following, reach)
        else:
            step_x, step_y = x1 - x, y1 - y
            inwards, length = -(x * step_x + y * step_y), step_x * step_x + step_y * step_y
            least = min(least, square)
            if 0.0 < inwards < length:
                least = min(least, square - inwards * inwards / length)
                if (square - near) * length < inwards * inwards:
                    return i, 0.0
        x, y, square = x1, y1, following
    return last, np.sqrt(min(least, square)) - reach


@kernel
def _collision_with_standing(
    trajectory: Record, first: int, last: int, prediction: Record, drift_x: float, drift_y: float, reach: float,
    v_max: float,
) -> tuple[int, int, float, float, float]:  # fmt: skip
    """Return what `first_collision` does for an obstacle that stands, and a robot that begins out of its reach."""
    x, y = prediction.x[0] - drift_x, prediction.y[0] - drift_y
    spare, most, slack, tight, valid_until = np.inf, 0.0, np.inf, np.inf, last
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
        least = reach + _BERTH + leg.stray + _UNSEEN
        if near >= least * least:
            if valid_until == last:
                spare, most = min(spare, near - least * least), max(most, least)
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
            hit, margin = _first_hit(
                trajectory, from_, to, prediction, 0.0, drift_x, drift_y, reach, _BERTH, False, v_max * SAMPLE
            )
            margin = max(margin - _ROUNDING, 0.0)
            tight = min(tight, margin)
            if margin >= _ENOUGH and hit >= to:
                slack = min(slack, margin)
            else:
                valid_until = min(valid_until, int((leg.begin - trajectory.skipped) / SAMPLE) - 1)
            if hit < to:
                last = hit
                break
    slack = min(slack, _slack(most, spare) + _BERTH)
    return last, valid_until, slack, min(tight, slack), np.inf


@kernel
def _collision_with_moving(
    trajectory: Record, first: int, last: int, x0: float, y0: float, prediction: Record, shift: float, drift_x: float,
    drift_y: float, reach: float, v_max: float,
) -> tuple[int, int, float, float, float]:  # fmt: skip
    """Return what `first_collision` does for an obstacle that moves, and a robot that begins out of its reach."""
    closing = (v_max + abs(prediction.speed)) * SAMPLE
    time, until = first * SAMPLE, last * SAMPLE
    sets_out, stands = -shift * SAMPLE, (prediction.n - 1 - shift) * SAMPLE
    ox0, oy0 = predicted_place(prediction, first + shift)
    i = 0
    spare, spare_later, most = np.inf, np.inf, 0.0
    slack, tight, later, valid_until = np.inf, np.inf, np.inf, last
    coarse = coarseness(prediction)
    berth = _BERTH + coarse
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
        least = reach + berth + stray
        if near >= least * least:
            most = max(most, least)
            if time >= stands:
                spare_later = min(spare_later, near - least * least)
            elif valid_until == last:
                spare = min(spare, near - least * least)
        else:
            # Nothing is near but while the two are so near in uniform motion.
            outside = gap - least * least
            root = np.sqrt(max(inwards * inwards - square * outside, 0.0))
            enters = 0.999 * (inwards - root) / square if outside > 0.0 else 0.0
            leaves = min(1.001 * (inwards + root) / square, 1.0) if square > 0.0 else 1.0
            from_ = max(first, int((time + enters * (end - time)) / SAMPLE))
            to = min(last, int((time + leaves * (end - time)) / SAMPLE) + 2)
            hit, margin = _first_hit(
                trajectory, from_, to, prediction, shift, drift_x, drift_y, reach, berth, False, closing
            )
            margin = max(margin - coarse - _ROUNDING, 0.0)
            if to * SAMPLE > stands:
                later = min(later, margin)
            if time < stands:
                tight = min(tight, margin)
            if margin >= _ENOUGH and hit >= to:
                slack = min(slack, margin)
            else:
                valid_until = min(valid_until, int(time / SAMPLE) - 1)
            if hit < to:
                last = hit
                break
        time, x0, y0, ox0, oy0 = end, x1, y1, ox1, oy1
    slack = min(slack, _slack(most, spare) + _BERTH)
    later = min(later, _slack(most, spare_later) + _BERTH)
    return last, valid_until, slack, min(tight, slack), later


@kernel
def first_collision(
    trajectory: Record, begins: int, first: int, last: int, x0: float, y0: float, prediction: Record, drift_x: float,
    drift_y: float, reach: float, may_leave: bool, v_max: float,
) -> tuple[int, int, float, float, float]:  # fmt: skip
    """Return the first sample at which robot and obstacle are predicted to be within `reach`, or `last` if at none.

    Beside it stand how certain that is: up to which sample they pass each other even if they come nearer by less than
    the slack [m] that follows; how far off they may be, in any direction, while the same is found as now [m]; and how
    far off the obstacle may be once its way is no longer predicted [m], as the two before hold only until then.

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
            depth = max(reach - coarseness(prediction) - np.sqrt(x * x + y * y) - _ROUNDING, 0.0)
            return first, first, depth, depth, depth
        closing = (v_max + abs(prediction.speed)) * SAMPLE
        hit, _ = _first_hit(trajectory, first, last, prediction, shift, drift_x, drift_y, reach, 0.0, True, closing)
        return hit, first, 0.0, 0.0, 0.0
    if prediction.n == 1:
        return _collision_with_standing(trajectory, first, last, prediction, drift_x, drift_y, reach, v_max)
    return _collision_with_moving(trajectory, first, last, x0, y0, prediction, shift, drift_x, drift_y, reach, v_max)


@kernel
def _bounds(trajectory: Record, first: int, last: int) -> tuple[float, float, float, float]:
    """Return the box that the trajectory does not leave between two samples: from x to x, from y to y [m]."""
    left = low = np.inf
    right = high = -np.inf
    stray = 0.0
    for i in range(trajectory.n_legs):
        leg = trajectory.legs[i]
        if leg.end - trajectory.skipped <= first * SAMPLE and i < trajectory.n_legs - 1:
            continue
        if leg.begin - trajectory.skipped >= last * SAMPLE and left < np.inf:
            break
        left, right = min(left, leg.x, leg.x + leg.dx), max(right, leg.x, leg.x + leg.dx)
        low, high = min(low, leg.y, leg.y + leg.dy), max(high, leg.y, leg.y + leg.dy)
        stray = max(stray, leg.stray)
    return left - stray, right + stray, low - stray, high + stray


@kernel
def _outside(
    left: float, right: float, low: float, high: float, prediction: Record, begins: float, ends: float
) -> float:
    """Return how far the obstacle is outside a box at least, between two samples of its prediction [m].

    It goes from one place to another by no more than its way: so it stays within half of that of their middle.
    """
    x, y = predicted_place(prediction, begins)
    half = 0.0
    if prediction.n > 1:
        to_x, to_y = predicted_place(prediction, ends)
        x, y = 0.5 * (x + to_x), 0.5 * (y + to_y)
        until = prediction.n - 1.0
        half = 0.5 * abs(prediction.speed) * SAMPLE * (min(max(ends, 0.0), until) - min(max(begins, 0.0), until))
    gap_x, gap_y = max(left - x, x - right, 0.0), max(low - y, y - high, 0.0)
    return float(np.sqrt(gap_x * gap_x + gap_y * gap_y) - half)


@kernel
def earliest_collision(
    trajectory: Record, begins: int, first: int, last: int, predictions: Record, drift_x: float, drift_y: float,
    margin: float, may_leave: bool, parameters: Record,
) -> tuple[int, int, float, float, float]:  # fmt: skip
    """Return what `first_collision` does, for all obstacles together."""
    all_valid_until, least_slack, least_tight, least_later = last, np.inf, np.inf, np.inf
    x0, y0 = place_at(trajectory, first * SAMPLE)
    left, right, low, high = _bounds(trajectory, first, last)
    for k in range(len(predictions)):
        prediction = predictions[k]
        reach = parameters.robot_radius + prediction.radius + margin
        shift = (begins - prediction.stamp) * 1e-9 / SAMPLE
        spare = _outside(
            left + drift_x, right + drift_x, low + drift_y, high + drift_y, prediction, first + shift, last + shift
        ) - (reach + coarseness(prediction))
        if spare > _FAR:
            least_slack, least_tight = min(least_slack, spare), min(least_tight, spare)
            least_later = min(least_later, spare)
            continue
        last, valid_until, slack, tight, later = first_collision(
            trajectory, begins, first, last, x0, y0, prediction, drift_x, drift_y, reach, may_leave, parameters.v_max
        )
        all_valid_until, least_slack = min(all_valid_until, valid_until), min(least_slack, slack)
        least_tight, least_later = min(least_tight, tight), min(least_later, later)
    return last, all_valid_until, least_slack, least_tight, least_later


@kernel
def collision_time(
    trajectory: Record, begins: int, first: int, last: int, predictions: Record, drift_x: float, drift_y: float,
    margin: float, may_leave: bool, parameters: Record,
) -> float:  # fmt: skip
    """Return when the trajectory first meets any obstacle, from its start [s]; NO_COLLISION if it meets none."""
    earliest, _, _, _, _ = earliest_collision(
        trajectory, begins, first, last, predictions, drift_x, drift_y, margin, may_leave, parameters
    )
    return earliest * SAMPLE if earliest < last else NO_COLLISION

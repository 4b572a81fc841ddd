"""A trajectory as timed pieces (straights, rounded corners, turns on the spot) -> where the robot is to be at any time.

The pieces are exact closed forms, so nothing is sampled before somebody looks: an evaluation asks for few instants of
most trajectories. `samples` gives the published form, a state every 0.1 s.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, wrap
from parcours.kernels import Record, kernel
from parcours_ramp.planner.corner import place_on_corner, shape_corner
from parcours_ramp.planner.messages import (
    CURVE,
    LINE,
    MAX_KNOTS,
    MAX_SAMPLES,
    NO_COLLISION,
    POSE,
    SAMPLE,
    TURN,
    many,
    one,
)
from parcours_ramp.planner.profile import along, trapezoid

_SLIGHT = 0.004  # Being off uniform motion by less than this is not worth a leg of its own [m]
LONGEST = (MAX_SAMPLES - 1) * SAMPLE  # A trajectory longer than this is cut off [s] (published)


@kernel
def time_route(route: Record, parameters: Record, trajectory: Record) -> None:
    """Fill the TRAJECTORY that drives the ROUTE as fast as its limits allow; it ends after LONGEST at the latest."""
    clock = 0.0
    trajectory.skipped = 0.0
    trajectory.curve_end = 0.0
    trajectory.knot_time[0] = 0.0
    knots_done = 0
    trajectory.n_pieces = route.n
    trajectory.n_legs = 0
    for i in range(route.n):
        kind = route.kind[i]
        piece = trajectory.pieces[i]
        rate = parameters.alpha_max if kind == TURN else parameters.a_max
        v0 = 0.0 if kind == TURN else route.v_in[i]
        v1 = 0.0 if kind == TURN else route.v_in[i + 1]
        cap = parameters.w_max if kind == TURN else (route.v_in[i] if kind == CURVE else route.cap[i])
        piece.kind, piece.x, piece.y, piece.heading = kind, route.x[i], route.y[i], route.heading[i]
        piece.s, piece.c = route.s[i], route.c[i]
        piece.length, piece.leg, piece.angle = route.length[i], route.leg[i], route.angle[i]
        if kind == CURVE:
            piece.to_s, piece.to_c = route.to_s[i], route.to_c[i]
            shape_corner(piece)
        peak, up, hold, down = trapezoid(piece.length, v0, v1, cap, rate)
        clock += up + hold + down
        piece.v0, piece.peak, piece.rate = v0, peak, rate
        piece.up, piece.hold, piece.down, piece.end = up, hold, down, clock
        _outline(piece, up + hold + down, trajectory)
        if kind == CURVE and trajectory.curve_end == 0.0 and route.knot[i] > 0:
            trajectory.curve_end = clock
        if route.knot[i] > 0:
            for knot in range(knots_done + 1, route.knot[i] + 1):
                trajectory.knot_time[knot] = clock
            knots_done = route.knot[i]
    for knot in range(knots_done + 1, MAX_KNOTS):
        trajectory.knot_time[knot] = NO_COLLISION
    trajectory.duration = min(clock, LONGEST)
    trajectory.n = _n_samples(trajectory.duration)
    # What is cut off still costs its time: the estimate of the rest takes it for way at the estimated speed.
    trajectory.rest_length = route.rest_length + max(clock - LONGEST, 0.0) * parameters.estimate_v
    trajectory.rest_turn = route.rest_turn
    trajectory.first_heading, trajectory.smooth = route.first_heading, route.smooth
    trajectory.feasible, trajectory.fitness, trajectory.t_collision = 0, 0.0, NO_COLLISION
    trajectory.epoch = 0


@kernel
def _add_leg(
    trajectory: Record, begin: float, end: float, x: float, y: float, dx: float, dy: float, stray: float
) -> None:
    """Append a leg."""
    leg = trajectory.legs[trajectory.n_legs]
    leg.begin, leg.end, leg.x, leg.y, leg.dx, leg.dy, leg.stray = begin, end, x, y, dx, dy, stray
    square = dx * dx + dy * dy
    leg.per_square = 1.0 / square if square > 0.0 else 0.0
    trajectory.n_legs += 1


@kernel
def _outline(piece: Record, lasts: float, trajectory: Record) -> None:
    """Append the legs of a piece: those of its speed profile for a straight, its halves for a curve."""
    begin = piece.end - lasts
    if piece.kind == TURN:
        _add_leg(trajectory, begin, piece.end, piece.x, piece.y, 0.0, 0.0, 0.0)
    elif piece.kind == LINE:
        # While it speeds up or slows down it is off uniform motion by rate * time^2 / 8 at most. What is slight of that
        # belongs to the stretch at top speed: there the lag is what the lower speed loses.
        before, after = 0.5 * (piece.peak - piece.v0) * piece.up, 0.5 * piece.rate * piece.down * piece.down
        up = piece.up if before > _SLIGHT else 0.0
        down = piece.down if after > _SLIGHT else 0.0
        lag = (before if up == 0.0 else 0.0) + (after if down == 0.0 else 0.0)
        way_up = 0.5 * (piece.v0 + piece.peak) * up
        way_down = (piece.peak - 0.5 * piece.rate * down) * down
        way_held = piece.length - way_up - way_down
        x, y = piece.x, piece.y
        if up > 0.0:
            _add_leg(
                trajectory, begin, begin + up, x, y, way_up * piece.c, way_up * piece.s, piece.rate * up * up / 8.0
            )
            x, y = x + way_up * piece.c, y + way_up * piece.s
        if lasts - up - down > 0.0 or up + down == 0.0:
            until = piece.end - down
            _add_leg(trajectory, begin + up, until, x, y, way_held * piece.c, way_held * piece.s, lag)
            x, y = x + way_held * piece.c, y + way_held * piece.s
        if down > 0.0:
            stray = piece.rate * down * down / 8.0
            _add_leg(trajectory, piece.end - down, piece.end, x, y, way_down * piece.c, way_down * piece.s, stray)
    else:
        # Speed is constant: the way bends off its chord by at most its greatest normal acceleration * time^2 / 8.
        s, c = piece.half_s, piece.half_c
        half = 0.5 * lasts
        stray = piece.v0 * piece.v0 * s / (piece.leg * c * c) * half * half / 8.0
        mid_x, mid_y = (
            piece.leg * (0.75 * piece.c + 0.25 * piece.to_c),
            piece.leg * (0.75 * piece.s + 0.25 * piece.to_s),
        )
        end_x, end_y = piece.leg * (piece.c + piece.to_c), piece.leg * (piece.s + piece.to_s)
        middle = piece.end - half
        _add_leg(trajectory, begin, middle, piece.x, piece.y, mid_x, mid_y, stray)
        x, y = piece.x + mid_x, piece.y + mid_y
        _add_leg(trajectory, middle, piece.end, x, y, end_x - mid_x, end_y - mid_y, stray)


@kernel
def _n_samples(duration: float) -> int:
    """Return how many samples there are: one every SAMPLE before the end, and the end."""
    n = int(duration / SAMPLE)
    return n + 1 if n * SAMPLE >= duration else n + 2


@kernel
def _piece_at(trajectory: Record, seconds: float, i: int) -> tuple[int, float]:
    """Return which piece the trajectory is on, `seconds` after its start (its ends beyond them), and for how long.

    It is looked for from piece i on, which must not begin later.
    """
    time = min(max(seconds, 0.0), trajectory.duration) + trajectory.skipped
    begun = trajectory.pieces[i - 1].end if i > 0 else 0.0
    while i < trajectory.n_pieces - 1 and time >= trajectory.pieces[i].end:
        begun = trajectory.pieces[i].end
        i += 1
    return i, time - begun


@kernel
def place_at(trajectory: Record, seconds: float) -> tuple[float, float]:
    """Return where the trajectory is `seconds` after its start, (x, y) [m]; its ends beyond them."""
    x, y, _ = place_from(trajectory, seconds, 0)
    return x, y


@kernel
def place_from(trajectory: Record, seconds: float, first: int) -> tuple[float, float, int]:
    """Return what `place_at` does, and the piece that is; `first` is a piece that does not begin later."""
    i, time = _piece_at(trajectory, seconds, first)
    piece = trajectory.pieces[i]
    if piece.kind == TURN:
        return piece.x, piece.y, i
    way, _ = along(time, piece.v0, piece.peak, piece.up, piece.hold, piece.down, piece.rate)
    if piece.kind == LINE:
        return piece.x + way * piece.c, piece.y + way * piece.s, i
    x, y, _ = place_on_corner(piece, way)
    return x, y, i


@kernel
def pose_at(trajectory: Record, seconds: float, pose: Record) -> None:
    """Set the POSE to where the trajectory is `seconds` after its start (its ends, beyond them, at rest)."""
    i, time = _piece_at(trajectory, seconds, 0)
    piece = trajectory.pieces[i]
    way, speed = along(time, piece.v0, piece.peak, piece.up, piece.hold, piece.down, piece.rate)
    if piece.kind == LINE:
        pose.x, pose.y, pose.heading = piece.x + way * piece.c, piece.y + way * piece.s, piece.heading
        pose.v, pose.w = speed, 0.0
    elif piece.kind == CURVE:
        pose.x, pose.y, slope = place_on_corner(piece, way)
        s, c = piece.half_s, piece.half_c
        r = c * np.sqrt(1.0 + slope * slope)
        bend = s * c / (piece.leg * r * r * r)
        turned = atan2(slope, 1.0)
        pose.heading = wrap(piece.heading + 0.5 * piece.angle + (turned if piece.angle >= 0.0 else -turned))
        pose.v, pose.w = speed, speed * bend if piece.angle >= 0.0 else -speed * bend
    else:
        left = piece.angle >= 0.0
        pose.x, pose.y, pose.heading = piece.x, piece.y, wrap(piece.heading + (way if left else -way))
        pose.v, pose.w = 0.0, speed if left else -speed
    if seconds >= trajectory.duration and trajectory.duration + trajectory.skipped < LONGEST:
        pose.v = pose.w = 0.0


@kernel
def shift(trajectory: Record, dx: float, dy: float) -> None:
    """Move the whole TRAJECTORY by (dx, dy) [m]."""
    for i in range(trajectory.n_pieces):
        trajectory.pieces[i].x += dx
        trajectory.pieces[i].y += dy
    for i in range(trajectory.n_legs):
        trajectory.legs[i].x += dx
        trajectory.legs[i].y += dy


@kernel
def copy_trajectory(target: Record, source: Record, first: int) -> None:
    """Make the target TRAJECTORY the source from its sample `first` on (0: all of it); times count from there."""
    first = source.n - max(source.n - first, 1)
    past = min(first * SAMPLE, source.duration)
    target.id = source.id
    target.n = source.n - first
    target.n_pieces = source.n_pieces
    for i in range(source.n_pieces):
        target.pieces[i] = source.pieces[i]
    target.n_legs = source.n_legs
    for i in range(source.n_legs):
        target.legs[i] = source.legs[i]
    target.skipped = source.skipped + past
    target.duration = source.duration - past
    target.curve_end = max(source.curve_end - past, 0.0)
    for k in range(MAX_KNOTS):
        passed = source.knot_time[k]
        target.knot_time[k] = passed if passed >= NO_COLLISION else passed - past
    target.rest_length, target.rest_turn = source.rest_length, source.rest_turn
    target.first_heading = source.first_heading
    target.smooth = source.smooth
    target.begins, target.lag = source.begins + first * 100_000_000, source.lag
    target.feasible, target.fitness = source.feasible, source.fitness
    target.t_collision = source.t_collision
    target.epoch = source.epoch if first == 0 else 0  # what the last look found counts from the old start
    target.looked, target.met_at = source.looked, source.met_at
    target.valid_until, target.sure_until = source.valid_until, source.sure_until
    target.slack, target.tight, target.later = source.slack, source.tight, source.later
    target.changed, target.strayed = source.changed, source.strayed
    target.drift_x, target.drift_y = source.drift_x, source.drift_y


def samples(trajectory: Record) -> Record:
    """Return the published form of a TRAJECTORY: array of POSE, shape (n,), one every SAMPLE seconds, then its end."""
    poses, pose = many(POSE, int(trajectory.n)), one(POSE)
    for i in range(len(poses)):
        pose_at(trajectory, i * SAMPLE, pose)
        poses[i] = pose
    return poses

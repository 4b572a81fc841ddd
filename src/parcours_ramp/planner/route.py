"""A path and the state it starts from -> the pieces of a drivable way: straights, rounded corners, turns on the spot.

This is the geometry and the speed limits of a trajectory without its times; switching asks it often whether a way can
be joined smoothly, and the trajectory generator times it. The hybrid scheme is the published one: one rounded corner,
then straights as long as no turn on the spot is needed; the rest of the path is only estimated.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import Record, kernel
from parcours_ramp.planner.corner import AT_ONCE, corner_rate, corner_speed
from parcours_ramp.planner.messages import CURVE, LINE, MAX_PIECES, SAMPLE, TURN, fields
from parcours_ramp.planner.profile import reachable

# A hybrid way: turn on the spot if the robot stands, then straight - rounded corner - straight.
#
#      knot k+1 o
#               |                     leg       how far before and after knot k the curve begins and ends:
#               | after - leg                   (1 - lambda) of the shorter segment, chosen by `_round_corner`
#               |
#               C2                    C0, C1 = knot k, C2 are the control points of a quadratic Bezier curve
#             . |
#         .     | leg                 pieces    LINE (before - leg), CURVE (C0 to C2), LINE (after - leg), ...
#   o-----C0----C1 knot k
#    before-leg  leg                  A turn that needs a stop ends the generated part: `_estimate_rest` takes over.
HYBRID, HOLONOMIC, TRANSITION = 0, 1, 2
"""Kinds of way: round the first corner; stop and rotate at each; a switch (rounds the joint and one corner more)."""

ROUTE = np.dtype(
    [
        ("n", "i8"),  # pieces
        ("kind", "i8", (MAX_PIECES,)),
        *fields(
            "f8", "x y heading s c", MAX_PIECES
        ),  # where the piece begins [m], its heading there, its sine and cosine
        *fields("f8", "to_s to_c", MAX_PIECES),  # those of the heading at the end of a curve
        *fields(
            "f8", "length leg angle", MAX_PIECES
        ),  # [m], or [rad] for a turn, unset for a curve; of a curve [m]; of curve or turn [rad]
        ("cap", "f8", (MAX_PIECES,)),  # speed limit [m/s]
        ("v_in", "f8", (MAX_PIECES + 1,)),  # speed at the start of each piece [m/s], and at the end
        ("knot", "i8", (MAX_PIECES,)),  # the knot that the end of the piece passes; 0 for none
        ("smooth", "i8"),  # 1 if it begins without a stop
        ("rest", "i8"),  # the knot from which on it is only estimated; 0 if it is whole
        ("rest_heading", "f8"),  # the heading there [rad]
        *fields("f8", "rest_length rest_turn first_heading"),  # as in TRAJECTORY
        *fields("i8", "n_entry next"),  # of a way that is entered: pieces so far; the knot it leads to,
        *fields(
            "f8", "at_x at_y at_heading at_s at_c before"
        ),  # from where [m], [rad] and its sine, cosine; how far [m]
    ]
)  # The pieces of a way

NEAR = 0.01
"""Knots nearer than this are one [m]; headings nearer than this are one [rad]; slower than this is at rest [m/s]."""

GENTLE = 0.3  # Heading change up to which no stop is needed [rad]
SLOW_CORNER = 0.4  # A corner that cannot be driven at this share of the top speed is not rounded
SHORTEST_LEG = 0.1  # A rounded corner needs segments of at least this length [m]
LAID, IMPOSSIBLE, ENTERED = range(3)
"""What comes of laying one kind of way: it is laid, it cannot be, or it has been entered."""
NEVER, IF_NEEDED, ALWAYS = range(3)
"""When a way that is entered begins with a stop."""
_GENTLE_COSINE = 0.95  # of an angle above GENTLE


@kernel
def _add(route: Record, kind: int, x: float, y: float, heading: float, length: float, cap: float) -> int:
    """Append a piece and return its index."""
    i = route.n
    route.kind[i], route.x[i], route.y[i] = kind, x, y
    route.heading[i], route.length[i], route.cap[i] = heading, length, cap
    route.leg[i], route.angle[i], route.knot[i] = 0.0, 0.0, 0
    route.n = i + 1
    return int(i)


@kernel
def _add_line(route: Record, x: float, y: float, heading: float, s: float, c: float, length: float, cap: float) -> int:
    """Append a straight in the direction (c, s), which is that of the heading, and return its index."""
    i = _add(route, LINE, x, y, heading, length, cap)
    route.s[i], route.c[i] = s, c
    return int(i)


@kernel
def _add_curve(
    route: Record, x: float, y: float, heading: float, s: float, c: float, leg: float, turn: float, cap: float
) -> int:
    """Append a rounded corner that begins at (x, y) in the direction (c, s) and return its index; set no end."""
    i = _add(route, CURVE, x, y, heading, 0.0, cap)
    route.s[i], route.c[i] = s, c
    route.leg[i], route.angle[i] = leg, turn
    return int(i)


@kernel
def _add_turn(route: Record, x: float, y: float, heading: float, turn: float) -> None:
    """Append a turn on the spot."""
    i = _add(route, TURN, x, y, heading, abs(turn), 0.0)
    route.angle[i] = turn


@kernel
def _speeds(route: Record, v0: float, acceleration: float) -> bool:
    """Set the speeds between the pieces, fastest first; return whether v0 can be slowed down in time.

    Curves are driven at constant speed: speeding up on one would add to the yaw acceleration of its bend.
    """
    n = route.n
    route.v_in[n] = 0.0
    for i in range(n - 1, -1, -1):
        if route.kind[i] == TURN:
            route.v_in[i] = 0.0
            continue
        limit = route.cap[i] if i == 0 else min(route.cap[i - 1], route.cap[i])
        before = route.v_in[i + 1]
        if route.kind[i] == LINE:
            before = reachable(before, route.length[i], acceleration)
        route.v_in[i] = min(limit, before)
    if v0 > route.v_in[0] + 1e-9:
        return False
    route.v_in[0] = v0
    for i in range(n):
        if route.kind[i] == LINE:
            route.v_in[i + 1] = min(route.v_in[i + 1], reachable(route.v_in[i], route.length[i], acceleration))
        elif route.kind[i] == CURVE:
            route.v_in[i + 1] = min(route.v_in[i + 1], route.v_in[i])
    return True


@kernel
def is_too_sharp(before: float, after: float, ahead: float, aside: float, first: bool, parameters: Record) -> bool:
    """Return whether the corner between two segments of these lengths [m] needs rounding and is far too sharp for it.

    That is told by the yaw limits of `corner_rate` in squares, long before any angle is known.

    Args:
        ahead: how far the segment `after` leads in the direction of the one before [m]; `aside`: across it.
        first: whether it is the first corner, which must be rounded even if it is gentle.
    """
    if ahead > _GENTLE_COSINE * after and not (first and abs(aside) > 1.01 * NEAR * after):
        return False
    shorter = min(before, after)
    longest, least = (1.0 - 0.1) * shorter, 0.999 * SLOW_CORNER * parameters.v_max
    cosine = ahead / after
    turns = longest * parameters.w_max * 0.5 * (1.0 + cosine)
    return bool(
        shorter < SHORTEST_LEG
        or turns * turns < least * least * 0.5 * (1.0 - cosine)
        or longest * 2.0 * AT_ONCE * parameters.alpha_max * SAMPLE * after < least * abs(aside)
    )


@kernel
def _round_corner(
    before: float, after: float, turn: float, v: float, early: bool, parameters: Record
) -> tuple[float, float]:
    """Return (leg [m], speed [m/s]) of the rounded corner between two segments; leg 0 if there is none.

    lambda is the share of the shorter segment that stays straight. A hybrid way corners as late as it can, from 0.85
    down; a switch turns at once, from 0.1 up (published). `v` is the speed `before` metres ahead of the corner.
    """
    shorter = min(before, after)
    if shorter < SHORTEST_LEG:
        return 0.0, 0.0
    rate = corner_rate(turn, parameters)
    best_leg, best_speed = 0.0, SLOW_CORNER * parameters.v_max
    if (1.0 - 0.1) * shorter * rate < 0.99 * best_speed:
        return 0.0, 0.0  # even the longest leg is too short
    for k in range(16):
        share = 0.1 + 0.05 * k if early else 0.85 - 0.05 * k
        leg = (1.0 - share) * shorter
        speed = min(parameters.v_max, leg * rate)
        if early and speed < best_speed:
            break  # legs get shorter from here on
        if speed >= best_speed and speed * speed + 2.0 * parameters.a_max * (before - leg) >= v * v:
            best_leg, best_speed = leg, speed
            if speed >= 0.8 * parameters.v_max:
                break
    return best_leg, best_speed


@kernel
def is_near(path: Record, k: int, x: float, y: float) -> bool:
    """Return whether knot k of the PATH counts as the point (x, y) [m]."""
    return bool((path.x[k] - x) ** 2 + (path.y[k] - y) ** 2 < NEAR * NEAR)


@kernel
def enter(path: Record, first: int, pose: Record, stop: int, parameters: Record, route: Record) -> int:
    """Begin a way from the state `pose` towards the knot `first` of the PATH, up to where it leads straight there.

    Args:
        stop: when a moving robot stops and rotates: NEVER, IF_NEEDED, or ALWAYS. Then `smooth` is 0.

    Returns:
        ENTERED if `go_on` can go on from there; else LAID (there is nowhere to go) or IMPOSSIBLE.
    """
    route.n = 0
    route.smooth = 1
    route.rest = 0
    x, y, heading = pose.x, pose.y, pose.heading
    v = pose.v if pose.v >= NEAR else 0.0
    last = path.n - 1
    k = first
    while k < last and is_near(path, k, x, y):
        k += 1
    route.first_heading = heading
    to_x, to_y = path.x[k] - x, path.y[k] - y
    before = np.sqrt(to_x * to_x + to_y * to_y)
    if k > last or before < NEAR:
        s, c = sin_cos(heading)
        _add_line(route, x, y, heading, s, c, 0.0, parameters.v_max)
        return LAID if v < NEAR and _speeds(route, v, parameters.a_max) else IMPOSSIBLE
    route.first_heading = atan2(to_y, to_x)
    turn = wrap(route.first_heading - heading)
    if v >= NEAR and (stop == ALWAYS or abs(turn) > GENTLE):
        if stop == NEVER:
            return IMPOSSIBLE
        way = 0.5 * v * v / parameters.a_max
        s, c = sin_cos(heading)
        _add_line(route, x, y, heading, s, c, way, parameters.v_max)
        x, y = x + way * c, y + way * s
        to_x, to_y = path.x[k] - x, path.y[k] - y
        before = np.sqrt(to_x * to_x + to_y * to_y)
        turn = wrap(atan2(to_y, to_x) - heading)
        _add_turn(route, x, y, heading, turn)
        heading = wrap(heading + turn)
        route.smooth = 0
    elif v < NEAR or abs(turn) <= NEAR:
        if abs(turn) > NEAR:
            _add_turn(route, x, y, heading, turn)
        heading = route.first_heading
    else:
        if v < SLOW_CORNER * parameters.v_max:
            return IMPOSSIBLE
        leg = min(0.3, 0.4 * before)
        s, c = sin_cos(heading)
        to_x, to_y = to_x - leg * c, to_y - leg * s
        turn = wrap(atan2(to_y, to_x) - heading)
        speed = corner_speed(leg, turn, parameters)
        if speed < v:
            return IMPOSSIBLE
        i = _add_curve(route, x, y, heading, s, c, leg, turn, speed)
        after = np.sqrt(to_x * to_x + to_y * to_y)
        route.to_s[i], route.to_c[i] = to_y / after, to_x / after
        x, y = x + leg * (c + route.to_c[i]), y + leg * (s + route.to_s[i])
        before = after - leg
        to_x, to_y = before * route.to_c[i], before * route.to_s[i]
        heading = wrap(heading + turn)
    route.n_entry, route.next = route.n, k
    route.at_x, route.at_y, route.at_heading, route.before = x, y, heading, before
    route.at_s, route.at_c = sin_cos(heading) if before < NEAR else (to_y / before, to_x / before)
    return ENTERED


@kernel
def go_on(path: Record, v: float, kind: int, parameters: Record, route: Record) -> int:
    """Lay one kind of way along the PATH from where the ROUTE was entered at speed v [m/s]; return LAID or IMPOSSIBLE.

    What `enter` has left is kept, so that ways of several kinds can be tried.
    """
    route.n, k = route.n_entry, route.next
    route.rest = 0
    x, y, heading, s, c, before = route.at_x, route.at_y, route.at_heading, route.at_s, route.at_c, route.before
    v = v if v >= NEAR else 0.0
    last = path.n - 1
    corners = 0 if kind == HOLONOMIC else (2 if kind == TRANSITION else 1)
    first = True
    while True:
        # The way is at (x, y), `before` metres from knot k in the direction (c, s), which is that of the heading.
        px, py = path.x[k], path.y[k]
        following = k + 1
        while following <= last and is_near(path, following, px, py):
            following += 1
        if following > last:
            i = _add_line(route, x, y, heading, s, c, before, parameters.v_max)
            route.knot[i] = last
            break
        after_x, after_y = path.x[following] - px, path.y[following] - py
        after = np.sqrt(after_x * after_x + after_y * after_y)
        ahead, aside = c * after_x + s * after_y, c * after_y - s * after_x
        if corners > 0 and is_too_sharp(before, after, ahead, aside, first, parameters):
            return IMPOSSIBLE
        turn = atan2(aside, ahead)
        leg, speed = 0.0, 0.0
        if abs(turn) > NEAR and kind != HOLONOMIC:
            if corners > 0:
                early = kind == TRANSITION and first
                leg, speed = _round_corner(before, after, turn, v if first else 0.0, early, parameters)
                if leg == 0.0 and (first or abs(turn) > GENTLE):
                    return IMPOSSIBLE
                corners -= 1
            elif abs(turn) <= GENTLE:
                leg = min(0.3, 0.4 * min(before, after))
                speed = corner_speed(leg, turn, parameters)
                if speed < 0.2 * parameters.v_max:
                    leg = 0.0
        i = _add_line(route, x, y, heading, s, c, before - leg, parameters.v_max)
        first = False
        if leg > 0.0:
            i = _add_curve(route, px - leg * c, py - leg * s, heading, s, c, leg, turn, speed)
        route.knot[i] = k
        if leg == 0.0 and abs(turn) > NEAR:
            if kind != HOLONOMIC:
                route.rest, route.rest_heading = k, heading
                break
            _add_turn(route, px, py, heading, turn)
        heading = wrap(heading + turn)
        s, c = after_y / after, after_x / after
        if leg > 0.0:
            route.to_s[i], route.to_c[i] = s, c
        x, y, before = px + leg * c, py + leg * s, after - leg
        k = following
    return LAID if _speeds(route, v, parameters.a_max) else IMPOSSIBLE


@kernel
def _estimate_rest(path: Record, route: Record) -> None:
    """Set the length and the turning of the part of the path that is not generated."""
    route.rest_length = route.rest_turn = 0.0
    heading = route.rest_heading
    for i in range(route.rest if route.rest > 0 else path.n, path.n - 1):
        x, y = path.x[i + 1] - path.x[i], path.y[i + 1] - path.y[i]
        length = np.sqrt(x * x + y * y)
        if length < NEAR:
            continue
        towards = atan2(y, x)
        route.rest_length += length
        route.rest_turn += abs(wrap(towards - heading))
        heading = towards


@kernel
def plan_route(path: Record, pose: Record, kind: int, parameters: Record, route: Record) -> None:
    """Lay the way along the path from the state `pose`: the asked kind if it can be, else with stops to rotate.

    Args:
        path: PATH; its first knot is the start, which `pose` replaces.
        pose: POSE the robot has there; its speed need not be zero.
        route: ROUTE that is filled. `smooth` is 0 if the robot must stop and rotate before it can follow the way.
    """
    for stop in range(IF_NEEDED, ALWAYS + 1):
        laid = enter(path, 1, pose, stop, parameters, route)
        stops = stop == ALWAYS or route.smooth == 0
        if laid == ENTERED:
            laid = go_on(path, pose.v, HYBRID if stops and kind == TRANSITION else kind, parameters, route)
            if laid != LAID and kind != HOLONOMIC:
                laid = go_on(path, pose.v, HOLONOMIC, parameters, route)
                if laid == LAID and not stops and kind == TRANSITION:
                    route.smooth = 0
        if laid == LAID:
            _estimate_rest(path, route)
            return
        if stops:
            break
    # Only standing at the goal, or so near that braking overshoots it, is left: brake and stay.
    route.n = 0
    s, c = sin_cos(pose.heading)
    way = 0.5 * pose.v * pose.v / parameters.a_max
    _add_line(route, pose.x, pose.y, pose.heading, s, c, way, parameters.v_max)
    route.knot[0] = path.n - 1
    route.rest_length = route.rest_turn = 0.0
    _speeds(route, pose.v, parameters.a_max)

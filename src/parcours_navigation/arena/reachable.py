"""How early a disc may, and certainly can, reach the goal among obstacles whose motion is known.

The inner set holds only points that are certainly reached without contact; each robot's shadow (a lattice point within
SHADOW spacings of it) stays in the outer set for as long as it has met nothing. docs/solvability.md has the proofs.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.arena.contact import least_distance
from parcours_navigation.arena.lattice import (
    EDGE,
    ROWS,
    SHADOW,
    WORDS,
    Box,
    grow_inner,
    grow_outer,
    put,
    reached_box,
    take_disc,
)
from parcours_navigation.arena.obstacles import place_at
from parcours_navigation.arena.world import TICK

INSIDE = 1e-6
"""The last leg ends this far inside the goal's tolerance [m]."""


@kernel
def blur(obstacle: Record) -> float:
    """Return by how much the world's own contact may differ from the true one [m] (see `arena.contact`).

    The sets leave it out on both sides, so that their answers hold for the world as well.
    """
    tick = TICK * 1e-9
    return float(obstacle.speed * (0.25 * tick + 0.125 * abs(obstacle.turn) * tick * tick) + 1e-9)


@kernel
def stray(obstacle: Record, t0: int, t1: int) -> tuple[float, float]:
    """Return (its way, how far it strays from its chord passed at constant speed) between t0 and t1 [ns], [m]."""
    a, b = max(t0, obstacle.start), min(t1, obstacle.stop)
    if a >= b:
        return 0.0, 0.0
    moving = (b - a) * 1e-9
    way = obstacle.speed * moving
    kink = way * max(a - t0, t1 - b) / (t1 - t0)
    return way, kink + 0.125 * obstacle.speed * abs(obstacle.turn) * moving * moving


@kernel
def leg_is_free(
    obstacles: Record, robot_radius: float, x: float, y: float, vx: float, vy: float, t0: int, t1: int, step: int
) -> bool:
    """Return whether a disc that is in (x, y) [m] at t0 [ns] and moves at (vx, vy) [m/s] until t1 meets nothing.

    The leg is looked at in pieces of at most `step` [ns]; each piece is charged for all it may hide.
    """
    for i in range(len(obstacles)):
        obstacle = obstacles[i]
        reach = robot_radius + obstacle.radius + blur(obstacle)
        a = t0
        ox, oy = place_at(obstacle, a)
        while a < t1:
            b = min(a + step, t1)
            ex, ey = place_at(obstacle, b)
            _, strayed = stray(obstacle, a, b)
            sa, sb = (a - t0) * 1e-9, (b - t0) * 1e-9
            gap = least_distance(x + vx * sa - ox, y + vy * sa - oy, x + vx * sb - ex, y + vy * sb - ey)
            if gap <= reach + strayed:
                return False
            a, ox, oy = b, ex, ey
    return True


@kernel
def nanoseconds(seconds: float) -> int:
    """Return the time in whole nanoseconds."""
    return int(np.rint(seconds * 1e9))


@kernel
def inflated(obstacle: Record, lattice: Record, k: int) -> float:
    """Return how far lattice points must be from the obstacle at both ends of step k, so that nothing happens in it.

    In the step the relative motion is a chord of length c, but for `stray`; if both its ends are farther than
    sqrt(r^2 + (c/2)^2) from the origin, all of it is farther than r.
    """
    #   a ------- m ------- b    the chord a b of length c, seen from the obstacle o:
    #     \       |       /      with |ao| and |bo| at least sqrt(r^2 + (c/2)^2), its nearest point m,
    #        \    | r  /         at worst in the middle, is no nearer than r
    #             o
    way, strayed = stray(obstacle, nanoseconds(k * lattice.step), nanoseconds((k + 1) * lattice.step))
    half = 0.5 * (way + lattice.v_max * lattice.step)
    r = lattice.robot_radius + obstacle.radius + blur(obstacle) + strayed
    return float(np.sqrt(r * r + half * half)) + 1e-9


@kernel
def begin_set(bits: Record, lattice: Record) -> None:
    """Empty the set but for the start."""
    bits[:] = np.uint64(0)
    put(bits, lattice.column, lattice.row)


@kernel
def take_obstacles_inner(bits: Record, lattice: Record, obstacles: Record, k: int) -> None:
    """Take out what an obstacle may touch in the step before or after time k."""
    now = nanoseconds(k * lattice.step)
    for i in range(len(obstacles)):
        radius = inflated(obstacles[i], lattice, k)
        if k > 0:
            radius = max(radius, inflated(obstacles[i], lattice, k - 1))
        x, y = place_at(obstacles[i], now)
        take_disc(bits, lattice, x, y, radius)


@kernel
def nearest(bits: Record, near: Record, lattice: Record) -> tuple[float, float, float]:
    """Return (distance to the goal, x, y) [m] of the nearest point in both sets; (inf, 0, 0) if there is none."""
    least, best_x, best_y = np.inf, 0.0, 0.0
    reach = (lattice.tolerance + lattice.v_max * lattice.step) / lattice.spacing + 2.0
    middle = (lattice.goal_y - lattice.y0) / lattice.spacing
    for row in range(max(int(middle - reach), 0), min(int(middle + reach) + 2, ROWS)):
        for w in range(WORDS):
            word = bits[1 + w, EDGE + row] & near[1 + w, EDGE + row]
            if word == np.uint64(0):
                continue
            y = lattice.y0 + row * lattice.spacing
            for b in range(64):
                if (word >> np.uint64(b)) & np.uint64(1):
                    x = lattice.x0 + (64 * w + b) * lattice.spacing
                    dx, dy = lattice.goal_x - x, lattice.goal_y - y
                    square = dx * dx + dy * dy
                    if square < least:
                        least, best_x, best_y = square, x, y
    return np.sqrt(least), best_x, best_y


@kernel
def last_leg(lattice: Record, obstacles: Record, k: int, x: float, y: float) -> float:
    """Return when a disc that leaves (x, y) [m] after k steps, straight for the goal, is there [s]; inf if never."""
    dx, dy = lattice.goal_x - x, lattice.goal_y - y
    far = np.sqrt(dx * dx + dy * dy)
    lasts = max(far - lattice.tolerance + INSIDE, 0.0) / lattice.v_max
    share = lattice.v_max / far if lasts > 0.0 else 0.0
    t0 = nanoseconds(k * lattice.step)
    t1 = t0 + nanoseconds(lasts)
    piece = nanoseconds(0.5 * lattice.step)
    free = leg_is_free(obstacles, lattice.robot_radius, x, y, share * dx, share * dy, t0, t1, piece)
    when = k * lattice.step + lasts
    return float(when) if free and when <= lattice.limit else np.inf


@kernel
def arrival(bits: Record, near: Record, lattice: Record, obstacles: Record, k: int) -> float:
    """Return the earliest arrival [s] from a point of the inner set by a free leg within step k; inf if none."""
    far, x, y = nearest(bits, near, lattice)
    if far == np.inf:
        return np.inf
    best = last_leg(lattice, obstacles, k, x, y)
    if best < np.inf:
        return best
    # The leg from the nearest point is blocked: try them all.
    for row in range(ROWS):
        for w in range(WORDS):
            word = bits[1 + w, EDGE + row] & near[1 + w, EDGE + row]
            if word == np.uint64(0):
                continue
            for b in range(64):
                if (word >> np.uint64(b)) & np.uint64(1):
                    x, y = lattice.x0 + (64 * w + b) * lattice.spacing, lattice.y0 + row * lattice.spacing
                    best = min(best, last_leg(lattice, obstacles, k, x, y))
    return best


@kernel
def _goal_is_covered(obstacles: Record, lattice: Record, k: int) -> bool:
    """Return whether one obstacle alone keeps the robot out of the whole goal throughout step k."""
    t0, t1 = nanoseconds(k * lattice.step), nanoseconds((k + 1) * lattice.step)
    for i in range(len(obstacles)):
        obstacle = obstacles[i]
        x, y = place_at(obstacle, t0)
        dx, dy = x - lattice.goal_x, y - lattice.goal_y
        way, _ = stray(obstacle, t0, t1)
        reach = lattice.robot_radius + obstacle.radius - blur(obstacle)
        if np.sqrt(dx * dx + dy * dy) + way + lattice.tolerance <= reach:
            return True
    return False


@kernel
def _outer_arrival(bits: Record, near: Record, lattice: Record, k: int) -> float:
    """Return a time [s] before which no robot whose shadow is in the outer set after k steps arrives; inf."""
    far, _, _ = nearest(bits, near, lattice)
    lasts = max(far - lattice.tolerance - SHADOW * lattice.spacing - 1e-9, 0.0) / lattice.v_max
    when = k * lattice.step + lasts
    return float(when) if lasts <= lattice.step and when <= lattice.limit else np.inf


@kernel
def _touches(bits: Record, others: Record, box: Box) -> bool:
    """Return whether the sets have a point in common within the box."""
    common = np.uint64(0)
    for w in range(box[0], box[1]):
        one, two = bits[w, box[2] : box[3]], others[w, box[2] : box[3]]
        for j in range(len(one)):
            common |= one[j] & two[j]
    return bool(common != np.uint64(0))


@kernel
def earliest_outer(
    obstacles: Record, lattice: Record, near: Record, edge: Record, caps: Record, bits: Record, wide: Record
) -> float:
    """Return a time [s] before which nobody arrives, inf if nobody does; the last two are working memory."""
    begin_set(bits, lattice)
    left = False  # whether somebody may be outside the lattice's square, and come back
    for k in range(lattice.n_steps + 1):
        if k > 0:
            box = reached_box(lattice, k)  # the cap lies in it as well, and with it whatever comes back
            grow_outer(bits, wide, box)
            if not left:
                left = _touches(bits, edge, box)
            back = ~np.uint64(0) if left else np.uint64(0)
            for w in range(box[0], box[1]):
                out, border, cap = bits[w, box[2] : box[3]], edge[w, box[2] : box[3]], caps[k, w, box[2] : box[3]]
                for j in range(len(out)):
                    out[j] = (out[j] | (border[j] & back)) & cap[j]
        now = nanoseconds(k * lattice.step)
        for i in range(len(obstacles)):
            reach = lattice.robot_radius + obstacles[i].radius - blur(obstacles[i]) - SHADOW * lattice.spacing - 1e-9
            if reach > 0.0:
                x, y = place_at(obstacles[i], now)
                take_disc(bits, lattice, x, y, reach)
        when = _outer_arrival(bits, near, lattice, k)
        if when < np.inf and not _goal_is_covered(obstacles, lattice, k):
            return when
    return np.inf


@kernel
def earliest_inner(obstacles: Record, lattice: Record, near: Record, bits: Record, wide: Record) -> float:
    """Return a time [s] by which a disc has arrived, inf if the inner set never does."""
    begin_set(bits, lattice)
    for k in range(lattice.n_steps + 1):
        if k > 0:
            grow_inner(bits, wide, reached_box(lattice, k))
        take_obstacles_inner(bits, lattice, obstacles, k)
        when = arrival(bits, near, lattice, obstacles, k)
        if when < np.inf:
            return when
    return np.inf

"""ORCA's half-planes of permitted velocities, between two bodies and before a wall, and the best velocity in them.

Van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance (Springer 2011), sections 4 and 5. A half-plane
is a row (nx, ny, b) that permits the velocities with nx*x + ny*y >= b [m/s]; (nx, ny) is a unit vector. Those of walls
come first and are kept even where those of bodies cannot be.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import kernel
from parcours_navigation.protocol import Floats

_CENTRED = 1e-12
_PARALLEL = 1e-9


@kernel
def half_plane(
    px: float, py: float, vx: float, vy: float, reach: float, horizon: float, overlap_time: float
) -> tuple[float, float, float, float]:
    """Return (ux, uy, nx, ny): the least change of velocity [m/s] that leaves the velocity obstacle, and its normal.

    (px, py) runs from the body to the other [m], (vx, vy) is its velocity less the other's [m/s], `reach` the sum of
    the radii [m]; the velocity obstacle is that of `horizon` [s], or of `overlap_time` [s] for bodies that overlap.
    """
    #      \   ( + )   /     + is (px, py) / time, the disc's radius reach / time
    #       \  (   )  /      the nearest border is the disc's front, or one of the legs, which touch the disc
    #        \_(___)_/
    #             o
    square = px * px + py * py
    overlaps = square <= reach * reach
    time = overlap_time if overlaps else horizon
    wx, wy = vx - px / time, vy - py / time  # from the centre of the disc that cuts the cone off
    length_square = wx * wx + wy * wy
    along = wx * px + wy * py
    if overlaps or (along < 0.0 and along * along > reach * reach * length_square):
        length = np.sqrt(length_square)
        if length < _CENTRED:
            away = np.sqrt(square)
            nx, ny = (-px / away, -py / away) if away > _CENTRED else (1.0, 0.0)
        else:
            nx, ny = wx / length, wy / length
        size = reach / time - length
        return size * nx, size * ny, nx, ny
    leg = np.sqrt(square - reach * reach)
    if px * wy - py * wx > 0.0:  # left of the axis: the left leg is nearer
        dx, dy = (px * leg - py * reach) / square, (px * reach + py * leg) / square
        nx, ny = -dy, dx
    else:
        dx, dy = (px * leg + py * reach) / square, (-px * reach + py * leg) / square
        nx, ny = dy, -dx
    out = vx * nx + vy * ny
    return -out * nx, -out * ny, nx, ny


@kernel
def _tangents(x: float, y: float, reach: float) -> tuple[float, float, float, float]:
    """Return the directions of the left and the right tangent from the origin to a disc round (x, y)."""
    square = x * x + y * y
    leg = np.sqrt(max(square - reach * reach, 0.0))
    return (
        (x * leg - y * reach) / square,
        (x * reach + y * leg) / square,
        (x * leg + y * reach) / square,
        (y * leg - x * reach) / square,
    )


@kernel
def wall_plane(
    ax: float, ay: float, bx: float, by: float, reach: float, horizon: float, vx: float, vy: float
) -> tuple[float, float, float]:
    """Return the half-plane (nx, ny, b) of velocities that a wall permits for `horizon` [s].

    The wall runs from (ax, ay) to (bx, by) as seen from the body [m]; `reach` is the body's radius with half the wall's
    thickness [m], (vx, vy) the body's velocity [m/s]. The wall does nothing: all the avoiding is the body's.
    """
    # The velocity obstacle is convex: the wall's capsule, shrunk by the horizon, and all behind it. Its core, between
    # the rays from l and r, is what is left when `reach` / `horizon` is taken off all round.
    #
    #      \             /      left leg, front and right leg are the core's three edges; the velocity is put on the
    #       \           /       border that belongs to its nearest point of them
    #        l─────────r
    #             o
    ex, ey = bx - ax, by - ay
    square = ex * ex + ey * ey
    share = min(max(-(ax * ex + ay * ey) / square, 0.0), 1.0) if square > 0.0 else 0.0
    fx, fy = ax + share * ex, ay + share * ey
    if fx * fx + fy * fy <= reach * reach:
        away = np.sqrt(fx * fx + fy * fy)
        if away > _CENTRED:
            return -fx / away, -fy / away, 0.0
        if square > 0.0:
            length = np.sqrt(square)
            return -ey / length, ex / length, 0.0
        return 1.0, 0.0, 0.0
    alx, aly, arx, ary = _tangents(ax, ay, reach)
    blx, bly, brx, bry = _tangents(bx, by, reach)
    b_is_left = alx * bly - aly * blx > 0.0
    a_is_right = brx * ary - bry * arx < 0.0
    k = 1.0 / horizon
    lx, ly, dlx, dly = (k * bx, k * by, blx, bly) if b_is_left else (k * ax, k * ay, alx, aly)
    rx, ry, drx, dry = (k * ax, k * ay, arx, ary) if a_is_right else (k * bx, k * by, brx, bry)
    one_end = b_is_left != a_is_right or square == 0.0
    wlx, wly, wrx, wry = vx - lx, vy - ly, vx - rx, vy - ry
    along_l, along_r = wlx * dlx + wly * dly, wrx * drx + wry * dry
    cx, cy = rx - lx, ry - ly
    t = 0.5 if one_end else (wlx * cx + wly * cy) / (cx * cx + cy * cy)
    if along_l < 0.0 and (t < 0.0 or (one_end and along_r < 0.0)):
        return _round(lx, ly, wlx, wly, k * reach)
    if along_r < 0.0 and t > 1.0:
        return _round(rx, ry, wrx, wry, k * reach)
    to_front, to_left, to_right = np.inf, np.inf, np.inf
    if along_l >= 0.0:
        to_left = abs(dlx * wly - dly * wlx)
    if along_r >= 0.0:
        to_right = abs(drx * wry - dry * wrx)
    nx, ny = 0.0, 0.0
    if not one_end and 0.0 <= t <= 1.0:
        length = np.sqrt(cx * cx + cy * cy)
        nx, ny = -cy / length, cx / length
        if nx * lx + ny * ly > 0.0:
            nx, ny = -nx, -ny
        to_front = abs(nx * wlx + ny * wly)
    if to_front <= to_left and to_front <= to_right:
        return nx, ny, nx * lx + ny * ly + k * reach
    if to_left <= to_right:
        return -dly, dlx, dlx * ly - dly * lx + k * reach
    return dry, -drx, dry * rx - drx * ry + k * reach


@kernel
def _round(x: float, y: float, wx: float, wy: float, radius: float) -> tuple[float, float, float]:
    """Return the half-plane outside a disc round (x, y) in the direction (wx, wy) from its centre."""
    length = np.sqrt(wx * wx + wy * wy)
    if length < _CENTRED:
        wx, wy, length = -x, -y, np.sqrt(x * x + y * y)
    nx, ny = wx / length, wy / length
    return nx, ny, nx * x + ny * y + radius


@kernel
def _optimum_on_line(
    planes: Floats, i: int, top: float, want_x: float, want_y: float, far: bool
) -> tuple[bool, float, float]:
    """Return (exists, x, y): the best velocity on the border of half-plane i within all earlier ones and the disc."""
    nx, ny, b = planes[i, 0], planes[i, 1], planes[i, 2]
    square = top * top - b * b
    if square < 0.0:
        return False, 0.0, 0.0
    high = np.sqrt(square)
    low = -high
    px, py, dx, dy = nx * b, ny * b, ny, -nx
    for j in range(i):
        slope = planes[j, 0] * dx + planes[j, 1] * dy
        room = planes[j, 2] - (planes[j, 0] * px + planes[j, 1] * py)
        if abs(slope) < _PARALLEL:
            if room > 0.0:
                return False, 0.0, 0.0
        elif slope > 0.0:
            low = max(low, room / slope)
        else:
            high = min(high, room / slope)
    if low > high:
        return False, 0.0, 0.0
    along = want_x * dx + want_y * dy
    if far:
        t = high if along > 0.0 else low
    else:
        t = min(max(along, low), high)
    return True, px + t * dx, py + t * dy


@kernel
def nearest_permitted(
    planes: Floats, n: int, top: float, want_x: float, want_y: float, far: bool
) -> tuple[int, float, float]:
    """Return (first half-plane that cannot be kept or n, x, y): the best velocity within a disc and half-planes.

    The two-dimensional linear program of section 5.3: half-planes are added one by one, and the optimum moves to the
    border of a new one that it does not satisfy. The disc has the radius `top` [m/s]. (want_x, want_y) is the velocity
    to be near to, or, if `far`, the direction to go far in.
    """
    #   permitted   :    + wanted      one line after the other is added; while the optimum keeps a new line nothing
    #     ─ ─ ─ ─ ─ ○ ─ ─ ─ ─ new     changes, else the new one lies on that line, within what the earlier ones leave
    #          old  :  forbidden
    x, y = want_x, want_y
    if far:
        x, y = want_x * top, want_y * top
    else:
        length = np.sqrt(x * x + y * y)
        if length > top:
            x, y = x * top / length, y * top / length
    for i in range(n):
        if planes[i, 0] * x + planes[i, 1] * y < planes[i, 2]:
            exists, new_x, new_y = _optimum_on_line(planes, i, top, want_x, want_y, far)
            if not exists:
                return i, x, y
            x, y = new_x, new_y
    return n, x, y


@kernel
def least_violating(
    planes: Floats, n: int, n_walls: int, first: int, top: float, x: float, y: float, scratch: Floats
) -> tuple[float, float]:
    """Return the velocity (x, y) in the disc whose greatest violation of a half-plane is least [m/s].

    The first `n_walls` half-planes are kept. `nearest_permitted` failed at half-plane `first` with (x, y); `scratch` is
    working memory, shape (>= n, 3).
    """
    # The three-dimensional linear program of section 5.3, solved as one of two dimensions for each half-plane that is
    # violated most: within it, where it is violated as much as another one is a line.
    kept_always = n_walls if first >= n_walls else 0
    worst = 0.0
    for i in range(first, n):
        if planes[i, 2] - (planes[i, 0] * x + planes[i, 1] * y) <= worst:
            continue
        for j in range(kept_always):
            scratch[j, 0], scratch[j, 1], scratch[j, 2] = planes[j, 0], planes[j, 1], planes[j, 2]
        m = kept_always
        for j in range(kept_always, i):
            nx, ny = planes[j, 0] - planes[i, 0], planes[j, 1] - planes[i, 1]
            length = np.sqrt(nx * nx + ny * ny)
            if length > _PARALLEL:
                scratch[m, 0], scratch[m, 1] = nx / length, ny / length
                scratch[m, 2] = (planes[j, 2] - planes[i, 2]) / length
                m += 1
        kept, new_x, new_y = nearest_permitted(scratch, m, top, planes[i, 0], planes[i, 1], True)
        if kept == m:
            x, y = new_x, new_y
        worst = planes[i, 2] - (planes[i, 0] * x + planes[i, 1] * y)
    return x, y


@kernel
def new_velocity(
    planes: Floats, scratch: Floats, n: int, n_walls: int, want_x: float, want_y: float, top: float
) -> tuple[float, float]:
    """Return the permitted velocity (x, y) [m/s] nearest to the wanted one, or else the least bad one.

    `planes` has n rows, the first `n_walls` of them those of walls; `scratch` is working memory, shape (>= n, 3).
    """
    kept, x, y = nearest_permitted(planes, n, top, want_x, want_y, False)
    if kept < n:
        return least_violating(planes, n, n_walls, kept, top, x, y, scratch)
    return x, y

"""ORCA: the permitted velocity nearest to the preferred one, free of collision for a while if obstacles keep theirs.

Van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance (Springer 2011): half-planes of section 4, linear
programs of sections 5.3 and 5.4 by the incremental method of de Berg et al., Computational Geometry (2008), chapter 4.
The unicycle follows the velocity with an error, by which the robot is taken to be larger: Alonso-Mora, Breitenmoser,
Rufli, Beardsley, Siegwart, Optimal reciprocal collision avoidance for multiple non-holonomic robots (Springer 2013).
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import kernel
from parcours_navigation.planners.motion import Options, chord_velocity, runs_into, settled
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import SECTORS, Surroundings
from parcours_navigation.protocol import HEADING, Command, Floats, Observation, Task

_STANDING = 1e-6
_ALIGNED = 1e-4
_CENTRED = 1e-12
_PARALLEL = 1e-9
_HALT_STEP = 0.1


@kernel
def half_plane(
    px: float, py: float, vx: float, vy: float, reach: float, horizon: float, overlap_time: float
) -> tuple[float, float, float, float]:
    """Return (ux, uy, nx, ny): the least change of velocity [m/s] that leaves the velocity obstacle, and its normal.

    (px, py) runs from the robot to the obstacle [m], (vx, vy) is the robot's velocity less the obstacle's [m/s],
    `reach` the sum of the radii [m].
    """
    # The relative velocities that lead to contact in time, seen from rest in o: a cone, cut off by a disc in front.
    #
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
def permit(
    robot: Floats,
    obstacles: Floats,
    radius: float,
    horizon: float,
    overlap_time: float,
    share: float,
    turn_time: float,
    planes: Floats,
) -> None:
    """Fill in the half-plane of permitted velocities for each obstacle: nx*x + ny*y >= b [m/s], rows (nx, ny, b)."""
    s, c = sin_cos(robot[2])
    vx, vy = robot[3] * c, robot[3] * s
    for i in range(obstacles.shape[0]):
        ox, oy = chord_velocity(obstacles[i, 2], obstacles[i, 3], obstacles[i, 4], turn_time)
        px, py = obstacles[i, 0] - robot[0], obstacles[i, 1] - robot[1]
        ux, uy, nx, ny = half_plane(px, py, vx - ox, vy - oy, radius + obstacles[i, 5], horizon, overlap_time)
        planes[i, 0], planes[i, 1] = nx, ny
        planes[i, 2] = (vx + share * ux) * nx + (vy + share * uy) * ny


@kernel
def drive_towards(
    heading: float, x: float, y: float, align_time: float, w_max: float, alpha: float
) -> tuple[float, float]:
    """Return (v, w) [m/s, rad/s]: speeds of a unicycle at a heading [rad] that turn it into the velocity (x, y) [m/s].

    The nearer the heading, the faster it drives: v is the speed that ends where the velocity would after `align_time`
    [s], times the cosine of the angle left; it turns on the spot from a right angle on. The turn keeps to `w_max`
    [rad/s], and can be stopped in time at `alpha` [rad/s2].

    >>> drive_towards(0.0, 0.2, 0.0, 0.5, 1.5, 2.0)
    (0.2, 0.0)
    >>> drive_towards(0.0, -0.2, 0.0, 0.5, 1.5, 2.0)[0]
    0.0
    """
    speed = float(np.sqrt(x * x + y * y))
    if speed < _STANDING:
        return 0.0, 0.0
    error = wrap(atan2(y, x) - heading)
    size = abs(error)
    w = float(min(min(size / align_time, np.sqrt(2.0 * alpha * size)), w_max))
    if error < 0.0:
        w = -w
    if size < _ALIGNED:
        return speed, w
    s, c = sin_cos(error)
    if c <= 0.0:
        return 0.0, w
    return min(speed * 0.5 * error * s / (1.0 - c), speed) * c, w


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
    border of a new one that it does not satisfy.

    The first n rows (nx, ny, b) of `planes` permit nx*x + ny*y >= b; (nx, ny) is a unit vector. The disc has the radius
    `top` [m/s]. (want_x, want_y) is the velocity to be near to, or, if `far`, the direction to go far in.
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
    planes: Floats, n: int, first: int, top: float, x: float, y: float, scratch: Floats
) -> tuple[float, float]:
    """Return the velocity (x, y) in the disc whose greatest violation of a half-plane is least [m/s].

    `nearest_permitted` failed at half-plane `first` with (x, y); `scratch` is working memory, shape (>= n, 3).
    """
    # The three-dimensional linear program of section 5.3, solved as one of two dimensions for each half-plane that is
    # violated most: within it, where it is violated as much as another one is a line.
    worst = 0.0
    for i in range(first, n):
        if planes[i, 2] - (planes[i, 0] * x + planes[i, 1] * y) <= worst:
            continue
        m = 0
        for j in range(i):
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
    planes: Floats, scratch: Floats, n: int, want_x: float, want_y: float, top: float
) -> tuple[float, float]:
    """Return the permitted velocity (x, y) [m/s] nearest to the wanted one, or else the least bad one."""
    kept, x, y = nearest_permitted(planes, n, top, want_x, want_y, False)
    if kept < n:
        return least_violating(planes, n, kept, top, x, y, scratch)
    return x, y


OPTIONS: Options = {
    "horizon": (5.0, 0.05, 60.0, "s"),  # velocities are free of collision for this long
    "overlap_time": (1.0, 0.01, 60.0, "s"),  # discs that overlap already part within this time
    "share": (1.0, 0.0, 1.0, ""),  # of the avoiding that the robot does; 0.5: the obstacles do the same
    "margin": (0.04, 0.0, 10.0, "m"),  # the robot's radius is enlarged by it, for the error of following a velocity
    "align_time": (0.6, 0.01, 10.0, "s"),  # the robot turns into its velocity in about this time
    "turn_time": (1.0, 0.0, 10.0, "s"),  # an obstacle's velocity is its mean over this time on its arc; 0: now
    "tilt": (0.03, -0.5, 0.5, "rad"),  # the preferred velocity is turned by it from the goal, to break symmetry
    "lookahead": (1.0, 0.0, 100.0, "m"),  # with a map or a path: heads for what is so far along the way; 0: the goal
    "wall_horizon": (1.5, 0.05, 60.0, "s"),  # velocities touch no wall for this long
    "halt_time": (0.5, 0.0, 10.0, "s"),  # brake if it would run into an obstacle within this time; 0: never
    "halt_margin": (0.02, 0.0, 10.0, "m"),  # ... or come this near to it
}


class Orca:
    """Optimal reciprocal collision avoidance, for a unicycle among obstacles that do not avoid it.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    def __init__(self, **options: float) -> None:
        self._options = settled("orca", OPTIONS, options)
        self._planes, self._scratch = np.empty((0, 3)), np.empty((0, 3))
        self._surroundings, self._route = Surroundings(), Route(self._options.margin)

    def reset(self, task: Task) -> None:
        """Begin a case; ORCA remembers nothing from one observation to the next, but for its way over a map."""
        self._route.begin()

    def observe(self, observation: Observation) -> Command:
        """Return the speeds that turn the robot into its new velocity; at the goal it stops."""
        task, robot, obstacles = observation.task, observation.robot, observation.obstacles
        limits, n, o = task.limits, len(obstacles), self._options
        self._surroundings.look(observation)
        aim = self._route.aim(observation, self._surroundings.walls, o.lookahead)
        dx, dy, distance, speed = towards(observation, aim)
        if speed == 0.0:
            return Command(0.0, 0.0)
        if n + SECTORS > len(self._planes):
            self._planes, self._scratch = np.empty((n + SECTORS, 3)), np.empty((n + SECTORS, 3))
        radius = task.robot_radius + o.margin
        permit(robot, obstacles, radius, o.horizon, o.overlap_time, o.share, o.turn_time, self._planes)
        near = self._surroundings.with_walls(observation, radius + limits.speed * o.wall_horizon)
        if len(near) > n:
            rest = self._planes[n:]
            permit(robot, near[n:], radius, o.wall_horizon, o.overlap_time, 1.0, 0.0, rest)
            obstacles, n = near, len(near)
        s, c = sin_cos(o.tilt)
        want_x, want_y = (c * dx - s * dy) * speed / distance, (s * dx + c * dy) * speed / distance
        x, y = new_velocity(self._planes, self._scratch, n, want_x, want_y, limits.speed)
        heading = float(robot[HEADING])
        v, w = drive_towards(heading, x, y, o.align_time, limits.yaw_rate, limits.yaw_acceleration)
        radius = task.robot_radius + o.halt_margin
        if o.halt_time > 0.0 and runs_into(robot, v, w, obstacles, radius, o.halt_time, _HALT_STEP)[1] >= 0:
            v = 0.0
        return Command(v, w)

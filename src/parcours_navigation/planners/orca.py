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
from parcours_navigation.others.half_planes import half_plane, new_velocity
from parcours_navigation.planners.motion import Options, chord_velocity, runs_into, settled
from parcours_navigation.planners.route import Route, towards
from parcours_navigation.planners.walls import SECTORS, Surroundings
from parcours_navigation.protocol import Floats, Observation, Task, X, Y

_STANDING = 1e-6
_ALIGNED = 1e-4
_HALT_STEP = 0.1


@kernel
def permit(
    robot: Floats,
    obstacles: Floats,
    first: int,
    last: int,
    radius: float,
    horizon: float,
    overlap_time: float,
    share: float,
    turn_time: float,
    planes: Floats,
) -> None:
    """Fill in the half-planes of velocities that obstacles permit: nx*x + ny*y >= b [m/s], rows (nx, ny, b)."""
    s, c = sin_cos(robot[2])
    vx, vy = robot[3] * c, robot[3] * s
    for i in range(first, last):
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


@kernel
def steer(
    robot: Floats,
    near: Floats,
    n_seen: int,
    x: float,
    y: float,
    speed: float,
    numbers: Floats,
    planes: Floats,
    scratch: Floats,
) -> tuple[float, float]:
    """Return the speeds (v, w) [m/s, rad/s] that turn the robot into its new velocity, or stop it before a contact.

    Args:
        robot: as in an observation.
        near: rows as in an observation; from row `n_seen` on they are walls.
        n_seen: how many of them are no walls.
        x: where it heads for, from the robot [m].
        y: [m].
        speed: how fast to go there [m/s]; below 0: there is the goal, and it says itself how fast.
        numbers: of the task, see `Orca._settle`.
        planes: working memory, shape (>= n, 3).
        scratch: working memory, shape (>= n, 3).
    """
    tilt_sin, tilt_cos, horizon, wall_horizon, overlap_time, share, turn_time = numbers[:7]
    radius, align_time, halt_time, halt_radius, top, w_max, braking, alpha, nearest = numbers[7:16]
    distance = float(np.sqrt(x * x + y * y))
    if speed < 0.0:
        speed = 0.0 if distance <= nearest else min(top, float(np.sqrt(2.0 * braking * distance)))
    if speed == 0.0:
        return 0.0, 0.0
    n = len(near)
    permit(robot, near, 0, n_seen, radius, horizon, overlap_time, share, turn_time, planes)
    permit(robot, near, n_seen, n, radius, wall_horizon, overlap_time, 1.0, 0.0, planes)
    want_x, want_y = (tilt_cos * x - tilt_sin * y) * speed / distance, (tilt_sin * x + tilt_cos * y) * speed / distance
    vx, vy = new_velocity(planes, scratch, n, 0, want_x, want_y, top)
    v, w = drive_towards(robot[2], vx, vy, align_time, w_max, alpha)
    if halt_time > 0.0 and runs_into(robot, v, w, near, halt_radius, halt_time, _HALT_STEP)[1] >= 0:
        v = 0.0
    return v, w


class Orca:
    """Optimal reciprocal collision avoidance, for a unicycle among obstacles that do not avoid it.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    def __init__(self, **options: float) -> None:
        self._options = settled("orca", OPTIONS, options)
        self._planes, self._scratch = np.empty((0, 3)), np.empty((0, 3))
        self._surroundings, self._route = Surroundings(), Route(self._options.margin)

        self._task: Task | None = None
        self._numbers = np.zeros(16)

    def reset(self, task: Task) -> None:
        """Begin a case; ORCA remembers nothing from one observation to the next, but for its way over a map."""
        self._route.begin()

    def _settle(self, task: Task) -> None:
        """Note what `steer` needs of a task, in the order in which it reads it."""
        o, limits, (s, c) = self._options, task.limits, sin_cos(self._options.tilt)
        self._task = task
        self._numbers[:] = (
            s, c, o.horizon, o.wall_horizon, o.overlap_time, o.share, o.turn_time, task.robot_radius + o.margin,
            o.align_time, o.halt_time, task.robot_radius + o.halt_margin, limits.speed, limits.yaw_rate,
            limits.acceleration, limits.yaw_acceleration, 0.5 * task.goal_tolerance,
        )  # fmt: skip

    def observe(self, observation: Observation) -> tuple[float, float]:
        """Return the speeds that turn the robot into its new velocity; at the goal it stops."""
        task, robot, near = observation.task, observation.robot, observation.obstacles
        if task is not self._task:
            self._settle(task)
        n, x, y, speed = len(near), task.goal[0] - robot.item(X), task.goal[1] - robot.item(Y), -1.0
        if observation.map is not None or observation.scan is not None or observation.path is not None:
            o = self._options
            self._surroundings.look(observation)
            aim = self._route.aim(observation, self._surroundings.walls, o.lookahead)
            x, y, _, speed = towards(observation, aim)
            reach = task.robot_radius + o.margin + task.limits.speed * o.wall_horizon
            near = self._surroundings.with_walls(observation, reach)
        if n + SECTORS > len(self._planes):
            self._planes, self._scratch = np.empty((n + SECTORS, 3)), np.empty((n + SECTORS, 3))
        return steer(robot, near, n, x, y, speed, self._numbers, self._planes, self._scratch)

"""An obstacle into the half-plane of velocities that avoid it, and a velocity into speeds that a unicycle can drive.

Half-planes as in van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance (Springer 2011), section 4;
the drive as in Alonso-Mora, Breitenmoser, Rufli, Beardsley, Siegwart, Optimal reciprocal collision avoidance for
multiple non-holonomic robots (Springer 2013), section 3.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import atan2, sin_cos, wrap
from parcours.kernels import kernel
from parcours_navigation.planners.motion import chord_velocity
from parcours_navigation.protocol import Floats

_STANDING = 1e-6
_ALIGNED = 1e-4
_CENTRED = 1e-12


@kernel
def half_plane(
    px: float, py: float, vx: float, vy: float, reach: float, horizon: float, overlap_time: float
) -> tuple[float, float, float, float]:
    """Return (ux, uy, nx, ny): the least change of velocity that leaves the velocity obstacle, outward.

    (ux, uy) [m/s] is added to the relative velocity; (nx, ny) is the normal of the obstacle's border there.

    Args:
        px: from the robot to the obstacle [m].
        py: its other part [m].
        vx: the robot's velocity less the obstacle's [m/s].
        vy: its other part [m/s].
        reach: sum of the radii [m].
        horizon: no collision for this long [s].
        overlap_time: discs that overlap already part within this time [s].
    """
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
    """Fill in the half-plane of permitted velocities for each obstacle.

    Args:
        robot: as in `Observation.robot`, shape (5,).
        obstacles: as in `Observation.obstacles`, shape (n, 6).
        radius: of the robot with its margin [m].
        horizon: no collision for this long [s].
        overlap_time: discs that overlap part within this time [s].
        share: part of the avoiding that the robot does itself; 1 where obstacles do nothing, 0.5 among equals.
        turn_time: an obstacle's velocity is its mean over this time on its arc [s]; 0: its velocity now.
        planes: receives rows (nx, ny, b): nx*x + ny*y >= b is permitted [m/s], shape (>= n, 3).
    """
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
    """Return (v, w) [m/s, rad/s]: speeds of a unicycle that turn it into the velocity (x, y).

    The nearer the heading, the faster it drives: v is the speed that ends where the velocity would after `align_time`,
    times the cosine of the angle left; it turns on the spot from a right angle on.

    Args:
        heading: of the robot [rad].
        x: wanted velocity [m/s].
        y: its other part [m/s].
        align_time: the heading is to be reached after this time [s].
        w_max: greatest yaw rate [rad/s].
        alpha: greatest yaw acceleration [rad/s2]; the turn can be stopped in time.

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

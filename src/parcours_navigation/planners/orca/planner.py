"""ORCA: an observation into the velocity nearest to the preferred one among those free of collision for a while.

Van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance (Springer 2011). The unicycle follows
the velocity with an error, by which the robot is taken to be larger (Alonso-Mora et al. 2013).
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import kernel
from parcours_navigation.planners.motion import require_number, runs_into, to_goal
from parcours_navigation.planners.orca.programs import least_violating, nearest_permitted
from parcours_navigation.planners.orca.velocities import drive_towards, permit
from parcours_navigation.protocol import HEADING, Command, Floats, Observation, Task

_HALT_STEP = 0.1


@kernel
def new_velocity(
    planes: Floats, scratch: Floats, n: int, want_x: float, want_y: float, top: float
) -> tuple[float, float]:
    """Return the velocity (x, y) [m/s] nearest to the wanted one that is permitted, or else the least bad one.

    Args:
        planes: rows (nx, ny, b): nx*x + ny*y >= b is permitted [m/s], shape (>= n, 3).
        scratch: working memory, shape (>= n, 3).
        n: how many rows count.
        want_x: wanted velocity [m/s].
        want_y: its other part [m/s].
        top: greatest speed [m/s].
    """
    kept, x, y = nearest_permitted(planes, n, top, want_x, want_y, False)
    if kept < n:
        return least_violating(planes, n, kept, top, x, y, scratch)
    return x, y


class Orca:
    """Optimal reciprocal collision avoidance, for a unicycle among obstacles that do not avoid it.

    Args:
        horizon: velocities are free of collision for this long [s].
        overlap_time: discs that overlap already part within this time [s].
        share: part of the avoiding that the robot does; 1: the obstacles do nothing, 0.5: they do the same.
        margin: the robot's radius is enlarged by this, for the error of following a velocity [m].
        align_time: the robot turns into its velocity in about this time [s].
        turn_time: an obstacle's velocity is its mean over this time on its arc [s]; 0: its velocity now.
        tilt: the preferred velocity is turned by this from the way to the goal, to break symmetry [rad].
        halt_time: brake if it would run into an obstacle within this time [s]; 0: never.
        halt_margin: ... or come this near to it [m].

    Raises:
        BadRequest: a parameter is no number or out of its range.
    """

    def __init__(
        self,
        *,
        horizon: float = 5.0,
        overlap_time: float = 1.0,
        share: float = 1.0,
        margin: float = 0.04,
        align_time: float = 0.6,
        turn_time: float = 1.0,
        tilt: float = 0.03,
        halt_time: float = 0.5,
        halt_margin: float = 0.02,
    ) -> None:
        self._horizon = require_number("orca", "horizon", horizon, 0.05, 60.0, "s")
        self._overlap_time = require_number("orca", "overlap_time", overlap_time, 0.01, 60.0, "s")
        self._share = require_number("orca", "share", share, 0.0, 1.0, "")
        self._margin = require_number("orca", "margin", margin, 0.0, 10.0, "m")
        self._align_time = require_number("orca", "align_time", align_time, 0.01, 10.0, "s")
        self._turn_time = require_number("orca", "turn_time", turn_time, 0.0, 10.0, "s")
        self._tilt = require_number("orca", "tilt", tilt, -0.5, 0.5, "rad")
        self._halt_time = require_number("orca", "halt_time", halt_time, 0.0, 10.0, "s")
        self._halt_margin = require_number("orca", "halt_margin", halt_margin, 0.0, 10.0, "m")
        self._planes = np.empty((0, 3))
        self._scratch = np.empty((0, 3))

    def reset(self, task: Task) -> None:
        """Begin a case; ORCA remembers nothing from one observation to the next."""

    def observe(self, observation: Observation) -> Command:
        """Return the speeds that turn the robot into its new velocity; at the goal it stops."""
        task, robot, obstacles = observation.task, observation.robot, observation.obstacles
        limits, n = task.limits, len(obstacles)
        dx, dy, distance, speed = to_goal(observation)
        if speed == 0.0:
            return Command(0.0, 0.0)
        if n > len(self._planes):
            self._planes, self._scratch = np.empty((n, 3)), np.empty((n, 3))
        radius = task.robot_radius + self._margin
        permit(robot, obstacles, radius, self._horizon, self._overlap_time, self._share, self._turn_time, self._planes)
        s, c = sin_cos(self._tilt)
        want_x, want_y = (c * dx - s * dy) * speed / distance, (s * dx + c * dy) * speed / distance
        x, y = new_velocity(self._planes, self._scratch, n, want_x, want_y, limits.speed)
        heading = float(robot[HEADING])
        v, w = drive_towards(heading, x, y, self._align_time, limits.yaw_rate, limits.yaw_acceleration)
        radius = task.robot_radius + self._halt_margin
        if self._halt_time > 0.0 and runs_into(robot, v, w, obstacles, radius, self._halt_time, _HALT_STEP)[1] >= 0:
            v = 0.0
        return Command(v, w)

"""A*: the cheapest way over the map, and a follower that slows down for what moves and goes round what stands.

The way is that of `search`; the follower is pure pursuit (Coulter, Implementation of the pure pursuit path tracking
algorithm, CMU-RI-TR-92-01, 1992) with the speed regulated by curvature and by room, as Macenski, Singh, Martin, Gines
do (Regulated pure pursuit for robot path tracking, Autonomous Robots 47, 2023).
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import PI, atan2, wrap
from parcours.kernels import kernel
from parcours_navigation.planners.distance import NO_WALLS, Walls, look, walls_of
from parcours_navigation.planners.motion import Options, runs_into, settled, travel
from parcours_navigation.planners.route import Route, blank, towards
from parcours_navigation.planners.walls import least_room
from parcours_navigation.protocol import HEADING, Command, Floats, Observation, Task, X, Y

_STEP = 0.1
_STANDING = 0.02
_CREEP = 0.3
"""The least share of top speed that narrow places leave."""


@kernel
def is_blocked(points: Floats, obstacles: Floats, radius: float, within: float) -> bool:
    """Return whether an obstacle that stands is nearer than `radius` [m] to the next `within` [m] of a way, (n, 2)."""
    gone = 0.0
    for k in range(len(points)):
        if k > 0:
            dx, dy = points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1]
            gone += np.sqrt(dx * dx + dy * dy)
            if gone > within:
                return False
        for i in range(len(obstacles)):
            dx, dy = points[k, 0] - obstacles[i, 0], points[k, 1] - obstacles[i, 1]
            reach = radius + obstacles[i, 5]
            if abs(obstacles[i, 3]) < _STANDING and dx * dx + dy * dy < reach * reach:
                return True
    return False


@kernel
def pursue(x: float, y: float, heading: float, speed: float, w_max: float, turn: float) -> tuple[float, float]:
    """Return (v, w) [m/s, rad/s] on the arc through a point (x, y) [m] from the robot, at `speed` [m/s] or less.

    From `turn` [rad] on between heading and point it turns on the spot.

    >>> pursue(1.0, 0.0, 0.0, 0.2, 1.0, 0.8)
    (0.2, 0.0)
    >>> pursue(0.0, 1.0, 0.0, 0.2, 1.0, 0.8)
    (0.0, 1.0)
    """
    error = wrap(atan2(y, x) - heading)
    if abs(error) > turn:
        return 0.0, min(max(2.0 * error, -w_max), w_max)
    away = max(np.sqrt(x * x + y * y), 1e-3)
    c, s = travel(0.0, 0.0, heading, 1.0, 0.0, 1.0)
    curvature = 2.0 * (c * y - s * x) / (away * away)
    v = min(speed, w_max / max(abs(curvature), 1e-9))
    return v, v * curvature


OPTIONS: Options = {
    "lookahead": (0.6, 0.05, 100.0, "m"),  # pursues the point so far along the way that it sees
    "turn": (0.7, 0.05, 3.2, "rad"),  # turns on the spot if the point is more aside
    "margin": (0.03, 0.0, 10.0, "m"),  # the way keeps so much more than the radius off walls, where it can
    "slow_room": (0.25, 0.001, 10.0, "m"),  # slower where there is less room than this beside the robot
    "slow_time": (2.0, 0.0, 60.0, "s"),  # slower if it would run into an obstacle within this time
    "halt_time": (0.6, 0.0, 10.0, "s"),  # brakes if within this time
    "patience": (1.0, 0.05, 60.0, "s"),  # after this time before an obstacle it looks for another way
}


class AStar:
    """A* on the map with a follower; without a map, in an empty one.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    needs = ("map",)

    def __init__(self, **options: float) -> None:
        self._options = settled("a-star", OPTIONS, options)
        self._route, self._walls, self._empty = Route(self._options.margin), NO_WALLS, NO_WALLS
        self._moved, self._searched, self._back_until = 0.0, -math.inf, -math.inf

    def reset(self, task: Task) -> None:
        """Begin a case: forget the way."""
        self._route.begin()
        self._empty = NO_WALLS
        self._moved, self._searched, self._back_until = 0.0, -math.inf, -math.inf

    def observe(self, observation: Observation) -> Command:
        """Return the speeds along the way; at the goal it stops."""
        task, robot, obstacles, o = observation.task, observation.robot, observation.obstacles, self._options
        walls, time = self._walls_of(observation), observation.time
        aim = self._route.aim(observation, walls, o.lookahead)
        if time >= self._searched + 0.5 and observation.path is None:
            waited = time - self._moved > o.patience
            if waited or is_blocked(self._route.points, obstacles, task.robot_radius + 0.5 * o.margin, 1.5):
                self._route.search(observation, walls, moving=waited)
                self._searched = time
                self._moved = max(self._moved, time - 0.5 * o.patience)
                aim = self._route.aim(observation, walls, o.lookahead)
        x, y, _, speed = towards(observation, aim)
        if speed == 0.0:
            self._moved = time
            return Command(0.0, 0.0)
        room = look(walls.distances, walls.frame, float(robot[X]), float(robot[Y]))[0] - task.robot_radius
        speed = min(speed, task.limits.speed * max(min(room / o.slow_room, 1.0), _CREEP))
        heading, top = float(robot[HEADING]), task.limits.yaw_rate
        is_car = task.robot.kind == "car"
        v, w = pursue(x, y, heading, speed, top, 4.0 * PI if is_car else o.turn)
        if is_car:
            v, w = self._steer(observation, walls, v, w, wrap(atan2(y, x) - heading))
        if v > 0.0 and least_room(robot, v, w, o.halt_time, walls.distances, walls.frame) < task.robot_radius:
            v, w = 0.0, w if abs(w) > 0.2 else wrap(atan2(y, x) - heading)
            w = min(max(2.0 * w, -top), top)
        if v != 0.0:
            radius = task.robot_radius + o.margin
            contact, _ = runs_into(robot, v, w, obstacles, radius, max(o.slow_time, o.halt_time), _STEP)
            if contact < o.slow_time:
                share = max(contact - o.halt_time, 0.0) / max(o.slow_time - o.halt_time, 1e-9)
                v, w = v * share, w * share if is_car else w
        if abs(v) > 0.1 * task.limits.speed or abs(w) > 0.5:
            self._moved = time
        return Command(v, w)

    def _walls_of(self, observation: Observation) -> Walls:
        if observation.map is not None:
            self._walls = walls_of(observation.map, self._walls)
            return self._walls
        if self._empty is NO_WALLS:
            start = float(observation.robot[X]), float(observation.robot[Y])
            self._empty = walls_of(blank(observation.task, *start))
        return self._empty

    def _steer(self, observation: Observation, walls: Walls, v: float, w: float, error: float) -> tuple[float, float]:
        """Return speeds within a car's steering angle: it backs up for a moment where it cannot go ahead."""
        task, time = observation.task, observation.time
        bend = math.tan(max(min(task.robot.steering, 1.4), 0.05)) / max(task.robot.wheelbase, 1e-3)
        if abs(error) > 0.5 * PI:
            v, w = 0.5 * task.limits.speed, math.copysign(bend * task.limits.speed, error)
        v = max(v, 0.2 * task.limits.speed)
        w = min(max(w, -bend * v), bend * v)
        ahead = least_room(observation.robot, v, w, 1.0, walls.distances, walls.frame)
        if ahead < task.robot_radius and time >= self._back_until:
            self._back_until = time + 1.5
        if time < self._back_until:
            back = -0.5 * task.limits.speed
            turn = math.copysign(bend * abs(back), error)
            if least_room(observation.robot, back, turn, 1.0, walls.distances, walls.frame) >= task.robot_radius:
                return back, turn
        return v, w

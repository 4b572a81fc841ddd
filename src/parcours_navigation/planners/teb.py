"""TEB: a band of timed poses to the goal, pulled tight in every period, on whichever side of obstacles is faster.

Rösmann, Feiten, Wösch, Hoffmann, Bertram (2012, 2013; see `band`); several bands on different sides of what is in the
way, as Rösmann, Hoffmann, Bertram, Integrated online trajectory planning and optimization in distinctive topologies
(Robotics and Autonomous Systems 88, 2017) have them, but only the sides of the first obstacle met.
"""

from __future__ import annotations

import math

import numpy as np

from parcours.elementary import atan2, sin_cos
from parcours.kernels import kernel
from parcours_navigation.planners.band import GAPS, WIDTH, Setting, begin_at, lay, resize, speeds_of, tighten
from parcours_navigation.planners.motion import Options, settled, travel
from parcours_navigation.planners.route import Aim, Route, towards
from parcours_navigation.planners.walls import Surroundings
from parcours_navigation.protocol import HEADING, SPEED, YAW_RATE, Command, Floats, Observation, Task, X, Y

_LEAST = 4
_STILL = 1e-3

_FIRMER, _FIRMEST, _SOFTER = 1.2, 20.0, 0.9
"""While the robot has to brake the weight of gaps grows by such factors, or else a band that cuts a corner stays."""


@kernel
def first_met(way: Floats, obstacles: Floats, speed: float, radius: float) -> tuple[int, int, float, float]:
    """Return (which, leg, x, y): the first obstacle met on a way at a speed [m/s], the leg of the way, its place then.

    `way` has the shape (k, 2) [m], `radius` [m] is the robot's with what is to be kept; without any, `which` is -1.
    Places are looked at a quarter of the radius apart, so an obstacle that is faster may be missed: it only decides
    on which sides bands are laid.
    """
    gone = 0.0
    for leg in range(1, len(way)):
        dx, dy = way[leg, 0] - way[leg - 1, 0], way[leg, 1] - way[leg - 1, 1]
        length = np.sqrt(dx * dx + dy * dy)
        n = min(int(4.0 * length / radius) + 1, 1000)
        for k in range(1, n + 1):
            x, y = way[leg - 1, 0] + dx * k / n, way[leg - 1, 1] + dy * k / n
            time = (gone + length * k / n) / speed
            for i in range(len(obstacles)):
                ox, oy = obstacles[i, 0], obstacles[i, 1]
                ox, oy = travel(ox, oy, obstacles[i, 2], obstacles[i, 3], obstacles[i, 4], time)
                reach = radius + obstacles[i, 5]
                if (ox - x) * (ox - x) + (oy - y) * (oy - y) < reach * reach:
                    return i, leg, ox, oy
        gone += length
    return -1, 0, 0.0, 0.0


@kernel
def settle(
    band: Floats,
    n: int,
    obstacles: Floats,
    setting: Setting,
    wanted: float,
    rounds: int,
    iterations: int,
    matrix: Floats,
    right: Floats,
) -> tuple[int, float]:
    """Return (n, cost) of a band after `rounds` of resizing and this many steps of tightening; see `band.tighten`."""
    cost = 0.0
    for _ in range(rounds):
        n = resize(band, n, wanted, _LEAST)
        cost = tighten(band, n, obstacles, setting, iterations, matrix, right)
    return n, cost


OPTIONS: Options = {
    "horizon": (2.5, 0.1, 100.0, "m"),  # the band reaches so far along the way
    "step": (0.35, 0.05, 5.0, "s"),  # time between poses, about
    "most_poses": (40, 8, 500, ""),  # longer bands have longer times
    "rounds": (2, 1, 50, ""),  # in each period poses are put in or taken out so often
    "iterations": (4, 1, 100, ""),  # each time followed by this many steps of tightening
    "afresh": (4, 1, 1000, ""),  # other sides are tried in each such period
    "times": (5.0, 1e-6, 1e6, ""),  # weight of the squares of times
    "speeds": (20.0, 0.0, 1e6, ""),  # ... of the shares by which speeds and accelerations exceed limits
    "rolling": (1000.0, 0.0, 1e9, ""),  # ... of metres that wheels slip aside
    "gaps": (60.0, 0.0, 1e9, ""),  # ... of metres that gaps lack to `comfort`
    "loyalty": (0.9, 0.0, 1.0, ""),  # another side must cost less than this share of the present one
    "comfort": (0.05, 0.001, 10.0, "m"),  # gaps above this cost nothing
    "margin": (0.02, 0.0, 10.0, "m"),  # the robot's radius is enlarged by it
    "halt_time": (0.5, 0.0, 10.0, "s"),  # brake if it would run into an obstacle or wall within this time; 0: never
    "halt_margin": (0.01, 0.0, 10.0, "m"),  # ... or come this near to it
}


class Teb:
    """A timed elastic band, among obstacles that are taken to keep their speed and yaw rate.

    Raises BadRequest if one of OPTIONS is given a value out of its range.
    """

    def __init__(self, **options: float) -> None:
        o = self._options = settled("teb", OPTIONS, options)
        self._weights = np.array([o.times, o.speeds, o.rolling, o.gaps])
        self._band, self._other = np.zeros((o.most_poses, 4)), np.zeros((o.most_poses, 4))
        self._matrix, self._right = np.zeros((4 * o.most_poses, WIDTH)), np.zeros(4 * o.most_poses)
        self._n = self._asked = 0
        self._firm = 1.0
        self._limits = np.zeros(5)
        self._surroundings, self._route = Surroundings(), Route(o.margin)

    def reset(self, task: Task) -> None:
        """Begin a case: forget the band."""
        limits, robot = task.limits, task.robot
        bend = math.inf
        if robot.kind == "car":
            bend = math.tan(max(min(robot.steering, 1.4), 0.05)) / max(robot.wheelbase, 1e-3)
        self._limits = np.array([limits.speed, limits.yaw_rate, limits.acceleration, limits.yaw_acceleration, bend])
        self._n = self._asked = 0
        self._firm = 1.0
        self._route.begin()

    def observe(self, observation: Observation) -> Command:
        """Return the speeds to the band's next pose; at the goal it stops."""
        task, robot, o = observation.task, observation.robot, self._options
        self._surroundings.look(observation)
        walls = self._surroundings.walls
        aim = self._route.aim(observation, walls, o.horizon)
        _, _, _, speed = towards(observation, aim)
        if speed == 0.0:
            self._n = 0
            return Command(0.0, 0.0)
        radius = task.robot_radius + o.margin
        # Walls of a map are read from its distances, those of a scan as discs
        reach = radius + o.comfort + o.horizon
        obstacles = self._surroundings.with_scan(observation, reach)
        now = np.array([float(robot[SPEED]), float(robot[YAW_RATE])])
        self._weights[GAPS] = o.gaps * self._firm
        setting = now, self._limits, self._weights, radius, o.comfort, walls.distances, walls.frame
        self._plan(self._way(observation, aim), float(robot[HEADING]), obstacles, setting)
        v, w = speeds_of(self._band)
        v, w = min(max(v, 0.0), speed), min(max(w, -task.limits.yaw_rate), task.limits.yaw_rate)
        if self._surroundings.must_halt(observation, v, w, o.halt_time, o.halt_margin):
            v = 0.0
        self._firm = min(self._firm * _FIRMER, _FIRMEST) if v < 0.1 * speed else max(self._firm * _SOFTER, 1.0)
        return Command(v, w)

    def _way(self, observation: Observation, aim: Aim) -> Floats:
        """Return the way from the robot to the band's end, shape (k, 2) [m], k > 1."""
        x, y = float(observation.robot[X]), float(observation.robot[Y])
        points, horizon = self._route.points, self._options.horizon
        if len(points) < 2:
            dx, dy = aim.x - x, aim.y - y
            share = min(horizon / max(math.hypot(dx, dy), _STILL), 1.0)
            return np.array([[x, y], [x + share * dx, y + share * dy]])
        legs = np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)).cumsum()
        last = min(int(np.searchsorted(legs, horizon)) + 1, len(points) - 1)
        stride = max(int(0.2 / max(float(legs[0]), _STILL)), 1)
        kept = points[stride:last:stride]
        return np.vstack([[[x, y]], kept, points[last : last + 1]])

    def _plan(self, way: Floats, heading: float, obstacles: Floats, setting: Setting) -> None:
        """Tighten the band; from time to time lay others along the way and beside it, and take the best."""
        o, work = self._options, (self._matrix, self._right)
        (x, y), (end_x, end_y) = way[0].tolist(), way[-1].tolist()
        cost = math.inf
        if self._n:
            self._n = begin_at(self._band, self._n, x, y, heading, end_x, end_y)
            self._n, cost = settle(self._band, self._n, obstacles, setting, o.step, o.rounds, o.iterations, *work)
        if self._n == 0 or self._asked % o.afresh == 0:
            for fresh in self._ways(way, obstacles, setting[3] + o.comfort):
                n = lay(self._other, fresh, heading, self._limits, o.step)
                n, other = settle(self._other, n, obstacles, setting, o.step, o.rounds, 2 * o.iterations, *work)
                if other < o.loyalty * cost or cost == math.inf:
                    cost, self._n = other, n
                    self._band, self._other = self._other, self._band
        self._asked += 1

    def _ways(self, way: Floats, obstacles: Floats, reach: float) -> list[Floats]:
        """Return the way, and one on each side of the first obstacle that it meets."""
        which, leg, x, y = first_met(way, obstacles, float(self._limits[0]), reach)
        if which < 0:
            return [way]
        dx, dy = (way[leg] - way[leg - 1]).tolist()
        s, c = sin_cos(atan2(dy, dx))
        aside = float(obstacles[which, 5]) + reach
        sides = [np.array([[x - side * s * aside, y + side * c * aside]]) for side in (1.0, -1.0)]
        return [way, *(np.vstack([way[:leg], side, way[leg:]]) for side in sides)]

"""Moves the world between two observations, compiled, with a case's whole state in one array of float64.

Passing one plain array costs a tenth of passing records.

The array begins with three words that a supervising process may read (`parcours.run.heartbeat`); the rest is the
world, the observation, the obstacles and the track, each viewed with its own layout.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours_navigation.arena.observing import freeze_later, freeze_world
from parcours_navigation.arena.obstacles import OBSTACLE, reported_at
from parcours_navigation.arena.world import NEVER, TICK, WORLD, advance, begin
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.guests.tracking import speeds

Floats = NDArray[np.float64]

CASE, TIME, LIMIT = range(3)
"""The words for the supervisor: case number, time in the case [ns], longest call allowed [s]."""

GO_ON, ARRIVED, NOT_FINITE = range(3)
"""What a step of the loop comes to."""

HOST = np.dtype(
    [
        ("n", "i8"),  # obstacles
        ("t_moving", "i8"),  # last time the robot moved [ns]
        ("n_track", "i8"),  # entries written
        ("most_track", "i8"),  # room for entries
    ]
)
"""The loop's own state."""

_HOST = 4
_WORLD = _HOST + HOST.itemsize // 8
_ROBOT = _WORLD + WORLD.itemsize // 8
_SEEN = _ROBOT + 5
_OBSTACLE = OBSTACLE.itemsize // 8
_ROW = 7


def memory_size(n_obstacles: int, most_track: int) -> int:
    """Return how many float64 words a case needs."""
    return _SEEN + n_obstacles * (6 + _OBSTACLE) + most_track * (_ROW + 2 * n_obstacles)


def observed(memory: Floats, n_obstacles: int) -> tuple[Floats, Floats]:
    """Return views of what a planner sees: the robot, shape (5,), and the obstacles, shape (n_obstacles, 6)."""
    return memory[_ROBOT:_SEEN], memory[_SEEN : _SEEN + 6 * n_obstacles].reshape(n_obstacles, 6)


def recorded(memory: Floats, n_obstacles: int) -> Floats:
    """Return a view of the track, shape (n, 7 + 2 n_obstacles): the fields of TRACK, then the obstacles' x, y."""
    first = _SEEN + n_obstacles * (6 + _OBSTACLE)
    n_track = int(memory[_HOST:_WORLD].view(HOST)[0]["n_track"])
    row = _ROW + 2 * n_obstacles
    return memory[first : first + n_track * row].reshape(n_track, row)


@kernel
def _obstacles(memory: Floats, n: int) -> Record:
    """Return the view of the obstacles."""
    first = _SEEN + 6 * n
    return memory[first : first + n * _OBSTACLE].view(OBSTACLE)


@kernel
def _observe(memory: Floats, world: Record, obstacles: Record) -> None:
    """Fill what the planner sees."""
    robot = world.robot
    memory[_ROBOT], memory[_ROBOT + 1], memory[_ROBOT + 2] = robot.x, robot.y, robot.heading
    memory[_ROBOT + 3], memory[_ROBOT + 4] = robot.v, robot.w
    for i in range(len(obstacles)):
        k = _SEEN + 6 * i
        obstacle = obstacles[i]
        memory[k], memory[k + 1], memory[k + 2] = obstacle.x, obstacle.y, obstacle.heading
        memory[k + 3], memory[k + 4] = reported_at(obstacle, world.now)
        memory[k + 5] = obstacle.radius


@kernel
def _mark(memory: Floats, host: Record, world: Record, obstacles: Record) -> None:
    """Write one entry of the track, and whether the robot moves."""
    robot = world.robot
    if robot.v * robot.v > 1e-4:
        host.t_moving = world.now
    if host.n_track >= host.most_track:
        return
    n = len(obstacles)
    k = _SEEN + n * (6 + _OBSTACLE) + host.n_track * (_ROW + 2 * n)
    memory[k], memory[k + 1], memory[k + 2], memory[k + 3] = float(world.now), robot.x, robot.y, robot.heading
    memory[k + 4], memory[k + 5], memory[k + 6] = robot.v, robot.w, 0.0
    for i in range(n):
        memory[k + _ROW + 2 * i], memory[k + _ROW + 2 * i + 1] = obstacles[i].x, obstacles[i].y
    host.n_track += 1


@kernel
def begin_case(memory: Floats, number: int, limit: float, case: Floats, setting: Floats, most_track: int) -> None:
    """Put case `number` at its beginning; a call of the planner may take `limit` [s].

    `case` holds the OBSTACLE records as float64 words; `setting` start x, y, heading, speed, goal x, y, tolerance, top
    speed, yaw rate, acceleration, yaw acceleration and radius of the robot, all SI; `most_track` entries are kept.
    """
    memory[CASE], memory[TIME], memory[LIMIT] = float(number), 0.0, limit
    host = memory[_HOST:_WORLD].view(HOST)[0]
    world = memory[_WORLD:_ROBOT].view(WORLD)[0]
    host.n = len(case) // _OBSTACLE
    host.t_moving = host.n_track = 0
    host.most_track = most_track
    first = _SEEN + 6 * host.n
    memory[first : first + len(case)] = case
    robot = world.robot
    robot.x, robot.y, robot.heading, robot.v = setting[0], setting[1], setting[2], setting[3]
    robot.w = robot.command_w = 0.0
    robot.command_v = setting[3]
    world.goal_x, world.goal_y, world.goal_tolerance = setting[4], setting[5], setting[6]
    robot.v_max, robot.w_max, robot.a_max, robot.alpha_max = setting[7], setting[8], setting[9], setting[10]
    robot.radius = setting[11]
    world.solid = 0
    obstacles = _obstacles(memory, host.n)
    begin(world, obstacles)
    _mark(memory, host, world, obstacles)
    _observe(memory, world, obstacles)


@kernel
def _step(memory: Floats, host: Record, world: Record, obstacles: Record) -> bool:
    """Advance the world by one tick; return whether the goal was reached for the first time."""
    before = world.t_goal
    advance(world, obstacles, world.now + TICK)
    if world.now % TRACK_PERIOD == 0:
        _mark(memory, host, world, obstacles)
    return bool(before == NEVER and world.t_goal != NEVER)


@kernel
def _is_far(world: Record) -> bool:
    """Return whether the robot cannot reach its goal within a TRACK_PERIOD."""
    robot = world.robot
    x, y = world.goal_x - robot.x, world.goal_y - robot.y
    reach = world.goal_tolerance + max(robot.v_max, abs(robot.v)) * TRACK_PERIOD * 1.1e-9
    return bool(x * x + y * y > reach * reach or world.t_goal != NEVER)


@kernel
def hold(memory: Floats, until: int, v: float, w: float) -> int:
    """Command speeds [m/s, rad/s], advance the world to `until` [ns] or to its goal, and fill the observation.

    Return GO_ON, or ARRIVED if the goal was just reached, or NOT_FINITE if a speed is not a finite number.
    """
    if not (np.isfinite(v) and np.isfinite(w)):
        return NOT_FINITE
    host = memory[_HOST:_WORLD].view(HOST)[0]
    world = memory[_WORLD:_ROBOT].view(WORLD)[0]
    obstacles = _obstacles(memory, host.n)
    world.robot.command_v, world.robot.command_w = v, w
    arrived = False
    while world.now < until and not arrived:
        if _is_far(world):
            advance(world, obstacles, min(until, world.now - world.now % TRACK_PERIOD + TRACK_PERIOD))
            if world.now % TRACK_PERIOD == 0:
                _mark(memory, host, world, obstacles)
        else:
            arrived = _step(memory, host, world, obstacles)
    memory[TIME] = float(world.now)
    _observe(memory, world, obstacles)
    return ARRIVED if arrived else GO_ON


@kernel
def follow(memory: Floats, until: int, points: Floats) -> int:
    """Do as `hold`, but command the robot at every tick so that it follows the points of a trajectory, shape (n, 4)."""
    host = memory[_HOST:_WORLD].view(HOST)[0]
    world = memory[_WORLD:_ROBOT].view(WORLD)[0]
    obstacles = _obstacles(memory, host.n)
    robot = world.robot
    arrived = False
    while world.now < until and not arrived:
        v, w = speeds(points, world.now * 1e-9, robot.x, robot.y, robot.heading)
        robot.command_v, robot.command_w = v, w
        arrived = _step(memory, host, world, obstacles)
    memory[TIME] = float(world.now)
    _observe(memory, world, obstacles)
    return ARRIVED if arrived else GO_ON


@kernel
def freeze(memory: Floats, facts: Record) -> None:
    """Write down in a record of FACTS how the case stands."""
    host = memory[_HOST:_WORLD].view(HOST)[0]
    world = memory[_WORLD:_ROBOT].view(WORLD)[0]
    freeze_world(world, _obstacles(memory, host.n), facts)
    facts.t_last_moving = host.t_moving


@kernel
def touched_later(memory: Floats, facts: Record) -> None:
    """Add to frozen FACTS what the robot touched after the end."""
    freeze_later(memory[_WORLD:_ROBOT].view(WORLD)[0], facts)


@kernel
def moved_since(memory: Floats, time: int) -> bool:
    """Return whether the robot moved later than `time` [ns]."""
    return bool(memory[_HOST:_WORLD].view(HOST)[0].t_moving > time)


@kernel
def goal_time(memory: Floats) -> int:
    """Return when the goal was first reached [ns]; NEVER."""
    return int(memory[_WORLD:_ROBOT].view(WORLD)[0].t_goal)

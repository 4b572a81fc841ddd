"""Moves a plain world between two observations, compiled: a unicycle and a disc among obstacles of closed form.

Any other world is moved by `stage.ticking`; where both can, they give the same bits.
"""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, heap_kernel, kernel
from parcours_navigation.arena.observing import freeze_later, freeze_world
from parcours_navigation.arena.obstacles import OBSTACLE, reported_at
from parcours_navigation.arena.world import NEVER, TICK, WORLD, advance, begin
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.stage.memory import AT_ROBOT, AT_STAGE, AT_WORLD, ROW, STAGE, TIME, Floats, Ints
from parcours_navigation.stage.tracking import speeds

GO_ON, ARRIVED, NOT_FINITE, NEXT_GOAL, ENDED = range(5)
"""What a step of the loop comes to."""

_OBSTACLE = OBSTACLE.itemsize // 8


@heap_kernel
def obstacles_of(memory: Floats, stage: Record) -> Record:
    """Return the view of the obstacles."""
    return memory[stage.at_obstacles : stage.at_obstacles + stage.n * _OBSTACLE].view(OBSTACLE)


@kernel
def mark(memory: Floats, stage: Record, world: Record, obstacles: Record) -> None:
    """Write one entry of the track, and whether the robot moves."""
    robot = world.robot
    if robot.v * robot.v > 1e-4:
        stage.t_moving = world.now
    if stage.n_track >= stage.most_track:
        return
    n = len(obstacles)
    k = stage.at_track + stage.n_track * (ROW + 2 * n)
    memory[k], memory[k + 1], memory[k + 2], memory[k + 3] = float(world.now), robot.x, robot.y, robot.heading
    memory[k + 4], memory[k + 5], memory[k + 6], memory[k + 7] = robot.v, robot.w, 0.0, np.inf
    for i in range(n):
        memory[k + ROW + 2 * i], memory[k + ROW + 2 * i + 1] = obstacles[i].x, obstacles[i].y
    stage.n_track += 1


@kernel
def _observe(memory: Floats, stage: Record, world: Record, obstacles: Record) -> None:
    """Fill what the planner sees."""
    robot = world.robot
    memory[AT_ROBOT], memory[AT_ROBOT + 1], memory[AT_ROBOT + 2] = robot.x, robot.y, robot.heading
    memory[AT_ROBOT + 3], memory[AT_ROBOT + 4] = robot.v, robot.w
    k = stage.at_seen
    for i in range(len(obstacles)):
        obstacle = obstacles[i]
        memory[k], memory[k + 1], memory[k + 2] = obstacle.x, obstacle.y, obstacle.heading
        memory[k + 3], memory[k + 4] = reported_at(obstacle, world.now)
        memory[k + 5] = obstacle.radius
        k += 6


@kernel
def begin_case(memory: Floats) -> None:
    """Put a case that was laid into its memory at its beginning."""
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)[0]
    obstacles = obstacles_of(memory, stage)
    begin(world, obstacles)
    stage.n_seen = stage.n
    mark(memory, stage, world, obstacles)
    _observe(memory, stage, world, obstacles)


@kernel
def _step(memory: Floats, stage: Record, world: Record, obstacles: Record) -> bool:
    """Advance the world by one tick; return whether the goal was reached for the first time."""
    before = world.t_goal
    advance(world, obstacles, world.now + TICK)
    if world.now % TRACK_PERIOD == 0:
        mark(memory, stage, world, obstacles)
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
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)[0]
    obstacles = obstacles_of(memory, stage)
    world.robot.command_v, world.robot.command_w = v, w
    arrived = False
    while world.now < until and not arrived:
        if _is_far(world):
            advance(world, obstacles, min(until, world.now - world.now % TRACK_PERIOD + TRACK_PERIOD))
            if world.now % TRACK_PERIOD == 0:
                mark(memory, stage, world, obstacles)
        else:
            arrived = _step(memory, stage, world, obstacles)
    memory[TIME] = float(world.now)
    _observe(memory, stage, world, obstacles)
    return ARRIVED if arrived else GO_ON


@kernel
def _show(memory: Floats, stage: Record, robot: Floats, obstacles: Floats) -> None:
    """Copy what the planner sees of a case."""
    for k in range(5):
        robot[k] = memory[AT_ROBOT + k]
    for i in range(obstacles.shape[0]):
        for k in range(6):
            obstacles[i, k] = memory[stage.at_seen + 6 * i + k]


@kernel
def begin_all(memories: Floats, rows: Ints, robots: Floats, obstacles: Floats) -> None:
    """Put the cases in some rows of memory at their beginning, and fill what the planner sees of each."""
    for k in range(len(rows)):
        memory = memories[rows[k]]
        begin_case(memory)
        _show(memory, memory[AT_STAGE:AT_WORLD].view(STAGE)[0], robots[k], obstacles[k])


@kernel
def hold_all(
    memories: Floats, rows: Ints, until: int, commands: Floats, status: Ints, robots: Floats, obstacles: Floats
) -> None:
    """Do as `hold` for the cases in some rows of memory, and fill what the planner sees of each.

    Args:
        memories: shape (n_cases, n_words).
        rows: which cases, shape (n,).
        commands: v, w of each, shape (n, 2).
        status: receives what `hold` returns, shape (n,).
        robots: receives the robots as seen, shape (>= n, 5).
        obstacles: receives the others as seen, shape (>= n, n_obstacles, 6).
    """
    for k in range(len(rows)):
        memory = memories[rows[k]]
        status[k] = hold(memory, until, commands[k, 0], commands[k, 1])
        _show(memory, memory[AT_STAGE:AT_WORLD].view(STAGE)[0], robots[k], obstacles[k])


@kernel
def follow(memory: Floats, until: int, points: Floats) -> int:
    """Do as `hold`, but command the robot at every tick so that it follows the points of a trajectory, shape (n, 4)."""
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)[0]
    obstacles = obstacles_of(memory, stage)
    robot = world.robot
    arrived = False
    while world.now < until and not arrived:
        v, w = speeds(points, world.now * 1e-9, robot.x, robot.y, robot.heading)
        robot.command_v, robot.command_w = v, w
        arrived = _step(memory, stage, world, obstacles)
    memory[TIME] = float(world.now)
    _observe(memory, stage, world, obstacles)
    return ARRIVED if arrived else GO_ON


@kernel
def present(memory: Floats, entry: Floats, radii: Floats) -> None:
    """Fill an entry of a track with how the world stands now, shape (ROW + 2 n_bodies,); as if without a ground.

    `radii` receives those of the bodies [m], shape (n_bodies,).
    """
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)[0]
    robot, obstacles = world.robot, obstacles_of(memory, stage)
    entry[0], entry[1], entry[2], entry[3] = float(world.now), robot.x, robot.y, robot.heading
    entry[4], entry[5], entry[6], entry[7] = robot.v, robot.w, 0.0, np.inf
    for i in range(len(obstacles)):
        entry[ROW + 2 * i], entry[ROW + 2 * i + 1] = obstacles[i].x, obstacles[i].y
        radii[i] = obstacles[i].radius


@kernel
def freeze(memory: Floats, facts: Record) -> None:
    """Write down in a record of FACTS how the case stands."""
    stage = memory[AT_STAGE:AT_WORLD].view(STAGE)[0]
    world = memory[AT_WORLD:AT_ROBOT].view(WORLD)[0]
    freeze_world(world, obstacles_of(memory, stage)[: stage.n - stage.n_agents], facts)
    facts.t_last_moving = stage.t_moving


@kernel
def touched_later(memory: Floats, facts: Record) -> None:
    """Add to frozen FACTS what the robot touched after the end."""
    freeze_later(memory[AT_WORLD:AT_ROBOT].view(WORLD)[0], facts)


@kernel
def moved_since(memory: Floats, time: int) -> bool:
    """Return whether the robot moved later than `time` [ns]."""
    return bool(memory[AT_STAGE:AT_WORLD].view(STAGE)[0].t_moving > time)


@kernel
def goal_time(memory: Floats) -> int:
    """Return when the last goal was first reached [ns]; NEVER."""
    return int(memory[AT_WORLD:AT_ROBOT].view(WORLD)[0].t_goal)

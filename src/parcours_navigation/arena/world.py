"""Robot, obstacles and goal under one clock: advance the world, and keep what is truly so.

The world ticks at 100 Hz. What reaches it between two ticks takes effect at the next one, so the bits of a run do not
depend on how often it was asked.
"""

from __future__ import annotations

import numpy as np

from parcours.elementary import sin_cos
from parcours.kernels import Record, kernel
from parcours_navigation.arena.contact import BOTH_CLOSED, ROBOT_CLOSED, contact_share, least_distance, who_closed
from parcours_navigation.arena.obstacles import move
from parcours_navigation.arena.robot import ROBOT, drive

TICK = 10_000_000
"""Length of one tick [ns]."""

NEVER = -1
"""The time [ns] of what has not happened."""

WORLD = np.dtype(
    [
        ("now", "i8"),  # time of the last tick [ns]
        ("solid", "i8"),  # 1 if an obstacle in contact with the robot stops for good, 0 if it drives through
        ("robot", ROBOT),
        ("goal_x", "f8"),  # [m]
        ("goal_y", "f8"),  # [m]
        ("goal_tolerance", "f8"),  # [m]
        ("t_goal", "i8"),  # first time within tolerance of the goal [ns], latched; NEVER
        ("t_contact", "i8"),  # first contact with any obstacle [ns]; NEVER
        ("t_robot_contact", "i8"),  # first contact whose gap the robot alone closed [ns]; NEVER
        ("t_shared_contact", "i8"),  # first contact whose gap both closed [ns]; NEVER
        ("n_robot_contacts", "i8"),  # contacts whose gap the robot alone closed
        ("n_shared_contacts", "i8"),  # ... both closed
        ("n_obstacle_contacts", "i8"),  # ... the obstacle alone closed, or that found the robot at rest
        ("min_clearance", "f8"),  # least gap to any obstacle so far [m]; negative is overlap
        ("t_min_clearance", "i8"),  # end of the tick in which it was least [ns]
        ("travelled", "f8"),  # length of the robot's way so far [m]
    ]
)
"""State of the world and the ground truth gathered so far."""


@kernel
def begin(world: Record, obstacles: Record) -> None:
    """Set the clock to 0 and forget all ground truth; all other data must be set already."""
    world.now = 0
    world.t_goal = world.t_contact = world.t_robot_contact = world.t_shared_contact = NEVER
    world.n_robot_contacts = world.n_shared_contacts = world.n_obstacle_contacts = 0
    world.min_clearance = np.inf
    world.t_min_clearance = 0
    world.travelled = 0.0
    for i in range(len(obstacles)):
        move(obstacles[i], 0)
        obstacles[i].now = 0
        obstacles[i].touching = 0
        obstacles[i].apart = NEVER


@kernel
def bring(obstacle: Record, now: int) -> None:
    """Put the obstacle where it is at `now` [ns], unless it is there already."""
    before = obstacle.now
    obstacle.now = now
    stood = before < obstacle.start or before >= obstacle.stop
    if before == now or (stood and (now < obstacle.start or before >= obstacle.stop)):
        return
    move(obstacle, now)


@kernel
def _meet(world: Record, obstacle: Record, x0: float, y0: float, x1: float, y1: float) -> None:
    """Record what one tick did to the gap between robot and obstacle; (x, y) run from robot to obstacle centre [m]."""
    robot = world.robot
    reach = robot.radius + obstacle.radius
    clearance = least_distance(x0, y0, x1, y1) - reach
    if clearance < world.min_clearance:
        world.min_clearance = clearance
        world.t_min_clearance = world.now
    if clearance > 0.0:
        obstacle.touching = 0
        # In a tick the gap closes by at most what both can go: until then nothing happens that would be noted.
        closing = (max(abs(robot.v), robot.v_max) + abs(obstacle.speed)) * (TICK * 1e-9) + 1e-12
        left = np.sqrt(x1 * x1 + y1 * y1) - reach - max(world.min_clearance, 0.0)
        obstacle.apart = world.now + TICK * int(max(left, 0.0) / closing)
        return
    obstacle.apart = NEVER
    if obstacle.touching:
        return
    obstacle.touching = 1
    share = min(contact_share(x0, y0, x1, y1, reach), 1.0)
    when = world.now - TICK + int(share * TICK)
    s, c = sin_cos(robot.heading)
    so, co = sin_cos(obstacle.heading)
    closer = who_closed(
        x0 + share * (x1 - x0), y0 + share * (y1 - y0), robot.v * c, robot.v * s, obstacle.v * co, obstacle.v * so
    )
    if world.solid:
        obstacle.stop = min(obstacle.stop, world.now)
        obstacle.v = obstacle.w = 0.0
    note_contact(world, when, closer)


@kernel
def note_contact(world: Record, when: int, closer: int) -> None:
    """Count a contact at `when` [ns] by who caused it."""
    if world.t_contact == NEVER:
        world.t_contact = when
    if closer == ROBOT_CLOSED:
        world.n_robot_contacts += 1
        if world.t_robot_contact == NEVER:
            world.t_robot_contact = when
    elif closer == BOTH_CLOSED:
        world.n_shared_contacts += 1
        if world.t_shared_contact == NEVER:
            world.t_shared_contact = when
    else:
        world.n_obstacle_contacts += 1


@kernel
def advance(world: Record, obstacles: Record, until: int) -> None:
    """Advance the world tick by tick to the last tick at or before `until` [ns]."""
    if world.now + TICK <= until:
        tick(world, obstacles, until)
        bring_all(world, obstacles)


@kernel
def bring_all(world: Record, obstacles: Record) -> None:
    """Put all obstacles where they are now."""
    for i in range(len(obstacles)):
        bring(obstacles[i], world.now)


@kernel
def tick(world: Record, obstacles: Record, until: int) -> None:
    """Advance the world like `advance`, but move only the obstacles that might touch the robot."""
    robot = world.robot
    while world.now + TICK <= until:
        x, y = robot.x, robot.y
        drive(robot, TICK * 1e-9)
        world.now += TICK
        step_x, step_y = robot.x - x, robot.y - y
        world.travelled += np.sqrt(step_x * step_x + step_y * step_y)
        for i in range(len(obstacles)):
            obstacle = obstacles[i]
            if world.now > obstacle.apart:
                bring(obstacle, world.now - TICK)
                gap_x, gap_y = obstacle.x - x, obstacle.y - y
                bring(obstacle, world.now)
                _meet(world, obstacle, gap_x, gap_y, obstacle.x - robot.x, obstacle.y - robot.y)
        if world.t_goal == NEVER:
            to_x, to_y = world.goal_x - robot.x, world.goal_y - robot.y
            if to_x * to_x + to_y * to_y < world.goal_tolerance * world.goal_tolerance:
                world.t_goal = world.now

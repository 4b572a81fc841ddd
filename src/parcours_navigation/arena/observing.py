"""What is sensed of the world, and what the FACTS of a case say of it in the end."""

from __future__ import annotations

import numpy as np

from parcours.kernels import Record, kernel
from parcours_navigation.arena.obstacles import motion_at, place_at, reported_at


@kernel
def sense(obstacles: Record, stamp: int, seen: Record) -> None:
    """Fill the obstacle message: where every obstacle was at `stamp` [ns] and how it was reported to move."""
    for k in range(len(obstacles)):
        pose, obstacle = seen[k].pose, obstacles[k]
        if obstacle.now == stamp:  # the world has brought it there
            pose.x, pose.y, pose.heading = obstacle.x, obstacle.y, obstacle.heading
        else:
            pose.x, pose.y = place_at(obstacle, stamp)
            pose.heading, _, _ = motion_at(obstacle, stamp)
        pose.v, pose.w = reported_at(obstacle, stamp)
        seen[k].radius = obstacle.radius


@kernel
def measure_robot(robot: Record, pose: Record) -> None:
    """Set the POSE to where the ROBOT is and how it moves."""
    pose.x, pose.y, pose.heading, pose.v, pose.w = robot.x, robot.y, robot.heading, robot.v, robot.w


@kernel
def _goal_gap(world: Record, obstacles: Record) -> float:
    """Return the clearance [m] that a robot on the goal would have once all obstacles rest."""
    gap = np.inf
    for k in range(len(obstacles)):
        x, y = place_at(obstacles[k], obstacles[k].stop)
        distance = np.sqrt((x - world.goal_x) ** 2 + (y - world.goal_y) ** 2)
        gap = min(gap, distance - obstacles[k].radius - world.robot.radius)
    return gap


@kernel
def freeze_world(world: Record, obstacles: Record, facts: Record) -> None:
    """Write down how the world stands at the end of a case, whatever planner drove the robot."""
    robot = world.robot
    facts.t_end = world.now
    facts.x, facts.y, facts.heading = robot.x, robot.y, robot.heading
    facts.to_goal = np.sqrt((world.goal_x - robot.x) ** 2 + (world.goal_y - robot.y) ** 2)
    facts.t_goal = world.t_goal
    facts.t_contact = world.t_contact
    facts.t_robot_contact, facts.t_shared_contact = world.t_robot_contact, world.t_shared_contact
    facts.n_robot_contacts, facts.n_shared_contacts = world.n_robot_contacts, world.n_shared_contacts
    facts.n_obstacle_contacts = world.n_obstacle_contacts
    facts.min_clearance, facts.t_min_clearance = world.min_clearance, world.t_min_clearance
    facts.travelled = world.travelled
    facts.goal_gap = _goal_gap(world, obstacles)


@kernel
def freeze_later(world: Record, facts: Record) -> None:
    """Add to frozen FACTS what the robot touched after the end, when no more is watched."""
    before = facts.n_robot_contacts + facts.n_shared_contacts
    facts.n_contacts_after = world.n_robot_contacts + world.n_shared_contacts - before
    facts.t_robot_contact, facts.t_shared_contact = world.t_robot_contact, world.t_shared_contact

"""Witnesses: each is driven again, in the world and by hand, and must be at the goal untouched."""

from __future__ import annotations

import math

import numpy as np
import pytest

from parcours.kernels import Record
from parcours_navigation.arena.contact import least_distance
from parcours_navigation.arena.obstacles import OBSTACLE, move
from parcours_navigation.arena.robot import ROBOT, drive
from parcours_navigation.arena.solution import PERIOD, Witness, witness
from parcours_navigation.arena.solvability import SOLVABLE, solve
from parcours_navigation.arena.world import NEVER, TICK, WORLD, advance, begin
from parcours_navigation.cases.family import SystemCases


def robot_at_start(robot: Record) -> None:
    robot["heading"], robot["v"] = math.pi / 4.0, 0.249
    robot["v_max"], robot["w_max"], robot["a_max"], robot["alpha_max"] = 0.25, math.pi / 2.0, 1.0, 2.0 * math.pi / 3.0
    robot["radius"] = 0.125


def in_the_world(case: Record, found: Witness) -> Record:
    """Return the world after the witness was driven in it."""
    worlds = np.zeros(1, WORLD)
    robot_at_start(worlds["robot"])
    worlds["goal_x"] = worlds["goal_y"] = 2.0
    worlds["goal_tolerance"] = 0.2
    world, obstacles = worlds.view(np.recarray)[0], case.copy()
    begin(world, obstacles)
    for v, w in found.commands.tolist():
        if world.t_goal == NEVER:
            world.robot.command_v, world.robot.command_w = v, w
            advance(world, obstacles, world.now + PERIOD)
    return world


def by_hand(case: Record, found: Witness) -> tuple[float, float]:
    """Return (least clearance, distance to the goal at the arrival) [m] from the motion of all bodies alone."""
    robots = np.zeros(1, ROBOT)
    robot_at_start(robots)
    robot, obstacles = robots.view(np.recarray)[0], case.copy().view(np.recarray)
    for one in obstacles:
        move(one, 0)
    clearance = math.inf
    for tick in range(round(found.arrival * 1e9) // TICK):
        robot.command_v, robot.command_w = found.commands[tick * TICK // PERIOD].tolist()
        before = [(one.x - robot.x, one.y - robot.y) for one in obstacles]
        drive(robot, TICK * 1e-9)
        for one, (x, y) in zip(obstacles, before, strict=True):
            move(one, (tick + 1) * TICK)
            clearance = min(clearance, least_distance(x, y, one.x - robot.x, one.y - robot.y) - 0.225)
    return clearance, math.hypot(robot.x - 2.0, robot.y - 2.0)


def test_witnesses_of_fifty_cases_arrive_untouched_when_driven_again() -> None:
    cases = SystemCases(11).obstacles(np.arange(50))
    drives = witness(cases)
    solved = solve(cases)
    found = [k for k, one in enumerate(drives) if one is not None]
    assert len(found) >= 48
    for k in found:
        one = drives[k]
        assert one is not None
        world = in_the_world(cases[k], one)
        assert world.t_contact == NEVER
        assert world.t_goal * 1e-9 == one.arrival
        clearance, far = by_hand(cases[k], one)
        assert 0.0 < clearance == pytest.approx(one.clearance, abs=1e-12)
        assert far < 0.2
        assert solved["earliest_outer"][k] <= one.arrival <= 21.0
        assert solved["answer"][k] == SOLVABLE


def test_no_witness_is_found_where_none_can_be() -> None:
    on_goal = np.zeros((1, 1), OBSTACLE)
    on_goal["x0"] = on_goal["y0"] = 2.0
    on_goal["radius"] = 0.1
    assert witness(on_goal) == [None]


def test_a_witness_waits_for_an_obstacle_to_leave_the_goal() -> None:
    leaves = np.zeros((1, 1), OBSTACLE)
    leaves["x0"] = leaves["y0"] = 2.0
    leaves["radius"], leaves["speed"] = 0.1, 0.3
    leaves["start"], leaves["stop"] = 14_000_000_000, 20_000_000_000
    found = witness(leaves)[0]
    assert found is not None
    assert 14.0 < found.arrival < 17.0


def test_a_witness_does_not_depend_on_the_other_cases() -> None:
    cases = SystemCases(11).obstacles(np.arange(6))
    together = witness(cases)
    alone = [witness(cases[k : k + 1])[0] for k in range(6)]
    for one, other in zip(together, alone, strict=True):
        assert one is not None and other is not None
        assert (one.arrival, one.clearance) == (other.arrival, other.clearance)
        assert (one.commands == other.commands).all()

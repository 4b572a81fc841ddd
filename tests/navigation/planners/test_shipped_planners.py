"""What every shipped planner does: arrive, avoid, stop, and answer sanely whatever it sees."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours_navigation.planners.a_star import AStar
from parcours_navigation.planners.baselines import StandStill, StraightAhead
from parcours_navigation.planners.dwa import Dwa
from parcours_navigation.planners.mpc import Mpc
from parcours_navigation.planners.mppi import Mppi
from parcours_navigation.planners.orca import Orca
from parcours_navigation.planners.teb import Teb
from parcours_navigation.protocol import Planner

if TYPE_CHECKING:
    from tests.navigation.planners.conftest import Course

Maker = Callable[[], Planner]
AVOIDING: list[Maker] = [Orca, Dwa, Mppi, Mpc, Teb, AStar]
avoiding = pytest.mark.parametrize("maker", AVOIDING)
every = pytest.mark.parametrize("maker", [*AVOIDING, StandStill, StraightAhead])


@avoiding
@pytest.mark.parametrize("goal", [(2.0, 0.0), (1.2, 1.2), (0.6, -1.6)])
def test_without_obstacles_the_goal_is_reached_in_near_minimal_time(
    course: Course, maker: Maker, goal: tuple[float, float]
) -> None:
    least = (math.hypot(*goal) - 0.2) / 0.25 + 0.125
    assert least - 0.1 <= course.drive(maker(), course.task_to(*goal), course.discs()).reached < 1.1 * least + 1.5


@avoiding
def test_a_goal_behind_is_reached_too(course: Course, maker: Maker) -> None:
    assert course.drive(maker(), course.task_to(-1.0, 0.0), course.discs()).reached < 9.0


@avoiding
@pytest.mark.parametrize("aside", [0.0, 0.03, -0.1])
def test_a_standing_obstacle_in_the_way_is_passed_without_contact(course: Course, maker: Maker, aside: float) -> None:
    driven = course.drive(maker(), course.task_to(2.0, 0.0), course.discs((1.0, aside, 0.0, 0.0, 0.0)))
    assert driven.gap > 0.0
    assert driven.reached < 14.0


@avoiding
def test_an_obstacle_that_crosses_is_not_touched(course: Course, maker: Maker) -> None:
    crossing = course.discs((1.0, -0.8, math.pi / 2, 0.2, 0.0))
    driven = course.drive(maker(), course.task_to(2.0, 0.0), crossing)
    assert driven.gap > 0.0
    assert driven.reached < 14.0


@every
def test_at_the_goal_it_stops(course: Course, maker: Maker) -> None:
    planner, task = maker(), course.task_to(0.05, 0.0)
    planner.reset(task)
    assert course.observe(planner, np.array([0.0, 0.0, 1.0, 0.2, 0.3]), course.discs(), task) == (0.0, 0.0)
    at_once = np.array([0.05, 0.0, 1.0, 0.0, 0.0])
    assert course.observe(planner, at_once, course.discs((0.05, 0.0, 0.0, 0.0, 0.0)), task) == (0.0, 0.0)


@avoiding
def test_a_robot_in_contact_does_not_push_on_but_may_leave(course: Course, maker: Maker) -> None:
    planner, task, robot = maker(), course.task_to(2.0, 0.0), np.zeros(5)
    planner.reset(task)
    for k in range(20):
        assert course.observe(planner, robot, course.discs((0.2, 0.0, 0.0, 0.0, 0.0)), task, 0.05 * k).v <= 0.0
    planner.reset(task)
    driven = course.drive(planner, task, course.discs((-0.2, 0.0, 0.0, 0.0, 0.0)))
    assert driven.reached < 10.0


@avoiding
def test_fifty_obstacles_even_on_top_of_it_get_an_answer_within_the_limits(course: Course, maker: Maker) -> None:
    rng, planner, task = np.random.default_rng(11), maker(), course.task_to(2.0, 2.0)
    planner.reset(task)
    for k in range(40):
        n = (50, 0, 7)[k % 3]
        rows = np.column_stack([rng.uniform(-1.0, 1.0, (n, 2)), rng.uniform(-3.0, 3.0, (n, 3)), np.full(n, 0.1)])
        if n:
            rows[0, :2] = 0.0
        command = course.observe(planner, np.array([0.0, 0.0, 0.5, 0.1, 0.0]), rows, task, 0.05 * k)
        assert abs(command.v) <= 0.25 + 1e-12
        assert abs(command.w) <= math.pi / 2 + 1e-12


@avoiding
def test_time_that_does_not_pass_does_no_harm(course: Course, maker: Maker) -> None:
    planner, task, robot = maker(), course.task_to(2.0, 0.0, period=0.0), np.zeros(5)
    planner.reset(task)
    for _ in range(5):
        command = course.observe(planner, robot, course.discs((1.0, 0.5, 0.0, 0.0, 0.0)), task, 0.0)
    assert command.v > 0.0


@every
def test_after_a_reset_the_same_observations_get_the_same_answers(course: Course, maker: Maker) -> None:
    obstacles = course.discs((1.0, 0.3, -2.0, 0.3, 0.5), (0.5, -0.6, 1.0, 0.1, -0.3))
    planner, other = maker(), course.task_to(-1.0, 0.5, seed=9)
    first = course.drive(planner, course.task_to(2.0, 0.3), obstacles, limit=6.0)
    course.drive(planner, other, course.discs((0.4, 0.4, 0.0, 0.0, 0.0)), limit=2.0)
    assert course.drive(planner, course.task_to(2.0, 0.3), obstacles, limit=6.0).commands == first.commands
    assert len(first.commands) == 120


def test_standing_still_never_moves_and_straight_ahead_runs_into_what_is_in_the_way(course: Course) -> None:
    obstacle = course.discs((1.0, 0.0, 0.0, 0.0, 0.0))
    assert course.drive(StandStill(), course.task_to(2.0, 0.0), obstacle, limit=2.0).places[-1] == (0.0, 0.0)
    straight = course.drive(StraightAhead(), course.task_to(2.0, 0.0), obstacle)
    assert straight.gap < 0.0
    assert straight.reached < 7.8

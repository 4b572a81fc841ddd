"""Walls near the robot: discs of a map's faces and of a scan's beams, and ways that planners steer along."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours_navigation.planners.distance import NO_WALLS
from parcours_navigation.planners.route import Route, blank
from parcours_navigation.planners.walls import SECTORS, Surroundings
from parcours_navigation.protocol import Map, Observation, Scan

if TYPE_CHECKING:
    from tests.navigation.planners.conftest import Course


def wall_ahead() -> Map:
    """Return a wall at x = 1 .. 1.05 with a gap of 0.6 m at y = 1.0 .. 1.6."""
    cells = np.zeros((60, 60), np.uint8)
    cells[:20, 20] = cells[32:, 20] = 100
    return Map(cells, 0.05, (0.0, 0.0))


def test_without_map_and_scan_the_observed_obstacles_are_given_as_they_are(course: Course) -> None:
    seen = Observation(0.0, np.zeros(5), course.discs((1.0, 0.0, 0.0, 0.0, 0.0)), course.task_to(2.0, 0.0))
    surroundings = Surroundings()
    surroundings.look(seen)
    assert surroundings.walls is NO_WALLS
    assert surroundings.with_walls(seen, 2.0) is seen.obstacles


def test_discs_of_a_map_lie_in_occupied_squares_and_the_nearest_is_among_them(course: Course) -> None:
    seen = Observation(0.0, np.array([0.5, 0.5, 0.3, 0, 0]), course.discs(), course.task_to(2.0, 0.0), map=wall_ahead())
    surroundings = Surroundings()
    surroundings.look(seen)
    discs = surroundings.discs(seen, 0.8)
    assert 3 < len(discs) <= SECTORS
    assert discs[:, 0] == pytest.approx(1.025) and (discs[:, 5] == 0.025).all()
    gaps = np.hypot(discs[:, 0] - 0.5, discs[:, 1] - 0.5)
    assert gaps.max() < 0.8 and gaps.min() == pytest.approx(0.525, abs=0.002)
    assert surroundings.with_walls(seen, 0.8)[:, 3].tolist() == [0.0] * len(discs)


def test_beams_become_discs_but_those_that_met_a_known_obstacle(course: Course) -> None:
    angles = np.linspace(-math.pi, math.pi, 361)[:-1]
    ranges = np.where(np.cos(angles) > 0.1, 0.6 / np.maximum(np.cos(angles), 0.1), math.inf)
    ranges[np.abs(angles) < 0.2] = 0.4
    scan = Scan(ranges, -math.pi, math.radians(1.0), 5.0)
    robot = np.array([1.0, 2.0, math.pi / 2, 0.0, 0.0])
    obstacles = course.discs((1.0, 2.5, 0.0, 0.0, 0.0))
    seen = Observation(0.0, robot, obstacles, course.task_to(2.0, 0.0), scan=scan)
    rows = Surroundings().with_walls(seen, 1.0)
    assert np.array_equal(rows[:1], obstacles)
    assert rows[1:, 1] == pytest.approx(2.6, abs=1e-9)
    assert np.abs(rows[1:, 0] - 1.0).min() > 0.1


def test_the_way_leads_through_the_gap_and_without_a_map_straight_to_the_goal(course: Course) -> None:
    task = course.task_to(2.5, 0.4)
    seen = Observation(0.0, np.array([0.5, 0.4, 0.0, 0.0, 0.0]), course.discs(), task)
    route, surroundings = Route(0.02), Surroundings()
    assert route.aim(seen, NO_WALLS, 1.0)[:2] == task.goal
    seen.map = wall_ahead()
    surroundings.look(seen)
    aim = route.aim(seen, surroundings.walls, 1.0)
    assert not aim.is_goal and aim.x < 1.1 and aim.y > 0.6
    crossing = route.points[np.abs(route.points[:, 0] - 1.025).argmin()]
    assert 1.1 < crossing[1] < 1.5
    assert route.is_whole and route.points[-1].tolist() == [2.5, 0.4]


def test_a_given_path_is_followed(course: Course) -> None:
    task = course.task_to(2.0, 0.0)
    seen = Observation(0.0, np.zeros(5), course.discs(), task)
    seen.path = np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [2.0, 0.0]])
    route = Route(0.02)
    aim = route.aim(seen, NO_WALLS, 0.5)
    assert (aim.x, aim.y) == pytest.approx((0.0, 0.5), abs=0.051)
    assert aim.left == pytest.approx(3.5, abs=0.06)


def test_an_empty_map_holds_start_and_goal_and_is_bounded(course: Course) -> None:
    far = blank(course.task_to(900.0, -4.0), 0.0, 0.0)
    assert max(far.cells.shape) == 400

"""ORCA: its linear programs against other solvers, its half-planes against the definition, and how it drives."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import linprog

from parcours.errors import BadRequest
from parcours_navigation.others.half_planes import half_plane, nearest_permitted, new_velocity
from parcours_navigation.planners.orca import Orca, drive_towards

if TYPE_CHECKING:
    from tests.navigation.planners.conftest import Course

    from parcours_navigation.protocol import Floats

TOP = 0.25


def random_planes(rng: np.random.Generator, n: int, reach: float) -> Floats:
    angles = rng.uniform(-math.pi, math.pi, n)
    return np.column_stack([np.cos(angles), np.sin(angles), rng.uniform(-TOP, reach, n)])


def disc_of_velocities(n_angles: int = 360, n_radii: int = 50) -> Floats:
    angles = np.linspace(0.0, 2.0 * math.pi, n_angles, endpoint=False)
    radii = np.linspace(0.0, TOP, n_radii)
    return np.stack([np.outer(radii, np.cos(angles)).ravel(), np.outer(radii, np.sin(angles)).ravel()], axis=1)


def solve(planes: Floats, want: tuple[float, float]) -> Floats:
    return np.array(new_velocity(planes, np.empty_like(planes), len(planes), 0, *want, TOP))


def violation(planes: Floats, velocities: Floats) -> Floats:
    """Return by how much each velocity breaks the half-plane it breaks most [m/s]; shape (n,)."""
    worst: Floats = (planes[:, 2] - velocities @ planes[:, :2].T).max(axis=1)
    return worst


def test_the_velocity_satisfies_every_half_plane_if_any_velocity_does_and_is_the_nearest() -> None:
    rng, everywhere = np.random.default_rng(1), disc_of_velocities()
    feasible = 0
    for _ in range(120):
        planes, want = random_planes(rng, 5, 0.15), rng.uniform(-TOP, TOP, 2)
        permitted = everywhere[violation(planes, everywhere) <= 0.0]
        if not len(permitted):
            continue
        feasible += 1
        velocity = solve(planes, (want[0], want[1]))
        assert violation(planes, velocity[None])[0] < 1e-9
        assert np.hypot(*velocity) <= TOP + 1e-12
        assert np.hypot(*(velocity - want)) <= np.hypot(*(permitted - want).T).min() + 1e-9
    assert 30 < feasible < 120


def test_where_nothing_is_permitted_the_greatest_violation_is_least() -> None:
    rng, everywhere = np.random.default_rng(2), disc_of_velocities()
    infeasible = 0
    for _ in range(120):
        planes = random_planes(rng, 6, 0.3)
        least = violation(planes, everywhere).min()
        if least <= 1e-3:
            continue
        infeasible += 1
        velocity = solve(planes, (0.25, 0.0))
        assert np.hypot(*velocity) <= TOP + 1e-9
        assert violation(planes, velocity[None])[0] == pytest.approx(least, abs=4e-3)
    assert infeasible > 30


def test_feasibility_agrees_with_a_linear_program_over_a_polygon_in_and_around_the_disc() -> None:
    rng = np.random.default_rng(3)
    corners = np.linspace(0.0, 2.0 * math.pi, 256, endpoint=False)
    outward = np.column_stack([np.cos(corners), np.sin(corners)])
    verdicts = []
    for _ in range(150):
        planes = random_planes(rng, 4, 0.2)
        kept, _, _ = nearest_permitted(planes, 4, TOP, 0.1, 0.0, False)
        found = []
        for radius in (TOP * math.cos(math.pi / 256), TOP):
            a = np.vstack([-planes[:, :2], outward])
            b = np.concatenate([-planes[:, 2], np.full(256, radius)])
            found.append(linprog([0.0, 0.0], A_ub=a, b_ub=b, bounds=(None, None)).status == 0)
        if found[0]:
            assert kept == 4
        if not found[1]:
            assert kept < 4
        verdicts.append(found[0])
    assert 30 < sum(verdicts) < 130


def test_the_border_of_the_half_plane_is_the_border_of_the_velocity_obstacle() -> None:
    rng, checked, horizon, reach = np.random.default_rng(4), 0, 2.0, 0.225
    times = np.linspace(0.0, horizon, 4001)
    for _ in range(300):
        p, v = rng.uniform(-1.0, 1.0, 2), rng.uniform(-0.5, 0.5, 2)
        if np.hypot(*p) < reach + 0.01:
            continue
        ux, uy, nx, ny = half_plane(p[0], p[1], v[0], v[1], reach, horizon, 0.5)
        assert math.hypot(nx, ny) == pytest.approx(1.0)
        for shift, collides in ((0.01, False), (-0.01, True)):
            w = v + np.array([ux + shift * nx, uy + shift * ny])
            gaps = np.hypot(*(p[:, None] - w[:, None] * times))
            assert (gaps.min() < reach - 1e-6) == collides
        checked += 1
    assert checked > 200


def test_discs_that_overlap_part_within_the_time_given() -> None:
    ux, uy, nx, ny = half_plane(0.1, 0.0, 0.0, 0.0, 0.225, 2.0, 0.5)
    assert (nx, ny) == (-1.0, 0.0)
    assert (-(ux * nx + uy * ny) * 0.5) == pytest.approx(-(0.225 - 0.1))
    assert uy == 0.0


def test_discs_in_the_same_place_still_give_a_half_plane() -> None:
    assert all(math.isfinite(number) for number in half_plane(0.0, 0.0, 0.0, 0.0, 0.2, 2.0, 0.5))


def test_a_unicycle_turns_to_the_side_of_the_velocity_and_drives_straight_when_aligned() -> None:
    assert drive_towards(0.0, 0.2, 0.0, 0.5, 1.5, 2.0) == (0.2, 0.0)
    left, right = drive_towards(0.0, 0.1, 0.1, 0.5, 1.5, 2.0), drive_towards(0.0, 0.1, -0.1, 0.5, 1.5, 2.0)
    assert left[1] == -right[1] > 0.0
    assert 0.0 < left[0] == right[0] < math.hypot(0.1, 0.1)
    assert drive_towards(3.0, 0.0, 0.0, 0.5, 1.5, 2.0) == (0.0, 0.0)


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_two_robots_that_meet_head_on_pass_each_other_and_arrive(course: Course, share: float) -> None:
    planners, goals = (Orca(share=share), Orca(share=share)), ((2.0, 0.0), (0.0, 0.0))
    robots = [np.array([0.0, 0.0, 0.0, 0.0, 0.0]), np.array([2.0, 0.0, math.pi, 0.0, 0.0])]
    arrived, least = [math.inf, math.inf], math.inf
    for k in range(500):
        seen = [np.array([[*robots[1 - i], 0.125]]) for i in (0, 1)]
        for i in (0, 1):
            command = course.observe(planners[i], robots[i], seen[i], course.task_to(*goals[i]), 0.05 * k)
            course.step(robots[i], command, 0.05)
            if math.dist(robots[i][:2], goals[i]) < 0.2:
                arrived[i] = min(arrived[i], 0.05 * k)
        least = min(least, math.dist(robots[0][:2], robots[1][:2]) - 0.25)
    assert least > 0.0
    assert max(arrived) < 15.0


def test_a_smaller_share_leaves_more_of_the_avoiding_to_the_other(course: Course) -> None:
    task, robot = course.task_to(2.0, 0.0), np.array([0.0, 0.0, 0.0, 0.25, 0.0])
    oncoming = course.discs((0.9, 0.05, math.pi, 0.25, 0.0))
    speeds = []
    for share in (0.2, 1.0):
        command = course.observe(Orca(share=share, halt_time=0.0, tilt=0.0), robot, oncoming, task)
        speeds.append(abs(command.w))
    assert speeds[0] < speeds[1]


@pytest.mark.parametrize(("name", "value"), [("share", 1.5), ("horizon", 0.0), ("margin", math.nan), ("tilt", "left")])
def test_a_parameter_out_of_its_range_is_refused_by_name(name: str, value: object) -> None:
    parameters = {name: value}
    with pytest.raises(BadRequest, match=rf"planner orca, {name}: .*\[planner-parameter\]"):
        Orca(**parameters)  # type: ignore[arg-type]

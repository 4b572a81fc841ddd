"""Solvability: hand-made cases, random drives that must stay in the outer set, a slow twin, and invariants."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours.kernels import Record
from parcours_navigation.arena.lattice import (
    EDGE,
    EVERYWHERE,
    ROWS,
    SHADOW,
    WORDS,
    as_points,
    grow_inner,
    grow_outer,
    lay_lattice,
    lay_points,
    reached_box,
)  # fmt: skip
from parcours_navigation.arena.obstacles import OBSTACLE, place_at
from parcours_navigation.arena.reachable import begin_set, take_obstacles_inner
from parcours_navigation.arena.solvability import SOLVABLE, UNDECIDED, UNSOLVABLE, shortest_way, solve
from parcours_navigation.cases.family import SystemCases
from parcours_ramp.system.study import system_study

SECOND = 1_000_000_000
STRAIGHT = (2.0 * math.sqrt(2.0) - 0.2) / 0.25


def discs(*given: tuple[float, float, float, float, float, float]) -> Record:
    """Return one case of obstacles (x, y, heading, speed, start, stop) [m, m, rad, m/s, s, s], shape (1, n)."""
    case = np.zeros((1, len(given)), OBSTACLE)
    case["radius"] = 0.1
    for i, (x, y, heading, speed, start, stop) in enumerate(given):
        one = case[0, i : i + 1]
        one["x0"], one["y0"], one["heading0"], one["speed"] = x, y, heading, speed
        one["start"], one["stop"] = round(start * SECOND), round(stop * SECOND)
    return case


def ring(n: int, x: float, y: float, radius: float, speed: float = 0.0, stop: float = 0.0) -> Record:
    """Return discs round a place, each moving towards it from time 0 to `stop` [s]."""
    angles = 2.0 * math.pi * np.arange(n) / n
    return discs(
        *((x + radius * math.cos(a), y + radius * math.sin(a), a + math.pi, speed, 0.0, stop) for a in angles.tolist())
    )


def test_an_empty_world_is_crossed_in_a_straight_line_at_top_speed() -> None:
    found = solve(np.zeros((1, 0), OBSTACLE))[0]
    assert found["answer"] == SOLVABLE
    assert found["earliest_outer"] == found["earliest_inner"] == pytest.approx(STRAIGHT, abs=1e-9)
    assert shortest_way((0.0, 0.0), (2.0, 2.0), 0.2) == pytest.approx(0.25 * STRAIGHT)


def test_too_short_a_limit_is_unsolvable() -> None:
    assert solve(np.zeros((1, 0), OBSTACLE), limit=STRAIGHT - 0.01)["answer"][0] == UNSOLVABLE
    assert solve(np.zeros((1, 0), OBSTACLE), limit=STRAIGHT + 0.01)["answer"][0] == SOLVABLE


def test_one_disc_in_the_way_costs_the_detour_round_it() -> None:
    found = solve(discs((1.0, 1.0, 0.0, 0.0, 0.0, 0.0)))[0]
    # two tangents to a circle of 0.225 m, and the arc between them, up to the goal's tolerance
    far = math.sqrt(2.0)
    way = 2.0 * math.sqrt(far**2 - 0.225**2) + 0.225 * 2.0 * math.asin(0.225 / far) - 0.2
    assert found["answer"] == SOLVABLE
    assert found["earliest_outer"] <= way / 0.25 + 1e-9
    assert way / 0.25 - 0.02 <= found["earliest_inner"] < way / 0.25 + 0.6


@pytest.mark.parametrize("off", [0.0, 0.02])
def test_an_obstacle_that_rests_on_the_goal_makes_a_case_unsolvable(off: float) -> None:
    found = solve(discs((2.0 + off, 2.0, 0.0, 0.0, 0.0, 0.0)))[0]
    assert found["answer"] == UNSOLVABLE
    assert found["earliest_outer"] == found["earliest_inner"] == np.inf


def test_an_obstacle_that_leaves_part_of_the_goal_free_does_not() -> None:
    assert solve(discs((2.08, 2.0, 0.0, 0.0, 0.0, 0.0)))["answer"][0] == SOLVABLE
    assert solve(discs((2.027, 2.0, 0.0, 0.0, 0.0, 0.0)))["answer"][0] != UNSOLVABLE


def test_an_obstacle_that_comes_to_rest_on_the_goal_in_time_makes_a_case_unsolvable() -> None:
    assert solve(discs((2.0, 0.5, 0.5 * math.pi, 0.5, 5.0, 8.0)))["answer"][0] == UNSOLVABLE
    assert solve(discs((2.0, 0.5, 0.5 * math.pi, 0.5, 15.0, 18.0)))["answer"][0] == SOLVABLE


def test_an_obstacle_that_leaves_the_goal_is_waited_for() -> None:
    found = solve(discs((2.0, 2.0, 0.0, 0.25, 15.0, 19.0)))[0]
    assert found["answer"] == SOLVABLE
    # the goal begins to show once the centre has moved 0.025 m, which is 0.1 s after it set out
    assert 14.8 <= found["earliest_outer"] <= 15.1 <= found["earliest_inner"] + 1e-9 < 15.8


def test_a_wall_round_the_goal_is_unsolvable_and_a_door_in_it_is_found() -> None:
    wall = ring(9, 2.0, 2.0, 0.55)
    assert solve(wall)["answer"][0] == UNSOLVABLE
    door = np.delete(wall, 5, axis=1)  # the one to the left, a little below
    assert solve(door)["answer"][0] == SOLVABLE
    assert solve(door, robot_radius=0.29)["answer"][0] == UNSOLVABLE


def test_who_must_leave_the_square_to_arrive_is_undecided_until_the_square_is_made_larger() -> None:
    back_door = ring(9, 2.0, 2.0, 0.55)[:, 1:]
    assert solve(back_door)["answer"][0] == UNDECIDED
    found = solve(back_door, margin=0.9)[0]
    assert found["answer"] == SOLVABLE
    assert STRAIGHT + 1.0 < found["earliest_outer"] < found["earliest_inner"]
    assert solve(back_door)["earliest_outer"][0] < found["earliest_inner"]


def test_a_wall_that_opens_in_time_is_solvable_only_after_it_has() -> None:
    wall = ring(9, 2.0, 2.0, 0.55)
    wall["heading0"][0, 5], wall["speed"][0, 5] = math.radians(200.0), 0.5
    wall["start"][0, 5], wall["stop"][0, 5] = 14 * SECOND, 18 * SECOND
    found = solve(wall)[0]
    assert found["answer"] == SOLVABLE
    assert found["earliest_outer"] > 14.0


def test_a_robot_that_cannot_evade_makes_a_case_unsolvable() -> None:
    closing = ring(10, 0.0, 0.0, 0.6, speed=0.5, stop=1.0)
    assert solve(closing)["answer"][0] == UNSOLVABLE
    closing["stop"] = 0
    assert solve(closing, goal=(0.2, 0.0), tolerance=0.05)["answer"][0] == SOLVABLE, "the same ring at rest"


def test_a_robot_that_starts_in_contact_is_lost() -> None:
    assert solve(discs((0.2, 0.0, 0.0, 0.0, 0.0, 0.0)))["answer"][0] == UNSOLVABLE


def test_a_bad_request_is_refused_by_name() -> None:
    with pytest.raises(BadRequest, match=r"solvability, v_max: .* is 0.0 .*\[solvability-range\]"):
        solve(np.zeros((1, 0), OBSTACLE), v_max=0.0)


def test_the_answer_to_a_case_does_not_depend_on_the_others() -> None:
    cases = SystemCases(3).obstacles(np.arange(60))
    together = solve(cases)
    order = np.random.default_rng(0).permutation(60)
    assert (solve(cases[order]) == together[order]).all()
    assert all(solve(cases[k : k + 1])[0] == together[k] for k in range(0, 60, 7))


@pytest.mark.parametrize("radii", [(0.125, 0.2), (0.2, 0.3), (0.3, 0.45)])
def test_a_bigger_robot_never_solves_more_or_sooner(radii: tuple[float, float]) -> None:
    cases = SystemCases(4).obstacles(np.arange(150))
    small, big = (solve(cases, robot_radius=radius) for radius in radii)
    assert not ((small["answer"] == UNSOLVABLE) & (big["answer"] == SOLVABLE)).any()
    assert (small["earliest_outer"] <= big["earliest_inner"] + 1e-5).all()
    assert (small["earliest_outer"] <= small["earliest_inner"]).all()


def test_all_three_answers_occur_where_it_is_tight() -> None:
    found = solve(SystemCases(5).obstacles(np.arange(600)), robot_radius=0.4)
    assert set(found["answer"].tolist()) == {UNSOLVABLE, UNDECIDED, SOLVABLE}
    assert (np.isfinite(found["earliest_inner"]) == (found["answer"] == SOLVABLE)).all()
    assert (np.isfinite(found["earliest_outer"]) == (found["answer"] != UNSOLVABLE)).all()


def test_no_robot_that_met_nothing_ever_arrived_where_the_outer_set_says_nobody_can() -> None:
    study = system_study("guarded", seed=1)
    facts = study(0, 230)
    facts = facts[(facts["t_goal"] >= 0) & (facts["t_goal"] <= 21 * SECOND) & (facts["t_contact"] < 0)][:200]
    assert len(facts) > 100
    found = solve(study.cases.obstacles(facts["number"]))
    assert (found["answer"] != UNSOLVABLE).all()
    assert (found["earliest_outer"] <= facts["t_goal"] / SECOND + 1e-9).all()


def test_without_the_inner_set_nobody_arrives_earlier_or_later_by_the_outer_one() -> None:
    cases = SystemCases(5).obstacles(np.arange(300))
    both, outer = (solve(cases, robot_radius=0.4, inner=inner) for inner in (True, False))
    assert (both["earliest_outer"] == outer["earliest_outer"]).all()
    assert ((outer["answer"] == UNSOLVABLE) == (both["answer"] == UNSOLVABLE)).all()
    assert (np.isfinite(outer["earliest_inner"]) <= (outer["earliest_inner"] == outer["earliest_outer"])).all()


# ------------------------------------------------------------------------- the sets themselves


def centres(case: Record, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the obstacles of a case are, shape (n_times, n_obstacles, 2) [m]."""
    return np.array([[place_at(one, round(t * SECOND)) for one in case.view(np.recarray)] for t in times.tolist()])


def random_drive(rng: np.random.Generator, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places at the times of a disc that changes velocity now and then, never above 0.25 m/s."""
    velocity = np.zeros((len(times) - 1, 2))
    heading, speed = rng.uniform(-0.5, 2.0), 0.25
    for k in range(len(velocity)):
        if rng.random() < 0.02:
            heading, speed = rng.uniform(-math.pi, math.pi), rng.choice([0.0, 0.1, 0.25])
        velocity[k] = speed * math.cos(heading), speed * math.sin(heading)
    return np.vstack([[0.0, 0.0], np.cumsum(velocity * np.diff(times)[:, None], axis=0)])


def test_the_shadow_of_every_drive_stays_in_the_outer_set_until_it_meets_an_obstacle() -> None:
    record = lay_points((0.0, 0.0), (2.0, 2.0), 0.2, 21.0, 0.25, 0.125)
    lattice = lay_lattice(record)
    wide = np.zeros((4, WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    rng = np.random.default_rng(7)
    case = SystemCases(6).obstacles(np.arange(1))[0]
    axis = np.arange(ROWS) * record.spacing
    times = np.arange(0, record.n_steps * 10 + 1) * record.step / 10.0
    blocked = centres(case, times)
    drives = [random_drive(rng, times) for _ in range(60)]
    touched = [np.flatnonzero((np.hypot(*(drive[:, None] - blocked).T) <= 0.225).any(axis=0)) for drive in drives]
    until = [int(where[0]) if len(where) else len(times) for where in touched]
    bits = np.zeros((WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    begin_set(bits, record)
    followed = 0
    for k in range(1, record.n_steps + 1):
        grow_outer(bits, wide, EVERYWHERE)
        bits |= lattice.edge
        now = as_points(bits)
        # what the kernel takes out: the points too near an obstacle for any shadow
        for x, y in blocked[10 * k]:
            far = np.hypot(record.x0 + axis[None, :] - x, record.y0 + axis[:, None] - y)
            now &= far > 0.225 - SHADOW * record.spacing
        bits[1:-1, EDGE:-EDGE] = np.packbits(now, axis=1, bitorder="little").view("<u8").T
        for drive, end in zip(drives, until, strict=True):
            x, y = drive[10 * k]
            inside = -0.45 < x < 2.45 and -0.45 < y < 2.45
            if 10 * k < end and inside:
                near = np.hypot(record.x0 + axis[None, :] - x, record.y0 + axis[:, None] - y) <= SHADOW * record.spacing
                assert (near & now).any()
                followed += 1
    assert followed > 1000


def test_every_step_within_the_inner_set_meets_nothing_when_looked_at_finely() -> None:
    record = lay_points((0.0, 0.0), (2.0, 2.0), 0.2, 21.0, 0.25, 0.125)
    wide = np.zeros((4, WORDS + 2, ROWS + 2 * EDGE), np.uint64)
    rng = np.random.default_rng(8)
    checked = 0
    for case in SystemCases(7).obstacles(np.arange(12)):
        bits = np.zeros((WORDS + 2, ROWS + 2 * EDGE), np.uint64)
        begin_set(bits, record)
        before = as_points(bits)
        for k in range(1, 70):
            grow_inner(bits, wide, reached_box(record, k))
            take_obstacles_inner(bits, record, case.view(np.recarray), k)
            now = as_points(bits)
            shares = np.linspace(0.0, 1.0, 9)
            blocked = centres(case, (k - 1 + shares) * record.step)
            there = np.argwhere(before)
            for j, i in there[rng.integers(len(there), size=40)]:
                dj, di = rng.integers(-4, 5, size=2)
                j2, i2 = j + dj, i + di
                if di * di + dj * dj > 18 or not (0 <= j2 < ROWS and 0 <= i2 < ROWS) or not now[j2, i2]:
                    continue
                x = record.x0 + (i + shares * di) * record.spacing
                y = record.y0 + (j + shares * dj) * record.spacing
                gap = np.hypot(x[:, None] - blocked[..., 0], y[:, None] - blocked[..., 1]).min()
                assert gap > 0.225
                checked += 1
            before = now
    assert checked > 5000


# ------------------------------------------------------------------------- a slow twin


def slow_earliest(case: Record, robot_radius: float, spacing: float = 0.1, seconds: float = 21.0) -> float:
    """Return the earliest time a robot on a coarse grid was seen to arrive, by breadth-first search; inf.

    A robot waits or goes on by an offset within reach in a step; contact is looked for in exact circles at 16 instants.
    What it finds can be done, but for what happens between two instants (1.2 mm): it bounds the outer time from above.
    """
    step = math.sqrt(5.0) * spacing / 0.25
    moves = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if i * i + j * j <= 5]
    shares = np.linspace(0.0, 1.0, 16)
    here = {(0, 0)}
    for k in range(int(seconds / step)):
        blocked = centres(case, (k + shares) * step)
        there = set()
        for i, j in here:
            for di, dj in moves:
                x, y = (i + shares * di) * spacing, (j + shares * dj) * spacing
                if (i + di, j + dj) in there:
                    continue
                gap = np.hypot(x[:, None] - blocked[..., 0], y[:, None] - blocked[..., 1]) - 0.1 - robot_radius
                if gap.min() > 0.0:
                    there.add((i + di, j + dj))
        here = {(i, j) for i, j in there if -4 <= i <= 24 and -4 <= j <= 24}
        if any(math.hypot(i * spacing - 2.0, j * spacing - 2.0) < 0.2 for i, j in here):
            return (k + 1) * step
    return math.inf


@pytest.mark.parametrize("robot_radius", [0.125, 0.35])
def test_what_a_slow_search_does_on_a_coarse_grid_is_never_before_the_outer_time(robot_radius: float) -> None:
    cases = SystemCases(9).obstacles(np.arange(6))
    found = solve(cases, robot_radius=robot_radius)
    slow = np.array([slow_earliest(case, robot_radius) for case in cases])
    assert np.isfinite(slow).any()
    assert (slow >= found["earliest_outer"]).all()
    assert (slow[np.isfinite(slow)] >= found["earliest_inner"][np.isfinite(slow)] - 0.5).all(), "finer is sooner"

"""The world: its clock, its ground truth against a fine-sampled twin, and nothing that slips through."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from parcours.kernels import Record
from parcours_navigation.arena.obstacles import OBSTACLE
from parcours_navigation.arena.world import NEVER, TICK, WORLD, advance, begin

Floats = NDArray[np.float64]

SECOND = 1_000_000_000
REACH = 0.225


def world(v: float = 0.0, heading: float = 0.0, goal: tuple[float, float] = (9.0, 9.0)) -> Record:
    one = np.zeros(1, WORLD).view(np.recarray)[0]
    robot = one.robot
    robot.v = robot.command_v = v
    robot.heading = heading
    robot.v_max, robot.w_max, robot.a_max, robot.alpha_max, robot.radius = 0.25, 1.5707963, 1.0, 2.0943951, 0.125
    one.goal_x, one.goal_y, one.goal_tolerance = *goal, 0.2
    return one


def obstacles(*rows: tuple[float, float, float, float, float, float, float]) -> Record:
    """Return obstacles by (x, y, heading, speed, turn, start, stop), times in seconds."""
    made = np.zeros(len(rows), OBSTACLE)
    for k, (x, y, heading, speed, turn, start, stop) in enumerate(rows):
        made[k]["x0"], made[k]["y0"], made[k]["heading0"] = x, y, heading
        made[k]["speed"], made[k]["turn"], made[k]["radius"] = speed, turn, 0.1
        made[k]["start"], made[k]["stop"] = round(start * SECOND), round(stop * SECOND)
    return made


def run(one: Record, others: Record, seconds: float) -> Record:
    begin(one, others)
    advance(one, others, round(seconds * SECOND))
    return one


rows = st.tuples(
    st.floats(0.3, 2.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1), st.floats(0.0, 0.5), st.floats(-1.5, 1.5),
    st.floats(0.0, 3.0), st.floats(3.0, 8.0),
)  # fmt: skip
stops = st.lists(st.integers(0, 8 * SECOND), max_size=8)


@settings(max_examples=40)
@given(rows, rows, stops, st.floats(-1.5, 1.5))
def test_the_bits_do_not_depend_on_how_often_the_world_was_asked(
    first: tuple[float, ...], second: tuple[float, ...], asked: list[int], turn: float
) -> None:
    results = []
    for times in ([], sorted(asked)):
        one, others = world(v=0.2), obstacles(first, second)  # type: ignore[arg-type]
        one.robot.command_w = turn
        begin(one, others)
        for until in times:
            advance(one, others, until)
        advance(one, others, 8 * SECOND)
        results.append((one.tobytes(), others.tobytes()))
    assert results[0] == results[1]


def test_the_world_never_runs_ahead_of_the_time_it_is_asked_for() -> None:
    one, others = world(v=0.25), obstacles()
    begin(one, others)
    for until, now in ((TICK - 1, 0), (TICK, TICK), (3 * TICK + 5, 3 * TICK), (2 * TICK, 3 * TICK)):
        advance(one, others, until)
        assert one.now == now


def arc(row: Record, seconds: Floats) -> tuple[Floats, Floats]:
    """Return where the obstacle's centre truly is at these times, by the textbook formula of an arc."""
    elapsed = np.clip(seconds, row["start"] / SECOND, row["stop"] / SECOND) - row["start"] / SECOND
    half = 0.5 * row["turn"] * elapsed
    chord = row["speed"] * elapsed * np.sinc(half / math.pi)
    return row["x0"] + chord * np.cos(row["heading0"] + half), row["y0"] + chord * np.sin(row["heading0"] + half)


def sampled_gaps(one: Record, others: Record, seconds: float) -> tuple[Floats, Floats]:
    """Run the world and return (times [s], gaps [m]) 20 times a tick, on the robot's chords and the true arcs."""
    ticks = round(seconds * SECOND) // TICK
    way = np.zeros((ticks + 1, 2))
    for tick in range(ticks):
        advance(one, others, (tick + 1) * TICK)
        way[tick + 1] = one.robot.x, one.robot.y
    fine = np.linspace(0.0, seconds, 20 * ticks + 1)
    x, y = arc(others[0], fine)
    coarse = np.linspace(0.0, seconds, ticks + 1)
    return fine, np.hypot(x - np.interp(fine, coarse, way[:, 0]), y - np.interp(fine, coarse, way[:, 1])) - REACH


@settings(max_examples=40)
@given(rows, st.floats(-1.0, 1.0))
def test_clearance_and_contact_are_what_fine_sampling_in_continuous_time_finds(
    row: tuple[float, ...], turn: float
) -> None:
    *motion, start, stop = row
    one, others = world(v=0.25), obstacles((*motion, round(start, 2), round(stop, 2)))  # type: ignore[arg-type]
    one.robot.command_w = turn
    begin(one, others)
    times, gaps = sampled_gaps(one, others, 6.0)
    assert one.min_clearance == pytest.approx(float(gaps.min()), abs=2e-4)  # 0.75 m/s for a fortieth of a tick
    deep = gaps < -2e-5
    if deep.any():
        assert one.t_contact != NEVER
        assert one.t_contact <= times[deep][0] * SECOND + 1
    if one.t_contact != NEVER:
        assert float(gaps.min()) < 2e-4


@settings(max_examples=20)
@given(rows)
def test_an_obstacle_that_sets_out_within_a_tick_blurs_clearance_by_a_millimetre_at_most(
    row: tuple[float, ...],
) -> None:
    one, others = world(v=0.25), obstacles(row)  # type: ignore[arg-type]
    begin(one, others)
    _, gaps = sampled_gaps(one, others, 6.0)
    assert one.min_clearance == pytest.approx(float(gaps.min()), abs=1.5e-3)  # 0.5 m/s for a quarter of a tick


def test_two_bodies_closing_at_three_quarters_of_a_metre_a_second_touch_when_they_must() -> None:
    one, others = world(v=0.25), obstacles((2.0, 0.0, math.pi, 0.5, 0.0, 0.0, 10.0))
    run(one, others, 4.0)
    assert one.t_contact == pytest.approx((2.0 - REACH) / 0.75 * SECOND, abs=1e3)
    assert one.t_shared_contact == one.t_contact
    assert (one.n_shared_contacts, one.n_robot_contacts, one.n_obstacle_contacts) == (1, 0, 0)


@pytest.mark.parametrize("radius", [1e-4, 1e-3, 3e-3])
def test_not_even_specks_tunnel_through_each_other(radius: float) -> None:
    # Between two ticks they close 7.5 mm: far more than both radii together.
    for offset in np.linspace(0.0, 0.0075, 16):
        one, others = world(v=0.25), obstacles((1.0 + offset, 0.0, math.pi, 0.5, 0.0, 0.0, 10.0))
        one.robot.radius = others["radius"][0] = radius
        run(one, others, 3.0)
        assert one.n_shared_contacts == 1
        assert one.min_clearance == pytest.approx(-2 * radius, abs=1e-9)


@pytest.mark.parametrize("solid", [0, 1])
def test_a_solid_obstacle_stops_where_it_touches_the_robot_and_another_drives_through(solid: int) -> None:
    one, others = world(), obstacles((1.0, 0.0, math.pi, 0.3, 0.0, 1.0, 9.0))
    one.solid = solid
    run(one, others, 10.0)
    assert one.n_obstacle_contacts == 1
    assert others["v"][0] == 0.0
    assert others["x"][0] == pytest.approx(REACH if solid else 1.0 - 8.0 * 0.3, abs=0.3 * 0.01)
    assert (one.min_clearance > -0.3 * 0.01) == bool(solid)


def test_contact_is_counted_once_until_the_bodies_part_and_meet_again() -> None:
    one, others = world(v=0.25), obstacles((0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    begin(one, others)
    speeds = itertools.chain([0.25] * 25, [-0.25] * 25, [0.25] * 30)
    for k, speed in enumerate(speeds):
        one.robot.command_v = speed
        advance(one, others, (k + 1) * SECOND // 10)
    assert one.n_robot_contacts == 2
    assert one.t_robot_contact == one.t_contact == pytest.approx(1.5 * SECOND, abs=2e7)


def test_a_robot_at_rest_is_never_to_blame() -> None:
    one = run(world(), obstacles((1.0, 0.0, math.pi, 0.3, 0.0, 1.0, 9.0)), 8.0)
    assert (one.n_robot_contacts, one.n_shared_contacts, one.n_obstacle_contacts) == (0, 0, 1)
    assert one.t_robot_contact == one.t_shared_contact == NEVER
    assert one.t_contact == pytest.approx((1.0 + (1.0 - REACH) / 0.3) * SECOND, abs=1e3)


def test_the_least_clearance_is_that_of_the_obstacle_that_came_nearest_and_when_it_did() -> None:
    rows = [(1.0, 0.5, 0, 0, 0, 0, 0), (3.0, 1.0, 0, 0, 0, 0, 0)]
    for order in (rows, rows[::-1]):
        one = run(world(v=0.25), obstacles(*order), 6.0)
        assert one.min_clearance == pytest.approx(0.5 - REACH, abs=1e-9)
        assert one.t_min_clearance == pytest.approx(1.0 / 0.25 * SECOND, abs=TICK)
    assert run(world(v=0.25), obstacles(rows[1]), 6.0).min_clearance == pytest.approx(math.hypot(1.5, 1.0) - REACH)


def test_the_goal_is_latched_when_first_within_tolerance_though_the_robot_passes_on() -> None:
    one = run(world(v=0.25, goal=(1.0, 0.1)), obstacles(), 8.0)
    entered = (1.0 - math.sqrt(0.2**2 - 0.1**2)) / 0.25
    assert one.robot.x == pytest.approx(2.0)
    assert 0 <= one.t_goal - entered * SECOND <= TICK


def test_a_goal_that_is_only_passed_at_a_distance_is_not_reached() -> None:
    assert run(world(v=0.25, goal=(1.0, 0.201)), obstacles(), 8.0).t_goal == NEVER


def test_the_way_travelled_is_the_length_of_the_path_not_the_distance() -> None:
    one, others = world(v=0.2), obstacles()
    one.robot.w = one.robot.command_w = 1.0
    run(one, others, 6.28)
    assert one.travelled == pytest.approx(0.2 * 6.28, rel=1e-4)
    assert math.hypot(one.robot.x, one.robot.y) < 0.01


def test_beginning_anew_forgets_everything_that_was_measured() -> None:
    one, others = world(v=0.25, goal=(0.5, 0.0)), obstacles((1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    run(one, others, 5.0)
    assert one.t_goal != NEVER
    assert one.t_contact != NEVER
    begin(one, others)
    assert [one.now, one.t_goal, one.t_contact, one.t_robot_contact, one.n_robot_contacts] == [0, -1, -1, -1, 0]
    assert one.min_clearance == math.inf
    assert others["touching"][0] == 0

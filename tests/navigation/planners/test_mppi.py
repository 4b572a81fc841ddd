"""MPPI: what its averages are made of, and that its chance is the seed's."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours.elementary import PI, exp, sin_cos
from parcours.errors import BadRequest
from parcours.streams import start
from parcours_navigation.arena.contact import gap_square
from parcours_navigation.planners.motion import exp_each, sin_cos_each
from parcours_navigation.planners.mppi import (
    _MOVING,
    COLLISION,
    GAP,
    HEADING,
    LANES,
    PROGRESS,
    Mppi,
    average,
    draw_pool,
    sample,
    score,
    shift_plan,
)

if TYPE_CHECKING:
    from tests.navigation.planners.conftest import Course

    from parcours_navigation.protocol import Floats

LIMITS = np.array([0.25, math.pi / 2, 1.0, 2.094])
WEIGHTS = np.array([3.0, 1.0, 0.2, 0.25, 0.0])


def pool_of(seed: int, n: int) -> Floats:
    stream, pool = np.zeros(1, np.uint64), np.empty(n)
    start(stream, np.uint64(seed), np.uint64(0), np.uint64(7))
    draw_pool(stream, pool)
    return pool


def cost(controls: Floats, places: Floats) -> float:
    """Return the cost of a future from rest in the origin with the goal at (1, 0)."""
    [found] = costs_of(np.zeros(5), controls[None], places, np.full(places.shape[1], 0.225))
    return float(found)


def costs_of(robot: Floats, samples: Floats, places: Floats, reaches: Floats) -> Floats:
    costs, lanes = np.zeros(len(samples)), np.empty((LANES, 2, len(samples)))
    score(robot, (1.0, 0.0), LIMITS, (places, reaches, len(reaches), 0.2), WEIGHTS, 0.1, samples, costs, lanes)
    return costs


def roll_out(
    robot: Floats, controls: Floats, goal: tuple[float, float], limits: Floats, places: Floats, reaches: Floats,
    step: float, weights: Floats, comfort: float,
) -> float:  # fmt: skip
    """Drive one future alone, step by step: its cost; its speeds are replaced up to where it runs into something."""
    n_steps = controls.shape[0]
    reach_v, reach_w = limits[2] * step, limits[3] * step
    x, y, heading, v, w = robot[0], robot[1], robot[2], robot[3], robot[4]
    least, cost = comfort, 0.0
    touched = False
    for t in range(n_steps):
        new_v = min(max(min(max(controls[t, 0], v - reach_v), v + reach_v), 0.0), limits[0])
        new_w = min(max(min(max(controls[t, 1], w - reach_w), w + reach_w), -limits[1]), limits[1])
        way, turn = 0.5 * (v + new_v) * step, 0.5 * (w + new_w) * step
        v, w = new_v, new_w
        controls[t, 0], controls[t, 1] = v, w
        s, c = sin_cos(heading + 0.5 * turn)
        heading += turn
        dx, dy = way * c, way * s
        for i in range(len(reaches)):
            x0, y0 = places[t, i, 0] - x, places[t, i, 1] - y
            x1, y1 = places[t + 1, i, 0] - x - dx, places[t + 1, i, 1] - y - dy
            square = gap_square(x0, y0, x1, y1)
            if square < (reaches[i] + least) * (reaches[i] + least):
                least = min(least, np.sqrt(square) - reaches[i])
                if square < reaches[i] * reaches[i]:
                    urgency = 1.0 - t / n_steps
                    if way > _MOVING and dx * (x0 + x1) + dy * (y0 + y1) > 0.0:
                        return float(cost + weights[COLLISION] * (1.0 + urgency) + weights[PROGRESS])
                    if not touched:
                        touched = True
                        cost += weights[COLLISION] * 0.5 * urgency
        x += dx
        y += dy
    to_x, to_y = goal[0] - x, goal[1] - y
    far = float(np.sqrt(to_x * to_x + to_y * to_y))
    s, c = sin_cos(heading)
    off = 1.0 - (c * to_x + s * to_y) / max(far, 1e-9)
    cost += weights[PROGRESS] * far + weights[HEADING] * off * min(far, 1.0)
    return float(cost + weights[GAP] * (1.0 - max(least, 0.0) / comfort))


def standing(*spots: tuple[float, float]) -> Floats:
    return np.tile(np.array(spots).reshape(1, len(spots), 2), (11, 1, 1))


def test_the_same_seed_gives_the_same_commands_and_another_seed_others(course: Course) -> None:
    obstacles = course.discs((0.8, 0.05, 2.0, 0.2, 0.3))
    planner = Mppi()
    first = course.drive(planner, course.task_to(1.5, 0.2, seed=4), obstacles)
    assert course.drive(planner, course.task_to(1.5, 0.2, seed=4), obstacles).commands == first.commands
    assert course.drive(Mppi(), course.task_to(1.5, 0.2, seed=4), obstacles).commands == first.commands
    assert course.drive(Mppi(), course.task_to(1.5, 0.2, seed=5), obstacles).commands != first.commands


def test_the_pool_is_standard_normal() -> None:
    pool = pool_of(3, 20_000)
    assert abs(pool.mean()) < 0.03
    assert pool.std() == pytest.approx(1.0, abs=0.02)
    assert (np.abs(pool) < 1.959964).mean() == pytest.approx(0.95, abs=0.006)


def test_disturbances_have_the_spread_and_correlation_asked_for() -> None:
    samples, bends, stream = np.empty((4000, 6, 2)), np.empty(4000), np.ones(1, np.uint64)
    plan = np.tile([0.1, 0.3], (6, 1))
    sample(plan, 0.25, np.array([0.2, 0.6, 0.8]), 0.0, stream, pool_of(1, 8192), samples, bends)
    assert np.array_equal(samples[0], plan)
    assert np.array_equal(samples[1], plan * [0.0, 1.0])
    noise = samples[2:] - plan
    assert noise[:, :, 0].std() == pytest.approx(0.2, rel=0.05)
    assert noise[:, :, 1].std() == pytest.approx(0.6, rel=0.05)
    assert np.corrcoef(noise[:, 2, 1], noise[:, 3, 1])[0, 1] == pytest.approx(0.8, abs=0.03)
    expected = (noise * plan / np.array([0.2, 0.6]) ** 2).sum(axis=(1, 2))
    assert bends[2:] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_plan_is_the_softmin_average() -> None:
    rng = np.random.default_rng(9)
    samples, costs, plan = rng.normal(size=(32, 5, 2)), rng.uniform(0.0, 0.1, 32), np.empty((5, 2))
    weights = np.exp(-(costs - costs.min()) / 0.02)
    expected = np.tensordot(weights / weights.sum(), samples, axes=1)
    average(samples, costs.copy(), 0.02, plan)
    assert plan == pytest.approx(expected, rel=1e-12)
    average(samples, costs.copy(), 1e-6, plan)
    assert np.array_equal(plan, samples[costs.argmin()])


def test_a_plan_moves_on_by_whole_steps_and_by_parts_of_them() -> None:
    plan = np.array([[0.0, 0.0], [1.0, 2.0], [3.0, 4.0]])
    shift_plan(plan, 0.5)
    assert plan.tolist() == [[0.5, 1.0], [2.0, 3.0], [3.0, 4.0]]
    shift_plan(plan, 1.0)
    assert plan.tolist() == [[2.0, 3.0], [3.0, 4.0], [3.0, 4.0]]
    shift_plan(plan, 1e9)
    assert plan.tolist() == [[3.0, 4.0]] * 3


def test_futures_keep_the_limits_whatever_was_drawn() -> None:
    wild = np.random.default_rng(10).normal(size=(10, 2)) * 5.0
    cost(wild, standing())
    steps = np.diff(np.vstack([[0.0, 0.0], wild]), axis=0)
    assert wild[:, 0].min() >= 0.0 and wild[:, 0].max() <= 0.25
    assert np.abs(wild[:, 1]).max() <= math.pi / 2
    assert np.abs(steps[:, 0]).max() <= 0.2 + 1e-12
    assert np.abs(steps[:, 1]).max() <= 0.4188 + 1e-12


def test_many_sines_and_cosines_at_a_time_are_to_the_bit_those_of_one() -> None:
    rng = np.random.default_rng(4)
    angles = np.concatenate(
        [rng.uniform(-9.0, 9.0, 999), rng.normal(0.0, 1e4, 999), np.arange(-9, 9) * (PI / 4.0), [-0.0]]
    )
    sines, cosines = np.empty(len(angles)), np.empty(len(angles))
    sin_cos_each(angles, sines, cosines)
    alone = np.array([sin_cos(angle) for angle in angles.tolist()])
    assert sines.tobytes() == alone[:, 0].tobytes()
    assert cosines.tobytes() == alone[:, 1].tobytes()


def test_many_powers_at_a_time_are_to_the_bit_those_of_one() -> None:
    powers = np.random.default_rng(5).uniform(-699.0, 699.0, 9999)
    alone = np.array([exp(one) for one in powers.tolist()])
    exp_each(powers)
    assert powers.tobytes() == alone.tobytes()


def test_futures_driven_side_by_side_are_to_the_bit_those_that_are_driven_alone() -> None:
    rng, ended = np.random.default_rng(12), 0
    for n in (0, 1, 2, 5, 9):
        spots = rng.uniform(-0.7, 0.7, (n, 2))
        places = np.ascontiguousarray(spots + np.arange(11)[:, None, None] * rng.normal(0.0, 0.04, (n, 2)))
        robot, reaches = np.array([0.0, 0.0, rng.uniform(-4.0, 4.0), 0.2, 0.3]), rng.uniform(0.1, 0.3, n)
        wild = rng.normal(0.1, 0.4, (70, 10, 2))
        together, alone = wild.copy(), wild.copy()
        found = costs_of(robot, together, places, reaches)
        for k in range(len(wild)):
            assert found[k] == roll_out(robot, alone[k], (1.0, 0.0), LIMITS, places, reaches, 0.2, WEIGHTS, 0.1)
        assert together.tobytes() == alone.tobytes()
        ended += int((together == wild).all(axis=2).any(axis=1).sum())
    assert ended > 10


def test_running_into_something_costs_most_early_and_standing_before_it_is_cheaper() -> None:
    ahead = np.tile([0.25, 0.0], (10, 1))
    free, late, early = (cost(ahead.copy(), standing(spot)) for spot in ((0.0, 5.0), (0.6, 0.0), (0.35, 0.0)))
    assert free < late < early
    assert cost(np.zeros((10, 2)), standing((0.6, 0.0))) < late


def test_passing_near_costs_more_than_passing_far() -> None:
    ahead = np.tile([0.25, 0.0], (10, 1))
    assert cost(ahead.copy(), standing((0.3, 0.35))) < cost(ahead.copy(), standing((0.3, 0.26)))


@pytest.mark.parametrize(("name", "value"), [("n_samples", 1), ("temperature", 0.0), ("smooth", -1), ("fresh", None)])
def test_a_parameter_out_of_its_range_is_refused_by_name(name: str, value: object) -> None:
    parameters = {name: value}
    with pytest.raises(BadRequest, match=rf"planner mppi, {name}: .*\[planner-parameter\]"):
        Mppi(**parameters)  # type: ignore[arg-type]

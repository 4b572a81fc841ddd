"""MPC: its derivatives against differences, and that each step improves within the limits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.planners.distance import walls_of
from parcours_navigation.planners.ilqr import World, improve, move, slopes, state_cost
from parcours_navigation.planners.mpc import Mpc, brake, head_for, shift
from parcours_navigation.protocol import Floats, Map

LIMITS = np.array([0.25, 1.5, 1.0, 2.0, math.inf])
CAR = np.array([0.25, 1.5, 1.0, 2.0, 3.0])
WEIGHTS = np.array([2.0, 1.0, 40.0, 3e-4, 50.0])
AIM = (1.5, 0.4)


def world_of(rng: np.random.Generator, n: int) -> World:
    cells = np.zeros((40, 40), np.uint8)
    cells[:, 30] = 100
    walls = walls_of(Map(cells, 0.05, (-1.0, -1.0)))
    places = np.tile(rng.uniform(-0.6, 0.6, (1, n, 2)), (21, 1, 1))
    return places, np.full(n, 0.2), n, walls.distances, walls.frame, 0.125, 0.1


def differences(function: object, at: Floats, h: float = 1e-6) -> Floats:
    assert callable(function)
    columns = []
    for k in range(len(at)):
        low, high = at.copy(), at.copy()
        low[k] -= h
        high[k] += h
        columns.append((np.asarray(function(high)) - np.asarray(function(low))) / (2.0 * h))
    return np.stack(columns, axis=-1)


def moved(z: Floats, u: Floats) -> Floats:
    out = np.empty(5)
    move(z, float(u[0]), float(u[1]), 0.2, out)
    return out


def test_the_slopes_of_a_move_are_those_of_differences() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        z, u = rng.uniform(-1.0, 1.0, 5), rng.uniform(-1.0, 1.0, 2)
        by_z, by_u = np.empty((5, 5)), np.empty((5, 2))
        slopes(z, float(u[0]), float(u[1]), 0.2, by_z, by_u)
        assert by_z == pytest.approx(differences(lambda at, u=u: moved(at, u), z), abs=1e-7)
        assert by_u == pytest.approx(differences(lambda at, z=z: moved(z, at), u), abs=1e-7)


@pytest.mark.parametrize("limits", [LIMITS, CAR])
def test_the_slopes_of_a_cost_are_those_of_differences(limits: Floats) -> None:
    rng = np.random.default_rng(2)
    world = world_of(rng, 4)

    def cost(z: Floats) -> float:
        return state_cost(z, 7, 20, AIM, limits, world, WEIGHTS, np.empty(5), np.empty((5, 5)))

    checked = 0
    for _ in range(200):
        z = np.concatenate([rng.uniform(-0.7, 0.7, 3), rng.uniform(-0.3, 0.4, 1), rng.uniform(-2.0, 2.0, 1)])
        gradient, hessian = np.empty(5), np.empty((5, 5))
        state_cost(z, 7, 20, AIM, limits, world, WEIGHTS, gradient, hessian)
        expected = differences(cost, z)
        if np.abs(differences(cost, z, 1e-4) - expected).max() < 1e-2:  # no kink nearby
            checked += 1
            assert gradient == pytest.approx(expected, abs=1e-4)
        assert hessian == pytest.approx(hessian.T, abs=1e-9)
        assert np.linalg.eigvalsh(hessian).min() > -1e-9
    assert checked > 100


@pytest.mark.parametrize("seed", range(10))
def test_improving_never_costs_more_and_keeps_the_limits_of_acceleration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = world_of(rng, 3)
    start = np.array([-0.8, 0.1, rng.uniform(-3.0, 3.0), rng.uniform(0.0, 0.25), rng.uniform(-1.0, 1.0)])
    controls = rng.uniform(-1.0, 1.0, (20, 2))
    costs = [improve(controls, start, 0.2, AIM, LIMITS, world, WEIGHTS, 1) for _ in range(12)]
    assert all(b <= a for a, b in itertools.pairwise(costs))
    assert costs[-1] < costs[0]
    assert np.abs(controls[:, 0]).max() <= 1.0 and np.abs(controls[:, 1]).max() <= 2.0


def test_plans_to_start_from_arrive_or_stop() -> None:
    controls, z = np.empty((40, 2)), np.array([0.0, 0.0, 2.0, 0.0, 0.0])
    head_for(z, 0.2, AIM, 0.0, LIMITS, controls)
    for k in range(40):
        z = moved(z, controls[k])
    assert math.dist(z[:2].tolist(), AIM) < 0.6
    z = np.array([0.0, 0.0, 2.0, 0.25, 1.0])
    brake(z, 0.2, LIMITS, controls)
    for k in range(20):
        z = moved(z, controls[k])
    assert z[3] == pytest.approx(0.0, abs=1e-12) and z[4] == pytest.approx(0.0, abs=1e-12)


def test_a_plan_moves_on_and_ends_in_constant_speeds() -> None:
    controls = np.array([[1.0, 2.0], [3.0, 4.0]])
    shift(controls, 0.5)
    assert controls.tolist() == [[2.0, 3.0], [1.5, 2.0]]
    shift(controls, 1e9)
    assert not controls.any()


@pytest.mark.parametrize(("name", "value"), [("n_steps", 1), ("iterations", 2.5), ("comfort", 0.0), ("bounds", None)])
def test_a_parameter_out_of_its_range_is_refused_by_name(name: str, value: object) -> None:
    parameters = {name: value}
    with pytest.raises(BadRequest, match=rf"planner mpc, {name}: .*\[planner-parameter\]"):
        Mpc(**parameters)  # type: ignore[arg-type]

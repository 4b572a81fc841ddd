"""Switching: from the motion under way into every member of the population, without a jump where it is smooth."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours.streams import start
from parcours_ramp.planner.control_cycle import control_cycle
from parcours_ramp.planner.messages import PATH, POSE, PREDICTION, SAMPLE, many, one
from parcours_ramp.planner.parameters import guarded, original
from parcours_ramp.planner.planner_state import PLANNER, begin_population
from parcours_ramp.planner.population import best_member
from parcours_ramp.planner.route import (
    ENTERED,
    GENTLE,
    HYBRID,
    LAID,
    NEAR,
    NEVER,
    ROUTE,
    TRANSITION,
    _round_corner,
    enter,
    go_on,
    is_too_sharp,
)
from parcours_ramp.planner.sensing_cycle import evaluate_population
from parcours_ramp.planner.switching import EARLIEST, switch_path
from parcours_ramp.planner.trajectory import pose_at, samples

if TYPE_CHECKING:
    from tests.planners.conftest import Sampler

GOAL = (2.0, 2.0)


@dataclass(frozen=True, slots=True)
class Cycle:
    """A planner after a control cycle, and the index of the member it committed to."""

    planner: Record
    best: int
    now: int


def begun(seed: int, schedule: str) -> tuple[Record, Record]:
    parameters = (guarded if schedule == "guarded" else original)(population=7).record()
    planner, pose = one(PLANNER), one(POSE)
    planner.goal_x, planner.goal_y = GOAL
    pose.heading, pose.v = math.pi / 4, 0.249
    start(planner.stream, np.uint64(seed), np.uint64(0), np.uint64(1))
    begin_population(planner, pose, parameters)
    evaluate_population(planner, many(PREDICTION, 0), parameters)
    return planner, parameters


@functools.cache
def cycles() -> list[Cycle]:
    """Return planners after one to four control cycles, 40 seeds of each schedule."""
    found = []
    for seed in range(40):
        for schedule in ("original", "guarded"):
            planner, parameters = begun(seed, schedule)
            for _ in range(1 + seed % 4):
                now = int(planner.t_next)
                best = best_member(planner.members, planner.n)
                pose_at(
                    planner.moving_on if planner.moving_on.n else planner.members[best].trajectory, 0.0, planner.latest
                )
                control_cycle(planner, many(PREDICTION, 0), now, parameters)
            found.append(Cycle(planner, best, now))
    return found


@settings(max_examples=3000)
@given(
    st.floats(0.0, 0.6), st.floats(0.02, 0.6), st.floats(-math.pi, math.pi) | st.floats(-0.4, 0.4), st.booleans(),
    st.floats(0.0, 0.33), st.booleans(),
)  # fmt: skip
def test_a_corner_that_is_called_too_sharp_is_not_rounded(
    before: float, after: float, turn: float, first: bool, v: float, early: bool
) -> None:
    parameters = guarded().record()
    ahead, aside = after * math.cos(turn), after * math.sin(turn)
    if is_too_sharp(before, after, ahead, aside, first, parameters):
        leg, _ = _round_corner(before, after, turn, v, early, parameters)
        assert leg == 0.0
        assert abs(turn) > (NEAR if first else GENTLE)


def test_most_ways_that_cannot_be_joined_have_a_corner_that_is_called_too_sharp() -> None:
    rng, parameters = np.random.default_rng(7), guarded().record()
    laid, sharp, other = 0, 0, 0
    path, pose, joined, route = one(PATH), one(POSE), one(PATH), one(ROUTE)
    path.n = 4
    for _ in range(10_000):
        direction = rng.uniform(-math.pi, math.pi)
        away, pose.v = rng.uniform(0.02, 0.5), rng.uniform(0.0, 0.33)
        path.x[:4], path.y[:4] = rng.uniform(0.0, 2.0, (2, 4))
        pose.x, pose.y = path.x[0] - away * math.cos(direction), path.y[0] - away * math.sin(direction)
        pose.heading = direction + rng.normal(0.0, 0.02)
        switch_path(path, pose, TRANSITION, joined)
        if enter(joined, 1, pose, NEVER, parameters, route) != ENTERED:
            continue
        can = go_on(joined, pose.v, TRANSITION, parameters, route) == LAID
        # What only looks whether it can be joined enters the path itself, which begins at the joint.
        assert enter(path, 0, pose, NEVER, parameters, route) == ENTERED
        assert (go_on(path, pose.v, TRANSITION, parameters, route) == LAID) == can
        x, y = path.x[1] - path.x[0], path.y[1] - path.y[0]
        ahead, aside = route.at_c * x + route.at_s * y, route.at_c * y - route.at_s * x
        is_sharp = is_too_sharp(route.before, math.hypot(x, y), ahead, aside, True, parameters)
        assert not (can and is_sharp)
        laid, sharp, other = laid + can, sharp + is_sharp, other + (not can and not is_sharp)
    assert min(laid, other) > 300
    assert sharp > other


def turn(one_heading: float, other: float) -> float:
    return abs(math.remainder(float(one_heading) - float(other), math.tau))


def test_every_member_begins_at_the_next_control_cycle_where_the_motion_under_way_will_be() -> None:
    for cycle in cycles():
        planner = cycle.planner
        expected = one(POSE)
        pose_at(planner.moving_on, (planner.t_next - planner.moving_on.begins) * 1e-9, expected)
        for i in range(int(planner.n)):
            trajectory = planner.members[i].trajectory
            assert trajectory.begins == planner.t_next
            first = samples(trajectory)[0]
            assert math.hypot(first.x - expected.x, first.y - expected.y) < 1e-9
            assert first.v == pytest.approx(expected.v, abs=NEAR)


def test_a_smooth_member_joins_without_a_jump_in_heading_or_a_stop() -> None:
    smooth = 0
    for cycle in cycles():
        planner = cycle.planner
        expected = one(POSE)
        pose_at(planner.moving_on, (planner.t_next - planner.moving_on.begins) * 1e-9, expected)
        if expected.v < 0.1:
            continue
        for i in range(int(planner.n)):
            trajectory = planner.members[i].trajectory
            if not trajectory.smooth or i == cycle.best:
                continue
            smooth += 1
            states = samples(trajectory)
            assert turn(states.heading[0], expected.heading) <= NEAR
            first = min(len(states), 11)
            steps = [turn(states.heading[k], states.heading[k + 1]) for k in range(first - 1)]
            assert max(steps) <= 1.5707964 * SAMPLE
            rotates = (states.v[: first - 1] < NEAR) & (np.abs(states.w[: first - 1]) > NEAR)
            assert not rotates[: max(first - 4, 1)].any()
    assert smooth > 100


def test_a_member_that_is_not_smooth_makes_the_robot_stop_and_rotate(sampled: Sampler) -> None:
    stopping = 0
    for cycle in cycles():
        planner = cycle.planner
        for i in range(int(planner.n)):
            trajectory = planner.members[i].trajectory
            if trajectory.smooth or trajectory.n < 30:
                continue
            stopping += 1
            motion = sampled(trajectory, 0.01)
            assert motion.v[motion.time < trajectory.duration - 0.3].min() < 0.011  # not only at its end
    assert stopping > 20


def test_the_best_member_goes_on_with_what_is_left_of_the_motion_under_way() -> None:
    kept = 0
    for cycle in cycles():
        planner = cycle.planner
        trajectory, moving_on = planner.members[cycle.best].trajectory, planner.moving_on
        at = round((planner.t_next - moving_on.begins) * 1e-9 / SAMPLE)
        n = int(moving_on.n) - at
        if n > 1 and trajectory.n == n:
            kept += np.allclose(samples(trajectory).x, samples(moving_on).x[at:], rtol=0.0, atol=1e-12)
    assert kept > len(cycles()) // 2


def test_the_next_control_cycle_comes_between_the_earliest_switch_and_the_longest_period() -> None:
    periods = np.array([(cycle.planner.t_next - cycle.planner.t_control) * 1e-9 for cycle in cycles()])
    assert periods.min() >= EARLIEST - 1e-9
    assert periods.max() <= guarded().control_period + 1e-9
    assert len(np.unique(np.round(periods, 1))) > 3
    for cycle in cycles():
        planner = cycle.planner
        early = planner.t_next - planner.moving_on.begins < 2_000_000_000
        assert planner.switch_kind == (TRANSITION if early else HYBRID)


def test_every_path_begins_at_the_anchor_and_ends_at_the_goal_after_any_cycle() -> None:
    for cycle in cycles():
        planner = cycle.planner
        for i in range(int(planner.n)):
            path = planner.members[i].path
            assert (path.x[0], path.y[0]) == (planner.anchor.x, planner.anchor.y)
            assert (path.x[path.n - 1], path.y[path.n - 1]) == GOAL


def test_a_switch_puts_the_pose_before_the_anchor_and_anything_else_puts_it_in_its_place() -> None:
    planner = cycles()[0].planner
    path, pose, out = planner.members[0].path, one(POSE), planner.work_path
    pose.x, pose.y = 0.11, 0.12
    switch_path(path, pose, TRANSITION, out)
    assert (out.n, out.x[0], out.x[1]) == (path.n + 1, 0.11, path.x[0])
    switch_path(path, pose, HYBRID, out)
    assert (out.n, out.x[0], out.x[1]) == (path.n, 0.11, path.x[1])

"""Evaluation: the first collision against a plain search, and what makes one trajectory fitter than another."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from parcours.kernels import Record
from parcours_ramp.planner.collision import collision_time, first_collision
from parcours_ramp.planner.messages import (
    EPOCH,
    LINE,
    NO_COLLISION,
    OBSTACLE_STATE,
    PREDICTION,
    SAMPLE,
    TRAJECTORY,
    many,
    one,
)
from parcours_ramp.planner.parameters import Parameters, guarded, original
from parcours_ramp.planner.prediction import predict, predicted_until
from parcours_ramp.planner.route import ROUTE
from parcours_ramp.planner.trajectory import copy_trajectory, place_at, samples, time_route
from parcours_ramp.planner.trajectory_evaluation import evaluate

if TYPE_CHECKING:
    from tests.planners.conftest import Way

V_MAX = guarded().v_max
Point = tuple[float, float]


def prediction_of(x: float, y: float, heading: float, v: float, w: float, stamp: int = 0) -> Record:
    obstacle, prediction = one(OBSTACLE_STATE), one(PREDICTION)
    pose = obstacle.pose
    pose.x, pose.y, pose.heading, pose.v, pose.w = x, y, heading, v, w
    obstacle.radius = 0.1
    predict(obstacle, stamp, prediction)
    return prediction


class Search:
    """The two bodies at every sample from `first` to `last`, both included.

    The obstacle's place between its own samples is on a line.
    """

    def __init__(
        self, trajectory: Record, begins: int, first: int, last: int, prediction: Record, drift: Point
    ) -> None:
        self.first, self.last = first, last
        at = np.arange(first, last + 1)
        poses, n = samples(trajectory), int(prediction.n)
        robot = np.minimum(at, len(poses) - 1)
        place = at + (begins - int(prediction.stamp)) * 1e-9 / SAMPLE
        x, y = (np.interp(place, np.arange(n), prediction[name][:n]) for name in ("x", "y"))
        self.gaps = np.stack([x - poses.x[robot] - drift[0], y - poses.y[robot] - drift[1]], axis=1)
        self.distances = np.hypot(*self.gaps.T)
        before, steps = self.gaps[:-1], np.diff(self.gaps, axis=0)
        self.moved = np.hypot(*steps.T)
        squares = (steps**2).sum(axis=1)
        shares = np.clip(-(before * steps).sum(axis=1) / np.where(squares > 0.0, squares, 1.0), 0.0, 1.0)
        self.nearest = np.hypot(*(before + shares[:, np.newaxis] * steps).T)
        """The least distance on the way to each sample but the first."""
        self.least = float(min(self.nearest[: last - first - 1].min(initial=np.inf), self.distances[0]))
        """The least distance before `last`."""

    def hit(self, reach: float, may_leave: bool) -> int:
        """Look at every sample and every step between two of them; skip nothing."""
        distances = self.distances
        leaving = may_leave and bool(distances[0] < reach)
        if distances[0] < reach and not leaving:
            return self.first
        for k in range(1, len(distances)):
            if leaving:
                if distances[k] < distances[k - 1] + 0.15 * self.moved[k - 1] - 1e-6:
                    return self.first + k - 1
                leaving = bool(distances[k] < reach)
            elif self.nearest[k - 1] < reach:
                return self.first + k
        return self.last


def found(
    trajectory: Record, begins: int, first: int, last: int, prediction: Record, drift: Point, reach: float, leave: bool
) -> tuple[int, int, float, float, float]:
    """Return what the kernel finds."""
    place = place_at(trajectory, first * SAMPLE)
    return first_collision(trajectory, begins, first, last, *place, prediction, *drift, reach, leave, V_MAX)


def test_the_first_collision_is_the_one_a_plain_search_finds_over_random_motions(ways: list[Way]) -> None:
    rng = np.random.default_rng(3)
    hits = []
    for k, way in enumerate(ways):
        v, w = rng.choice([0.0, rng.uniform(0.05, 0.5)]), rng.choice([0.0, rng.uniform(-1.5, 1.5)])
        prediction = prediction_of(
            rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0), rng.uniform(-3.1, 3.1), v, w, int(rng.integers(2 * 10**9))
        )
        reach, leave = float(rng.choice([0.225, 0.275, 0.42])), bool(k % 2)
        begins, first, last = int(rng.integers(4 * 10**9)), int(rng.integers(0, 5)), int(way.trajectory.n)
        last = last if k % 3 else first + 11
        drift = (float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-0.05, 0.05)))
        hit = found(way.trajectory, begins, first, last, prediction, drift, reach, leave)[0]
        assert hit == Search(way.trajectory, begins, first, last, prediction, drift).hit(reach, leave), k
        hits.append(hit < last)
    assert 0.2 < np.mean(hits) < 0.8


motions = st.one_of(
    st.just((0.0, 0.0)),
    st.tuples(st.floats(0.01, 0.5) | st.floats(-0.5, -0.01), st.just(0.0)),
    st.tuples(st.floats(0.01, 0.5) | st.floats(-0.5, -0.01), st.floats(0.01, 3.0) | st.floats(-3.0, -0.01)),
)
places = st.floats(-0.3, 2.3)
small = st.floats(-0.05, 0.05)


@settings(max_examples=1500)
@given(
    st.integers(0, 599), motions, places, places, st.floats(-math.pi, math.pi),
    st.integers(-2 * 10**9, 14 * 10**9), st.integers(0, 60), st.integers(1, 520), small, small,
    st.floats(0.05, 0.5) | st.floats(-9.0, -2.0), st.booleans(), st.booleans(), st.floats(-math.pi, math.pi),
    st.sampled_from([0.1, 0.9, 0.999999]),
)  # fmt: skip
def test_nothing_the_search_skips_could_have_been_a_collision(
    ways: list[Way], number: int, motion: Point, x: float, y: float, heading: float, late: int, first: int, n: int,
    dx: float, dy: float, reach: float, above: bool, leave: bool, aside: float, share: float,
) -> None:  # fmt: skip
    trajectory, prediction = ways[number].trajectory, prediction_of(x, y, heading, *motion, stamp=3 * 10**9)
    begins, last = 3 * 10**9 + late, first + n
    search = Search(trajectory, begins, first, last, prediction, (dx, dy))
    if reach < 0.0:  # the bodies only just touch, or miss, by 10^reach: at the nearest they come, or begin
        reach = search.least + (10.0**reach if above else -(10.0**reach))
        assume(0.01 < reach < 2.0)
    hit, valid_until, slack, tight, later = found(trajectory, begins, first, last, prediction, (dx, dy), reach, leave)
    assert hit == search.hit(reach, leave)
    assert valid_until <= hit
    assert 0.0 <= tight <= slack
    assert later >= 0.0
    # So far the two could come nearer by `slack`, and nothing would be found; by `later`, where no way is predicted.
    until = int(min(valid_until, max(predicted_until(prediction, begins), first)))
    for sample, least in ((until, slack), (valid_until, min(slack, later))):
        if sample > first:
            way = search.nearest[: sample - first - (sample == last)]
            assert least <= min(float(search.distances[0]), float(way.min(initial=np.inf))) - reach + 1e-12
    # By less than `tight` and `later` the two may be elsewhere, in any direction, and the same is found.
    off = share * min(tight, later, 3.0)
    drift = (dx + off * math.cos(aside), dy + off * math.sin(aside))
    assert found(trajectory, begins, first, last, prediction, drift, reach, leave)[0] == hit


def crossing(samples: int = 60) -> Record:
    """Return a trajectory straight along x at top speed."""
    route, trajectory = one(ROUTE), one(TRAJECTORY)
    route.n, route.kind[0], route.length[0], route.cap[0] = 1, LINE, 0.025 * (samples - 1), V_MAX
    route.v_in[:2], route.c[0] = V_MAX, 1.0
    route.smooth = 1
    time_route(route, guarded().record(), trajectory)
    assert trajectory.n == samples
    return trajectory


def test_head_on_at_three_quarters_of_a_metre_a_second_is_seen_at_the_sample_it_happens() -> None:
    prediction = prediction_of(1.5, 0.0, math.pi, 0.5, 0.0)
    touched = (1.5 - 0.225) / 0.75
    hit = found(crossing(), 0, 0, 60, prediction, (0.0, 0.0), 0.225, False)[0]
    assert hit == math.ceil(touched / SAMPLE)


def test_a_body_that_crosses_between_two_samples_does_not_slip_through() -> None:
    # Both are tiny: at every sample they are farther apart than reach, in between they meet.
    trajectory = crossing()
    prediction = prediction_of(0.5 + 0.0125, -0.5 * 2.05, math.pi / 2, 0.5, 0.0)
    assert Search(trajectory, 0, 0, 60, prediction, (0.0, 0.0)).distances.min() > 0.02
    assert found(trajectory, 0, 0, 60, prediction, (0.0, 0.0), 0.01, False)[0] == 21


def test_a_robot_that_begins_too_near_may_leave_but_not_come_nearer() -> None:
    behind, ahead = prediction_of(-0.1, 0.0, 0.0, 0.0, 0.0), prediction_of(0.1, 0.0, 0.0, 0.0, 0.0)
    for prediction, may_leave, hit in ((behind, False, 0), (behind, True, 60), (ahead, False, 0), (ahead, True, 0)):
        assert found(crossing(), 0, 0, 60, prediction, (0.0, 0.0), 0.225, may_leave)[0] == hit


def test_a_robot_that_begins_too_near_may_not_slip_past() -> None:
    for angle, hit in ((1.4, 0), (1.6, 0), (1.8, 60)):  # 90 degrees is 1.57: then it goes along the obstacle's edge
        beside = prediction_of(0.2 * math.cos(angle), 0.2 * math.sin(angle), 0.0, 0.0, 0.0)
        assert found(crossing(), 0, 0, 60, beside, (0.0, 0.0), 0.225, True)[0] == hit


def test_what_lies_outside_the_window_is_not_looked_at() -> None:
    prediction = prediction_of(1.0, 0.0, 0.0, 0.0, 0.0)
    touched = math.ceil((1.0 - 0.225) / 0.025)
    assert found(crossing(), 0, 0, touched, prediction, (0.0, 0.0), 0.225, False)[0] == touched
    assert found(crossing(), 0, 0, touched + 1, prediction, (0.0, 0.0), 0.225, False)[0] == touched
    passed = prediction_of(0.0, 0.0, 0.0, 0.0, 0.0)
    assert found(crossing(), 0, 12, 60, passed, (0.0, 0.0), 0.225, False)[0] == 60


def test_the_collision_time_is_that_of_the_first_of_all_obstacles_and_margins_bring_it_forward() -> None:
    predictions = many(PREDICTION, 2)
    predictions[0], predictions[1] = prediction_of(1.2, 0, 0, 0, 0), prediction_of(0.8, 0, 0, 0, 0)
    parameters = guarded().record()
    near = collision_time(crossing(), 0, 0, 60, predictions, 0.0, 0.0, 0.0, False, parameters)
    far = collision_time(crossing(), 0, 0, 60, predictions[:1], 0.0, 0.0, 0.0, False, parameters)
    wary = collision_time(crossing(), 0, 0, 60, predictions, 0.0, 0.0, 0.1, False, parameters)
    assert wary < near < far
    assert near == pytest.approx((0.8 - 0.225) / 0.25)
    assert collision_time(crossing(), 0, 0, 60, predictions[:0], 0.0, 0.0, 0.0, False, parameters) == NO_COLLISION


@pytest.mark.parametrize("parameters", [original(), guarded()], ids=["original", "guarded"])
def test_every_feasible_trajectory_is_fitter_than_every_infeasible_one(ways: list[Way], parameters: Parameters) -> None:
    rng = np.random.default_rng(11)
    feasible: list[float] = []
    infeasible: list[float] = []
    for way in ways:
        predictions = many(PREDICTION, 2)
        for k in range(2):
            predictions[k] = prediction_of(
                rng.uniform(0.3, 2.0), rng.uniform(0.3, 2.0), rng.uniform(-3.1, 3.1), rng.uniform(0.0, 0.5), 0.0
            )
        trajectory = one(TRAJECTORY)
        copy_trajectory(trajectory, way.trajectory, 0)
        evaluate(trajectory, predictions, one(EPOCH), 0.0, 0.0, float(way.start.heading), False, parameters.record())
        assert 0.0 < trajectory.fitness <= 1.0
        if trajectory.t_collision < NO_COLLISION or not trajectory.smooth:
            assert not trajectory.feasible
        (feasible if trajectory.feasible else infeasible).append(float(trajectory.fitness))
    assert min(len(feasible), len(infeasible)) > 50
    assert min(feasible) > max(infeasible)


@given(st.floats(0.0, 49.9), st.floats(0.0, 30.0), st.floats(0.0, 14.2), st.floats(0.0, 15.8), st.floats(-3.2, 3.2))
def test_the_longest_way_through_the_arena_is_fitter_than_the_latest_collision(
    late: float, lasts: float, rest: float, turn: float, heading: float
) -> None:
    # At most five legs of a path of seven knots are left, each no longer than the arena's diagonal.
    free, doomed = crossing(), crossing(501)
    free.duration, free.rest_length, free.rest_turn, free.first_heading = lasts, rest, turn, heading
    obstacle = prediction_of(0.025 * round(late / SAMPLE) + 0.22, 0.0, 0.0, 0.0, 0.0)
    predictions = many(PREDICTION, 1)
    predictions[0] = obstacle
    evaluate(free, predictions[:0], one(EPOCH), 0.0, 0.0, 0.0, False, guarded().record())
    evaluate(doomed, predictions, one(EPOCH), 0.0, 0.0, 0.0, False, original().record())
    assert free.feasible
    assert not doomed.feasible
    assert free.fitness > doomed.fitness


def test_a_collision_at_once_costs_the_published_1e4_and_a_later_one_1e4_over_its_time() -> None:
    predictions, trajectory = many(PREDICTION, 1), crossing()
    for x, t, penalty in ((0.1, 0.0, 1e4), (0.24, 0.1, 1e5), (0.9, None, None)):
        predictions[0] = prediction_of(x, 0.0, 0.0, 0.0, 0.0)
        evaluate(trajectory, predictions, one(EPOCH), 0.0, 0.0, 0.0, False, original().record())
        at = float(trajectory.t_collision) if t is None else t
        assert trajectory.t_collision == pytest.approx(at)
        expected = 1e4 / at if penalty is None else penalty
        assert 1.0 / trajectory.fitness == pytest.approx(5.9 + expected)


def test_fitness_falls_with_duration_rest_turning_and_first_heading_and_with_an_earlier_collision() -> None:
    def fitness(predictions: Record, halted: bool = False, **changes: float) -> float:
        trajectory = crossing()
        for name, value in changes.items():
            setattr(trajectory, name, value)
        evaluate(trajectory, predictions, one(EPOCH), 0.0, 0.0, 0.0, halted, guarded().record())
        return float(trajectory.fitness)

    nobody, early, late = many(PREDICTION, 0), many(PREDICTION, 1), many(PREDICTION, 1)
    early[0], late[0] = prediction_of(0.6, 0, 0, 0, 0), prediction_of(1.2, 0, 0, 0, 0)
    best = fitness(nobody)
    assert best == pytest.approx(1.0 / 5.9)
    assert fitness(nobody, duration=7.0) == pytest.approx(1.0 / 7.0)
    assert fitness(nobody, rest_length=1.0) == pytest.approx(1.0 / (5.9 + 8.0))
    assert fitness(nobody, rest_turn=math.pi / 8) == pytest.approx(1.0 / 6.9)
    assert fitness(nobody, first_heading=-math.pi / 2) == pytest.approx(1.0 / 6.4)
    assert fitness(early) < fitness(late) < best
    assert fitness(nobody, smooth=0) == pytest.approx(1.0 / (5.9 + 1e5 * 0.1 / math.pi))
    assert fitness(nobody, smooth=0, first_heading=1.0) < fitness(nobody, smooth=0)
    assert fitness(nobody, halted=True, smooth=0) == best
    assert fitness(nobody, duration=0.2) == 1.0

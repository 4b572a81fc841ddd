"""What an evaluation remembers: over any run of events it says what an evaluation says that remembers nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from parcours.kernels import Record
from parcours.planners.ramp.guard import evaluate_moving_on
from parcours.planners.ramp.messages import NO_COLLISION, OBSTACLE_STATE, POSE, PREDICTION, TRAJECTORY, many, one
from parcours.planners.ramp.parameters import guarded, original
from parcours.planners.ramp.planner_state import PLANNER, begin_population
from parcours.planners.ramp.prediction import predict
from parcours.planners.ramp.sensing_cycle import changes_of, evaluate_population, sensing_cycle
from parcours.planners.ramp.trajectory import copy_trajectory, pose_at, shift
from parcours.planners.ramp.trajectory_evaluation import evaluate, still_passes
from parcours.streams import start

PERIOD = 50_000_000
RESULTS = ("feasible", "fitness", "t_collision")


@dataclass(slots=True)
class Mover:
    """An obstacle that keeps its speeds until told otherwise."""

    x: float
    y: float
    heading: float
    v: float
    w: float

    def go_on(self, seconds: float) -> None:
        """Move in closed form."""
        if abs(self.w) < 1e-9:
            self.x += self.v * seconds * math.cos(self.heading)
            self.y += self.v * seconds * math.sin(self.heading)
            return
        to = self.heading + self.w * seconds
        self.x += self.v / self.w * (math.sin(to) - math.sin(self.heading))
        self.y -= self.v / self.w * (math.cos(to) - math.cos(self.heading))
        self.heading = math.remainder(to, math.tau)

    def seen(self, state: Record) -> None:
        """Fill the OBSTACLE_STATE."""
        pose = state.pose
        pose.x, pose.y, pose.heading, pose.v, pose.w = self.x, self.y, self.heading, self.v, self.w
        state.radius = 0.1


class Run:
    """A planner with its population, three obstacles, and a clock."""

    def __init__(self, seed: int, schedule: str) -> None:
        self.rng = np.random.default_rng(seed)
        self.parameters = (guarded if schedule == "guarded" else original)(population=6).record()
        self.planner, pose = one(PLANNER), one(POSE)
        self.planner.goal_x = self.planner.goal_y = 2.0
        pose.heading, pose.v = math.pi / 4, 0.249
        start(self.planner.stream, np.uint64(seed), np.uint64(0), np.uint64(1))
        begin_population(self.planner, pose, self.parameters)
        self.planner.t_next = 10**12  # no control cycle is near
        copy_trajectory(self.planner.moving_on, self.planner.members[0].trajectory, 0)
        self.movers = [self.mover() for _ in range(3)]
        self.states, self.predictions = many(OBSTACLE_STATE, 3), many(PREDICTION, 3)
        self.now = 0
        self.spared = self.met = 0

    def mover(self) -> Mover:
        rng = self.rng
        v = float(rng.choice([0.0, rng.uniform(0.05, 0.5)]))
        w = float(rng.choice([0.0, rng.uniform(-1.5, 1.5), rng.uniform(-0.02, 0.02)]))
        return Mover(*rng.uniform(0.2, 2.0, 2), float(rng.uniform(-3.1, 3.1)), v, w)

    def step(self) -> None:
        """Let time pass, the obstacles move and perhaps do something else, and the robot drift."""
        rng = self.rng
        self.now += PERIOD
        for k, mover in enumerate(self.movers):
            mover.go_on(PERIOD * 1e-9)
            if rng.random() < 0.02:
                self.movers[k] = self.mover()
            if rng.random() < 0.1:  # it is not quite where it was predicted
                mover.x, mover.y = mover.x + rng.normal(0.0, 0.005), mover.y + rng.normal(0.0, 0.005)
                mover.heading += rng.normal(0.0, 0.002)
            mover.seen(self.states[k])
        if rng.random() < 0.5:
            self.planner.drift_x += rng.normal(0.0, 0.01)
            self.planner.drift_y += rng.normal(0.0, 0.01)
        if rng.random() < 0.05:
            self.planner.drift_x, self.planner.drift_y = rng.uniform(-0.1, 0.1, 2)
        if rng.random() < 0.05:  # as a commitment does
            member = self.planner.members[int(rng.integers(self.planner.n))].trajectory
            copy_trajectory(self.planner.moving_on, member, int(rng.integers(0, max(member.n - 10, 1))))
            self.planner.moving_on_until = 0
            shift(self.planner.moving_on, self.planner.drift_x, self.planner.drift_y)
        pose_at(self.planner.moving_on, (self.now - self.planner.moving_on.begins) * 1e-9, self.planner.latest)

    def check_population(self) -> None:
        """Compare every member with a copy of it that is evaluated without memory."""
        planner, fresh = self.planner, one(TRAJECTORY)
        for i in range(int(planner.n)):
            member = planner.members[i].trajectory
            copy_trajectory(fresh, member, 0)
            evaluate(
                fresh, self.predictions, 0, 0.0, float(planner.drift_x), float(planner.drift_y),
                float(planner.latest.heading), bool(planner.halted), self.parameters,
            )  # fmt: skip
            assert [member[name] for name in RESULTS] == [fresh[name] for name in RESULTS]
            self.met += member.t_collision < NO_COLLISION

    def check_moving_on(self, predictions: Record) -> None:
        """Compare what is said of the motion under way with what is said of it without memory."""
        planner = self.planner
        said = int(planner.moving_on_hit), float(planner.moving_on_t)
        again = planner.copy()
        evaluate_moving_on(again, predictions, self.now, np.inf, self.parameters)
        assert said == (again.moving_on_hit, again.moving_on_t)

    def remembers(self, trajectory: Record) -> bool:
        planner = self.planner
        return bool(
            still_passes(trajectory, planner.scene, planner.changed, float(planner.drift_x), float(planner.drift_y))
        )


@pytest.mark.parametrize("schedule", ["original", "guarded"])
@pytest.mark.parametrize("seed", range(25))
def test_over_random_scenes_what_is_remembered_never_changes_an_evaluation(seed: int, schedule: str) -> None:
    run = Run(seed, schedule)
    for _ in range(80):
        run.step()
        if run.rng.random() < 0.3:  # the guard looks first, at predictions of its own
            changed = run.planner.changed + changes_of(run.planner, run.predictions, run.states, run.now)
            own = many(PREDICTION, 3)
            for k in range(3):
                predict(run.states[k], run.now, own[k])
            evaluate_moving_on(run.planner, own, run.now, float(changed), run.parameters)
            run.check_moving_on(own)
        sensing_cycle(run.planner, run.states, run.now, run.now, run.predictions, run.parameters)
        run.check_population()
        run.check_moving_on(run.predictions)
        # The drift changes between two messages too.
        run.planner.drift_x += run.rng.normal(0.0, 0.02)
        run.spared += sum(run.remembers(run.planner.members[i].trajectory) for i in range(int(run.planner.n)))
        evaluate_population(run.planner, run.predictions, run.parameters)
        run.check_population()
    assert run.spared > 0
    assert run.met > 0

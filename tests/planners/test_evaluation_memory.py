"""What an evaluation remembers: over any run of events it says what an evaluation says that remembers nothing."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest
from tests.planners.conftest import Way

from parcours.kernels import Record, kernel
from parcours.streams import start
from parcours_ramp.planner.guard import evaluate_moving_on, is_known_to_pass
from parcours_ramp.planner.late_evaluation import catch_up_with_all, catch_up_with_best
from parcours_ramp.planner.messages import EPOCH, NO_COLLISION, OBSTACLE_STATE, POSE, PREDICTION, TRAJECTORY, many, one
from parcours_ramp.planner.parameters import guarded, original
from parcours_ramp.planner.planner_state import PLANNER, begin_population
from parcours_ramp.planner.population import best_member
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.sensing_cycle import evaluate_population, look_on, sensing_cycle
from parcours_ramp.planner.trajectory import copy_trajectory, pose_at, shift
from parcours_ramp.planner.trajectory_evaluation import evaluate, known_up_to

PERIOD = 50_000_000
UNKNOWN = one(EPOCH)
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
        self.wild = (1.0, 1.0, 0.02, 0.02, 0.0)[seed % 5]
        """How much the robot and the obstacles stray from what was planned; if at all, some obstacles stand."""
        self.renewed = 0.1
        """How likely it is that all members begin anew."""
        make, stops_cost = guarded if schedule == "guarded" else original, 1.0 if seed % 2 else 1e5
        self.parameters = make(population=6, q_orientation=stops_cost).record()  # a member that must stop may be best
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
        self.spared = self.partly = self.again = self.left_out = self.met = self.put_off = self.never_asked = 0
        """Evaluations that memory spares wholly, or up to a sample; the same collisions it knows of again; the guard's
        looks it spares; collisions; how many evaluations were put off, and how many of them the choice of the best
        member did not ask for."""

    def mover(self) -> Mover:
        rng = self.rng
        v = float(rng.choice([0.0, rng.uniform(0.05, 0.5)]))
        w = float(rng.choice([0.0, rng.uniform(-1.5, 1.5), rng.uniform(-0.02, 0.02)]))
        if self.wild == 0.0:
            v, w = float(rng.uniform(0.2, 0.5)), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5))
        x, y = rng.uniform(0.2, 2.0, 2)
        return Mover(float(x), float(y), float(rng.uniform(-3.1, 3.1)), v, w)

    def step(self) -> None:
        """Let time pass, the obstacles move and perhaps do something else, and the robot drift."""
        rng = self.rng
        self.now += PERIOD
        for k, mover in enumerate(self.movers):
            mover.go_on(PERIOD * 1e-9)
            if rng.random() < (0.02 if self.wild == 1.0 else 0.005):
                self.movers[k] = self.mover()
            if rng.random() < 0.1 * self.wild:  # it is not quite where it was predicted
                mover.x, mover.y = mover.x + rng.normal(0.0, 0.005), mover.y + rng.normal(0.0, 0.005)
                mover.heading += rng.normal(0.0, 0.002)
            mover.seen(self.states[k])
        if rng.random() < 0.5:
            self.drift(0.01)
        if rng.random() < 0.05 * self.wild:
            self.planner.drift_x, self.planner.drift_y = rng.uniform(-0.1, 0.1, 2)
        if rng.random() < self.renewed:  # as a control cycle does, which begins all anew
            for i in range(int(self.planner.n)):
                member = self.planner.members[i].trajectory
                member.begins, member.epoch = self.now + int(rng.integers(0, 2 * 10**9)), 0
        if rng.random() < 0.05:  # as a commitment does
            member = self.planner.members[int(rng.integers(self.planner.n))].trajectory
            copy_trajectory(self.planner.moving_on, member, int(rng.integers(0, max(member.n - 10, 1))))
            shift(self.planner.moving_on, self.planner.drift_x, self.planner.drift_y)
            self.planner.moving_on.epoch = 0
        pose_at(self.planner.moving_on, (self.now - self.planner.moving_on.begins) * 1e-9, self.planner.latest)

    def drift(self, far: float) -> None:
        """Let the robot drift about so far [m], if it is a wild one."""
        self.planner.drift_x += self.rng.normal(0.0, far * self.wild)
        self.planner.drift_y += self.rng.normal(0.0, far * self.wild)

    def evaluate_population(self) -> None:
        """Evaluate every member with what it remembers, after counting what that spares."""
        planner = self.planner
        for i in range(int(planner.n)):
            member = planner.members[i].trajectory
            drift = float(planner.drift_x), float(planner.drift_y)
            up_to = int(known_up_to(member, int(member.begins), planner.epoch, *drift))
            self.spared += up_to >= member.n
            self.partly += 0 < up_to < member.n
            self.again += member.met_at < up_to
        evaluate_population(planner, self.predictions, self.parameters)

    def check_population(self) -> None:
        """Compare every member with a copy of it that is evaluated without memory; none stays put off."""
        planner, fresh = self.planner, one(TRAJECTORY)
        drift, heading = (float(planner.drift_x), float(planner.drift_y)), float(planner.latest.heading)
        planner.drift_x, planner.drift_y, planner.latest.heading = 1.0, -1.0, 1.0  # these no longer count
        self.put_off += int(planner.members["put_off"].sum())
        best = catch_up_with_best(planner, self.predictions, self.parameters)
        self.never_asked += int(planner.members["put_off"].sum())
        catch_up_with_all(planner, self.predictions, self.parameters)
        assert best == best_member(planner.members, int(planner.n))
        (planner.drift_x, planner.drift_y), planner.latest.heading = drift, heading
        for i in range(int(planner.n)):
            member = planner.members[i].trajectory
            copy_trajectory(fresh, member, 0)
            evaluate(fresh, self.predictions, UNKNOWN, *drift, heading, bool(planner.halted), self.parameters)
            assert [member[name] for name in RESULTS] == [fresh[name] for name in RESULTS]
            self.met += member.t_collision < NO_COLLISION

    def check_moving_on(self, predictions: Record) -> None:
        """Compare what is said of the motion under way with what is said of it without memory."""
        planner = self.planner
        said = int(planner.moving_on_hit), float(planner.moving_on_t)
        again = planner.copy()
        evaluate_moving_on(again, predictions, self.now, UNKNOWN, self.parameters)
        assert said == (again.moving_on_hit, again.moving_on_t)

    def look_as_guard(self) -> None:
        """Look at predictions of one's own before the planner's thread has made its, as the guard does."""
        planner, own = self.planner, many(PREDICTION, 3)
        look_on(planner, self.predictions, self.states, self.now)
        for k in range(3):
            predict(self.states[k], self.now, own[k])
        self.left_out += is_known_to_pass(planner, self.now, planner.next_epoch, self.parameters)
        evaluate_moving_on(planner, own, self.now, planner.next_epoch, self.parameters)
        self.check_moving_on(own)


@pytest.mark.parametrize("schedule", ["original", "guarded"])
@pytest.mark.parametrize("block", range(0, 30, 5))
def test_over_random_scenes_what_is_remembered_never_changes_an_evaluation(block: int, schedule: str) -> None:
    runs = [Run(seed, schedule) for seed in range(block, block + 5)]
    for run, _ in itertools.product(runs, range(120)):
        run.step()
        if run.rng.random() < 0.3:
            run.look_as_guard()
        sensing_cycle(run.planner, run.states, run.now, run.now, run.predictions, run.parameters)
        run.check_population()
        run.check_moving_on(run.predictions)
        run.drift(0.02)  # changes between two messages, too
        run.evaluate_population()
        run.check_population()
    assert sum(run.spared for run in runs) > 100
    assert sum(run.partly for run in runs) > 100
    assert sum(run.again for run in runs) > 50
    assert sum(run.met for run in runs) > 100
    assert sum(run.left_out for run in runs) > 0
    assert sum(run.put_off for run in runs) > sum(run.never_asked for run in runs) > 100


@kernel
def _compare(planner: Record, predictions: Record, unknown: Record, fresh: Record, parameters: Record) -> int:
    """Return how many members that were not put off are evaluated otherwise without memory."""
    wrong = 0
    for i in range(planner.n):
        member = planner.members[i]
        if member.put_off == 0:
            copy_trajectory(fresh, member.trajectory, 0)
            evaluate(fresh, predictions, unknown, 0.0, 0.0, planner.latest.heading, planner.halted == 1, parameters)
            wrong += 1 if fresh.t_collision != member.trajectory.t_collision else 0
    return wrong


@pytest.mark.parametrize("schedule", ["original", "guarded"])
def test_while_obstacles_do_as_predicted_what_is_remembered_of_their_ends_never_misleads(
    ways: list[Way], schedule: str
) -> None:
    rng, partly, sooner = np.random.default_rng(5), 0, 0
    smooth = [way.trajectory for way in ways if way.trajectory.smooth and way.trajectory.n > 30]
    for _ in range(400):
        run = Run(int(rng.integers(4, 10_000)) * 5 + 4, schedule)  # one whose obstacles turn, and do not stray
        planner, run.renewed = run.planner, 0.0
        planner.n = len(planner.members)
        for member in planner.members:
            copy_trajectory(member.trajectory, smooth[int(rng.integers(len(smooth)))], 0)
            member.trajectory.begins = int(rng.integers(10**8, 3 * 10**9))
        members = planner.members["trajectory"]
        for _ in range(40):
            run.step()
            before = members["t_collision"].copy()
            sensing_cycle(planner, run.states, run.now, run.now, run.predictions, run.parameters)
            assert _compare(planner, run.predictions, UNKNOWN, one(TRAJECTORY), run.parameters) == 0
            sooner += int(np.count_nonzero(members["t_collision"] < before))
            partly += int(np.count_nonzero(members["sure_until"] < members["valid_until"]))
    assert min(sooner, partly) > 1000

"""What the host costs a planner: cases a second on one core, for planners that cost nothing and for those that ship.

python bench/bench_planners.py

The first three do nothing but answer, so what they take is the host's: world, messages, judging. Processor time, best
of three. What is hoped for is 500 cases a second; the ratio says how far each is from that.

Answers to random scenes, which are all new to the planner, are timed one by one (docs/shipped-planners.md).

A step of the world moves a robot by ORCA among three obstacles: ours in a whole case, with what judges it, and
IR-SIM's (if it is installed) by its reciprocal velocity obstacles, without pictures.

The last two lines are for machines. A step of ORCA is the answer to an observation of three obstacles: ours by
`observe`, navground's (if it is installed) by `compute_cmd` of a behaviour that knows its neighbours already, the two
in turn. Batched cases are those of a planner for batches that answers (0, 0), and of a network with two layers.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest
from parcours_navigation.adapters.navground import ORCA
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.checking.scenes import Row, observation, script, standard_task
from parcours_navigation.planners.dwa import Dwa
from parcours_navigation.planners.mppi import Mppi
from parcours_navigation.planners.orca import Orca
from parcours_navigation.protocol import Answer, Observation, Observations, Task, Trajectory
from parcours_navigation.study.study import NavigationStudy

CASES, TRIES = 256, 3
HOPED = 500.0
PATH = Trajectory(np.array([[0.0, 0.0, 0.0, 0.78539816], [21.0, 0.6, 0.6, 0.78539816]]))

WORLD = """
world: {height: 4, width: 4, step_time: 0.05}
robot:
  - kinematics: {name: diff}
    shape: {name: circle, radius: 0.1}
    state: [0.5, 0.5, 0.78]
    goal: [3.5, 3.5, 0.78]
    vel_max: [0.33, 1.5]
    behavior: {name: rvo}
obstacle:
  - number: 3
    distribution: {name: manual}
    kinematics: {name: diff}
    shape: {name: circle, radius: 0.1}
    state: [[1.5, 2.5, 0.0], [2.5, 1.5, 3.0], [3.0, 3.0, -1.57]]
    goal: [[3.5, 2.5], [0.5, 1.5], [3.0, 0.5]]
    vel_max: [0.25, 1.5]
    behavior: {name: dash}
"""  # for IR-SIM: none arrives in the steps that are timed


def stand(observation: Observation) -> Answer:
    """Stand, as a plain function."""
    return 0.0, 0.0


def silent(observation: Observation) -> Answer:
    """Say nothing: the first command stays."""
    return None


def path(observation: Observation) -> Answer:
    """Follow one and the same trajectory, which never reaches the goal."""
    return PATH


class Stands:
    """Stands, in all cases of a batch."""

    def observe_batch(self, seen: Observations) -> NDArray[np.float64]:
        """Return (0, 0) for each."""
        return np.zeros((len(seen.robots), 2))


class Network:
    """Two layers with random weights."""

    def __init__(self) -> None:
        draw = np.random.default_rng(7).normal
        self.first, self.bias, self.second = draw(size=(25, 64)) * 0.3, draw(size=64) * 0.1, draw(size=(64, 2)) * 0.3

    def reset_batch(self, tasks: tuple[Task, ...]) -> None:
        """Note the goals."""
        self.goals = np.array([task.goal for task in tasks])

    def observe_batch(self, seen: Observations) -> NDArray[np.float64]:
        """Return what the layers make of robots, obstacles and goals."""
        n = len(seen.robots)
        inputs = np.hstack([seen.robots, seen.obstacles.reshape(n, -1), self.goals[seen.cases]])
        answer: NDArray[np.float64] = np.tanh(np.maximum(inputs @ self.first + self.bias, 0.0) @ self.second)
        return answer * [0.25, 1.5]


def batched(planner: type, cases: SystemCases, n: int = 1024) -> float:
    """Return how many cases a second one core runs of a planner for batches."""
    study = NavigationStudy(planner, cases)
    study(0, n)
    took = float("inf")
    for _ in range(TRIES):
        begin = time.process_time()
        study(0, n)
        took = min(took, time.process_time() - begin)
    return n / took


def observed(planner: type[Orca] | type[Dwa] | type[Mppi], n_obstacles: int, n_scenes: int = 200) -> float:
    """Return how long an answer takes to one of random scenes, with nothing within 0.4 m of the robot: median [us]."""
    draw, task = np.random.default_rng(3).uniform, standard_task()
    took: list[float] = []
    plugin = planner()
    plugin.reset(task)
    for k in range(n_scenes):
        rows: list[Row] = []
        while len(rows) < n_obstacles:
            x, y, heading, v, w = draw((-0.5, -0.5, -3.0, 0.0, -0.5), (2.5, 2.5, 3.0, 0.3, 0.5)).tolist()
            if np.hypot(x, y) > 0.4:
                rows.append((x, y, heading, v, w, 0.1))
        seen = observation(task, (0.0, 0.0, 0.78, 0.1, 0.0), rows, 0.05 * k)
        for _ in range(TRIES):
            begin = time.perf_counter()
            plugin.observe(seen)
            took.append(time.perf_counter() - begin)
    return float(np.median(took[TRIES:])) * 1e6


def orca_steps() -> tuple[float, float]:
    """Return the processor time of a step of ORCA, ours and navground's [us]; NaN if that is not installed."""
    task = standard_task()
    ours, peer, way = Orca(), None, script(task)
    ours.reset(task)
    with contextlib.suppress(BadRequest):
        peer = ORCA()
        peer.reset(task)
    took = np.full((2, len(way), 10 * TRIES), np.nan)
    for k, seen in enumerate(way):
        asked: list[Callable[[], object]] = [lambda seen=seen: ours.observe(seen)]  # type: ignore[misc]
        if peer is not None:
            peer.observe(seen)
            made, relative = peer._behavior, peer._core.Frame.relative
            asked.append(lambda made=made, relative=relative: made.compute_cmd(0.05, relative))  # type: ignore[misc]
        for j in range(took.shape[2]):
            for i, ask in enumerate(asked):
                begin = time.process_time()
                for _ in range(200):
                    ask()
                took[i, k, j] = (time.process_time() - begin) / 200 * 1e6
    mine, others = took.min(axis=2).mean(axis=1).tolist()
    return mine, others


def world_step(n_steps: int = 100) -> float:
    """Return the processor time of a step of IR-SIM's world [us]; NaN if that is not installed."""
    try:
        with contextlib.redirect_stdout(None):  # it says which windows there are not
            import irsim
    except ImportError:
        return float("nan")
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as scene:
        scene.write(WORLD)
        scene.flush()
        world = irsim.make(scene.name, headless=True, disable_all_plot=True, log_level="ERROR")
    took = float("inf")
    for _ in range(TRIES):
        world.reset()
        begin = time.process_time()
        for _ in range(n_steps):
            world.step()
        took = min(took, time.process_time() - begin)
    world.end()
    return took / n_steps * 1e6


def main() -> None:
    """Print one line a planner: cases a second, microseconds an observation."""
    cases = SystemCases(1)
    begin = time.perf_counter()
    NavigationStudy(stand, cases)(0, 1)
    print(f"first case of this process: {time.perf_counter() - begin:.2f} s")
    begin = time.process_time()
    cases.obstacles(np.arange(CASES))
    drawing = time.process_time() - begin
    step: dict[str, float] = {}
    print(f"drawing the cases themselves: {drawing / CASES * 1e6:.0f} us a case")
    for name, planner, n in (("a function that stands", stand, CASES), ("None", silent, CASES),
                             ("a trajectory each time", path, CASES), ("stand-still", "stand-still", CASES),
                             ("straight-ahead", "straight-ahead", CASES), ("orca", "orca", CASES // 4),
                             ("dwa", "dwa", CASES // 8), ("mppi", "mppi", CASES // 32)):  # fmt: skip
        study = NavigationStudy(planner, cases)
        study(0, 2)
        took, asked = float("inf"), 0
        for _ in range(TRIES):
            begin = time.process_time()
            facts = study(0, n)
            took = min(took, time.process_time() - begin)
            asked = int(facts["n_planning_cycles"].sum())
        print(
            f"{name:24} {n / took:>7.0f} cases/s {took / asked * 1e6:>8.2f} us an observation,"
            f" {asked / n:>4.0f} a case; {n / took / HOPED:>5.2f} x {HOPED:.0f} cases/s",
            flush=True,
        )
        step[name] = took / asked * 1e6
    print(f"world us/step: {step['orca']:.2f}, IR-SIM {world_step():.0f}")
    for one in (Orca, Dwa, Mppi):
        few, many = observed(one, 3), observed(one, 50)
        print(f"{one.__name__.lower():5} {few:>5.1f} us an answer to a random scene of 3 obstacles, {many:.1f} of 50")
    ours, peer = orca_steps()
    print(f"orca us/step: {ours:.2f}, navground {peer:.2f}")
    print(f"batched cases/s: {batched(Stands, cases):.0f}, two layers {batched(Network, cases):.0f}")


if __name__ == "__main__":
    main()

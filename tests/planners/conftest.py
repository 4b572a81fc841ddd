"""Random ways through the arena with their trajectories, the same in every run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours.kernels import Record, kernel
from parcours_ramp.planner.messages import PATH, POSE, SAMPLE, TRAJECTORY, many, one
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.planner.route import ROUTE, TRANSITION
from parcours_ramp.planner.switching import switch_path
from parcours_ramp.planner.trajectory import pose_at, samples
from parcours_ramp.planner.trajectory_generator import generate


@dataclass(frozen=True, slots=True, repr=False)
class Way:
    """A path, the state it was begun in, what kind was asked for, the trajectory that came of it, and its samples."""

    path: Record
    start: Record
    kind: int
    trajectory: Record
    states: Record

    def samples(self, name: str) -> NDArray[np.float64]:
        """Return one field of the trajectory's samples, shape (n,)."""
        return np.asarray(self.states[name])


def random_way(rng: np.random.Generator) -> Way:
    """Return a way of 2 to 7 random knots in the arena, begun at rest, at top speed or in between, of any kind."""
    parameters = guarded().record()
    path, start, trajectory = one(PATH), one(POSE), one(TRAJECTORY)
    n, kind = int(rng.integers(2, 8)), int(rng.integers(0, 3))
    path.n = n
    path.x[:n], path.y[:n] = rng.uniform(0.0, 2.0, n), rng.uniform(0.0, 2.0, n)
    towards = math.atan2(path.y[1] - path.y[0], path.x[1] - path.x[0])
    start.heading = rng.choice([rng.uniform(-math.pi, math.pi), towards + rng.uniform(-0.3, 0.3), towards])
    start.v = rng.choice([0.0, 0.25, rng.uniform(0.02, 0.25)])
    before = rng.uniform(0.05, 0.5) if kind == TRANSITION else 0.0
    start.x = path.x[0] - before * math.cos(start.heading)
    start.y = path.y[0] - before * math.sin(start.heading)
    entered = one(PATH)
    switch_path(path, start, kind, entered)
    generate(entered, start, kind, parameters, one(ROUTE), trajectory)
    return Way(entered, start, kind, trajectory, samples(trajectory))


@pytest.fixture(scope="session")
def ways() -> list[Way]:
    """Return 600 random ways, always the same ones."""
    rng = np.random.default_rng(20160711)
    return [random_way(rng) for _ in range(600)]


@dataclass(frozen=True, slots=True)
class Sampled:
    """A trajectory's motion at equal times from its begin, and at its exact end; arrays of shape (n,)."""

    time: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]
    v: NDArray[np.float64]
    w: NDArray[np.float64]


class Sampler(Protocol):
    """Samples a TRAJECTORY every `period` seconds."""

    def __call__(self, trajectory: Record, period: float = SAMPLE) -> Sampled: ...


@kernel
def _fill(poses: Record, trajectory: Record, time: Record) -> None:
    """Set each of the poses to where the trajectory is at its time."""
    for i in range(len(time)):
        pose_at(trajectory, time[i], poses[i])


def sample(trajectory: Record, period: float = SAMPLE) -> Sampled:
    """Return the motion of the trajectory every `period` seconds: the one way by which tests look inside."""
    duration = float(trajectory.duration)
    time = np.append(np.arange(0.0, duration - 1e-9, period), duration)
    poses = many(POSE, len(time))
    _fill(poses, trajectory, time)
    return Sampled(time, *(np.array(poses[name]) for name in ("x", "y", "heading", "v", "w")))


@pytest.fixture(scope="session")
def sampled() -> Sampler:
    """Return `sample`."""
    return sample

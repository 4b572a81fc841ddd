"""Signals are taken from a track as their units and words say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from parcours_navigation.facts import TRACK
from parcours_navigation.measures import measures_of
from parcours_navigation.requirements.signals import take
from parcours_navigation.requirements.vocabulary import SIGNALS

Floats = NDArray[np.float64]
RADII, ROBOT, GOAL = np.array([0.1, 0.2]), 0.125, (2.0, 1.0)


def drive(n: int, seed: int, *, ground: bool = False) -> Floats:
    """Return entries of a track: time, x, y, heading, v, w, halted, perhaps the gap to the ground, two obstacles."""
    rng = np.random.default_rng(seed)
    entries = rng.normal(0.0, 1.0, (n, 7 + ground + 4))
    entries[:, 0] = np.arange(n) * 50_000_000
    entries[:, 6] = rng.random(n) < 0.3
    return entries


def taken(entries: Floats, last: Floats) -> dict[str, Floats]:
    memory = np.full((len(SIGNALS) + 1, len(entries) + 1), np.nan)
    n = take(entries, last, RADII, ROBOT, *GOAL, np.ones(len(SIGNALS), np.int64), memory)
    return dict(zip(SIGNALS, memory[:-1, :n], strict=True))


def twin(rows: Floats, ground: bool = False) -> dict[str, Floats]:
    time, x, y, heading, v, w, halted = rows[:, :7].T
    bodies = rows[:, 7 + ground :].reshape(len(rows), 2, 2)
    gaps = np.hypot(bodies[:, :, 0] - x[:, None], bodies[:, :, 1] - y[:, None]) - RADII - ROBOT
    least = gaps.min(axis=1)
    steps = np.diff(time) * 1e-9
    turn = np.arctan2(GOAL[1] - y, GOAL[0] - x) - heading
    return {
        "time": time * 1e-9, "x": x, "y": y, "heading": heading, "speed": np.abs(v), "forward_speed": v, "yaw_rate": w,
        "acceleration": np.concatenate([[0.0], np.diff(v) / steps]),
        "yaw_acceleration": np.concatenate([[0.0], np.diff(w) / steps]),
        "clearance": np.minimum(least, rows[:, 7]) if ground else least,
        "time_to_collision": np.array([np.inf, *(_driven_into(*two, ground) for two in pairwise(rows))]),
        "goal_distance": np.hypot(GOAL[0] - x, GOAL[1] - y), "heading_error": (turn + np.pi) % (2 * np.pi) - np.pi,
        "travelled": np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))]),
        "imminent": np.where(halted > 0.0, 1.0, -1.0),
    }  # fmt: skip


def _driven_into(was: Floats, now: Floats, ground: bool) -> float:
    """Look where a body first touches, in small steps; if none does, how fast the robot's half ahead gets nearer."""
    step, dt = now[1:3] - was[1:3], (now[0] - was[0]) * 1e-9
    if np.hypot(*step) < 0.01 * dt:
        return np.inf
    forward = step / np.hypot(*step)
    turned = np.array([forward, [-forward[1], forward[0]]])  # into the robot's frame: forward, left
    least = dt * now[7] / (was[7] - now[7]) if ground and now[7] < was[7] else np.inf
    for k, radius in enumerate(RADII):
        at, reach = 7 + ground + 2 * k, radius + ROBOT
        p0, p1 = (turned @ (row[at : at + 2] - row[1:3]) for row in (was, now))
        way = p0 + np.linspace(0.0, 1.0, 200_001)[:, np.newaxis] * (p1 - p0)
        inside = np.hypot(*way.T) <= reach
        if inside[0]:
            continue
        if inside.any():
            least = min(least, -dt * way[inside.argmax()][0] / np.hypot(*(p1 - p0)))
            continue
        angles, base = np.linspace(-np.pi / 2, np.pi / 2, 20_001), np.linspace(-reach, reach, 20_001)
        half = np.concatenate([reach * np.column_stack([np.cos(angles), np.sin(angles)]),
                               np.column_stack([np.zeros(20_001), base])])  # fmt: skip
        left = [np.hypot(*(half - place).T).min() for place in way[::40_000]]
        least = min([least, *(dt / 5 * b / (a - b) for a, b in pairwise(left) if b < a)])
    return float(least)


@pytest.mark.parametrize("ground", [False, True])
@pytest.mark.parametrize("n", [1, 2, 40])
def test_every_signal_is_what_its_twin_computes(n: int, ground: bool) -> None:
    rows = drive(n + 1, n, ground=ground)
    rows[-1, 0] -= 20_000_000  # the case ended 30 ms after its last entry
    found = taken(rows[:-1], rows[-1])
    for name, expected in twin(rows, ground).items():
        tolerance = 1e-3 if name == "time_to_collision" else 1e-12
        assert np.allclose(found[name], expected, rtol=1e-12, atol=tolerance), name


def test_the_state_at_the_end_is_a_sample_only_if_it_is_later_than_the_last_entry() -> None:
    rows = drive(5, 1)
    assert len(taken(rows, rows[-1])["time"]) == 5
    later = rows[-1].copy()
    later[0] += 10_000_000
    assert np.allclose(taken(rows, later)["time"], [0.0, 0.05, 0.1, 0.15, 0.2, 0.21])


def test_clearance_is_the_one_that_is_measured_bit_for_bit() -> None:
    rows = drive(60, 4)
    track = np.zeros(60, TRACK)
    for k, name in enumerate(TRACK.names or ()):
        track[name] = rows[:, k]
    measured = measures_of(track, rows[:, 7:].reshape(60, 2, 2), RADII, robot_radius=ROBOT, goal=GOAL)
    signals = taken(rows, rows[-1])
    assert np.float32(signals["clearance"].min()) == measured["least_clearance"]  # kept in single precision
    assert np.float32(signals["goal_distance"][-1]) == measured["goal_distance"]


def test_only_wanted_signals_are_taken() -> None:
    rows = drive(9, 2)
    for k in range(len(SIGNALS)):
        memory = np.full((len(SIGNALS) + 1, 10), np.nan)
        wanted = np.zeros(len(SIGNALS), np.int64)
        wanted[k] = 1
        take(rows, rows[-1], RADII, ROBOT, *GOAL, wanted, memory)
        assert (~np.isnan(memory[:-1, :9])).all(axis=1).tolist() == (wanted == 1).tolist()

"""Clearance, contact and way of whole RAMP runs against shapely, from nothing but the robot's track and the case."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from parcours_navigation.facts import NEVER
from parcours_ramp.system.study import SCHEDULES, system_study

Floats = NDArray[np.float64]

REACH = 0.225
SEED = 5
NUMBERS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 35)

BLUR = 2e-3
"""How exact clearance is [m]: 1.25 mm for the tick in which an obstacle sets out or stops, the rest for chords."""


@functools.cache
def replay(schedule: str, number: int) -> tuple[NDArray[np.void], NDArray[np.void], NDArray[np.void]]:
    """Return facts (1,), track (n,) and obstacles (3,) of one case."""
    study = dataclasses.replace(system_study(schedule, seed=SEED), watched_on=0.0)
    facts, track, *_ = study.track(number)
    return facts, track, np.asarray(study.cases.obstacles(np.array([number]))[0])


def obstacle_at(row: np.void, time: Floats) -> Floats:
    """Return where the obstacle is at these times [s], shape (n, 2)."""
    start, stop = row["start"] * 1e-9, row["stop"] * 1e-9
    moved = np.clip(time, start, stop) - start
    half = 0.5 * row["turn"] * moved
    chord = row["speed"] * moved * np.sinc(half / np.pi)
    towards = row["heading0"] + half
    return np.stack([row["x0"] + chord * np.cos(towards), row["y0"] + chord * np.sin(towards)], axis=1)


def distances(track: NDArray[np.void], row: np.void) -> tuple[Floats, Floats]:
    """Return (when each step begins [s], least gap in it [m]), a step being 2.5 ms of the robot's chord and the arc."""
    known = track["time"] * 1e-9
    time = np.arange(known[0], known[-1] + 1e-9, 0.0025)
    place = np.stack([np.interp(time, known, track[name]) for name in ("x", "y")], axis=1)
    gap = place - obstacle_at(row, time)
    steps = shapely.linestrings(np.stack([gap[:-1], gap[1:]], axis=1))
    return time[:-1], shapely.distance(steps, shapely.Point(0.0, 0.0)) - REACH


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_least_clearance_and_contact_of_a_run_are_those_that_shapely_finds(schedule: str, number: int) -> None:
    [facts], track, obstacles = replay(schedule, number)
    gaps = [distances(track, row) for row in obstacles]
    least = min(float(gap.min()) for _, gap in gaps)
    assert facts["min_clearance"] == pytest.approx(least, abs=BLUR)
    if abs(least) > BLUR:
        assert (facts["t_contact"] != NEVER) == (least < 0.0)
    firsts = [float(time[gap < -BLUR][0]) for time, gap in gaps if (gap < -BLUR).any()]
    if firsts:
        assert facts["t_contact"] * 1e-9 <= min(firsts) + 0.0025
    way = shapely.LineString(np.stack([track["x"], track["y"]], axis=1)).length
    assert facts["travelled"] == pytest.approx(way, abs=0.05 * 0.25 + 0.01 * way)


def test_among_these_runs_are_contacts_and_near_misses() -> None:
    least = [float(replay(schedule, number)[0]["min_clearance"][0]) for schedule in SCHEDULES for number in NUMBERS]
    assert min(least) < 0.0 < max(least)
    assert any(0.0 < clearance < 0.1 for clearance in least)

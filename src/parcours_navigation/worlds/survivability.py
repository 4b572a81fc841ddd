"""How long does a robot survive that only stands somewhere in a world? As `arena.survivability`, but for any world.

The others move once, around a robot that stays at its start: whether somebody would have given way to a robot at each
other place is not asked. Between two entries of their tracks, 50 ms apart, they count as going straight on.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from parcours.kernels import kernel
from parcours_navigation.arena.contact import least_distance
from parcours_navigation.facts import TRACK_PERIOD
from parcours_navigation.ground.clearance import clearance
from parcours_navigation.stage.memory import EVERYWHERE, ROW, TIME, lay, recorded, size_of
from parcours_navigation.stage.ticking import NO_POINTS, begin_any, move_any
from parcours_navigation.worlds.family import WorldCases

Floats = NDArray[np.float64]

SIDE = 16
"""Places along one side of the area, as in the paper's arena."""

LONGEST = 120.0
"""A case is watched for so long at most [s]."""


def survived_worlds(cases: WorldCases, numbers: NDArray[np.int64]) -> Floats:
    """Return the survivability of cases, in [0, 1], 1 the easiest; NaN where there is no free place, shape (n,).

    It is the mean over SIDE x SIDE places of the time until somebody moves into a robot that stands there, as a share
    of the time limit; without places that the ground or somebody covers from the first.
    """
    found = np.ones(len(numbers))
    for k, number in enumerate(numbers.tolist()):
        [staged] = cases.staged([number], 0.05)
        if len(staged.scene.obstacles):
            scene = dataclasses.replace(staged.scene, ends_on_contact=False, longest_rest=0, within=EVERYWHERE)
            limit = min(staged.end, LONGEST)
            end = round(limit * 1e9)
            most = end // TRACK_PERIOD + 2
            memory = np.zeros(size_of(scene, most))
            lay(memory, number, 0.0, scene, most)
            begin_any(memory)
            while memory[TIME] < end:  # it goes on where a goal was reached at the start
                move_any(memory, end, 0.0, 0.0, 0.0, NO_POINTS, False)
            rows, n = recorded(memory)
            places = rows[:, ROW:].reshape(len(rows), n, 2)
            land = cases.land(number)
            area = land.area or (*places.min(axis=(0, 1)), *places.max(axis=(0, 1)))
            reaches = np.ascontiguousarray(scene.obstacles["radius"]) + float(scene.robot["radius"][0])
            found[k] = _survived(rows[:, 0] * 1e-9, np.ascontiguousarray(places), reaches, np.array(area, float),
                                 land.packed, float(scene.robot["radius"][0]), limit)  # fmt: skip
    return found


@kernel
def _survived(
    times: Floats, places: Floats, reaches: Floats, area: Floats, packed: Floats, radius: float, limit: float
) -> float:
    """Return the mean share of the limit that a standing robot survives in the area; NaN without any free place."""
    total, counted = 0.0, 0
    for row in range(SIDE):
        for column in range(SIDE):
            x = area[0] + (column + 0.5) / SIDE * (area[2] - area[0])
            y = area[1] + (row + 0.5) / SIDE * (area[3] - area[1])
            if clearance(packed, x, y) <= radius:
                continue
            first = _first_hit(times, places, reaches, x, y)
            if first > 0.0:
                counted += 1
                total += min(first, limit) / limit
    return total / counted if counted else np.nan


@kernel
def _first_hit(times: Floats, places: Floats, reaches: Floats, x: float, y: float) -> float:
    """Return the end of the first stretch of time in which anybody comes within reach [s]; 0 from the first; or inf."""
    for i in range(len(reaches)):
        if (places[0, i, 0] - x) ** 2 + (places[0, i, 1] - y) ** 2 <= reaches[i] * reaches[i]:
            return 0.0
    for k in range(1, len(times)):
        for i in range(len(reaches)):
            x0, y0, x1, y1 = places[k - 1, i, 0], places[k - 1, i, 1], places[k, i, 0], places[k, i, 1]
            if least_distance(x0 - x, y0 - y, x1 - x, y1 - y) <= reaches[i]:
                return float(times[k])
    return np.inf

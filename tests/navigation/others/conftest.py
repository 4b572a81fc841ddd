"""A stroll: others drawn for one case and moved for a while, with all their places kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.others.drawing import Crowd, drawn
from parcours_navigation.others.entries import Others
from parcours_navigation.protocol import Floats

TICK = 10_000_000
NO_WALLS = np.empty((0, 4))
FAR_AWAY = (1e4, 1e4, 0.0, 0.0, 0.3)


@dataclass
class Stroll:
    """Places of all agents at every tick, shape (n_ticks + 1, n, 2), and their speeds and headings."""

    crowd: Crowd
    places: Floats
    speeds: Floats
    headings: Floats

    @property
    def gaps(self) -> Floats:
        """Least distance between two borders at every tick [m]."""
        radii = self.crowd.obstacles["radius"]
        apart = np.linalg.norm(self.places[:, :, None] - self.places[:, None], axis=-1)
        apart -= radii[:, None] + radii[None]
        n = len(radii)
        apart[:, range(n), range(n)] = np.inf
        least: Floats = apart.min(axis=(1, 2))
        return least


Stroller = Callable[..., Stroll]


def stroll(
    others: Others | Sequence[Others],
    seconds: float,
    *,
    walls: Floats = NO_WALLS,
    seed: int = 1,
    case: int = 0,
    robot: Callable[[float], tuple[float, float, float, float, float]] = lambda time: FAR_AWAY,
    crowd: Crowd | None = None,
) -> Stroll:
    """Return what the others do; `robot` says for a time [s] its x, y, vx, vy, radius."""
    entries = [others] if isinstance(others, Others) else others
    crowd = crowd or drawn(entries, seed, case)
    agents, ways, obstacles = crowd.agents, crowd.ways, crowd.obstacles
    begin_agents(agents, ways, obstacles, walls)
    n = round(seconds * 100)
    places, speeds, headings = np.empty((n + 1, len(agents), 2)), np.empty((n + 1, len(agents))), []
    for k in range(n + 1):
        if k > 0:
            step_agents(agents, ways, obstacles, walls, *robot((k - 1) * 0.01), k * TICK, 0.01)
        places[k, :, 0], places[k, :, 1] = obstacles["x"], obstacles["y"]
        speeds[k] = obstacles["v"]
        headings.append(obstacles["heading"].copy())
    return Stroll(crowd, places, speeds, np.array(headings))


@pytest.fixture(name="stroll", scope="session")
def _stroll() -> Stroller:
    return stroll

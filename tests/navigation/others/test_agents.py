"""All agents under one clock: when they decide, what they write, and how walls stop them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours_navigation.others.agent import DECISION, FOREVER
from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.others.drawing import Crowd, drawn
from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import (
    ConstantVelocity,
    Motion,
    OrcaPeople,
    RandomWalk,
    Recorded,
    SocialForcePeople,
    Waypoints,
)
from parcours_navigation.others.tracks import Tracks
from parcours_navigation.others.walls import nearest

if TYPE_CHECKING:
    from tests.navigation.others.conftest import Stroller

    from parcours_navigation.protocol import Floats

TICK = 10_000_000
NONE = np.empty((0, 4))
AREA = (0.0, 0.0, 6.0, 6.0)
TRACK = Tracks(("a",), (np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 2.0], [3.0, 5.0, 2.0]]),))
MOTIONS: list[Motion] = [
    ConstantVelocity(), Waypoints(((0.0, 0.0), (1.0, 2.0), (-1.0, 3.0))), RandomWalk(between=(0.2, 0.5)),
    Recorded(TRACK), SocialForcePeople(), OrcaPeople(),
]  # fmt: skip


def tick(crowd: Crowd, k: int, walls: Floats = NONE) -> None:
    step_agents(crowd.agents, crowd.ways, crowd.obstacles, walls, 1e4, 1e4, 0.0, 0.0, 0.3, k * TICK, 0.01)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: type(motion).__name__)
def test_what_an_agent_writes_is_how_it_moved(motion: Motion) -> None:
    number = 1 if isinstance(motion, Recorded) else 3
    crowd = drawn([Others(motion, number=number, area=AREA)], 1, 0)
    begin_agents(crowd.agents, crowd.ways, crowd.obstacles, NONE)
    compared = 0
    for k in range(1, 400):
        before = crowd.obstacles.copy()
        tick(crowd, k)
        for old, now in zip(before, crowd.obstacles, strict=True):
            assert now.now == k * TICK
            way = math.hypot(now.x - old.x, now.y - old.y)
            assert way <= now.speed * 0.01 + 1e-12
            steady = abs(math.remainder(now.heading - old.heading, math.tau)) < 1e-9 and abs(now.v - old.v) < 1e-9
            if not steady and not isinstance(motion, (SocialForcePeople, OrcaPeople)):
                continue  # it turned a corner within the tick
            assert way == pytest.approx(now.v * 0.01, abs=1e-6)
            if way > 1e-6:
                towards = math.atan2(now.y - old.y, now.x - old.x)
                assert math.remainder(towards - now.heading, math.tau) == pytest.approx(0.0, abs=1e-3)
                compared += 1
    assert compared > 100


def test_a_begun_obstacle_is_at_its_start_and_will_not_stop_by_itself() -> None:
    crowd = drawn([Others(OrcaPeople(), number=2, area=AREA)], 1, 0)
    begin_agents(crowd.agents, crowd.ways, crowd.obstacles, NONE)
    one, agent = crowd.obstacles[0], crowd.agents[0]
    assert (one.x, one.y, one.now, one.stop, one.apart) == (one.x0, one.y0, 0, FOREVER, -1)
    assert one.speed == agent.top


@pytest.mark.parametrize("motion", [SocialForcePeople(), OrcaPeople()])
def test_people_decide_every_fifth_tick(motion: Motion) -> None:
    crowd = drawn([Others(motion, number=12, area=AREA, radius=0.2)], 1, 0)
    begin_agents(crowd.agents, crowd.ways, crowd.obstacles, NONE)
    names = ["ax", "ay"] if isinstance(motion, SocialForcePeople) else ["vx", "vy"]
    decided = []
    for k in range(1, 101):
        before = [crowd.agents[name].tolist() for name in names]
        tick(crowd, k)
        if [crowd.agents[name].tolist() for name in names] != before:
            decided.append((k - 1) * TICK)
    assert decided == list(range(0, 100 * TICK, DECISION))


@pytest.mark.parametrize("motion", [SocialForcePeople, OrcaPeople])
def test_a_person_slides_along_a_wall(stroll: Stroller, motion: type[SocialForcePeople | OrcaPeople]) -> None:
    wall = np.array([[-5.0, 1.0, 20.0, 1.0]])
    person = Others(motion(goals=((12.0, 4.0),), loop=False), places=((0.0, 0.0),))
    walked = stroll(person, 8.0, walls=wall)
    x, y = walked.places[:, 0].T
    assert y.max() <= 0.7 + 1e-9
    assert y[-1] > 0.5
    assert x[-1] > 6.0
    assert walked.headings[-1, 0] == pytest.approx(0.0, abs=0.05)


def test_who_feels_no_wall_until_it_is_touched_slides_along_it_all_the_same(stroll: Stroller) -> None:
    wall = np.array([[-5.0, 1.0, 40.0, 1.0]])
    person = Others(SocialForcePeople(goals=((30.0, 30.0),), wall_strength=0.0), places=((0.0, 0.0),), speed=1.0)
    walked = stroll(person, 6.0, walls=wall)
    touching = walked.places[:, 0, 1] > 0.7 - 1e-6
    assert touching[-300:].all()
    assert np.abs(walked.headings[-300:, 0]).max() < 0.05
    assert walked.speeds[-300:, 0].max() < 0.9


@pytest.mark.parametrize("angle", np.linspace(0.2, 3.0, 8))
@pytest.mark.parametrize("motion", [SocialForcePeople, OrcaPeople])
def test_in_a_corner_neither_wall_is_entered(
    stroll: Stroller, angle: float, motion: type[SocialForcePeople | OrcaPeople]
) -> None:
    corner = np.array([[0.0, 0.0, 8.0, 0.0], [0.0, 0.0, 8.0 * math.cos(angle), 8.0 * math.sin(angle)]])
    start = (4.0 * math.cos(angle / 2), 4.0 * math.sin(angle / 2))
    person = Others(motion(goals=((-4.0, -1.0),)), places=(start,), radius=0.3, speed=1.5)
    walked = stroll(person, 6.0, walls=corner)
    least = min(nearest(corner, x, y)[0] for x, y in walked.places[:, 0])
    assert least >= 0.3 - 1e-12 or math.dist(start, (0.0, 0.0)) * math.sin(angle / 2) < 0.3


def test_obstacles_without_an_agent_are_avoided_and_stay(stroll: Stroller) -> None:
    crowd = drawn([Others(OrcaPeople(goals=((8.0, 0.0),), loop=False), places=((0.0, 0.0),))], 1, 0)
    obstacles = np.concatenate([np.zeros(1, crowd.obstacles.dtype), crowd.obstacles]).view(np.recarray)
    obstacles[0].x, obstacles[0].y, obstacles[0].radius = 4.0, 0.1, 0.5
    crowd.agents["obstacle"] += 1
    begin_agents(crowd.agents, crowd.ways, obstacles, NONE)
    for k in range(1, 900):
        step_agents(crowd.agents, crowd.ways, obstacles, NONE, 1e4, 1e4, 0.0, 0.0, 0.3, k * TICK, 0.01)
        assert math.dist((obstacles[1].x, obstacles[1].y), (4.0, 0.1)) > 0.8
    assert obstacles[1].x > 7.0
    assert (obstacles[0].x, obstacles[0].now) == (4.0, 0)

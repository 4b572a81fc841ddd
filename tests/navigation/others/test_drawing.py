"""Drawing others: clear of each other and of all else, by seed and case; and what is refused."""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours_navigation.others.drawing import GAP, drawn
from parcours_navigation.others.entries import Others, read_others
from parcours_navigation.others.kinds import ConstantVelocity, OrcaPeople, RandomWalk, SocialForcePeople, Waypoints

AREA = (0.0, 0.0, 8.0, 6.0)


def is_free(x: float, y: float, radius: float) -> bool:
    """Return whether a disc is clear of a wall at x = 4 m."""
    return abs(x - 4.0) > radius


@settings(max_examples=40)
@given(st.integers(0, 2**63), st.integers(0, 10**6), st.integers(1, 5), st.integers(1, 20), st.floats(0.05, 0.3))
def test_all_begin_clear_of_each_other_of_walls_and_of_the_robot(
    seed: int, case: int, group: int, number: int, radius: float
) -> None:
    others = [
        Others(SocialForcePeople(), number=number, area=AREA, radius=radius, group=group),
        Others(RandomWalk(), number=5, area=AREA, radius=0.2),
        Others(Waypoints(((1.0, 1.0), (2.0, 2.0)))),
        Others(OrcaPeople(), number=3, area=AREA, radius=0.2),
    ]
    crowd = drawn(others, seed, case, is_free=is_free, taken=[(2.0, 3.0, 0.5)])
    bodies = [(float(o.x0), float(o.y0), float(o.radius)) for o in crowd.obstacles]
    drawn_places = [body for k, body in enumerate(bodies) if k != number + 5]
    for k, (x, y, r) in enumerate(drawn_places):
        assert 0.0 <= x <= 8.0
        assert 0.0 <= y <= 6.0
        assert is_free(x, y, r)
        assert math.dist((x, y), (2.0, 3.0)) >= r + 0.5 + GAP
        for ox, oy, other in drawn_places[:k]:
            assert math.dist((x, y), (ox, oy)) >= r + other + GAP - 1e-12
    goals = crowd.ways[[int(a["first"]) + k for a in crowd.agents[:number] for k in range(int(a["count"]))]]
    assert all(is_free(x, y, radius) for _, x, y in goals)


def is_way_free(x0: float, y0: float, x1: float, y1: float, radius: float) -> bool:
    """Return whether both ends are on one side of the wall."""
    return (x0 < 4.0) == (x1 < 4.0)


@pytest.mark.parametrize("loop", [True, False])
def test_drawn_goals_may_be_held_to_free_ways(loop: bool) -> None:
    people = Others(OrcaPeople(drawn_goals=4, loop=loop), number=20, area=AREA, radius=0.2)
    crowd = drawn([people], 3, 0, is_free=is_free, is_way_free=is_way_free)
    for agent, body in zip(crowd.agents, crowd.obstacles, strict=True):
        goals = crowd.ways[agent["first"] : agent["first"] + agent["count"], 1:].tolist()
        assert len({tuple(goal) for goal in goals}) == 4
        assert len(goals) == (6 if loop else 4)
        stops = [[float(body.x0), float(body.y0)], *goals, *(goals[:1] if loop else [])]
        assert all(is_way_free(a[0], a[1], b[0], b[1], 0.2) for a, b in itertools.pairwise(stops))


def test_a_case_is_its_seed_and_number() -> None:
    others = [Others(SocialForcePeople(), number=10, area=AREA, group=3, speed_spread=0.2)]
    first, again, other = drawn(others, 7, 3), drawn(others, 7, 3), drawn(others, 7, 4)
    assert first.agents.tobytes() == again.agents.tobytes()
    assert first.obstacles.tobytes() == again.obstacles.tobytes()
    assert first.obstacles.tobytes() != other.obstacles.tobytes()


def test_of_those_drawn_only_some_are_there_and_they_are_as_they_were() -> None:
    entry = Others(SocialForcePeople(), number=6, area=(0.0, 0.0, 8.0, 8.0), group=2, speed_spread=0.1)
    every, some = drawn([entry], 1, 5), drawn([dataclasses.replace(entry, only=(1, 4))], 1, 5)
    names = [name for name in every.agents.dtype.names or () if name not in ("obstacle", "group")]
    assert all(some.agents[name].tobytes() == every.agents[[1, 4]][name].tobytes() for name in names)
    assert some.obstacles.tobytes() == every.obstacles[[1, 4]].tobytes()
    with pytest.raises(BadRequest, match=r"numbers of them, 0 to 5, but is \(6,\)"):
        dataclasses.replace(entry, only=(6,))


def test_another_entry_changes_nothing_of_an_earlier_one() -> None:
    people = Others(SocialForcePeople(), number=10, area=AREA)
    alone, beside = drawn([people], 1, 0), drawn([people, Others(OrcaPeople(), number=5, area=AREA)], 1, 0)
    assert alone.agents.tobytes() == beside.agents[:10].tobytes()


def test_groups_have_one_number_the_same_goals_and_begin_near_each_other() -> None:
    crowd = drawn([Others(SocialForcePeople(), number=11, area=(0.0, 0.0, 30.0, 30.0), group=4)], 2, 0)
    assert crowd.agents["group"].tolist() == [0] * 4 + [1] * 4 + [2] * 3
    places = np.column_stack([crowd.obstacles["x0"], crowd.obstacles["y0"]])
    for first, last in ((0, 4), (4, 8), (8, 11)):
        assert np.linalg.norm(places[first:last] - places[first], axis=1).max() < 3.0
        ways = [crowd.ways[a["first"] : a["first"] + a["count"]].tolist() for a in crowd.agents[first:last]]
        assert all(way == ways[0] for way in ways)
    assert drawn([Others(OrcaPeople(), number=3, area=AREA)], 2, 0).agents["group"].tolist() == [-1, -1, -1]


def test_speeds_have_the_spread_that_was_asked_for() -> None:
    others = Others(OrcaPeople(), number=200, area=(0.0, 0.0, 60.0, 60.0), speed=1.29, speed_spread=0.19)
    speeds = drawn([others], 1, 0).agents["speed"]
    assert speeds.mean() == pytest.approx(1.29, abs=0.05)
    assert speeds.std() == pytest.approx(0.19, abs=0.03)
    assert drawn([others], 1, 0).agents["top"] == pytest.approx(1.3 * speeds)


def test_those_who_do_not_fit_are_refused_with_how_many_did() -> None:
    crowd = Others(OrcaPeople(), number=30, area=(0.0, 0.0, 2.0, 2.0))
    message = (
        r"others of case 5: 30 discs with a radius of 0.3 m must find room, but \d+ did in the area .*; give fewer"
    )
    with pytest.raises(BadRequest, match=rf"{message}.*\[others-do-not-fit\]"):
        drawn([crowd], 1, 5)
    nowhere = Others(OrcaPeople(), places=((0.0, 0.0),), area=AREA)
    with pytest.raises(BadRequest, match=r"a goal must have room .*\[others-do-not-fit\]"):
        drawn([nowhere], 1, 0, is_free=lambda x, y, radius: False)


def test_an_entry_of_a_world_file_is_read(tmp_path: Path) -> None:
    entry = {"number": 20, "motion": "social-force", "speed": 1.3, "radius": 0.3, "group": 4, "area": [0, 0, 8, 6]}
    others = read_others(entry)
    assert others == Others(SocialForcePeople(), number=20, speed=1.3, radius=0.3, group=4, area=(0, 0, 8, 6))
    others = read_others({"motion": "waypoints", "points": [[0, 0], [1, 2.5]], "loop": False})
    assert others.motion == Waypoints(((0, 0), (1, 2.5)), loop=False)
    (tmp_path / "walk.csv").write_text("agent,t,x,y\na,0,0,0\nb,0,1,1\n", encoding="utf-8")
    assert read_others({"motion": "recorded", "tracks": "walk.csv"}, folder=tmp_path).number == 2


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({}, r"others 2, motion: must be a known name, but '' was given.*\[others-key\]"),
        ({"motion": "orca", "horizont": 2}, r"others 2, key: .*did you mean 'horizon'.*\[others-key\]"),
        ({"motion": "orca", "number": 0}, r"others 2, number: it must lie in 1 to 200, but is 0"),
        ({"motion": "orca", "number": 2.5}, r"others 2, number: it must be a whole number, but is 2.5"),
        (
            {"motion": "orca", "number": "many"},
            r"others 2, number: it must be a number from 1 to 200, but is 'many'; give one, or an input that",
        ),
        ({"motion": "orca", "radius": -0.3}, r"others 2, radius: it must lie in 0.001 to 100 m, but is -0.3"),
        ({"motion": "orca", "yields": 1.5}, r"others 2, yields: it must lie in 0 to 1, but is 1.5"),
        ({"motion": "orca", "speed": math.nan}, r"others 2, speed: it must lie in 0 to 100 m/s, but is nan"),
        ({"motion": "orca", "speed": 90}, r"others 2, speed: in a tick of 0.01 s nobody may move more than half"),
        ({"motion": "orca", "area": [1, 0, 0, 1]}, r"others 2, area: its lower corner must be below and left"),
        ({"motion": "orca", "area": [1, 0]}, r"others 2, area: it must be x_low, y_low, x_high, y_high"),
        ({"motion": "orca", "area": 3}, r"others 2, area: it must be x_low, y_low, x_high, y_high, but is 3"),
        (
            {"motion": "orca", "area": None},
            r"others 2: they must begin somewhere, but have neither an area nor places, and the ground has no bounds",
        ),
        ({"motion": "orca", "area": None, "places": [[0, 0]]}, r"others 2: they must have goals"),
        ({"motion": "orca", "goals": [[0, 0, 0]]}, r"others 2, goals, point 1: a point must be two numbers"),
        ({"motion": "orca", "places": [[0, 0]], "number": 2}, r"others 2, places: there must be a place for each"),
        ({"motion": "orca", "start": [2, 1]}, r"others 2, start: the first must not be above the second"),
        ({"motion": "social-force", "relax": 0.0}, r"others 2, relax: it must lie in 0.1 to 10 s, but is 0"),
        ({"motion": "social-force", "nearest": 99}, r"others 2, nearest: it must lie in 0 to 32, but is 99"),
        (
            {"motion": "waypoints"},
            r"others 2: others that move by waypoints must have the key 'points', but these do not; add it",
        ),
        ({"motion": "waypoints", "points": []}, r"others 2, points: there must be a waypoint"),
        ({"motion": "constant-velocity", "at_walls": "jump"}, r"others 2, at_walls: must be a known name"),
        ({"motion": "random-walk", "between": [0, 0]}, r"others 2, between: changes must be at least 0.01 s apart"),
        ({"motion": "recorded", "tracks": "no.csv"}, r"no.csv: a file of tracks must be readable"),
    ],
)
def test_a_bad_entry_is_refused_by_its_key(entry: dict[str, Any], message: str) -> None:
    with pytest.raises(BadRequest, match=message):
        read_others({"area": [0, 0, 8, 6], **entry}, "others 2")


def test_motions_that_need_no_goal_take_their_bounds_from_the_area() -> None:
    agents = drawn([Others(RandomWalk(), area=AREA), Others(ConstantVelocity(), area=AREA)], 1, 0).agents
    assert (agents[0].x_low, agents[0].y_high) == (0.3, 5.7)
    assert agents[1].x_low == -math.inf

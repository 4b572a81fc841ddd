"""People: they give way, keep off walls, keep together, and are the same people however they are counted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from parcours_navigation.others.agents import begin_agents, step_agents
from parcours_navigation.others.drawing import drawn
from parcours_navigation.others.entries import Others
from parcours_navigation.others.kinds import ConstantVelocity, OrcaPeople, RandomWalk, SocialForcePeople
from parcours_navigation.others.walls import nearest

if TYPE_CHECKING:
    from tests.navigation.others.conftest import Stroller

ROOM = np.array([[0.0, 0.0, 9.0, 0.0], [9.0, 0.0, 9.0, 9.0], [9.0, 9.0, 0.0, 9.0], [0.0, 9.0, 0.0, 0.0]])
INSIDE = (0.5, 0.5, 8.5, 8.5)
PEOPLE = [SocialForcePeople, OrcaPeople]


def meeting(motion: type[SocialForcePeople | OrcaPeople], offset: float, **options: float) -> list[Others]:
    """Return two people who walk towards each other, 10 m apart, and `offset` beside each other."""
    return [
        Others(motion(goals=((10.0, 0.0),), loop=False, **options), places=((0.0, 0.0),)),  # type: ignore[arg-type]
        Others(motion(goals=((0.0, offset),), loop=False, **options), places=((10.0, offset),)),  # type: ignore[arg-type]
    ]


@pytest.mark.parametrize("motion", PEOPLE)
def test_two_people_who_meet_head_on_both_pass_on_the_right_and_arrive(
    stroll: Stroller, motion: type[SocialForcePeople | OrcaPeople]
) -> None:
    walked = stroll(meeting(motion, 0.0), 15.0)
    k = int(np.argmin(np.abs(walked.places[:, 0, 0] - walked.places[:, 1, 0])))
    assert walked.places[k, 0, 1] < -0.2 < 0.2 < walked.places[k, 1, 1]
    assert np.abs(walked.places[-1, :, 0] - [10.0, 0.0]).max() < 0.5


@pytest.mark.parametrize("offset", [-0.4, -0.1, 0.1, 0.4])
def test_a_pair_by_social_force_passes_on_one_side_and_hardly_touches(stroll: Stroller, offset: float) -> None:
    walked = stroll(meeting(SocialForcePeople, offset), 12.0)
    beside = walked.places[:, 0, 1] - walked.places[:, 1, 1]
    near = np.abs(walked.places[:, 0, 0] - walked.places[:, 1, 0]) < 1.0
    assert (np.sign(beside[near]) == np.sign(beside[near][0])).all()
    assert walked.gaps.min() > -0.02


def test_bodies_in_contact_are_stopped_by_their_stiffness_alone(stroll: Stroller) -> None:
    walked = stroll(meeting(SocialForcePeople, 0.0, strength=0.0), 8.0)
    # two masses on one spring: the depth is that of the relative speed over sqrt(2 k / m)
    assert -1.2 * 2.58 / math.sqrt(2.0 * 1500.0) < walked.gaps.min() < -0.5 * 2.58 / math.sqrt(2.0 * 1500.0)


def test_pairs_by_orca_never_touch(stroll: Stroller) -> None:
    rng, least = np.random.default_rng(3), math.inf
    for case in range(400):
        pair = [
            Others(
                OrcaPeople(goals=tuple(map(tuple, rng.uniform(0.0, 6.0, (3, 2)))), margin=0.0,
                           horizon=rng.uniform(0.5, 5.0)),
                places=((float(x), float(rng.uniform(0.0, 6.0))),), speed=rng.uniform(0.3, 2.0), radius=0.3,
            )
            for x in (rng.uniform(0.0, 2.5), rng.uniform(3.5, 6.0))
        ]  # fmt: skip
        least = min(least, stroll(pair, 8.0, case=case).gaps.min())
    assert least > -1e-9


@pytest.mark.parametrize("motion", PEOPLE)
def test_nobody_enters_a_wall_or_goes_faster_than_the_top_speed(
    stroll: Stroller, motion: type[SocialForcePeople | OrcaPeople]
) -> None:
    crowd = Others(motion(), number=40, area=INSIDE, radius=0.25, group=2, speed_spread=0.19)
    walked = stroll(crowd, 20.0, walls=ROOM)
    assert min(nearest(ROOM, x, y)[0] for x, y in walked.places[::3].reshape(-1, 2)) >= 0.25 - 1e-12
    tops = walked.crowd.agents["top"]
    assert (walked.speeds <= tops * (1.0 + 1e-12)).all()
    ways = np.linalg.norm(np.diff(walked.places, axis=0), axis=-1)
    assert (ways <= tops * 0.01 * (1.0 + 1e-9) + 1e-8).all()
    assert ways.sum(axis=0).min() > 3.0


def test_a_crowd_by_orca_in_a_room_does_not_touch(stroll: Stroller) -> None:
    walked = stroll(Others(OrcaPeople(), number=25, area=INSIDE, radius=0.25), 30.0, walls=ROOM)
    assert walked.gaps.min() > 0.0


@pytest.mark.parametrize("motion", PEOPLE)
def test_who_yields_gives_way_to_the_robot_and_who_does_not_walks_on(
    stroll: Stroller, motion: type[SocialForcePeople | OrcaPeople]
) -> None:
    def robot(time: float) -> tuple[float, float, float, float, float]:
        return 9.0 - 0.5 * time, 0.05, -0.5, 0.0, 0.3

    least = []
    for yields in (0.0, 1.0):
        others = Others(motion(goals=((20.0, 0.0),)), places=((0.0, 0.0),), yields=yields)
        walked = stroll(others, 9.0, robot=robot)
        gaps = [math.dist(walked.places[k, 0], robot(0.01 * k)[:2]) - 0.6 for k in range(len(walked.places))]
        least.append(min(gaps))
        if yields == 0.0:
            assert np.abs(walked.places[:, 0, 1]).max() < 0.5
    assert least[0] < -0.3
    assert least[1] > -0.05


def test_the_share_that_yields_is_that_of_the_people() -> None:
    agents = drawn([Others(OrcaPeople(), number=200, area=(0.0, 0.0, 60.0, 60.0), yields=0.3, effort=0.5)], 1, 0).agents
    assert set(agents["yields"].tolist()) == {0.0, 0.5}
    assert 40 < (agents["yields"] > 0.0).sum() < 80


def test_a_group_stays_together_by_cohesion(stroll: Stroller) -> None:
    def spread(cohesion: float) -> float:
        goals = ((60.0, 5.0),)
        group = Others(SocialForcePeople(goals=goals, cohesion=cohesion), number=4, group=4, area=(0.0, 3.0, 4.0, 7.0),
                       speed_spread=0.3)  # fmt: skip
        places = stroll(group, 30.0, seed=4).places[-1]
        return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())

    assert spread(3.0) < 1.7  # half a metre for each companion, no pull within it
    assert spread(0.0) > 3.0


def test_people_go_round_who_stands_and_who_gives_way_to_nobody(stroll: Stroller) -> None:
    for motion in PEOPLE:
        others = [
            Others(motion(goals=((12.0, 0.0),), loop=False), places=((0.0, 0.0),)),
            Others(ConstantVelocity(heading=math.pi), places=((9.0, 0.05),), speed=0.6),
        ]
        walked = stroll(others, 15.0)
        assert walked.gaps.min() > -0.06  # by social force people brush
        assert walked.places[-1, 0, 0] > 11.0


def test_who_is_stopped_for_good_stands_and_is_avoided(stroll: Stroller) -> None:
    crowd = drawn(meeting(OrcaPeople, 0.0), 1, 0)
    walls = np.empty((0, 4))
    begin_agents(crowd.agents, crowd.ways, crowd.obstacles, walls)
    for k in range(1, 1500):
        step_agents(crowd.agents, crowd.ways, crowd.obstacles, walls, 1e4, 1e4, 0.0, 0.0, 0.3, k * 10_000_000, 0.01)
        if k == 200:
            crowd.obstacles[1].stop, place = k * 10_000_000, crowd.obstacles[1].x
        assert (
            math.dist((crowd.obstacles[0].x, crowd.obstacles[0].y), (crowd.obstacles[1].x, crowd.obstacles[1].y)) > 0.6
        )
    assert crowd.obstacles[1].x == place
    assert crowd.obstacles[1].v == 0.0
    assert crowd.obstacles[0].x > 9.0


def test_who_sets_out_later_stands_till_then(stroll: Stroller) -> None:
    people = Others(OrcaPeople(goals=((9.0, 0.0),)), places=((0.0, 0.0),), start=(2.0, 2.0))
    walked = stroll(people, 4.0)
    assert (walked.places[:201, 0] == 0.0).all()
    assert walked.places[-1, 0, 0] == pytest.approx(2.0 * 1.29, abs=0.05)


MIXED = [
    Others(SocialForcePeople(), number=40, area=INSIDE, radius=0.2, group=3),
    Others(OrcaPeople(), number=20, area=INSIDE, radius=0.2),
    Others(RandomWalk(), number=5, area=INSIDE, radius=0.2, speed=0.8),
]


def test_a_case_has_the_same_bits_each_time_it_is_begun(stroll: Stroller) -> None:
    first = stroll(MIXED, 5.0, walls=ROOM)
    again = stroll(MIXED, 5.0, walls=ROOM, crowd=first.crowd)
    assert first.places.tobytes() == again.places.tobytes()
    assert first.places.tobytes() != stroll(MIXED, 5.0, walls=ROOM, case=1).places.tobytes()


def test_the_order_of_agents_does_not_matter(stroll: Stroller) -> None:
    crowd = drawn(MIXED, 1, 0)
    turned = drawn(MIXED, 1, 0)
    order = np.random.default_rng(1).permutation(len(crowd.agents))
    turned.agents[:] = crowd.agents[order]
    assert stroll(MIXED, 5.0, crowd=crowd).places.tobytes() == stroll(MIXED, 5.0, crowd=turned).places.tobytes()

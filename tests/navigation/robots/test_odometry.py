"""Odometry: what a robot believes of its way has the errors that were asked for, and the truth has none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from parcours.kernels import Record
from parcours_navigation.robots.body import command_body
from parcours_navigation.robots.driving import drive_body
from parcours_navigation.robots.kinds import Body, Odometry

TICK = 0.01


def driven(
    body: Body, v: float, w: float, seconds: float, case: int = 0, tick: float = TICK, vy: float = 0.0
) -> Record:
    record = body.record(0.0, 0.0, 0.0, seed=1, case=case, tick=tick)
    command_body(record, v, vy, w)
    for _ in range(round(seconds / tick)):
        drive_body(record, tick)
    return record


def test_a_scale_error_grows_with_the_way_and_with_the_turn() -> None:
    body = Body(odometry=Odometry(way_scale=0.02, turn_scale=-0.1), acceleration=1000.0, yaw_acceleration=1000.0)
    straight = driven(body, 0.25, 0.0, 8.0)
    assert straight.believed_x == pytest.approx(1.02 * straight.x)
    turned = driven(body, 0.0, 0.5, 4.0)
    assert turned.believed_heading == pytest.approx(0.9 * turned.heading)
    arc = driven(body, 0.2, 0.5, 4.0)
    radius = 1.02 * 0.2 / (0.9 * 0.5)
    assert arc.believed_x == pytest.approx(radius * math.sin(arc.believed_heading), abs=2e-3)
    assert arc.believed_y == pytest.approx(radius * (1.0 - math.cos(arc.believed_heading)), abs=2e-3)


@pytest.mark.parametrize("tick", [0.01, 0.02])
def test_noise_grows_with_the_root_of_the_way_whatever_the_tick(tick: float) -> None:
    body = Body(odometry=Odometry(way_noise=0.03), acceleration=1000.0)
    errors = []
    for case in range(300):
        record = driven(body, 0.25, 0.0, 4.0, case, tick)
        errors.append(record.believed_x - record.x)
        assert record.believed_y == 0.0
    assert np.std(errors) == pytest.approx(0.03, rel=0.15)
    assert np.mean(errors) == pytest.approx(0.0, abs=0.006)


def test_noise_of_the_heading_grows_with_turn_and_way() -> None:
    odometry = Odometry(turn_noise=0.05, turn_noise_way=0.08)
    body = Body(odometry=odometry, acceleration=1000.0, yaw_acceleration=1000.0)
    errors = [driven(body, 0.25, 0.0, 4.0, case).believed_heading for case in range(300)]
    assert np.std(errors) == pytest.approx(0.08, rel=0.15)
    errors = [driven(body, 0.0, 0.5, 2.0, case).believed_heading - 1.0 for case in range(300)]
    assert np.std(errors) == pytest.approx(0.05, rel=0.15)


def test_the_truth_does_not_depend_on_what_is_believed() -> None:
    noisy = Body(odometry=Odometry(way_scale=0.1, way_noise=0.1, turn_noise=0.1, turn_noise_way=0.1))
    believed, exact = driven(noisy, 0.2, 0.4, 5.0), driven(Body(), 0.2, 0.4, 5.0)
    assert [believed[name] for name in ("x", "y", "heading")] == [exact[name] for name in ("x", "y", "heading")]
    assert believed.believed_x != believed.x


def test_a_case_has_its_own_noise_and_has_it_again() -> None:
    body = Body(odometry=Odometry(way_noise=0.05))
    assert driven(body, 0.2, 0.0, 2.0).tobytes() == driven(body, 0.2, 0.0, 2.0).tobytes()
    assert driven(body, 0.2, 0.0, 2.0).believed_x != driven(body, 0.2, 0.0, 2.0, case=1).believed_x


def test_a_robot_that_stands_believes_to_stand() -> None:
    body = Body(odometry=Odometry(way_noise=0.5, turn_noise=0.5))
    record = driven(body, 0.0, 0.0, 2.0)
    assert (record.believed_x, record.believed_y, record.believed_heading) == (0.0, 0.0, 0.0)


def test_a_holonomic_body_measures_its_way_sideways_too() -> None:
    body = Body("holonomic", acceleration=1000.0, odometry=Odometry(way_scale=0.02))
    record = driven(body, 0.0, 0.0, 4.0, vy=0.2)
    assert (record.believed_x, record.believed_y) == pytest.approx((0.0, 1.02 * record.y))

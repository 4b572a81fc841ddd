"""Every door by which a nonsensical test could enter refuses it: with where, the rule, the value and a slug."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from parcours.errors import BadRequest
from parcours_navigation.cases.family import PROTOCOLS, Protocol, SystemCases
from parcours_ramp.planner.latency import Latencies
from parcours_ramp.planner.parameters import guarded
from parcours_ramp.system.study import system_study


@pytest.mark.parametrize("radius", [0.0, -0.1, 0.6, float("nan"), float("inf")])
def test_radii_that_no_body_has_are_refused(radius: float) -> None:
    for name in ("robot_radius", "obstacle_radius"):
        with pytest.raises(BadRequest, match=rf"{name}: it must be above 0 .*but is {radius} m \[radius-range\]"):
            SystemCases(0, **{name: radius})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["v_max", "w_max", "a_max", "alpha_max", "robot_radius", "arena", "control_period"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_limits_that_no_robot_has_are_refused(name: str, value: float) -> None:
    with pytest.raises(BadRequest, match=rf"'{name}': it must be .*but is {value} \[parameter-range\]"):
        guarded(**{name: value})


@pytest.mark.parametrize("value", [-5.0, float("nan"), float("inf"), 3601.0])
def test_times_that_no_test_lasts_are_refused(value: float) -> None:
    for name in ("time_limit", "watched_on"):
        with pytest.raises(BadRequest, match=rf"{name}: it must be from .*but is {value} s \[study-range\]"):
            dataclasses.replace(system_study("guarded"), **{name: value})  # type: ignore[arg-type]
    with pytest.raises(BadRequest, match="study-range"):
        dataclasses.replace(system_study("guarded"), time_limit=0.0)


def test_an_arena_smaller_than_the_robot_and_two_sizes_of_one_robot_are_refused() -> None:
    study = system_study("original", radius=0.3)
    with pytest.raises(BadRequest, match=r"'arena': .* diameter is 0.6 m, but it is 0.5 m \[parameter-range\]"):
        dataclasses.replace(study, parameters=dataclasses.replace(study.parameters, arena=0.5))
    with pytest.raises(BadRequest, match=r"robot_radius: .* 0.3 m and 0.125 m \[study-range\]"):
        dataclasses.replace(study, parameters=guarded())


def test_a_negative_delay_is_refused() -> None:
    for name in ("added_sensing", "added_planning", "added_stop"):
        with pytest.raises(BadRequest, match=r"-0.1.*\[latency-range\]"):
            Latencies(**{name: -0.1})  # type: ignore[arg-type]


def test_a_delay_beyond_what_a_channel_keeps_in_order_is_refused() -> None:
    for name, most in (("added_sensing", 5), ("added_planning", 5), ("added_stop", 5), ("transport", 0.2)):
        with pytest.raises(BadRequest, match=rf"from 0 to {most} s, but {name} is 6.0 \[latency-range\]"):
            Latencies(**{name: 6.0})  # type: ignore[arg-type]


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("radii", [(0.125, 0.1), (0.5, 0.1)])
def test_no_case_of_the_system_study_begins_inside_an_obstacle(protocol: Protocol, radii: tuple[float, float]) -> None:
    obstacles = SystemCases(5, protocol, *radii).obstacles(np.arange(300))
    assert (np.hypot(obstacles["x0"], obstacles["y0"]) - sum(radii) > 0.0).all()

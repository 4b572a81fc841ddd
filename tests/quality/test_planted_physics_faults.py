"""Faults planted in copies of the physics: a check against the independent references must find each of them."""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import Phase, settings

TESTS = Path(__file__).parent.parent

PROFILES = "planners/test_physics_profiles.py"
CORNERS = "planners/test_physics_corners.py"
PREDICTIONS = "planners/test_physics_predictions.py"
CONTACT = "navigation/arena/test_physics_contact.py"
MOTION = "navigation/arena/test_physics_motion.py"

LASTS = "test_a_profile_lasts_as_long_as_ruckig_s_time_optimal_motion"
FOLLOWS = "test_way_and_speed_are_ruckig_s_at_every_time_of_the_profile"
LENGTH = "test_a_corner_is_as_long_as_quadrature_and_a_fine_polygon_say"
YAW = "test_at_corner_speed_no_yaw_limit_is_broken_along_the_whole_curve_at_any_phase_of_the_samples"
INTEGRALS = "test_place_and_heading_are_the_integrals_of_speed_and_yaw_rate"
SEGMENT = "test_least_distance_is_shapely_s_distance_to_the_segment"
ENTERS = "test_contact_begins_where_shapely_finds_the_segment_to_enter_the_disc"
SWEPT = "test_a_robot_touches_a_standing_disc_if_and_only_if_its_swept_area_does"
HEAD_ON = "test_head_on_at_three_quarters_of_a_metre_a_second_every_phase_of_the_tick_finds_the_contact"
LINES = "test_on_straight_lines_contact_is_found_if_and_only_if_the_lines_come_within_reach"
ARCS = "test_on_arcs_contact_is_found_if_and_only_if_the_arcs_come_within_reach"
AGAIN = "test_a_robot_that_backs_off_and_comes_again_touches_when_its_way_says_so"
STOPS = "test_a_disc_that_stops_within_a_tick_stands_where_it_stopped"
OBSTACLE = "test_an_obstacle_is_where_integration_of_its_speed_and_yaw_rate_leads"
ONE_TICK = "test_one_tick_of_changing_speeds_is_the_integral_of_their_ramps"
OBEYED = "test_a_new_command_is_obeyed_as_the_limits_allow_in_continuous_time"
PREDICTED = "test_a_predicted_motion_is_the_arena_s_own_while_the_obstacle_keeps_its_speeds"

FAULTS = [
    # (module, what stands there, what is planted, tests, the test that must fail)
    ("ramp.planner.profile", "0.5 * (v0 * v0 + v1 * v1)", "0.5 * (v0 * v0 - v1 * v1)", PROFILES, LASTS),
    ("ramp.planner.profile", "(peak - v1) / acceleration", "(peak - v0) / acceleration", PROFILES, LASTS),
    ("ramp.planner.profile", "- 0.5 * (peak + v1) * down", "- 0.499 * (peak + v1) * down", PROFILES, LASTS),
    ("ramp.planner.profile", "way += peak * hold", "way += 1.001 * peak * hold", PROFILES, FOLLOWS),
    ("ramp.planner.profile", "- 0.5 * acceleration * time * time,", "- acceleration * time**2,", PROFILES, FOLLOWS),
    ("ramp.planner.corner", "* SAMPLE / (", "* 1.2 * SAMPLE / (", CORNERS, YAW),
    ("ramp.planner.corner", "c * c / s * _", "c / s * _", CORNERS, LENGTH),
    ("ramp.planner.corner", "parameters.w_max * c * c", "parameters.w_max * c", CORNERS, YAW),
    ("ramp.planner.trajectory", "bend = s * c / (", "bend = 1.01 * s * c / (", CORNERS, INTEGRALS),
    ("ramp.planner.trajectory", "else -turned)", "else turned)", CORNERS, INTEGRALS),
    ("ramp.planner.trajectory", "speed if left else -speed", "speed", CORNERS, INTEGRALS),
    ("ramp.planner.prediction", "pose.x - arc_radius * s", "pose.x + arc_radius * s", PREDICTIONS, PREDICTED),
    ("navigation.arena.contact", "-(x0 * dx + y0 * dy)", "-(x0 * dx - y0 * dy)", CONTACT, SEGMENT),
    ("navigation.arena.contact", ", 0.0), 1.0)", ", 0.0), 1.1)", CONTACT, SEGMENT),
    ("navigation.arena.contact", "(-b - np.sqrt(discriminant))", "(-b + np.sqrt(discriminant))", CONTACT, ENTERS),
    ("navigation.arena.contact", "b >= 0.0 or discriminant", "b > 1e9 or discriminant", CONTACT, ENTERS),
    ("navigation.arena.world", "robot.radius + obstacle.radius", "robot.radius", CONTACT, SWEPT),
    ("navigation.arena.world", "least_distance(x0, y0, x1, y1)", "np.hypot(x1, y1)", CONTACT, LINES),
    ("navigation.arena.world", "if clearance > 0.0:", "if np.hypot(x1, y1) > reach:", CONTACT, HEAD_ON),
    ("navigation.arena.world", "obstacle.x - x, obstacle", "obstacle.x - robot.x, obstacle", CONTACT, LINES),
    ("navigation.arena.world", "bring(obstacle, world.now)", "bring(obstacle, world.now - TICK)", CONTACT, ARCS),
    ("navigation.arena.world", "stood and (now < obstacle.start or before", "(now < obstacle.start or now",
     CONTACT, STOPS),
    ("navigation.arena.world", "now + TICK * int(", "now + 2 * TICK * int(", CONTACT, AGAIN),
    ("navigation.arena.obstacles", "- arc_radius * (c1 - c0)", "+ arc_radius * (c1 - c0)", MOTION, OBSTACLE),
    ("navigation.arena.obstacles", "_STRAIGHT = 1e-9", "_STRAIGHT = 1e-4", MOTION, OBSTACLE),
    ("navigation.arena.robot", "0.5 * mean_w * dt", "mean_w * dt", MOTION, ONE_TICK),
    ("navigation.arena.robot", "0.5 * (v0 + v), ", "v, ", MOTION, ONE_TICK),
    ("navigation.arena.robot", "robot.alpha_max * dt", "robot.a_max * dt", MOTION, OBEYED),
]  # fmt: skip


GRAZING = 0.225 - 1e-6
"""How far aside the obstacle of the head-on test passes [m]."""

MIDST = 0.35
"""The share of a tick after which the disc of the stopping test stops."""


@pytest.fixture(autouse=True)
def _find_but_do_not_shrink() -> Iterator[None]:
    before = settings.get_current_profile_name()
    settings.register_profile(
        "planted", settings.get_profile(before), phases=[Phase.generate], report_multiple_bugs=False
    )
    settings.load_profile("planted")
    yield
    settings.load_profile(before)


_numbers = itertools.count()


def module_from(path: Path, source: str) -> ModuleType:
    """Return a fresh module of the source, which no other module sees."""
    spec = importlib.util.spec_from_loader(f"planted_{next(_numbers)}", loader=None, origin=str(path))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses look for it while they are made
    exec(compile(source, str(path), "exec"), module.__dict__)
    del sys.modules[spec.name]
    return module


def replanted(path: Path, sound: ModuleType, faulty: ModuleType) -> ModuleType:
    """Return the module at the path with all it took from the sound module taken from the faulty one."""
    module = module_from(path, path.read_text(encoding="utf-8").replace("@kernel\n", ""))
    for name, value in list(vars(module).items()):
        if callable(value) and getattr(value, "__module__", None) == sound.__name__:
            setattr(module, name, getattr(faulty, name))
    return module


def perform(module: str, stands: str, planted: str, tests: str, test: str) -> None:
    """Perform a test as if the module read otherwise; kernels of the copy are not compiled."""
    sound = importlib.import_module(f"parcours_{module}")
    path = Path(str(sound.__file__))
    source = path.read_text(encoding="utf-8")
    if source.count(stands) != 1:
        pytest.fail(f"{module} must read {stands!r} once, so that it can be made wrong")
    faulty = module_from(path, source.replace(stands, planted).replace("@kernel\n", ""))
    arguments: list[object] = []
    if test == HEAD_ON:
        arguments = [GRAZING]
    elif test == STOPS:
        arguments = [MIDST]
    elif test == INTEGRALS:
        shared = replanted(TESTS / "planners/conftest.py", sound, faulty)
        rng = np.random.default_rng(1)
        ways = [shared.random_way(rng) for _ in range(40)]
        arguments = [[way for way in ways if way.trajectory.curve_end > 0.0][:4], shared.sample]
    getattr(replanted(TESTS / tests, sound, faulty), test)(*arguments)


@pytest.mark.parametrize(
    ("module", "stands", "planted", "tests", "test"), FAULTS, ids=[f"{fault[0]}: {fault[2]}" for fault in FAULTS]
)
def test_a_fault_in_the_physics_is_found(module: str, stands: str, planted: str, tests: str, test: str) -> None:
    with pytest.raises(AssertionError):
        perform(module, stands, planted, tests, test)


@pytest.mark.parametrize(("module", "tests", "test"), sorted({(fault[0], fault[3], fault[4]) for fault in FAULTS}))
def test_the_same_copies_without_a_fault_pass(module: str, tests: str, test: str) -> None:
    perform(module, "from __future__", "from __future__", tests, test)

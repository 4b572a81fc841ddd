"""Component form and compiled loop with latencies: the same delays from the same stream, the same bits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from parcours_ramp.planner.latency import Latencies
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.sampling import judge_sampled
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study


def assert_same(study: SystemStudy, number: int) -> np.void:
    ran, (facts, track, places) = run_components(study, number), study.track(number)
    assert ran.facts is not None
    for name in facts.dtype.names or ():
        assert ran.facts[name].tobytes() == facts[name].tobytes(), name
    assert ran.track.tobytes() == track.tobytes() and ran.places.tobytes() == places.tobytes()
    first: np.void = facts[0]
    return first


@pytest.mark.parametrize("protocol", ["table-vii", "published"])
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_cases_with_their_latencies_leave_the_same_bits_in_both_forms(schedule: str, protocol: str) -> None:
    study = dataclasses.replace(system_study(schedule, seed=11, protocol=protocol), time_limit=3.0, watched_on=0.0)  # type: ignore[arg-type]
    facts = [assert_same(study, number) for number in range(0, 900, 75)]
    assert sum(int(one["n_late_cycles"]) for one in facts) > 20
    assert (schedule, protocol) != ("original", "table-vii") or sum(int(one["n_halts"]) for one in facts) > 0


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_so_do_a_whole_case_that_is_watched_on_and_cases_with_delays_added(schedule: str) -> None:
    plain = system_study(schedule, seed=12)
    assert_same(plain, 5)
    short = dataclasses.replace(plain, time_limit=3.0, watched_on=0.0)
    for name, seconds in (("added_sensing", 0.25), ("added_planning", 0.1), ("added_stop", 0.5), ("transport", 0.05)):
        for number in (1, 2):
            assert_same(dataclasses.replace(short, latencies=Latencies(**{name: seconds})), number)  # type: ignore[arg-type]


def test_so_do_cases_in_which_a_newer_trajectory_is_on_its_way_when_control_begins() -> None:
    study = system_study("original", seed=3, protocol="published")
    slow = dataclasses.replace(study, latencies=Latencies(transport=0.15), time_limit=1.2, watched_on=0.0)
    for number in range(12):
        assert_same(slow, number)


def test_messages_with_latencies_are_judged_and_most_old_obstacle_lists_are_dropped() -> None:
    study = dataclasses.replace(system_study("guarded", seed=11), time_limit=2.0, watched_on=0.0)
    assert judge_sampled(study, 3).judgement.passed
    events = run_components(study, 3).trace.events
    dropped = [event for event in events if event.kind == "drop" and event.channel == "obstacles"]
    assert dropped and {event.text for event in dropped} == {"overrun"}

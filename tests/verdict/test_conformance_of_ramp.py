"""RAMP without faults does not deviate: its component cases in turns, and whole system cases in free run."""

from __future__ import annotations

import dataclasses

import pytest

from parcours.verdict.conformance import Allowance, check
from parcours.verdict.conformance.tracking import Observes
from parcours_ramp.components.model import component_model
from parcours_ramp.components.study import component_plan, run_functional
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import SystemStudy, system_study

MS = 1_000_000
RAMP = Allowance(unmodelled=frozenset({"trajectory_request", "evaluation_request"}), conversations=True)
TIMEOUTS = {"update": 40 * MS, "modification_request": 60 * MS, "trajectory_response": 5 * MS}


def timeless(schedule: str) -> SystemStudy:
    """Return the study without latencies: how long an answer may take is known."""
    return dataclasses.replace(system_study(schedule), latencies=none())


def test_no_component_case_deviates_in_what_it_takes_or_sends() -> None:
    plan = component_plan(seed=7, rows=6)
    assert plan.n_cases == 402
    for number in range(plan.n_cases):
        trace = run_functional(plan.case(number)).execution.trace
        for observes in ("transitions", "messages"):
            found = check(trace, component_model(), observes=observes, data=message_of)
            assert found.judgement.passed, f"{trace.case}: {found.judgement.why}"
            assert found.n_events == len(trace.events)


@pytest.mark.parametrize("schedule", ["guarded", "original"])
@pytest.mark.parametrize("observes", ["transitions", "messages"])
def test_no_system_case_deviates(schedule: str, observes: Observes) -> None:
    for number in range(2):
        trace = run_components(timeless(schedule), number, 4.0).trace
        found = check(
            trace, component_model(schedule), observes=observes, allowance=RAMP, quiescence=TIMEOUTS, data=message_of
        )
        assert found.judgement.passed, found.judgement.why
        assert found.n_outside > 0


def test_the_planner_asks_more_than_the_table_says() -> None:
    trace = run_components(timeless("guarded"), 0, 0.2).trace
    found = check(trace, component_model())
    assert found.deviation is not None
    assert found.deviation.component == "Planner"
    assert found.deviation.rule == "evaluation_request was sent, but no transition taken sends it"
    assert found.path == ("p12", "p13")

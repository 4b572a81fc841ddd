"""RAMP without faults does not deviate: its component cases in turns, and whole system cases in free run."""

from __future__ import annotations

import dataclasses

import pytest

from parcours.study.components.executing import in_process
from parcours.verdict.conformance import check
from parcours.verdict.conformance.tracking import Observes
from parcours_ramp.components.model import OUTSIDE, component_model
from parcours_ramp.components.study import component_plan, component_study, run_functional
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.viewing import message_of
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import SystemStudy, system_study

MS = 1_000_000
TIMEOUTS = {"update": 40 * MS, "modification_request": 60 * MS, "trajectory_response": 5 * MS}


def timeless(schedule: str) -> SystemStudy:
    """Return the study without latencies: how long an answer may take is known."""
    return dataclasses.replace(system_study(schedule), latencies=none())


def test_no_component_case_deviates_in_what_it_takes_or_sends() -> None:
    plan = component_plan(seed=7, rows=1)
    assert plan.n_cases == 67
    for number in range(plan.n_cases):
        trace = run_functional(plan.case(number)).execution.trace
        for observes in ("transitions", "messages"):
            found = check(trace, component_model(), observes=observes, data=message_of)
            assert found.judgement.passed, f"{trace.case}: {found.judgement.why}"
            assert found.n_events == len(trace.events)


def test_nor_does_one_with_an_instance_for_the_whole_case() -> None:
    study = component_study()
    settings = {one.name: one.default for one in study.parameters}
    execute = in_process(study.exercise(settings))
    assert settings["instances"] == "per-case"
    for case in study.suite(settings, 7, 67):
        found = check(execute(case).trace, study.model, allowance=study.allowance, data=message_of)
        assert found.judgement.passed, f"{case.id}: {found.judgement.why}"


@pytest.mark.parametrize("schedule", ["guarded", "original"])
@pytest.mark.parametrize("observes", ["transitions", "messages"])
def test_no_system_case_deviates(schedule: str, observes: Observes) -> None:
    for number in range(2):
        trace = run_components(timeless(schedule), number, 4.0).trace
        found = check(
            trace, component_model(schedule), observes=observes, allowance=OUTSIDE, quiescence=TIMEOUTS, data=message_of
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

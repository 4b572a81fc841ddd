"""All abstract component cases of RAMP on nodes of ROS 2: each keeps its order, and is judged as in simulated time."""

from __future__ import annotations

import pytest

from parcours.run.hosts.ros2.transport import Ros2Transport
from parcours.run.hosts.scheduling import real_time
from parcours.run.trace import transitions
from parcours.suite import Case
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.study import component_plan, on, run_functional

CASES = tuple(component_plan(0, 1).cases(0, 67))


def name(case: Case) -> str:
    return case.abstract


@pytest.mark.parametrize("case", CASES, ids=name)
def test_a_case_keeps_its_order_and_is_judged_as_in_simulated_time(ramp: Ros2Transport, case: Case) -> None:
    with real_time():
        real = run_functional(case, on(ramp))
    simulated = run_functional(case)
    assert real.judgement == simulated.judgement
    assert real.judgement.verdict is Verdict.PASS
    assert transitions(real.execution.trace) == transitions(simulated.execution.trace)
    assert (real.execution.trace.clock, real.execution.trace.host) == ("wall", "ros2, gated")


@pytest.mark.parametrize("case", CASES, ids=name)
def test_it_keeps_the_order_that_it_demands_when_its_nodes_run_at_the_same_time(
    ramp: Ros2Transport, case: Case
) -> None:
    with real_time():
        real = run_functional(case, on(ramp, strict=False))
    assert real.judgement.verdict is Verdict.PASS, real.judgement


def test_there_are_67_cases() -> None:
    assert len({case.abstract for case in CASES}) == 67

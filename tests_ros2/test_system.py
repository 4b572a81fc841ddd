"""RAMP whole on nodes of ROS 2, in real time: the world is the tester's, and all that passes is checked."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from parcours.run.faults.plan import ComponentFault, FaultPlan
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.ros2.transport import Ros2Transport
from parcours.run.hosts.scheduling import real_time
from parcours.run.trace import transitions
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.model import component_model
from parcours_ramp.planner.component_factory import COMPONENTS
from parcours_ramp.system.component_form import system_links
from parcours_ramp.system.live import run_live
from parcours_ramp.system.study import system_study

RESIDENT = "parcours_ramp.system.live"


@pytest.fixture
def ramp_system() -> Iterator[Ros2Transport]:
    nodes = nodes_of(system_links(), COMPONENTS, f"{RESIDENT}:SystemNodeProgram")
    with real_time():
        transport = Ros2Transport(
            nodes, interfaces(component_model(), system_links()), [RESIDENT], domain=43
        )  # the other RAMP still lives
        yield transport
        transport.close()


def test_cases_run_to_their_end_as_the_model_allows(ramp_system: Ros2Transport) -> None:
    for number in (1, 2):
        run = run_live(system_study("guarded"), number, ramp_system)
        assert run.conformance.verdict is Verdict.PASS, run.conformance
        assert not run.deaths
        assert run.judgement.verdict in (Verdict.PASS, Verdict.FAIL)
        assert run.track["x"].max() - run.track["x"].min() > 0.1
        for component in set(COMPONENTS) - {
            "PathModification"
        }:  # a Planner that is kept busy by sensing asks it nothing
            assert transitions(run.trace, component), component


def test_a_dead_planner_is_a_failure_wherever_the_robot_coasts_to(ramp_system: Ros2Transport) -> None:
    crash = FaultPlan(0, (ComponentFault("Planner", "crash", at_ns=3_000_000_000),))
    run = run_live(system_study("guarded"), 1, ramp_system, faults=crash)
    assert run.deaths == {"Planner": "killed by SIGKILL"}
    assert run.judgement.verdict is Verdict.FAIL
    assert "dead at the end: Planner" in run.judgement.why

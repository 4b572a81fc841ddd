"""RAMP's components as nodes on a real ROS 1 graph: all 67 cases keep their order, on the names of Table I."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import pytest

from parcours.run.enforcement import Execution, enforce
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.live_enforcement import DrivenInstances
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours.run.hosts.scheduling import real_time
from parcours.run.port import links
from parcours.suite import Case
from parcours_ramp.components.model import component_model
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.components.study import component_plan, component_study, run_functional
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.planner.wire import encode

_NODE_PROGRAM = "parcours_ramp.components.ros1:node_program"
_PRELOAD = ["parcours_ramp.components.ros1", "parcours_ramp.components.warm"]


@pytest.fixture(scope="module")
def transport() -> Iterator[Ros1Transport]:
    model = component_model()
    nodes = nodes_of(links(model), [one.name for one in model.components], _NODE_PROGRAM)
    started = Ros1Transport(nodes, interfaces(model), CODEC, _PRELOAD)
    with closing(started), real_time():
        yield started


@pytest.mark.parametrize("strict", [True, False], ids=["in their order", "as free as they may"])
def test_all_component_cases_keep_their_order_and_pass(transport: Ros1Transport, strict: bool) -> None:
    def execute(case: Case) -> Execution:
        tester = ComponentTester(case)
        instances = DrivenInstances(transport, CODEC, tester)
        return enforce(component_study().events(case), instances, tester.supply, case=case.id, strict=strict)

    done = [run_functional(case, execute) for case in component_plan(0, 1).cases(0, 67)]
    assert len(done) == 67
    assert [(one.case.id, one.judgement) for one in done if not one.judgement.passed] == []
    assert all(one.execution.completed for one in done)
    assert {one.execution.trace.host for one in done} == {"ros1, gated"}
    assert not transport.refusals
    sent = {event.channel: event for one in done for event in one.execution.trace.events if event.kind == "send"}
    for event in sent.values():
        again = CODEC.decode(event.channel, CODEC.encode(event.channel, event.payload))
        assert encode(event.channel, again) == encode(event.channel, event.payload), "no bit is lost on ROS"
    assert set(sent) >= {channel.name for channel in component_model().channels}


def test_topics_and_services_on_the_graph_are_those_of_table_i(transport: Ros1Transport) -> None:
    types = dict(ask(transport.master, "getTopicTypes", "/test"))
    publishers, subscribers, services = (dict(part) for part in ask(transport.master, "getSystemState", "/test"))
    of_the_paper = {
        "/odometry": ("parcours_messages/Odometry", "/Sensing"),
        "/obstacles": ("parcours_messages/ObstacleList", "/Planner"),
        "/best_trajectory": ("parcours_messages/RampTrajectory", "/Control"),
        "/update": ("parcours_messages/MotionState", "/Planner"),
    }
    others = [topic for topic in types if not topic.startswith("/parcours/")]
    assert {topic: (types[topic], *subscribers[topic]) for topic in others} == of_the_paper
    assert all(publishers[topic] == ["/parcours"] for topic in of_the_paper)
    assert {service: held for service, held in services.items() if not service.startswith("/parcours/")} == {
        "/trajectory_generation": ["/TrajectoryGenerator"],
        "/trajectory_evaluation": ["/TrajectoryEvaluation"],
        "/path_modification": ["/PathModification"],
    }
    assert publishers["/parcours/out/best_trajectory"] == ["/Planner"]
    assert publishers["/parcours/Planner/report"] == subscribers["/parcours/Planner/command"] == ["/Planner"]

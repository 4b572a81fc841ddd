"""RAMP's components in a whole run: they take the model's transitions in the model's order, and answer in kind."""

from __future__ import annotations

import dataclasses
import functools
from collections import Counter

import numpy as np
import pytest

from parcours.model.structure import Machine
from parcours.run.trace import Trace, transitions
from parcours_ramp.components.model import component_model
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.messages import (
    EvaluationRequest,
    EvaluationResponse,
    ModificationRequest,
    ModificationResponse,
    TrajectoryRequest,
    TrajectoryResponse,
)
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import SystemStudy, system_study

SECONDS = 14.0
RUNS = [(schedule, number) for schedule in ("original", "guarded") for number in (0, 4, 8)]
COMPONENTS = ("Planner", "TrajectoryGenerator", "TrajectoryEvaluation", "PathModification", "Control", "Sensing")


@functools.cache
def trace_of(schedule: str, number: int) -> Trace:
    study: SystemStudy = dataclasses.replace(system_study(schedule, seed=3), latencies=none())
    return run_components(study, number, SECONDS).trace


def taken(trace: Trace, component: str) -> tuple[str, ...]:
    return tuple(name for name in transitions(trace, component) if name)


def machines_of(component: str) -> tuple[Machine, ...]:
    [found] = [one for one in component_model().components if one.name == component]
    return found.machines


@pytest.mark.parametrize(("schedule", "number"), RUNS)
@pytest.mark.parametrize("component", COMPONENTS)
def test_a_component_names_only_transitions_of_its_own_model(schedule: str, number: int, component: str) -> None:
    own = {transition.id for machine in machines_of(component) for transition in machine.transitions}
    names = set(taken(trace_of(schedule, number), component))
    assert names
    assert names <= own


@pytest.mark.parametrize(("schedule", "number"), RUNS)
@pytest.mark.parametrize("component", COMPONENTS)
def test_every_machine_goes_from_state_to_state_as_the_model_says(schedule: str, number: int, component: str) -> None:
    names = taken(trace_of(schedule, number), component)
    for machine in machines_of(component):
        state, moves = machine.initial, {transition.id: transition for transition in machine.transitions}
        for place, name in enumerate(names):
            if name in moves:
                assert moves[name].source == state, f"{name} after {names[max(place - 8, 0) : place]}"
                state = moves[name].target


def test_the_runs_take_nearly_every_transition_of_the_model() -> None:
    whole = {t.id for component in COMPONENTS for machine in machines_of(component) for t in machine.transitions}
    seen = {name for run in RUNS for component in COMPONENTS for name in taken(trace_of(*run), component)}
    # What is left are the idle loops: the simulated host tells components of messages, it does not poll them.
    assert whole - seen <= {"p14", "p21", "p31", "p41", "p47", "p51", "p61"}


SERVICES = {
    "trajectory": (TrajectoryRequest, TrajectoryResponse),
    "evaluation": (EvaluationRequest, EvaluationResponse),
    "modification": (ModificationRequest, ModificationResponse),
}


@pytest.mark.parametrize(("schedule", "number"), RUNS)
@pytest.mark.parametrize("service", SERVICES)
def test_every_request_is_answered_in_order_under_its_own_tag(schedule: str, number: int, service: str) -> None:
    events = [event for event in trace_of(schedule, number).events if event.kind == "send"]
    asked = [e.payload for e in events if e.channel == f"{service}_request"]
    answered = [e.payload for e in events if e.channel == f"{service}_response"]
    assert len(asked) > 100
    request, response = SERVICES[service]
    assert all(isinstance(payload, request) for payload in asked)
    assert all(isinstance(payload, response) for payload in answered)
    tags = [[getattr(payload, "tag") for payload in payloads] for payloads in (asked, answered)]  # noqa: B009
    assert tags[0] == tags[1]


@pytest.mark.parametrize(("schedule", "number"), RUNS)
def test_answers_have_one_entry_for_each_thing_asked(schedule: str, number: int) -> None:
    events = [event for event in trace_of(schedule, number).events if event.kind == "send"]
    payloads = [event.payload for event in events]
    for name, size in (("trajectory", "trajectories"), ("evaluation", "fitness")):
        request, response = SERVICES[name]
        asked = [p for p in payloads if isinstance(p, request)]
        answered = [p for p in payloads if isinstance(p, response)]
        for question, answer in zip(asked, answered, strict=True):
            assert len(getattr(answer, size)) == _asked_for(question)


def _asked_for(request: object) -> int:
    if isinstance(request, EvaluationRequest):
        return len(request.trajectories)
    assert isinstance(request, TrajectoryRequest)
    return len(request.paths if request.obstacles is None else request.obstacles.states)


def test_the_planner_asks_once_an_obstacle_and_sends_the_best_trajectory_once_a_control_cycle() -> None:
    for run in RUNS:
        counts = Counter(taken(trace_of(*run), "Planner"))
        sent = Counter(event.channel for event in trace_of(*run).events if event.kind == "send")
        assert sent["best_trajectory"] == counts["p12"] > 5
        assert sent["modification_request"] == counts["p11"] > 200
        assert abs(counts["p16"] - 2 * counts["p15"]) <= 2  # three obstacles: two more after the first
        assert sent["obstacles"] == pytest.approx(SECONDS * 20, abs=2)
        assert sent["update"] == pytest.approx(SECONDS * 30, abs=2)


def test_the_same_run_has_the_same_trace() -> None:
    study = dataclasses.replace(system_study("guarded", seed=3), latencies=none())
    first, second = (run_components(study, 8, 4.0) for _ in range(2))
    assert first.trace == second.trace
    assert np.array_equal(first.track, second.track)

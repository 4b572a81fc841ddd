"""Faults planted in single components: each must turn cases to fail, with a sentence that names what went wrong."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from parcours.kernels import Record
from parcours.run.hosts.battery import ToyStep
from parcours.run.port import Component, Step
from parcours.suite import Case
from parcours.verdict.judgement import Verdict
from parcours_ramp.components import study
from parcours_ramp.components.study import Functional, component_plan, interaction_cases, run_functional
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.planner.messages import (
    EvaluationResponse,
    ModificationRequest,
    ModificationResponse,
    StateReport,
    Tag,
    TrajectoryResponse,
)

Spoil = Callable[[Step], list[Step]]
"""What a faulty component does in place of a step."""


@functools.cache
def sound_cases(itp: str) -> tuple[Case, ...]:
    """Return one row of every abstract case of an interaction path; they pass as long as nothing is spoilt."""
    plan = component_plan()
    cases = [plan.case(plan.number(id, 0)) for id, case in interaction_cases().items() if case.interaction.name == itp]
    assert all(run_functional(case).judgement.passed for case in cases)
    return tuple(cases)


def run_spoiled(
    monkeypatch: pytest.MonkeyPatch, component: str, methods: tuple[str, ...], spoil: Spoil, itp: str
) -> list[Functional]:
    """Run one row of every abstract case of an interaction path, with the steps of one component spoilt."""

    class Spoilt(ComponentTester):
        def component(self, name: str) -> Component:
            made = super().component(name)
            if name == component:
                for method in methods:
                    setattr(made, method, _spoilt(getattr(made, method), spoil))
            return made

    cases = sound_cases(itp)
    monkeypatch.setattr(study, "ComponentTester", Spoilt)
    return [run_functional(case) for case in cases]


def _spoilt(method: Callable[..., Iterator[Step]], spoil: Spoil) -> Callable[..., Iterator[Step]]:
    def spoilt(*arguments: object) -> Iterator[Step]:
        for step in method(*arguments):
            yield from spoil(step)

    return spoilt


def all_fail(results: list[Functional], *words: str) -> None:
    assert results
    for result in results:
        assert result.judgement.verdict is Verdict.FAIL, result.case.id
        for word in words:
            assert word in result.judgement.why, result.judgement.why


def replaced(channel: str, change: Callable[[object], object]) -> Spoil:
    """Return the fault that changes every message on a channel."""
    return lambda step: [ToyStep(step.transition, tuple((c, change(m) if c == channel else m) for c, m in step.sends))]


@pytest.mark.parametrize(
    ("component", "itp", "skipped", "instead"),
    [
        ("TrajectoryGenerator", "ITP1", "p23", "p24"),
        ("TrajectoryEvaluation", "ITP2", "p33", "p34"),
        ("PathModification", "ITP3", "p53", "p54"),
        ("Sensing", "ITP5", "p63", "p64"),
    ],
)
def test_a_service_that_leaves_out_a_transition_is_found_at_that_transition(
    monkeypatch: pytest.MonkeyPatch, component: str, itp: str, skipped: str, instead: str
) -> None:
    def spoil(step: Step) -> list[Step]:
        return [] if step.transition == skipped else [step]

    results = run_spoiled(monkeypatch, component, ("handle",), spoil, itp)
    all_fail(results, f"expected {skipped}, got {instead}", component)


@pytest.mark.parametrize(
    ("component", "itp", "transition"),
    [("TrajectoryGenerator", "ITP1", "p24"), ("TrajectoryEvaluation", "ITP2", "p34"), ("Sensing", "ITP5", "p63")],
)
def test_a_message_sent_twice_is_found_by_its_channel(
    monkeypatch: pytest.MonkeyPatch, component: str, itp: str, transition: str
) -> None:
    results = run_spoiled(monkeypatch, component, ("handle",), lambda s: [ToyStep(s.transition, s.sends * 2)], itp)
    all_fail(results, f"expected {transition} to send", f"got {transition} sending")
    assert all(result.judgement.why.count(", got") == 1 for result in results)


def test_a_service_that_answers_a_transition_too_often_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(step: Step) -> list[Step]:
        return [step, step] if step.transition == "p22" else [step]

    all_fail(run_spoiled(monkeypatch, "TrajectoryGenerator", ("handle",), spoil, "ITP1"), "expected p23, got p22")


def test_a_path_that_comes_back_unmodified_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[ModificationRequest] = []

    class Lazy(ComponentTester):
        def component(self, name: str) -> Component:
            made = super().component(name)
            if name == "PathModification":
                handle = made.handle

                def lazy(channel: str | None, message: object, now: int) -> Iterator[Step]:
                    if isinstance(message, ModificationRequest):
                        asked.append(message)
                    for step in handle(channel, message, now):
                        yield from replaced("modification_response", unmodified)(step)

                made.handle = lazy  # type: ignore[method-assign]
            return made

    def unmodified(message: object) -> object:
        assert isinstance(message, ModificationResponse)
        paths = np.array([asked[-1].modification.first]).view(np.recarray)
        return message._replace(paths=paths)

    cases = sound_cases("ITP3")
    monkeypatch.setattr(study, "ComponentTester", Lazy)
    all_fail([run_functional(case) for case in cases], "modification_response/")
    assert asked


def test_a_fitness_of_three_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(message: object) -> object:
        assert isinstance(message, EvaluationResponse)
        return message._replace(fitness=np.full_like(message.fitness, 3.0))

    spoil = replaced("evaluation_response", change)
    all_fail(run_spoiled(monkeypatch, "TrajectoryEvaluation", ("handle",), spoil, "ITP2"), "evaluation_response/")


@pytest.mark.parametrize("value", [0.0, -0.1, float("nan")])
def test_a_fitness_that_is_not_positive_is_found(monkeypatch: pytest.MonkeyPatch, value: float) -> None:
    def change(message: object) -> object:
        assert isinstance(message, EvaluationResponse)
        fitness = message.fitness.copy()
        fitness[-1] = value
        return message._replace(fitness=fitness)

    spoil = replaced("evaluation_response", change)
    all_fail(run_spoiled(monkeypatch, "TrajectoryEvaluation", ("handle",), spoil, "ITP2"), "evaluation_response/")


@pytest.mark.parametrize("size", [5, 9, 501])
def test_a_trajectory_of_the_wrong_size_is_found_by_its_size(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    def change(message: object) -> object:
        assert isinstance(message, TrajectoryResponse)
        trajectories = message.trajectories.copy()
        trajectories["n"] = size
        return message._replace(trajectories=trajectories)

    spoil = replaced("trajectory_response", change)
    results = run_spoiled(monkeypatch, "TrajectoryGenerator", ("handle",), spoil, "ITP1")
    all_fail(results, "trajectory_response/")


def test_a_control_that_never_reports_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(step: Step) -> list[Step]:
        return [] if step.transition in ("p48", "p49") else [step]

    results = run_spoiled(monkeypatch, "Control", ("tick",), spoil, "ITP6")
    all_fail(results, "expected p48, got", "Control")


def test_a_control_that_reports_into_the_void_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    results = run_spoiled(monkeypatch, "Control", ("tick",), lambda step: [ToyStep(step.transition)], "ITP6")
    all_fail(results, "expected p48 to send update, got p48 sending nothing")


def test_a_control_whose_reports_are_no_numbers_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(message: object) -> object:
        assert isinstance(message, StateReport)
        pose = message.pose.copy()
        pose.x = np.nan
        return StateReport(message.stamp, pose)

    results = run_spoiled(monkeypatch, "Control", ("tick",), replaced("update", change), "ITP4")
    reporting = [r for r in results if "tp42" in r.case.abstract]
    all_fail(reporting, "update/as sensed: it.x is nan")


def test_a_planner_that_ignores_obstacle_messages_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(step: Step) -> list[Step]:
        return [] if step.transition == "p15" else [step]

    results = run_spoiled(monkeypatch, "Planner", ("handle",), spoil, "ITP5")
    all_fail(results, "expected p15, got no transition", "Planner")


@pytest.mark.parametrize(
    ("component", "itp", "first"),
    [
        ("TrajectoryGenerator", "ITP1", "p2"), ("TrajectoryEvaluation", "ITP2", "p3"),
        ("PathModification", "ITP3", "p5"), ("Control", "ITP5", "p4"),
        ("Sensing", "ITP5", "p6"), ("Planner", "ITP4", "p1"),
    ],
)  # fmt: skip
def test_a_frozen_component_is_found_at_its_first_transition(
    monkeypatch: pytest.MonkeyPatch, component: str, itp: str, first: str
) -> None:
    methods = {"Planner": ("handle", "plan", "control"), "Control": ("handle", "tick", "execute")}
    results = run_spoiled(monkeypatch, component, methods.get(component, ("handle",)), lambda step: [], itp)
    all_fail(results, f"expected {first}", "got no transition", "after its start", component)


def test_a_service_that_raises_is_found_by_what_it_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(step: Step) -> list[Step]:
        if step.transition == "p23":
            raise ZeroDivisionError("no way")
        return [step]

    results = run_spoiled(monkeypatch, "TrajectoryGenerator", ("handle",), spoil, "ITP1")
    all_fail(results, "ZeroDivisionError: no way", "p23")


def test_an_answer_under_a_wrong_tag_is_found_where_its_answer_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(message: object) -> object:
        assert isinstance(message, TrajectoryResponse)
        return message._replace(tag=Tag("planning", 77))

    results = run_spoiled(
        monkeypatch, "TrajectoryGenerator", ("handle",), replaced("trajectory_response", change), "ITP1"
    )
    all_fail(results, "Planner", "got no transition")


def test_a_control_that_follows_another_trajectory_than_it_was_sent_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Deaf(ComponentTester):
        def component(self, name: str) -> Component:
            made = super().component(name)
            if name == "Control":
                handle = made.handle

                def deaf(channel: str | None, message: object, now: int) -> Iterator[Step]:
                    if channel == "best_trajectory":
                        message = _moved(message)
                    return handle(channel, message, now)

                made.handle = deaf  # type: ignore[method-assign]
            return made

    cases = sound_cases("ITP5")
    monkeypatch.setattr(study, "ComponentTester", Deaf)
    results = [run_functional(case) for case in cases]
    all_fail(results, "0 follow the last one")


def _moved(trajectory: Record) -> Record:
    other = trajectory.copy()
    other.pieces[0]["x"] += 1e-3
    return other


def test_a_control_whose_reports_never_change_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(message: object) -> object:
        assert isinstance(message, StateReport)
        return _at_origin(message)

    results = run_spoiled(monkeypatch, "Control", ("tick",), replaced("update", change), "ITP6")
    all_fail(results, "update/as sensed: it.x is 0")


def _at_origin(report: StateReport) -> StateReport:
    pose = report.pose.copy()
    pose.x = pose.y = 0.0
    return StateReport(report.stamp, pose)

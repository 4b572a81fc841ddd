"""RAMP's services against their references: sound ones agree, a fault in any field of an answer is found."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from parcours.kernels import Record
from parcours.study.components.references import difference
from parcours.suite import Case
from parcours_ramp.components.references import TOLERANCE
from parcours_ramp.components.references.evaluation import Evaluation
from parcours_ramp.components.references.generator import Generator
from parcours_ramp.components.references.modification import Modification
from parcours_ramp.components.relations import relations
from parcours_ramp.components.study import component_plan, here, run_functional
from parcours_ramp.planner import messages
from parcours_ramp.planner.messages import EvaluationRequest, ModificationRequest, Obstacles, Tag, TrajectoryRequest
from parcours_ramp.planner.parameters import Parameters, guarded, original
from parcours_ramp.planner.path_modification import CROSSOVER, MOVE, PathModification, applies
from parcours_ramp.planner.trajectory_evaluation import TrajectoryEvaluation
from parcours_ramp.planner.trajectory_generator import TrajectoryGenerator
from parcours_ramp.planner.viewing import message_of

CASE = Case("any", 7, "any", 0, (), (), 1.0, seed=3)
TAG = Tag("sensing", 4)


def path_of(rng: np.random.Generator, n: int) -> Record:
    path = messages.one(messages.PATH)
    path.n, path.x[:n], path.y[:n] = n, rng.uniform(0.0, 2.0, n), rng.uniform(0.0, 2.0, n)
    return path


def ways(seed: int, n: int = 60) -> TrajectoryRequest:
    """Return a request for ways of every kind, from states at rest and in motion."""
    rng = np.random.default_rng(seed)
    paths, starts = messages.many(messages.PATH, n), messages.many(messages.POSE, n)
    for k in range(n):
        paths[k] = path_of(rng, int(rng.integers(2, 9)))
        pose, path = starts[k], paths[k]
        towards = math.atan2(path.y[1] - path.y[0], path.x[1] - path.x[0])
        pose.x, pose.y, pose.heading = path.x[0], path.y[0], towards + rng.normal(0.0, 0.2)
        pose.v = rng.choice([0.0, 0.25, rng.uniform(0.0, 0.25)])
    return TrajectoryRequest(TAG, paths, starts, rng.integers(0, 3, n))


def obstacles(seed: int, n: int = 6) -> Obstacles:
    rng = np.random.default_rng(seed)
    states = messages.many(messages.OBSTACLE_STATE, n)
    for k in range(n):
        pose = states[k].pose
        pose.x, pose.y, pose.heading = rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0), rng.uniform(-3.0, 3.0)
        pose.v, pose.w = rng.choice([0.0, rng.uniform(0.0, 0.5)]), rng.choice([0.0, rng.uniform(-1.5, 1.5)])
        states[k].radius = 0.1
    return Obstacles(int(rng.integers(10**9)), states)


def evaluations(seed: int, parameters: Parameters) -> Iterator[EvaluationRequest]:
    """Yield requests about trajectories among moving and standing obstacles, whole and in a window."""
    generator = TrajectoryGenerator(parameters)
    asked = generator.answer(TrajectoryRequest(TAG, obstacles=obstacles(seed))).trajectories
    trajectories = generator.answer(ways(seed, 12)).trajectories
    trajectories["begins"] = 700_000_000
    for halted in (False, True):
        yield EvaluationRequest(TAG, trajectories, asked[:3], (0.02, -0.01), 0.3, halted)
    yield EvaluationRequest(TAG, trajectories[:1], asked, (0.0, 0.0), 0.3, False, (10**9, 3, 24, 0.025, True))


def answered(channel: str, service: Any, request: Any) -> tuple[Any, Any]:
    """Return request and answer as messages of the model."""
    return message_of(f"{channel}_request", request), message_of(f"{channel}_response", service.answer(request))


def test_generated_ways_and_predictions_agree() -> None:
    for seed in range(8):
        for request in (ways(seed), TrajectoryRequest(TAG, obstacles=obstacles(seed, 12))):
            asked, answer = answered("trajectory", TrajectoryGenerator(guarded()), request)
            assert difference(answer, Generator()(asked), TOLERANCE) == ""


@pytest.mark.parametrize("parameters", [guarded(), original()], ids=["guarded", "original"])
def test_evaluations_agree(parameters: Parameters) -> None:
    reference, found = Evaluation(dataclasses.asdict(parameters)), set()
    for seed in range(12):
        for request in evaluations(seed, parameters):
            asked, answer = answered("evaluation", TrajectoryEvaluation(parameters), request)
            assert difference(answer, reference(asked), TOLERANCE) == ""
            found |= {time == 9999.0 for time in answer["t_collision"]}
    assert found == {False, True}


def modifications() -> Iterator[ModificationRequest]:
    rng = np.random.default_rng(5)
    for k in range(120):
        asked = messages.one(messages.MODIFICATION)
        asked.operator, asked.first = k % 6, path_of(rng, int(rng.integers(2, 8)))
        asked.direction, asked.distance = rng.uniform(-3.0, 3.0), rng.uniform(0.1, 1.0)
        if asked.operator == CROSSOVER:
            asked.second = path_of(rng, int(rng.integers(2, 8)))
        if k % 6 == MOVE or applies(asked.operator, asked.first.n) or k > 60:
            yield ModificationRequest(TAG, asked)


def test_modifications_agree_from_the_first_to_the_last() -> None:
    reference, service = Modification(CASE), PathModification(guarded(), CASE.seed, CASE.number)
    for request in modifications():
        asked, answer = answered("modification", service, request)
        assert difference(answer, reference(asked), TOLERANCE) == ""


FIELDS = ("points", "knot_times", "duration", "skipped", "curve_end", "rest_length", "rest_turn", "first_heading",
          "fitness", "t_collision", "smooth", "feasible", "begins", "legs", "id")  # fmt: skip


def spoilt(value: Any) -> Any:
    """Return a value with one number or truth in it changed a little."""
    if isinstance(value, list):
        return [*value[:-1], spoilt(value[-1])]
    if isinstance(value, dict):
        return {**value, (last := list(value)[-1]): spoilt(value[last])}
    return not value if isinstance(value, bool) else value + 1e-5 * max(1.0, abs(value))


@pytest.mark.parametrize("field", FIELDS)
def test_a_wrong_field_of_a_trajectory_is_found(field: str) -> None:
    asked, answer = answered("trajectory", TrajectoryGenerator(guarded()), ways(1, 4))
    wrong = copy.deepcopy(answer)
    wrong["trajectories"][2][field] = spoilt(wrong["trajectories"][2][field])
    assert f".trajectories[2].{field}" in difference(wrong, Generator()(asked), TOLERANCE)


@pytest.mark.parametrize("field", ["points", "heading", "speed", "turn", "radius", "stamp", "straight", "bend"])
def test_a_wrong_field_of_a_prediction_is_found(field: str) -> None:
    request = TrajectoryRequest(TAG, obstacles=obstacles(2, 1))
    assert request.obstacles is not None
    request.obstacles.states[0].pose.v, request.obstacles.states[0].pose.w = 0.3, 0.4
    asked, answer = answered("trajectory", TrajectoryGenerator(guarded()), request)
    answer["predictions"][0][field] = spoilt(answer["predictions"][0][field])
    assert f".predictions[0].{field}" in difference(answer, Generator()(asked), TOLERANCE)


@pytest.mark.parametrize("change", [{"v_max": 0.5}, {"alpha_max": 2.0}, {"a_max": 1.01}, {"estimate_v": 0.12}])
def test_a_generator_with_another_limit_is_found(change: dict[str, float]) -> None:
    asked, answer = answered("trajectory", TrajectoryGenerator(guarded(**change)), ways(6))
    if "estimate_v" in change:  # only a way that is cut off after 50 s needs it
        assert difference(answer, Generator(change)(asked), TOLERANCE) == ""
    else:
        assert difference(answer, Generator()(asked), TOLERANCE) != ""


@pytest.mark.parametrize(
    "change", [{"plan_margin": 0.0}, {"robot_radius": 0.2}, {"q_collision": 1e3}, {"estimate_w": 1.0}]
)
def test_an_evaluation_with_another_number_is_found(change: dict[str, float]) -> None:
    found = [
        difference(answer, Evaluation()(asked), TOLERANCE)
        for seed in range(6)
        for request in evaluations(seed, guarded())
        for asked, answer in [answered("evaluation", TrajectoryEvaluation(guarded(**change)), request)]
    ]
    assert any(found)


def test_a_modifier_that_draws_otherwise_is_found() -> None:
    reference, service = Modification(CASE), PathModification(guarded(), CASE.seed, CASE.number + 1)
    asked, answer = answered("modification", service, next(modifications()))
    assert difference(answer, reference(asked), TOLERANCE) != ""


def test_nothing_is_said_where_rounding_decides() -> None:
    request = ways(0, 1)
    path, start = request.paths[0], request.starts[0]
    path.n, path.x[:3], path.y[:3] = 3, [0.5, 1.0, 0.5], [0.5, 0.5, 0.5]  # back to where it came from
    start.x, start.y, start.heading, start.v = 0.5, 0.5, 0.0, 0.0
    request = request._replace(kinds=np.array([1]))
    asked, _ = answered("trajectory", TrajectoryGenerator(guarded()), request)
    assert Generator()(asked)["trajectories"] == [None]


@pytest.mark.parametrize("relation", relations(), ids=lambda one: one.name)
def test_a_relation_notices_another_answer(relation: Any) -> None:
    """The relations of the clean study hold (`run_functional`); an answer that is shifted breaks each of them."""
    service = {"mirrored ways": "TrajectoryGenerator"}.get(relation.name, "TrajectoryEvaluation")
    case = next(one for one in component_plan(0).cases() if service in _asked(one))
    assert run_functional(case).judgement.passed
    execution, changed = here()(case), here()(case, relation)
    assert relation.judge(execution.trace, changed.trace, message_of) == ""
    for event in changed.trace.events:
        if event.kind == "send" and isinstance(event.payload, messages.EvaluationResponse):
            event.payload.fitness[:] *= 1.01
        if event.kind == "send" and isinstance(event.payload, messages.TrajectoryResponse):
            name = "x" if "speed" in event.payload.trajectories.dtype.names else "duration"
            event.payload.trajectories[name] += 0.01
    assert f"relation {relation.name}" in relation.judge(execution.trace, changed.trace, message_of)


def _asked(case: Case) -> set[str]:
    """Return the services that the tester asks in a case, for ways or for an evaluation."""
    supplied = [
        event for event in here()(case).trace.events if event.kind == "send" and event.component == "environment"
    ]
    found = {"TrajectoryEvaluation" for event in supplied if isinstance(event.payload, EvaluationRequest)}
    return found | {"TrajectoryGenerator" for event in supplied if isinstance(event.payload, TrajectoryRequest)}

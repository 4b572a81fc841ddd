"""RAMP's messages into bytes and back: the same bits, the same behaviour, and BadRequest for anything else."""

from __future__ import annotations

import dataclasses
import functools
import math
import struct
from array import array
from collections.abc import Callable, Iterator
from typing import Any

import numba
import numpy as np

from parcours.abtc import serialise
from parcours_ramp.components.model import component_model
from parcours_ramp.components.study import component_plan, interaction_cases
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.planner.control import CONTROL, command, follow
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.messages import (
    EPOCH,
    LEG,
    MODIFICATION,
    OBSTACLE_STATE,
    PATH,
    PIECE,
    POSE,
    PREDICTION,
    TRAJECTORY,
    EvaluationRequest,
    EvaluationResponse,
    ModificationRequest,
    Obstacles,
    StateReport,
    Tag,
    TrajectoryRequest,
    TrajectoryResponse,
    many,
    one,
)
from parcours_ramp.planner.parameters import guarded, original
from parcours_ramp.planner.prediction import predict
from parcours_ramp.planner.trajectory import copy_trajectory, pose_at, samples
from parcours_ramp.planner.trajectory_evaluation import TrajectoryEvaluation, evaluate
from parcours_ramp.planner.wire import FORMS, decode, encode, flatten, restore
from parcours_ramp.system.component_form import run_components, system_links
from parcours_ramp.system.study import system_study

Sent = tuple[str, Any]
TAG = Tag("sensing", 3)

type_of: Callable[[object], object] = numba.typeof
"""What a compiled function is compiled for."""


@functools.cache
def sent() -> tuple[Sent, ...]:
    """Return what was really sent in a run of each schedule, and what the tester of components supplies."""
    found: list[Sent] = []
    for schedule in ("guarded", "original"):
        study = dataclasses.replace(system_study(schedule, seed=3), latencies=none())
        events = run_components(study, 4, 6.0).trace.events
        found += [(event.channel, event.payload) for event in events if event.kind == "send"]
    for case in list(component_plan(seed=4).cases())[::7]:
        tester = ComponentTester(case)
        events_of = serialise(interaction_cases()[case.abstract])
        received = [event for event in events_of if event.receives is not None and event.receives.event is None]
        found += [(event.receives.channel, tester.supply(event)) for event in received if event.receives is not None]
    return tuple(found)


@functools.cache
def greatest(channel: str) -> Any:
    """Return the payload that was sent on the channel and has the most to it."""
    return max((payload for name, payload in sent() if name == channel), key=lambda p: len(encode(channel, p)))


def bits(value: object) -> object:
    """Return what the value holds, bit by bit, without what lies beyond the counts of records."""
    if isinstance(value, np.ndarray | np.void) and value.dtype.names:
        table = np.asarray(value).reshape(-1)
        return tuple(_bits_of_record(record) for record in table) if isinstance(value, np.ndarray) else bits(table)
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, tuple):
        return type(value), tuple(bits(part) for part in value)
    return (type(value), struct.pack("d", value)) if isinstance(value, float) else (type(value), value)


def _bits_of_record(record: Any) -> tuple[object, ...]:
    counts = {"pieces": "n_pieces", "legs": "n_legs", "x": "n", "y": "n"}
    found: list[object] = []
    for name in record.dtype.names:
        part = record[name]
        if part.dtype.names:
            found += [_bits_of_record(each) for each in np.atleast_1d(part)[: _count(record, counts.get(name))]]
        else:
            found.append(part[: _count(record, counts.get(name))].tobytes() if part.ndim else part.tobytes())
    return tuple(found)


def _count(record: Any, name: str | None) -> int | None:
    return int(record[name]) if name in record.dtype.names else None


def test_the_forms_are_those_of_all_channels_of_the_model_and_of_the_whole_system() -> None:
    assert set(FORMS) == {link.channel for link in system_links()}
    assert set(FORMS) >= {channel.name for channel in component_model().channels}


def test_every_field_has_a_name_that_message_files_take_a_meaning_and_is_alone_of_its_name() -> None:
    for form in FORMS.values():
        assert len({field.name for field in form}) == len(form)
        for field in form:
            assert field.name.isidentifier() and field.name == field.name.lower() and "__" not in field.name
            assert not field.name.endswith("_") and field.name[0] != "_"
            assert field.doc


def test_every_channel_has_been_heard_in_the_runs() -> None:
    assert {channel for channel, _ in sent()} == set(FORMS)


def test_what_was_really_sent_comes_back_with_every_bit() -> None:
    for channel, payload in sent():
        back = decode(channel, encode(channel, payload))
        assert bits(back) == bits(payload), channel


def test_values_are_of_the_kinds_that_their_form_names() -> None:
    kinds = {"float": float, "int": int, "bool": bool}
    for channel, payload in sent():
        values = flatten(channel, payload)
        assert len(values) == len(FORMS[channel])
        for field, value in zip(FORMS[channel], values, strict=True):
            if isinstance(value, np.ndarray):
                assert value.dtype == {"floats": np.float64, "ints": np.int64}[field.kind]
                assert value.ndim == 1 and value.flags.c_contiguous and value.size % field.width == 0
            else:
                assert type(value) is kinds[field.kind]


def test_arrays_may_come_as_other_sequences_as_ros_gives_them() -> None:
    for channel in FORMS:
        payload = greatest(channel)
        for shape in (list, tuple, lambda v: array("d" if v.dtype == np.float64 else "q", v.tolist())):
            values = [shape(v.tolist() if shape in (list, tuple) else v) if isinstance(v, np.ndarray) else v
                      for v in flatten(channel, payload)]  # fmt: skip
            assert bits(restore(channel, values)) == bits(payload)


def test_what_comes_back_is_what_compiled_code_was_compiled_for_and_lies_in_memory_of_its_own() -> None:
    for channel, payload in sent()[::7]:
        data = encode(channel, payload)
        back = decode(channel, data)
        for name, part in _records_of(channel, payload):
            other = dict(_records_of(channel, back))[name]
            assert type_of(other) == type_of(part), (channel, name)
        values = flatten(channel, payload)
        before = encode(channel, back := restore(channel, values))
        for value in values:
            if isinstance(value, np.ndarray) and value.flags.writeable:
                value[...] = 0
        assert encode(channel, back) == before


def _records_of(channel: str, payload: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(payload, np.void):
        yield channel, payload
    for name, part in zip(getattr(payload, "_fields", ()), payload if isinstance(payload, tuple) else (), strict=False):
        if isinstance(part, np.ndarray | np.void):
            yield name, part
            if isinstance(part, np.ndarray) and part.dtype.names and len(part):
                yield name + "[0]", part[0]
        elif isinstance(part, Obstacles):
            yield from _records_of(channel, part)


# Nothing is read beyond the counts.


def soiled(trajectory: Any) -> Any:
    """Return the trajectory with something else beyond its counts."""
    other = trajectory.copy()
    other.pieces[int(other.n_pieces) :] = np.full(1, 7.5e3).repeat(PIECE.itemsize // 8).view(PIECE)[0]
    other.legs[int(other.n_legs) :] = np.full(1, -3.25).repeat(LEG.itemsize // 8).view(LEG)[0]
    return other


def soiled_prediction(prediction: Any) -> Any:
    other = prediction.copy()
    other.x[int(other.n) :], other.y[int(other.n) :] = math.nan, 1e300
    return other


def some_predictions() -> Any:
    predictions, state = many(PREDICTION, 4), one(OBSTACLE_STATE)
    for k, (v, w) in enumerate(((0.0, 0.0), (0.3, 0.0), (0.2, 0.7), (0.25, -2.0))):
        state.pose.x, state.pose.y, state.pose.heading, state.radius = 0.4 * k + 0.5, 0.9, -0.8 * k, 0.2
        state.pose.v, state.pose.w = v, w
        predict(state, 12_000_000, predictions[k])
    return predictions


def test_a_trajectory_that_came_back_behaves_bit_by_bit_as_the_one_sent(ways: list[Any]) -> None:
    predictions = some_predictions()
    dirty = predictions.copy()
    for k in range(len(dirty)):
        dirty[k] = soiled_prediction(predictions[k])
    differing = 0
    for way in ways[::5]:
        given, asked = soiled(way.trajectory), many(TRAJECTORY, 1)
        given.begins, given.lag, given.id = 700_000_001, 5, 12
        asked[0] = given
        request = EvaluationRequest(TAG, asked, dirty, (0.01, -0.02), 0.3, False)
        back = decode("evaluation_request", encode("evaluation_request", request))
        returned = back.trajectories[0]
        differing += returned.tobytes() != given.tobytes()
        assert samples(returned).tobytes() == samples(given).tobytes()
        epoch = one(EPOCH)
        epoch.number, epoch.changed = 4, 0.1
        for parameters in (guarded(), original()):
            answers = [TrajectoryEvaluation(parameters).answer(each) for each in (request, back)]
            assert bits(answers[0]) == bits(answers[1])
            windowed = [each._replace(window=(600_000_000, 1, 31, 0.025, True)) for each in (request, back)]
            assert bits(TrajectoryEvaluation(parameters).answer(windowed[0])) == bits(
                TrajectoryEvaluation(parameters).answer(windowed[1])
            )
            results = []
            for trajectory, seen in ((given, dirty), (returned, back.predictions)):
                work, control, tail = trajectory.copy(), one(CONTROL), one(TRAJECTORY)
                record = parameters.record()
                evaluate(work, seen, epoch, 0.01, 0.0, 0.2, False, record)
                copy_trajectory(tail, work, min(int(work.n) - 1, 9))
                follow(control, work, 0, record)
                control.limit = 0.2
                command(control, way.start, 900_000_000, record)
                pose = one(POSE)
                pose_at(tail, 0.37, pose)
                results.append((_bits_of_record(work), _bits_of_record(tail), _bits_of_record(control), bits(pose)))
            assert results[0] == results[1]
    assert differing == len(ways[::5]), "the test is to soil what lies beyond the counts"


def test_what_an_evaluation_remembers_survives() -> None:
    trajectory, record = greatest("best_trajectory").copy(), guarded().record()
    epoch = one(EPOCH)
    epoch.number, epoch.changed, epoch.strayed = 6, 0.25, 0.125
    evaluate(trajectory, some_predictions()[:1], epoch, 0.01, -0.03, 0.2, False, record)
    assert trajectory.epoch == 6
    trajectory.begins, trajectory.lag, trajectory.slack = 2**62 + 1, -(2**40) - 1, math.inf
    back = decode("best_trajectory", encode("best_trajectory", trajectory))
    for name in (
        "epoch",
        "looked",
        "met_at",
        "valid_until",
        "sure_until",
        "slack",
        "tight",
        "later",
        "changed",
        "strayed",
        "drift_x",
        "drift_y",
        "begins",
        "lag",
        "id",
        "t_collision",
    ):
        assert back[name] == trajectory[name]


def test_negative_zero_denormal_numbers_and_the_ends_of_ints_survive() -> None:
    pose = one(POSE)
    pose.x, pose.y, pose.heading, pose.v = -0.0, 5e-324, math.nextafter(1.0, 2.0), 1.7976931348623157e308
    report = StateReport(-(2**63), pose, 2**63 - 1)
    assert bits(decode("update", encode("update", report))) == bits(report)
    assert decode("speed_limit", encode("speed_limit", math.inf)) == math.inf


def test_what_lies_beyond_the_counts_does_not_travel_and_is_zero_afterwards() -> None:
    trajectory = soiled(greatest("best_trajectory"))
    assert encode("best_trajectory", trajectory) == encode("best_trajectory", greatest("best_trajectory"))
    back = decode("best_trajectory", encode("best_trajectory", trajectory))
    assert not np.any(back.pieces[int(back.n_pieces) :].view(np.int64))
    assert not np.any(back.legs[int(back.n_legs) :].view(np.int64))


def test_an_empty_message_comes_back_empty() -> None:
    for channel, payload in (
        ("odometry", Obstacles(1, many(OBSTACLE_STATE, 0))),
        ("trajectory_request", TrajectoryRequest(TAG, obstacles=Obstacles(4, many(OBSTACLE_STATE, 0)))),
        ("trajectory_request", TrajectoryRequest(TAG, many(PATH, 0), many(POSE, 0), np.zeros(0, np.int64))),
        ("trajectory_response", TrajectoryResponse(TAG, many(TRAJECTORY, 0))),
        ("evaluation_response", EvaluationResponse(TAG, np.zeros(0, np.int64), np.zeros(0), np.zeros(0))),
    ):
        assert bits(decode(channel, encode(channel, payload))) == bits(payload)


def test_both_parents_of_a_crossover_survive() -> None:
    modification = one(MODIFICATION)
    for n, path in ((3, modification.first), (7, modification.second)):
        path.n, path.x[:n], path.y[:n] = n, np.arange(n) / 7.0, -np.arange(n) / 3.0
    modification.operator, modification.direction, modification.distance = 4, -1.25, 9999.0
    request = ModificationRequest(Tag("planning", 2**40), modification)
    assert bits(decode("modification_request", encode("modification_request", request))) == bits(request)

"""RAMP's own traces recorded and read back: the same events, the same bits in every payload, the same verdict."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from parcours.run.recording import read_recording, write_recording
from parcours.run.trace import Trace, durations
from parcours_ramp.components.oracles import ORACLES
from parcours_ramp.components.study import (
    Functional,
    component_plan,
    interaction_of,
    paper_sample,
    run_functional,
)
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.wire import FORMS, FormField, flatten, restore
from parcours_ramp.system.component_form import run_components
from parcours_ramp.system.study import system_study

both = pytest.mark.parametrize("form", ("mcap", "bag"))


class Wire:
    """RAMP's messages as they travel."""

    def form(self, channel: str) -> Sequence[FormField] | None:
        return FORMS.get(channel)

    def flatten(self, channel: str, payload: object) -> Sequence[object]:
        return flatten(channel, payload)

    def restore(self, channel: str, values: Sequence[object]) -> object:
        return restore(channel, values)


WIRE = Wire()


def bits(trace: Trace) -> list[object]:
    """Return every payload's values, as bytes."""
    return [
        None
        if event.payload is None or not event.channel
        else [np.asarray(one).tobytes() for one in flatten(event.channel, event.payload)]
        for event in trace.events
    ]


def one_case_an_interaction() -> list[Functional]:
    cases = {interaction_of(case): case for case in paper_sample(component_plan())}
    return [run_functional(case) for case in cases.values()]


@both
def test_a_component_case_is_judged_the_same_from_its_recording(form: str, tmp_path: Path) -> None:
    judged = 0
    for ran in one_case_an_interaction():
        path = tmp_path / f"run.{form}"
        write_recording(path, ran.execution.trace, WIRE, about={"verdict": ran.judgement.verdict.value})
        again = read_recording(path, WIRE)
        assert again.complete and again.trace == ran.execution.trace
        assert bits(again.trace) == bits(ran.execution.trace)
        judgement = ORACLES[interaction_of(ran.case)](again.trace)
        assert judgement == ran.judgement and again.about["verdict"] == judgement.verdict.value
        judged += 1
    assert judged == 6


@both
def test_a_system_case_reads_back_with_all_its_messages(form: str, tmp_path: Path) -> None:
    study = dataclasses.replace(system_study("guarded", seed=3), latencies=none())
    trace = run_components(study, 4, 2.0).trace
    path = tmp_path / f"run.{form}"
    write_recording(path, trace, WIRE)
    again = read_recording(path, WIRE)
    assert again.complete and again.left_out == () and again.trace == trace
    assert bits(again.trace) == bits(trace)
    assert {event.channel for event in trace.events if event.payload is not None} >= {
        "pose", "best_trajectory", "trajectory_request", "evaluation_response", "cmd_vel", "obstacles",
    }  # fmt: skip
    assert durations(again.trace, "p12", "p12") == durations(trace, "p12", "p12") != ()

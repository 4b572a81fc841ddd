"""Recordings of component cases: judged again by what is recorded alone, and not fooled by what was changed in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import BadResults
from parcours.run.clocks import WallClock
from parcours.run.recording import Recorder, read_recording, write_recording
from parcours.run.trace import TraceEvent
from parcours.study.components.archive import Archive, Form
from parcours.study.components.archive import rejudge as rejudge_of
from parcours.study.protocol import Rejudged
from parcours.verdict.judgement import Judgement, Verdict
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.components.study import (
    Functional,
    component_plan,
    component_study,
    here,
    interaction_of,
    paper_sample,
    run_functional,
    run_timing,
)
from parcours_ramp.planner.messages import TrajectoryResponse

both = pytest.mark.parametrize("form", ("mcap", "bag"))


def archive_in(folder: Path, form: str) -> Archive:
    return Archive(component_study(), folder, form, "here", {})


def rejudge(path: Path) -> Rejudged:
    return rejudge_of(component_study(), path)


def one_case(itp: str) -> Functional:
    case = next(case for case in paper_sample(component_plan(3)) if interaction_of(case) == itp)
    return run_functional(case, here(WallClock))


@both
def test_functional_cases_earn_their_verdict_again(form: Form, tmp_path: Path) -> None:
    archive = archive_in(tmp_path, form)
    for itp in ("ITP1", "ITP2", "ITP3", "ITP4", "ITP5", "ITP6"):
        run = one_case(itp)
        archive.functional(run)
        judged = rejudge(archive.path("functional", run.case.id))
        assert judged.agrees and judged.judgement == run.judgement
        assert (judged.case, judged.recorded) == (run.case.id, "pass")


@both
def test_a_failed_case_is_failed_again(form: Form, tmp_path: Path) -> None:
    run = one_case("ITP1")
    events = (*run.execution.trace.events, TraceEvent(10**12, "deviation", text="x"))
    deviated = replace(run.execution.trace, events=events)
    failed = Functional(run.case, replace(run.execution, trace=deviated), Judgement(Verdict.FAIL, "x"))
    archive = archive_in(tmp_path, form)
    archive.functional(failed)
    judged = rejudge(archive.path("functional", run.case.id))
    assert judged.agrees and judged.judgement == failed.judgement


@both
def test_a_timing_case_of_many_repeats_earns_its_verdict_again(form: Form, tmp_path: Path) -> None:
    archive = archive_in(tmp_path, form)
    timed = list(
        run_timing(paper_sample(component_plan(3)), here(WallClock), repeats=1, warm_up=0, listener=archive.repeat)
    )
    for one in timed:
        archive.timing(one)
        judged = rejudge(archive.path("timing", one.case.id))
        assert judged.agrees and judged.judgement == one.judgement
        assert read_recording(archive.path("timing", one.case.id), RampCodec()).trace.noise == one.noise
    assert len(timed) == 60


def test_a_timing_case_that_was_cut_off_is_inconclusive(tmp_path: Path) -> None:
    archive = archive_in(tmp_path, "mcap")
    run = one_case("ITP4")
    archive.repeat(run.case, run.execution.trace)
    archive.repeat(run.case, run.execution.trace)
    judged = rejudge(archive.path("timing", run.case.id))
    assert judged.judgement.verdict is Verdict.INCONCLUSIVE and "incomplete" in judged.judgement.why
    assert not judged.agrees


Change = Callable[[tuple[TraceEvent, ...]], list[TraceEvent]]


def without(kind: str) -> Change:
    """Take out the first event of a kind."""

    def change(events: tuple[TraceEvent, ...]) -> list[TraceEvent]:
        k = next(k for k, event in enumerate(events) if event.kind == kind)
        return [*events[:k], *events[k + 1 :]]

    return change


def swapped(events: tuple[TraceEvent, ...]) -> list[TraceEvent]:
    """Let the receiver take its first transition before the sender."""
    last = events[-1].time
    return [replace(one, time=one.time + last + 1) if one.component.endswith("#0") else one for one in events]


def shortened(events: tuple[TraceEvent, ...]) -> list[TraceEvent]:
    """Shorten every trajectory that was answered to two points."""
    changed: dict[int, object] = {}
    made = []
    for event in events:
        payload = event.payload
        if isinstance(payload, TrajectoryResponse) and len(payload.trajectories):
            if id(payload) not in changed:
                trajectories = np.copy(payload.trajectories).view(np.recarray)
                trajectories["n"] = 2
                changed[id(payload)] = payload._replace(trajectories=trajectories)
            payload = changed[id(payload)]
        made.append(replace(event, payload=payload))
    return made


CHANGES: dict[str, tuple[Change, Verdict]] = {
    "a transition taken out": (without("take"), Verdict.FAIL),
    "times exchanged": (swapped, Verdict.INCONCLUSIVE),
    "a payload changed": (shortened, Verdict.FAIL),
}


@both
@pytest.mark.parametrize("what", CHANGES)
def test_what_was_changed_in_a_recording_changes_its_verdict(form: str, what: str, tmp_path: Path) -> None:
    run = one_case("ITP1")
    change, verdict = CHANGES[what]
    events = sorted(change(run.execution.trace.events), key=lambda event: event.time)
    whole = archive_in(tmp_path, "mcap")
    whole.functional(run)
    about = dict(read_recording(whole.path("functional", run.case.id), RampCodec()).about)
    path = tmp_path / f"changed.{form}"
    write_recording(path, replace(run.execution.trace, events=tuple(events)), RampCodec(), about=about)
    judged = rejudge(path)
    assert judged.recorded == "pass" and judged.judgement.verdict is verdict and not judged.agrees


@pytest.mark.parametrize("about", [
    {}, {"kind": "dream"}, {"kind": "functional"}, {"kind": "functional", "case": "{"},
    {"kind": "functional", "case": '{"study": 3}'}, {"kind": "system"}, {"kind": "system", "system": "[]"},
    {"kind": "system", "system": "nothing"}, {"kind": "timing"}, {"kind": "timing", "bound": "soon"},
])  # fmt: skip
def test_a_recording_that_does_not_say_of_which_case_it_is_is_refused(about: dict[str, str], tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path, RampCodec(), clock="wall", about=about) as recorder:
        recorder.write(TraceEvent(1, "take", "Planner#0", "p11"))
    with pytest.raises(BadResults, match="recording-case"):
        rejudge(path)

"""System cases in real time: what was seen is made anew from the trace alone, byte for byte, and judged the same."""

from __future__ import annotations

import contextlib
import dataclasses
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from parcours.errors import HostFailure
from parcours.run.faults import parse_plan
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.recording import Recorder, read_recording
from parcours.run.trace import Trace, TraceEvent
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.planner.component_factory import COMPONENTS
from parcours_ramp.planner.wire import flatten
from parcours_ramp.system.component_form import system_links
from parcours_ramp.system.live import LiveRun, rerun, run_live
from parcours_ramp.system.live_results import rejudge, system_about
from parcours_ramp.system.study import SystemStudy, system_study

NODE_PROGRAM, NUMBER = "parcours_ramp.system.live:SystemNodeProgram", 3


@pytest.fixture(scope="module")
def study() -> SystemStudy:
    return replace(system_study("guarded", seed=2), time_limit=0.5)


@pytest.fixture(scope="module")
def transport() -> Iterator[ProcessTransport]:
    transport = opened()
    yield transport
    transport.close()


def opened() -> ProcessTransport:
    """Start nodes that load code when they need it."""
    return ProcessTransport(nodes_of(system_links(), COMPONENTS, NODE_PROGRAM), ["parcours_ramp.system.live"])


@pytest.fixture(scope="module")
def recorded(
    study: SystemStudy, transport: ProcessTransport, tmp_path_factory: pytest.TempPathFactory
) -> tuple[LiveRun, Path]:
    """Return a case that was run, and its recording."""
    path = tmp_path_factory.mktemp("recorded") / "system.mcap"
    about = system_about("guarded", 2, NUMBER, study.cases.protocol, study.time_limit)
    run_live(study, NUMBER, transport, RampCodec())  # loads the code in the nodes
    case = study.cases.id(NUMBER)
    with Recorder(path, RampCodec(), clock="wall", host="processes", case=case, about=about) as recorder:
        run = run_live(study, NUMBER, transport, RampCodec(), listener=recorder.write)
        recorder.conclude(about={"verdict": str(run.judgement.verdict), "why": run.judgement.why})
    return run, path


def same(one: LiveRun, other: LiveRun) -> bool:
    return (
        one.facts.tobytes() == other.facts.tobytes()
        and one.track.tobytes() == other.track.tobytes()
        and one.places.tobytes() == other.places.tobytes()
        and (one.deaths, one.judgement) == (other.deaths, other.judgement)
    )


def test_a_live_case_is_lived_by_all_components(recorded: tuple[LiveRun, Path]) -> None:
    run, _ = recorded
    assert run.deaths == {} and run.trace.clock == "wall" and run.trace.host == "processes"
    acting = {event.component for event in run.trace.events if event.kind in ("take", "send", "receive")}
    assert {*COMPONENTS, "World"} <= acting
    assert int(run.facts[0]["t_end"]) >= 500_000_000 and len(run.track) > 10
    assert int(run.facts[0]["n_control_cycles"]) > 0


def test_a_case_made_anew_from_its_trace_has_the_same_facts_byte_for_byte(
    recorded: tuple[LiveRun, Path], study: SystemStudy
) -> None:
    run, path = recorded
    assert same(rerun(study, NUMBER, run.trace), run)
    read = read_recording(path, RampCodec())
    assert read.complete and bits(read.trace) == bits(run.trace)
    assert same(rerun(study, NUMBER, read.trace), run)


def bits(trace: Trace) -> list[tuple[object, ...]]:
    """Return every event with the bytes of its payload, events of one instant in a fixed order."""
    carrying = [e if e.channel else dataclasses.replace(e, payload=None) for e in trace.events]
    told = [
        (e.time, e.kind, e.component, e.transition, e.channel, e.message, e.text, [] if e.payload is None else [
            np.asarray(value).tobytes() for value in flatten(e.channel, e.payload)])
        for e in carrying
    ]  # fmt: skip
    return sorted(told, key=repr)


def test_its_recording_is_judged_the_same(recorded: tuple[LiveRun, Path]) -> None:
    run, path = recorded
    judged = rejudge(path)
    assert judged.agrees and judged.judgement == run.judgement


def rewritten(path: Path, to: Path, change: Callable[[tuple[TraceEvent, ...]], list[TraceEvent]]) -> Path:
    """Write the recording anew with its events changed, in a file that is sound by itself."""
    read = read_recording(path, RampCodec())
    trace = read.trace
    with Recorder(to, RampCodec(), clock="wall", host=trace.host, case=trace.case, about=read.about) as recorder:
        for event in change(read.trace.events):
            recorder.write(event)
    return to


def test_commands_that_were_taken_out_of_a_recording_change_what_is_made_of_it(
    recorded: tuple[LiveRun, Path], study: SystemStudy, tmp_path: Path
) -> None:
    run, path = recorded

    def without_commands(events: tuple[TraceEvent, ...]) -> list[TraceEvent]:
        return [event for event in events if event.channel != "cmd_vel"]

    untouched = rewritten(path, tmp_path / "same.mcap", list)
    assert same(rerun(study, NUMBER, read_recording(untouched, RampCodec()).trace), run)
    spoilt = rewritten(path, tmp_path / "spoilt.mcap", without_commands)
    again = rerun(study, NUMBER, read_recording(spoilt, RampCodec()).trace)
    assert again.facts.tobytes() != run.facts.tobytes()
    assert rejudge(spoilt).judgement.why != run.judgement.why


def test_a_flipped_byte_is_noticed(recorded: tuple[LiveRun, Path], tmp_path: Path) -> None:
    content = bytearray(recorded[1].read_bytes())
    content[len(content) // 3] ^= 1
    spoilt = tmp_path / "flipped.mcap"
    spoilt.write_bytes(content)
    with pytest.raises(Exception, match=r"\[recording-[a-z-]+\]|\[mcap-[a-z-]+\]"):
        rejudge(spoilt)


def test_a_dead_component_fails_the_case_however_its_robot_fares_and_the_next_case_is_not_begun(
    study: SystemStudy,
) -> None:
    with contextlib.closing(opened()) as transport:
        run = run_live(study, NUMBER, transport, RampCodec(), faults=parse_plan("Planner: crash at 200 ms"))
        assert run.deaths == {"Planner": "killed by SIGKILL"}
        assert run.judgement.verdict is Verdict.FAIL
        assert run.judgement.why.startswith("dead at the end: Planner (killed by SIGKILL)")
        assert rerun(study, NUMBER, run.trace).judgement == run.judgement
        with pytest.raises(HostFailure, match=r"Planner: killed by SIGKILL.*node-gone"):
            run_live(study, NUMBER, transport, RampCodec())


def test_a_frozen_component_is_let_go_on_for_the_next_case(study: SystemStudy, transport: ProcessTransport) -> None:
    run = run_live(study, NUMBER, transport, RampCodec(), faults=parse_plan("Control: freeze at 300 ms"))
    assert run.deaths == {}
    [stopped] = [e.time for e in run.trace.events if e.text.startswith("fault")]
    acting = [e.time for e in run.trace.events if e.component == "Control" and e.kind in ("take", "receive")]
    assert acting and max(acting) < stopped + 50_000_000 < int(run.facts[0]["t_end"])
    again = run_live(study, NUMBER, transport, RampCodec())
    acting = [e.time for e in again.trace.events if e.component == "Control" and e.kind in ("take", "receive")]
    assert again.deaths == {} and max(acting) > stopped + 50_000_000


def test_a_node_killed_by_somebody_else_is_found_out(study: SystemStudy) -> None:
    with contextlib.closing(opened()) as transport:
        begun: list[int] = []

        def kill_it_once(event: TraceEvent) -> None:
            if event.time > 200_000_000 and not begun:
                begun.append(event.time)
                transport.signal("TrajectoryEvaluation", signal.SIGKILL)

        run = run_live(study, NUMBER, transport, RampCodec(), listener=kill_it_once)
        assert run.deaths == {"TrajectoryEvaluation": "killed by SIGKILL"} and run.judgement.verdict is Verdict.FAIL

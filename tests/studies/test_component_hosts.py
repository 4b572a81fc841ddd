"""The 67 component cases on nodes of their own: order kept, messages held, the same payloads and verdicts as ever."""

from __future__ import annotations

import functools
import signal
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from parcours.abtc import Event
from parcours.errors import HostFailure
from parcours.run.enforcement import Turn, disorder, enforce, instance_name
from parcours.run.hosts.live_enforcement import DrivenInstances
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.port import links
from parcours.run.trace import BESIDE, Trace, TraceEvent, held, transitions
from parcours.study.hosting import started
from parcours.suite import Case
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.model import component_model
from parcours_ramp.components.node_program import RampCodec
from parcours_ramp.components.study import (
    Functional,
    component_nodes,
    component_plan,
    component_study,
    here,
    interaction_of,
    judge_trace,
    on,
    run_functional,
)
from parcours_ramp.components.tester import ComponentTester
from parcours_ramp.planner.wire import FORMS, flatten

NODE_PROGRAM = "parcours_ramp.components.node_program:ComponentNodeProgram"
WARM = ["parcours_ramp.components.warm"]
CASES = tuple(component_plan(seed=5, rows=1).cases())


@functools.cache
def simulated() -> dict[str, Functional]:
    return {case.id: run_functional(case) for case in CASES}


@pytest.fixture(scope="module")
def transport() -> Iterator[ProcessTransport]:
    with started(component_nodes(), "processes") as hosted:
        assert isinstance(hosted.transport, ProcessTransport)
        yield hosted.transport


@pytest.fixture(scope="module", params=[True, False], ids=["strict", "as concurrent as allowed"])
def ran(request: pytest.FixtureRequest, transport: ProcessTransport) -> tuple[bool, list[Functional]]:
    execute = on(transport, RampCodec(), strict=request.param)
    return request.param, [run_functional(case, execute) for case in CASES]


def events_of(case: Case) -> tuple[Event, ...]:
    return component_study().events(case)


def stamps(case: Case, trace: Trace) -> list[int]:
    """Return when each event of the case was taken, by its position."""
    times: dict[str, list[int]] = defaultdict(list)
    for one in trace.events:
        if one.kind == "take":
            times[one.component].append(one.time)
    return [times[instance_name(event)].pop(0) for event in events_of(case)]


def test_every_case_keeps_its_order_on_the_real_clock(ran: tuple[bool, list[Functional]]) -> None:
    strict, runs = ran
    assert len(runs) == 67
    for run in runs:
        trace, events = run.execution.trace, events_of(run.case)
        assert run.execution.completed and run.execution.disorder == "", run.execution
        assert trace.clock == "wall" and trace.host == "processes, gated"
        times = stamps(run.case, trace)
        if strict:
            assert times == sorted(times)
            assert transitions(trace) == tuple(event.transition for event in events)
        for event in events:
            assert all(times[one] <= times[event.position] for one in event.after)
            assert event.before is None or times[event.position] <= times[event.before]


def test_every_message_between_references_is_held_until_its_turn(ran: tuple[bool, list[Functional]]) -> None:
    for run in ran[1]:
        trace = run.execution.trace
        bound = [event.receives for event in events_of(run.case) if event.receives and event.receives.event is not None]
        when: dict[str, dict[int, int]] = defaultdict(dict)
        for one in trace.events:
            when[one.kind][one.message] = one.time
        kept = held(trace)
        assert len(kept) == len(bound)
        for number, time_held in kept.items():
            assert when["send"][number] == when["hold"][number] <= when["release"][number] <= when["receive"][number]
            assert time_held == when["release"][number] - when["hold"][number]
    assert any(held(run.execution.trace) for run in ran[1])


def test_every_case_passes_as_it_does_in_simulated_time(ran: tuple[bool, list[Functional]]) -> None:
    for run in ran[1]:
        expected = simulated()[run.case.id].judgement
        assert run.judgement.verdict is expected.verdict is Verdict.PASS, (run.case.id, run.judgement.why)


def payloads(trace: Trace) -> dict[tuple[str, str, str], list[bytes]]:
    """Return what was sent, taken up and shown, by whom, bit by bit; without what is told of the time."""
    found: dict[tuple[str, str, str], list[bytes]] = defaultdict(list)
    for event in trace.events:
        is_timed = event.channel == "cmd_vel"  # a command depends on when it is given
        if event.payload is None or event.text == BESIDE or is_timed or not event.channel:
            continue
        values = list(flatten(event.channel, event.payload))
        for k, entry in enumerate(FORMS[event.channel]):
            if entry.name == "trajectory_numbers":
                numbers = np.array(values[k])
                numbers[2:3] = 0  # when it begins
                values[k] = numbers
            elif entry.name in ("window_first", "window_last"):
                values[k] = 0  # which of its samples are still to come
        found[event.kind, event.component, event.channel].append(b"".join(np.asarray(one).tobytes() for one in values))
    return found


@pytest.mark.parametrize("strict", [True, False], ids=["strict", "as concurrent as allowed"])
def test_every_payload_is_bit_for_bit_that_of_simulated_time(strict: bool) -> None:
    """What is planned depends on how late it is, which a busy machine decides: so time passes slowly here."""
    with started(replace(component_nodes(), node_program="slow_time:SlowNodeProgram"), "processes") as hosted:
        execute = on(hosted.transport, RampCodec(), strict=strict)
        runs = [run_functional(case, execute) for case in CASES]
    compared = 0
    for run in runs:
        expected, given = payloads(simulated()[run.case.id].execution.trace), payloads(run.execution.trace)
        for of in (expected, given):
            for key in [key for key in of if key[0] in ("hold", "release")]:
                del of[key]
        assert given == expected, run.case.id
        compared += sum(map(len, given.values()))
    assert compared > 500


@pytest.mark.parametrize("number", range(0, 67, 7))
def test_stamps_that_contradict_the_order_are_inconclusive_never_a_pass(number: int) -> None:
    run = simulated()[CASES[number].id]
    events = events_of(run.case)
    names = [instance_name(event) for event in events]
    pairs = [(one, event.position) for event in events for one in event.after if names[one] != names[event.position]]
    assert pairs and run.judgement.passed
    for first, second in pairs:
        trace = delayed(run, first, second)
        assert disorder(events, trace).startswith(f"event {first} must come before event ")
        judged = judge_trace(run.case, trace)
        assert judged.verdict is Verdict.INCONCLUSIVE and "order not enforced" in judged.why


def delayed(run: Functional, first: int, second: int) -> Trace:
    """Return the trace with everything of the first event's instance from then on stamped after the second."""
    trace, events = run.execution.trace, events_of(run.case)
    times = stamps(run.case, trace)
    name, late = instance_name(events[first]), times[second] - times[first] + 1
    moved: list[TraceEvent] = [
        replace(one, time=one.time + late) if one.component == name and one.time >= times[first] else one
        for one in trace.events
    ]
    return replace(trace, events=tuple(sorted(moved, key=lambda one: one.time)))


def test_a_trace_that_lacks_or_doubles_a_transition_fails() -> None:
    run = simulated()[CASES[0].id]
    events = run.execution.trace.events
    [first, *_] = [k for k, one in enumerate(events) if one.kind == "take"]
    for spoilt in (events[:first] + events[first + 1 :], events[: first + 1] + events[first:]):
        judged = judge_trace(run.case, replace(run.execution.trace, events=spoilt))
        assert judged.verdict is Verdict.FAIL and "must take" in judged.why


class Striking(DrivenInstances):
    """Sends a signal to a node just before its k-th turn is granted."""

    def __init__(self, transport: ProcessTransport, tester: ComponentTester, node: str, number: int) -> None:
        super().__init__(transport, RampCodec(), tester)
        self._of, self._node, self._number, self._struck = transport, node, number, False

    def grant(self, turns: Sequence[Turn]) -> None:
        if turns[0].event.component == self._node and not self._struck:
            self._struck = True
            self._of.signal(self._node, self._number)
            while process_state(self._of.pids[self._node]) not in ("T", "Z", ""):
                time.sleep(0.001)
        super().grant(turns)


def process_state(pid: int) -> str:
    """Return the state of a process, T if stopped, Z if ended; empty if it is no more."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return ""


def test_a_planner_that_freezes_or_dies_in_the_middle_of_a_case_fails_it() -> None:
    model, case = component_model(), next(case for case in CASES if interaction_of(case) == "ITP1")
    transport = ProcessTransport(nodes_of(links(model), ["Planner", "TrajectoryGenerator"], NODE_PROGRAM), WARM)
    try:
        for number, got in (signal.SIGSTOP, "nothing within 1 s"), (signal.SIGKILL, "killed by SIGKILL"):
            tester = ComponentTester(case)
            events = events_of(case)
            instances = Striking(transport, tester, "TrajectoryGenerator", number)
            execution = enforce(events, instances, tester.supply, case=case.id, patience=1_000_000_000)
            judged = judge_trace(case, execution.trace)
            assert execution.deviation is not None
            assert judged.verdict is Verdict.FAIL and got in judged.why
            assert instance_name(execution.deviation.event).startswith("TrajectoryGenerator#")
            taken = transitions(execution.trace, instance_name(execution.deviation.event))
            assert execution.deviation.path == taken
            if number == signal.SIGSTOP:
                assert run_functional(case, on(transport, RampCodec())).judgement.passed, (
                    "let go on, it is as good as new"
                )
        with pytest.raises(HostFailure, match=r"TrajectoryGenerator.*SIGKILL.*node-gone"):
            on(transport, RampCodec())(case)
    finally:
        transport.close()


def test_nodes_give_what_the_same_case_gives_in_this_process_on_the_real_clock(transport: ProcessTransport) -> None:
    from parcours.run.clocks import WallClock

    for case in CASES[::20]:
        mine, theirs = here(WallClock)(case), on(transport, RampCodec())(case)
        assert mine.completed and theirs.completed
        assert transitions(mine.trace) == transitions(theirs.trace)

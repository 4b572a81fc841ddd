"""Faults in real time: what befalls which message is what the plan foretells, and the same as in simulated time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial

import pytest

from parcours.errors import BadRequest
from parcours.run.faults import Effects, FaultPlan, parse_plan
from parcours.run.hosts.battery import Counting, Sink, Source
from parcours.run.hosts.node_program import Plain, nodes_of
from parcours.run.hosts.processes import ProcessTransport
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.simulated import SimulatedHost
from parcours.run.port import ENVIRONMENT, Link, LinkKind, Send
from parcours.run.trace import Trace, TraceEvent

MS, S = 1_000_000, 1_000_000_000
LINKS = (
    Link("numbers", "Source", "Sink", 1000, LinkKind.SERVICE),
    Link("seen", "Sink", ENVIRONMENT, 1000),
    Link("ask", ENVIRONMENT, "Counting", 1000, LinkKind.SERVICE),
    Link("answer", "Counting", ENVIRONMENT, 1000),
)
NODES = ["Source", "Sink", "Counting"]


class Numbers(Plain):
    """Messages of one number, with their flat form."""

    def __init__(self, component: str = "") -> None:
        super().__init__(component, {"Source": Source, "Sink": Sink, "Counting": Counting})

    def flatten(self, channel: str, payload: object) -> tuple[object, ...]:
        return (float(str(payload)),)

    def restore(self, channel: str, values: Sequence[object]) -> object:
        return values[0]


@pytest.fixture(scope="module")
def transport() -> Iterator[ProcessTransport]:
    transport = started()
    yield transport
    transport.close()


def started() -> ProcessTransport:
    return ProcessTransport(
        nodes_of(LINKS, NODES, "parcours.run.hosts.battery:node_program"),
        ["parcours.run.hosts.battery"],
    )


def real(transport: ProcessTransport, plan: str, *asks: int, until: int = 20 * S) -> tuple[Trace, dict[str, str]]:
    """Run the pipe of the battery under the plan, ask Counting at these times; return trace and deaths."""
    host = RealTimeHost(transport, LINKS, Numbers(), faults=parse_plan(plan))
    for at in asks:
        host.inject("ask", 0, at)
    host.run(until)
    host.rest()
    return host.trace(), host.deaths


def simulated(plan: str) -> Trace:
    host = SimulatedHost((Source(), Sink(), Counting()), LINKS, faults=parse_plan(plan), codec=Numbers())
    host.run(20 * S)
    return host.trace()


def story(trace: Trace, channel: str) -> dict[str, list[str]]:
    """Return, by kind of event, the payloads on a channel in order."""
    kinds = ("send", "receive", "drop")
    return {kind: [repr(e.payload) for e in trace.events if (e.kind, e.channel) == (kind, channel)] for kind in kinds}


PLANS = {
    "drop": "seed: 3; numbers: drop 30 %; seen: drop 20 %",
    "delay": "seed: 3; numbers: delay 40 % by 2 ms",
    "delay of the answer": "seed: 8; seen: delay 30 % by 3 ms",
    "jitter": "seed: 4; numbers: jitter 5 ms",
    "duplicate": "seed: 5; numbers: duplicate 30 %; seen: duplicate 40 %",
    "corrupt": "seed: 6; numbers: corrupt sign 40 %; seen: corrupt scale 30 %",
    "some messages": "seed: 7; numbers: drop messages 5 to 9; seen: corrupt nan messages 0",
    "all at once": "seed: 9; numbers: drop 20 %; numbers: jitter 2 ms; numbers: corrupt 20 %; numbers: duplicate 20 %",
}


@pytest.mark.parametrize("kind", PLANS)
def test_the_same_messages_meet_the_same_effect_as_in_simulated_time(transport: ProcessTransport, kind: str) -> None:
    trace, deaths = real(transport, PLANS[kind])
    expected = simulated(PLANS[kind])
    assert deaths == {}
    for channel in ("numbers", "seen"):
        assert story(trace, channel) == story(expected, channel)


@pytest.mark.parametrize("kind", PLANS)
def test_the_trace_says_of_each_message_what_has_befallen_it(transport: ProcessTransport, kind: str) -> None:
    trace, _ = real(transport, PLANS[kind])
    effects = Effects(parse_plan(PLANS[kind]))
    for channel in ("numbers", "seen"):
        of = [event for event in trace.events if event.channel == channel]
        sent = sorted({event.message for event in of if event.kind == "send"})
        for k, number in enumerate(sent):
            effect = effects.effect(channel, k, 0)
            mine = [event for event in of if event.message == number]
            check(mine, effect.copies, effect.why, channel)


def check(events: list[TraceEvent], copies: tuple[int, ...], why: str, channel: str) -> None:
    counted = Counter(event.kind for event in events)
    assert counted["receive"] == len(copies) and counted["send"] == 1
    said = [event.text for event in events if event.text]
    if not copies:
        assert (counted["drop"], said) == (1, ["fault: lost"])
        return
    assert counted["drop"] == 0 and said == ([f"fault: {channel} {why}"] if why else [])
    [send] = [event.time for event in events if event.kind == "send"]
    assert min(event.time for event in events if event.kind == "receive") >= send + min(copies)


def test_a_message_held_back_is_overtaken_and_one_doubled_comes_again_later(transport: ProcessTransport) -> None:
    trace, _ = real(transport, "numbers: reorder 250 ms messages 3; seen: duplicate 250 ms messages 0")
    got = [event.payload for event in trace.events if (event.kind, event.channel) == ("receive", "numbers")]
    assert got == [k for k in range(40) if k != 3] + [3]
    seen = [event.payload for event in trace.events if (event.kind, event.channel) == ("receive", "seen")]
    assert sorted(seen) == [0, *range(40)] and seen[0] == 0 and seen.index(0, 1) >= 39  # type: ignore[type-var]


def test_a_message_doubled_later_does_not_keep_the_others_waiting(transport: ProcessTransport) -> None:
    trace, _ = real(transport, "numbers: duplicate 400 ms messages 0")
    assert story(trace, "seen")["receive"] == [*map(str, range(40)), "0"]
    times = {event.payload: event.time for event in trace.events if (event.kind, event.channel) == ("receive", "seen")}
    assert times[39] < 400 * MS <= times[0], "of 0 the last time counts here: its copy"


def test_faults_in_force_for_a_while_befall_only_what_is_sent_then(transport: ProcessTransport) -> None:
    trace, _ = real(transport, "ask: drop from 20 ms to 40 ms", *(at * MS for at in range(0, 60, 5)))
    for event in trace.events:
        if event.kind == "send" and event.channel == "ask":
            lost = any(e.kind == "drop" and e.message == event.message for e in trace.events)
            assert lost == (20 * MS <= event.time < 40 * MS)
    assert len(story(trace, "ask")["send"]) == 12 and story(trace, "ask")["receive"]


def test_a_frozen_component_answers_when_it_goes_on(transport: ProcessTransport) -> None:
    trace, deaths = real(transport, "Counting: freeze at 20 ms for 150 ms", 60 * MS, 70 * MS)
    got = [event.time for event in trace.events if (event.kind, event.channel) == ("receive", "answer")]
    assert deaths == {} and len(got) == 2 and got[0] >= 170 * MS
    said = [(e.text, e.time) for e in trace.events if e.kind == "note"]
    assert [text for text, _ in said] == ["fault: stop", "fault: continue"]
    assert said[0][1] >= 20 * MS and said[1][1] >= 170 * MS


def test_a_slowed_down_component_stops_and_goes_on_by_turns_and_loses_nothing(transport: ProcessTransport) -> None:
    trace, deaths = real(transport, "Counting: slow down 4 x at 0 s for 200 ms", *(at * MS for at in range(0, 200, 10)))
    said = [event.text for event in trace.events if event.kind == "note"]
    assert said == ["fault: stop", "fault: continue"] * 10 and deaths == {}
    assert story(trace, "answer")["receive"] == [str(k) for k in range(1, 21)]


def test_a_crashed_component_is_dead_what_is_sent_to_it_lost_and_the_others_go_on() -> None:
    transport = started()
    try:
        trace, deaths = real(transport, "Counting: crash at 50 ms", 10 * MS, 250 * MS)
        assert deaths == {"Counting": "killed by SIGKILL"}
        assert [e.text for e in trace.events if e.component == "Counting" and e.kind in ("note", "drop")] == [
            "fault: kill", "died: killed by SIGKILL", "its receiver is dead",
        ]  # fmt: skip
        assert story(trace, "answer")["receive"] == ["1"] and story(trace, "seen")["receive"] == [*map(str, range(40))]
    finally:
        transport.close()


def test_a_fault_of_what_is_no_node_is_refused_before_anything_runs(transport: ProcessTransport) -> None:
    make = partial(RealTimeHost, transport, LINKS, Numbers())
    for plan in ("nobody: crash at 1 s", "environment: crash at 1 s", "nothing: drop 1 %"):
        with pytest.raises(BadRequest, match="fault-unknown-name"):
            make(faults=parse_plan(plan))


def test_a_plan_without_faults_changes_nothing(transport: ProcessTransport) -> None:
    seen: list[Send] = []

    def tester(channel: str, payload: object, now: int) -> Sequence[Send]:
        seen.append((channel, payload))
        return ()

    host = RealTimeHost(transport, LINKS, Numbers(), faults=FaultPlan(3), environment=tester)
    host.run(20 * S)
    host.rest()
    assert seen == [("seen", k) for k in range(40)]
    assert {event.kind for event in host.trace().events} == {"take", "send", "receive"}

"""What needs no ROS of testing foreign nodes: who sits where, the relay, conformance from outside, the world."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from message_classes import defined_types
from parcours.errors import BadRequest, HostFailure
from parcours.run.binding import Binding, RegisteredGraph, compile_binding, graph_findings, parse_binding, read_binding
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.graph import Quality
from parcours.run.binding.in_transit import BEGINS, CONTINUED, MADE, STALLED, STOPPED, Answered, RawMessage
from parcours.run.binding.relay import Relay
from parcours.run.binding.slots import SlotPlan, Spoke, apart, whole
from parcours.run.binding.structure import BoundEntry
from parcours.run.faults.text import parse_plan
from parcours.run.recording import Raw
from parcours.run.trace import TraceEvent
from parcours.study.journal import Journal
from parcours.verdict.timing import NEVER as TIMED_OUT
from parcours_navigation.facts import NEVER
from parcours_navigation.foreign.cases import abstract_scenes, find_scenes
from parcours_navigation.foreign.conforming import SLACK, Conformers, visible
from parcours_navigation.foreign.judging import JudgedCase
from parcours_navigation.foreign.quiescence import proposals, silences
from parcours_navigation.foreign.results import Result, RosResults, tables, waterfalls
from parcours_navigation.foreign.timing import durations, spans, steps, timed
from parcours_navigation.foreign.world import CaseKey, ForeignWorld

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros1_python" / "binding.yaml"
MS = 1_000_000


@pytest.fixture(scope="module")
def binding() -> Binding:
    """The example's."""
    return read_binding(EXAMPLE)


def test_each_reference_of_a_case_has_a_process_behind_names_of_its_own(binding: Binding) -> None:
    slot_plan = apart(binding, {0: "Follower", 1: "Planner", 2: "Follower"})
    assert [slot.name for slot in slot_plan.slots] == ["Follower#0", "Planner#1", "Follower#2"]
    first, _, second = slot_plan.slots
    assert (first.ros_node, second.ros_node) == ("/follower", "/follower_2")
    assert "__name:=follower_2" in second.arguments("ros1")
    names = [{name for _, name in slot.remap} for slot in (first, second)]
    assert names[0].isdisjoint(names[1])
    assert "/plan:=/parcours/out/Follower_2/plan" in second.arguments("ros1")


def test_a_node_of_somebody_else_cannot_be_two_references() -> None:
    text = EXAMPLE.read_text().replace("command: [/usr/bin/python3, follower.py]", "running: true")
    for topic in ("/obstacles", "/plan"):
        text = text.replace(f": {topic}\n", f": {topic}\n    out: /theirs{topic}\n    in: /mine{topic}\n")
    theirs = parse_binding(text, str(EXAMPLE))
    with pytest.raises(HostFailure, match="it is not started here"):
        apart(theirs, {0: "Follower", 1: "Planner", 2: "Follower"})


@dataclass
class _Graph:
    """Ends that remember what they were given, at a time that stands until it is moved."""

    time: int = 0
    said: list[tuple[str, bytes]] = field(default_factory=list)
    asked: list[tuple[str, bytes, Answered]] = field(default_factory=list)

    def say(self, spoke: Spoke, data: bytes) -> int:
        self.said.append((spoke.address, data))
        return 0

    def ask(self, spoke: Spoke, data: bytes, answered: Answered) -> None:
        self.asked.append((spoke.address, data, answered))

    def abandon(self, spoke: Spoke, answered: Answered) -> None:
        self.asked.clear()

    def now(self) -> int:
        return self.time


def _relay(binding: Binding, faults: str = "") -> tuple[Relay, _Graph, SlotPlan]:
    graph, slot_plan = _Graph(), whole(binding)
    relay = Relay(binding, slot_plan, graph, lambda channel: Raw(channel, "*", "", b""), graph.now, parse_plan(faults))
    relay.case_began = 0
    return relay, graph, slot_plan


def _out(slot_plan: SlotPlan, channel: str) -> Spoke:
    return next(one for one in slot_plan.spokes if one.side == "out" and channel in one.channels)


def _told(relay: Relay) -> list[tuple[str, str, str]]:
    return [(event.kind, event.component, event.channel) for event in relay.events]


def test_a_message_goes_on_before_anybody_is_told_of_it_and_remarks_keep_their_place(binding: Binding) -> None:
    graph, slot_plan, told = _Graph(), whole(binding), list[TraceEvent]()
    kind = lambda channel: Raw(channel, "*", "", b"")  # noqa: E731
    relay = Relay(binding, slot_plan, graph, kind, graph.now, listener=told.append)
    relay.heard(_out(slot_plan, "obstacles"), b"as it came")
    assert len(graph.said) == 2 and not told
    relay.note("meanwhile")
    relay.report()
    assert told == relay.events and [event.kind for event in told] == ["send", "receive", "send", "receive", "note"]


def test_one_topic_of_two_channels_reaches_both_receivers_unchanged(binding: Binding) -> None:
    relay, graph, slot_plan = _relay(binding)
    relay.heard(_out(slot_plan, "obstacles"), b"as it came")
    assert graph.said == [("/parcours/in/Planner/obstacles", b"as it came"),
                          ("/parcours/in/Follower/obstacles", b"as it came")]  # fmt: skip
    assert _told(relay) == [
        ("send", "ObstacleFilter", "obstacles"), ("receive", "Planner", "obstacles"),
        ("send", "ObstacleFilter", "obstacles_near"), ("receive", "Follower", "obstacles_near"),
    ]  # fmt: skip


def test_a_call_is_passed_on_and_its_answer_comes_back(binding: Binding) -> None:
    relay, graph, slot_plan = _relay(binding)
    answers: list[bytes | None] = []
    relay.asked(_out(slot_plan, "plan_request"), b"ask", answers.append)
    [(address, data, answered)] = graph.asked
    assert (address, data, answers) == ("/plan", b"ask", [])
    answered(b"answer", "")
    assert answers == [b"answer"]
    assert _told(relay)[-1] == ("receive", "Follower", "plan_response")
    assert not relay.calls


@pytest.mark.parametrize(("faults", "late"), [("", 1000 * MS), ("plan_response: drop 100 %", 0)])
def test_a_call_without_an_answer_fails_for_its_client(binding: Binding, faults: str, late: int) -> None:
    relay, graph, slot_plan = _relay(binding, faults)
    answers: list[bytes | None] = []
    relay.asked(_out(slot_plan, "plan_request"), b"ask", answers.append)
    if faults:
        graph.asked[0][2](b"answer", "")
    graph.time = late + 1
    relay.agenda.do_what_is_due()
    assert answers == [None]
    assert "drop" in {event.kind for event in relay.events}


def test_a_delayed_message_keeps_its_place(binding: Binding) -> None:
    relay, graph, slot_plan = _relay(binding, "obstacles: delay 20 ms messages 0 to 0")
    for data in (b"first", b"second"):
        relay.heard(_out(slot_plan, "obstacles"), data)
    assert [data for address, data in graph.said if "Planner" in address] == []
    graph.time = 20 * MS
    relay.agenda.do_what_is_due()
    assert [data for address, data in graph.said if "Planner" in address] == [b"first", b"second"]


def test_what_is_kept_by_a_hook_goes_nowhere_until_it_is_released(binding: Binding) -> None:
    relay, graph, slot_plan = _relay(binding)
    kept: list[RawMessage] = []
    relay.arrived = kept.append
    relay.heard(_out(slot_plan, "obstacles"), b"x")
    assert (len(kept), graph.said) == (2, [])
    relay.release(kept[0])
    assert graph.said == [("/parcours/in/Planner/obstacles", b"x")]


TEXTS = {
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/PoseStamped": "Header header\nPose pose",
    "geometry_msgs/PoseArray": "Header header\nPose[] poses",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "nav_msgs/Odometry": "Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist",
    "nav_msgs/Path": "Header header\ngeometry_msgs/PoseStamped[] poses",
    "nav_msgs/GetPlan": "geometry_msgs/PoseStamped start\ngeometry_msgs/PoseStamped goal\nfloat32 tolerance\n---\n"
    "nav_msgs/Path plan",
    "std_msgs/Bool": "bool data",
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
}


@pytest.fixture
def follow(binding: Binding) -> Callable[..., Conformers]:
    """Follows a component through (time [ms], kind, channel) or (time [ms], note)."""
    compiled = compile_binding(binding, defined_types(TEXTS))

    def followed(name: str, events: Sequence[tuple[int, str, str]], until: int) -> Conformers:
        conformers = Conformers(compiled, [name], Decoder(binding, compiled.types))
        conformers.take(TraceEvent(0, "note", text=BEGINS))
        for time, kind, channel in events:
            is_note = kind == "note"
            component = "" if is_note and channel.startswith(STALLED) else name
            conformers.take(TraceEvent(
                time * MS, kind, component, channel="" if is_note else channel, text=channel if is_note else ""  # type: ignore[arg-type]
            ))  # fmt: skip
        conformers.take(until * MS)
        return conformers

    return followed


def test_messages_on_two_topics_may_come_in_the_other_order(follow: Callable[..., Conformers]) -> None:
    swapped = [(10, "send", "stopped"), (11, "send", "command"), (60, "send", "command"), (61, "send", "stopped")]
    assert not follow("Follower", swapped, 700).deviations


def test_a_message_whose_partner_never_comes_deviates(follow: Callable[..., Conformers]) -> None:
    late = 10 + SLACK // MS
    alone = [(10, "send", "stopped"), (late + 20, "receive", "odometry")]
    [found] = follow("Follower", alone, late + 30).deviations
    assert "stopped was sent, but nothing that it may do now sends it" in found.rule
    assert "send command" in {str(one) for one in found.expected}


@pytest.mark.parametrize(
    ("meanwhile", "is_silent"),
    [
        ([], True),
        ([(20, "note", f"{STALLED}{900 * MS}")], False),
        ([(20, "note", STOPPED), (920, "note", CONTINUED)], False),
        ([(500, "send", "obstacles"), (500, "send", "obstacles_near")], False),
    ],
)
def test_silence_counts_but_not_while_nothing_could_be_said(
    follow: Callable[..., Conformers], meanwhile: list[tuple[int, str, str]], is_silent: bool
) -> None:
    found = follow("ObstacleFilter", [(10, "receive", "detections"), *meanwhile], 1500).deviations
    assert [one.rule for one in found] == ["nothing came on obstacles within 1000 ms, but must"] * is_silent


def test_what_is_not_bound_is_left_out_of_the_model() -> None:
    text = EXAMPLE.read_text()
    begin, end = text.index("  stopped:\n    topic"), text.index("\ntiming:")
    text = text[:begin] + text[end:]
    text = text[: text.index("system:")]
    seen = visible(parse_binding(text, str(EXAMPLE)))
    sent = {send.channel for part in seen.components for one in part.transitions() for send in one.sends}
    assert "stopped" not in sent
    assert "command" in sent
    assert "o1" not in {one.id for one in seen.component("Follower").transitions()}


def test_a_check_of_a_binding_loads_nothing_that_only_cases_need() -> None:
    heavy = "{'numba', 'scipy', 'matplotlib', 'parcours.data', 'parcours.abtc', 'parcours.report'}"
    code = f"import sys, parcours_navigation.foreign.checking; print(*({heavy} & set(sys.modules)))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.split() == []


def test_the_robot_is_driven_by_commands_until_they_run_out(binding: Binding) -> None:
    assert binding.system is not None
    world = ForeignWorld(binding.system, CaseKey(1, 0, "empty"))
    world.command(0.25, 0.0, 100 * MS)
    world.advance(590 * MS)
    assert world.values(0, 0.0)["robot.v"] == pytest.approx(0.25)
    world.advance(1500 * MS)
    assert world.values(0, 0.0)["robot.v"] == pytest.approx(0.0)
    assert world.values(0, 0.0)["odom.y"] == pytest.approx(0.0, abs=1e-12)
    assert world.facts()["t_goal"][0] == NEVER


def test_how_often_the_world_is_asked_changes_nothing(binding: Binding) -> None:
    assert binding.system is not None
    worlds = [ForeignWorld(binding.system, CaseKey(3, 4)) for _ in range(2)]
    for now in range(0, 3000, 7):
        worlds[0].advance(now * MS)
    for world in worlds:
        world.command(0.2, 0.5, 3000 * MS)
        world.advance(4000 * MS)
    assert worlds[0].facts().tobytes() == worlds[1].facts().tobytes()


def test_spans_run_from_the_first_hop_to_the_last(binding: Binding) -> None:
    assert [(span.name, span.begin, span.end) for span in spans(binding)] == [
        ("plan", "plan_request", "plan_response"), ("sense_to_motion", "detections", "obstacles_near"),
        ("filtering", "detections", "obstacles"), ("reaction", "detections", "command"),
    ]  # fmt: skip


def test_a_period_is_a_span_from_a_channel_to_itself() -> None:
    events = [TraceEvent(time, kind, channel="a") for time in (0, 30, 70) for kind in ("send", "receive")]
    assert durations(events, BoundEntry("period", (), "a", "a")) == [(30,), (40,)]


def test_a_chain_is_linked_and_its_steps_are_named(binding: Binding) -> None:
    reaction = spans(binding)[-1]
    assert steps(binding, reaction) == ("ObstacleFilter", "on obstacles_near", "Follower")
    with pytest.raises(BadRequest, match=r"'obstacles' goes to Planner, and 'command' comes from Follower.*\[binding"):
        parse_binding(EXAMPLE.read_text().replace("through: [obstacles_near]", "through: [obstacles]"), str(EXAMPLE))


def test_nodes_that_are_led_by_a_clock_have_no_timing() -> None:
    stack = EXAMPLE.parents[1] / "ros2_navigation" / "dwa.yaml"
    timing = "\ntiming: {reaction: {from: scan, to: command, bound: every < 1 s}}\n"
    with pytest.raises(BadRequest, match=r"led by /clock.*clock-domains"):
        parse_binding(stack.read_text() + timing, str(stack))
    with pytest.raises(BadRequest, match=r"to a stack by its own section, but 'clock' is given.*binding-clock"):
        parse_binding(stack.read_text() + "\nclock: 100 Hz\n", str(stack))


def test_a_chain_that_was_timed_is_kept_and_drawn(binding: Binding, tmp_path: Path) -> None:
    reaction = spans(binding)[-1]
    rows = [(k * MS, MS, 2 * MS) for k in range(1, 40)]
    [(case, made)] = timed(reaction, [*rows, (TIMED_OUT,)], 9, None, steps(binding, reaction))
    assert (len(case.durations), len(made.rows) if made else 0) == (31, 30)
    result = Result("timing/reaction/x", "timing", JudgedCase(case.judgement), 1.0, timing=case, chain=made)
    with Journal(tmp_path) as journal:
        journal.add(result.id, json.loads(json.dumps(result.entry())))
    kept = RosResults("small", tmp_path, 1, "ros1")
    assert kept.found[0].chain == made
    assert "ObstacleFilter" in waterfalls(kept.found)[0].svg
    assert tables(kept.found)[-1].title == "Shares of reaction"


def test_abstract_cases_are_found_by_their_ids(binding: Binding) -> None:
    ids = [scene.id for scene in abstract_scenes(binding, 1)]
    assert len(ids) == len(set(ids)) == 29
    absent = ["nothing/0", ids[0].removesuffix("/0"), f"{ids[0]}x", ids[0].removesuffix("0") + "1"]
    assert list(find_scenes(binding, 1, [ids[-1], *absent])) == [ids[-1]]


def test_a_silence_longer_than_the_quiescence_is_proposed_for(binding: Binding) -> None:
    times = {"send": (0, 800, 1900), "receive": (100, 900, 2000)}
    events = [TraceEvent(time * MS, "send", "Follower", channel="command") for time in times["send"]]
    for kind, channel, late in (("receive", "plan_request", 0), ("send", "plan_response", 20)):
        events += [TraceEvent((time + late) * MS, kind, "Planner", channel=channel) for time in times["receive"]]  # type: ignore[arg-type]
    events.sort(key=lambda event: event.time)
    assert silences(binding, events) == {"command": 1100 * MS, "plan_response": 20 * MS}
    [said] = proposals(binding, events)
    assert "channel 'command' was silent for 1.1 s, but its quiescence is 1 s; write quiescence: 2.2 s" in said


def test_what_the_tester_made_and_cannot_be_read_is_no_error(binding: Binding) -> None:
    compiled = compile_binding(binding, defined_types(TEXTS))
    for text, is_blamed in ((MADE, False), ("", True)):
        conformers = Conformers(compiled, ["Planner"], Decoder(binding, compiled.types))
        spoilt = Raw("nav_msgs/GetPlan", "", "", b"?")
        for event in (
            TraceEvent(0, "note", text=BEGINS),
            TraceEvent(1, "send", "environment", channel="plan_request", message=7, text=text, payload=spoilt),
            TraceEvent(2, "receive", "Planner", channel="plan_request", message=7, payload=spoilt),
        ):
            conformers.take(event)
        assert (conformers.error is not None) == is_blamed


def test_qualities_that_do_not_connect_are_named_with_both_sides(binding: Binding) -> None:
    plan = whole(binding)
    [out] = [one.address for one in plan.spokes if one.side == "out" and "obstacles" in one.channels]
    into = next(one.address for one in plan.spokes if one.side == "into" and "obstacles" in one.channels)
    graph = RegisteredGraph(
        offered={out: {"/a": Quality(deadline=2 * MS)}}, requested={into: {"/b": Quality(deadline=MS)}}
    )
    [found] = [one for one in graph_findings(binding, graph) if one.rule == "qos-mismatch"]
    assert "/a offers a deadline of 2 ms, but a deadline of 1 ms is requested by /b" in found.message

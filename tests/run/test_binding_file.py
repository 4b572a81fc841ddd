"""Bindings as files: what a good one says, and what is said of a bad one, with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from parcours.errors import BadRequest
from parcours.model import parse_model
from parcours.run.binding import Binding, check_binding, parse_binding, read_binding

MODEL = parse_model("""
parcours: model/1
name: pair
messages:
  Pose: {fields: {x: {type: real, unit: m}, heading: {type: real, unit: rad}}}
  Command: {fields: {v: {type: real, unit: m/s}}}
channels:
  odometry: {from: environment, to: Planner, message: Pose}
  ask: {from: Planner, to: Server, message: Pose, topic: /plan}
  answer: {from: Server, to: Planner, message: Pose, topic: /plan}
  order: {from: Planner, to: Wheels, message: Command}
  motion: {from: Wheels, to: environment, message: Command}
components:
  Planner:
    variables: {stop: {type: bool, role: input}}
    machines:
      cycle:
        initial: idle
        transitions:
          p1: {from: idle, to: asking, event: odometry(pose), message: ask}
          p2: {from: asking, to: idle, event: answer(pose), message: order}
  Server:
    machines:
      service:
        initial: idle
        transitions:
          s1: {from: idle, to: busy, event: ask(pose)}
          s2: {from: busy, to: idle, message: answer}
  Wheels:
    machines:
      drive:
        initial: idle
        transitions:
          w1: {from: idle, to: idle, event: order(what), message: motion}
interactions:
  round: [Planner, Server, Planner]
""")

TEXT = """\
parcours: binding/1
name: pair
model: pair.yaml
transport: ros1
constants: {reach: 0.5}
nodes:
  Planner: {command: [./planner], ros_node: /planner}
  Server: {command: [./server]}
  Wheels: {command: [./wheels]}
channels:
  odometry:
    topic: /odom
    type: nav_msgs/Odometry
    fields: {x: pose.pose.position.x, heading: yaw(pose.pose.orientation)}
    inject: {base: {header: {frame_id: map}}, set: {pose.pose.position.x: robot.x}}
  ask: {service: /plan, type: nav_msgs/GetPlan, part: request}
  answer: {service: /plan, type: nav_msgs/GetPlan, part: response}
  order: {topic: /order, type: geometry_msgs/Twist, fields: {v: linear.x}}
  motion: {topic: /cmd_vel, type: geometry_msgs/Twist, quiescence: 50 ms}
observe:
  alarm: {topic: /alarm, type: std_msgs/Bool}
timing:
  round: p99 < 20 ms over 200 repeats
  turn: {from: ask, to: answer, bound: p99 < 5 ms over 200 repeats}
system:
  sense: {odometry: 50 Hz}
  command: {linear: motion.linear.x, angular: motion.angular.z, hold: 0.5 s}
  imminent_collision: alarm.data
"""


def made(text: str = TEXT) -> Binding:
    return parse_binding(text, "pair_binding.yaml", MODEL)


def test_a_binding_says_what_its_file_says() -> None:
    binding = made()
    assert [node.command for node in binding.nodes] == [("./planner",), ("./server",), ("./wheels",)]
    assert binding.process_of("Server") is binding.nodes[1]
    assert binding.channel("motion").quiescence == pytest.approx(0.05)
    assert binding.channel("odometry").quiescence == 0.5
    assert binding.channel("answer").part == "response"
    assert [bound.texts for bound in binding.timing] == [
        ("p99 < 20 ms over 200 repeats",),
        ("p99 < 5 ms over 200 repeats",),
    ]
    system = binding.system
    assert system is not None
    assert dict(system.sense) == pytest.approx({"odometry": 0.02})
    assert (system.command.on, system.command.hold) == ("motion", 0.5)
    assert system.alarm is not None and system.alarm[0] == "alarm"


def test_addresses_and_types_have_one_spelling() -> None:
    same = TEXT.replace("topic: /order", "topic: order").replace("type: std_msgs/Bool", "type: std_msgs/msg/Bool")
    assert made(same) == made()


def test_a_component_that_no_node_runs_is_played_by_the_tester() -> None:
    binding = made(TEXT.replace("  Server: {command: [./server]}\n", ""))
    assert binding.process_of("Server") is None


BAD = [
    ("transport: ros1", "transport: ros3", 4, "'transport' must be ros1 or ros2, but is 'ros3'", "value"),
    ("binding/1", "binding/2", 1, "this version reads binding/1 only", "format"),
    ("name: pair\n", "", 0, "a binding must have the key 'name'", "missing-key"),
    ("Server: {command: [./server]}", "Sever: {command: [./server]}", 8, "did you mean 'Server'?", "binding-unknown"),
    ("{command: [./server]}", "{}", 8, "must have a command, or say 'running: true'", "binding-start"),
    ("{command: [./server]}", "{running: true}", 8, "'ros_node' must say by what name", "missing-key"),
    ("[./server]}", "[./s], ready: [{topic: /a, node: /b}]}", 8, "must name one of topic,", "binding-ready"),
    (
        "{command: [./server]}",
        "{command: [/opt/ros/bin/ros2, launch, a, b.py]}",
        8,
        "a launch file obeys no remapping",
        "binding-start",
    ),
    ("{command: [./server]}", "{running: true, ros_node: /s, remap: true}", 8, "says 'remap: true'", "binding-start"),
    ("[./server]}", "[./s], timeout: soon}", 8, "must be a time above 0, such as 0.5 s, 20 ms", "value"),
    ("  order: {topic", "  ordr: {topic", 18, "did you mean 'order'?", "binding-unknown"),
    ("topic: /order,", "", 18, "must have a topic, a service or an action, but has none", "binding-address"),
    ("topic: /order", "topic: 'or der'", 18, "must be a name such as /cmd_vel, but is 'or der'", "binding-name"),
    ("topic: /order", "topic: '~order'", 18, "must be a global name, but '~order' is private", "binding-name"),
    ("type: geometry_msgs/Twist, f", "type: Twist, f", 18, "must be package/Type, but is 'Twist'", "binding-type"),
    ("{v: linear.x}", "{vx: linear.x}", 18, "a field of 'Command', which channel 'order' carries,", "binding-unknown"),
    ("{v: linear.x}", "{v: linear.x +}", 18, "a value must stand at the caret", "syntax"),
    ("{v: linear.x}", "{v: __import__('os')}", 18, "'__import__' is not or has none", "unknown-function"),
    ("part: request", "part: question", 16, "must be request or response or goal or", "value"),
    ("part: response", "part: goal", 17, "is of a service: 'part' must be request or response", "missing-key"),
    (
        "service: /plan, type: nav_msgs/GetPlan, part: response",
        "action: /plan, type: a/Plan, part: goal",
        17,
        "only ros2 has actions",
        "binding-action-part",
    ),
    (
        "part: response",
        "part: request",
        17,
        "must have one server, but is bound as of Server and of Planner",
        "binding-service",
    ),
    ("  ask: {service: /plan, type: nav_msgs/GetPlan, part: request}\n", "", 16, "at most one resp", "binding-service"),
    ("nav_msgs/GetPlan, part: request", "nav_msgs/GetMap, part: request", 17, "must have one type", "binding-address"),
    (
        "topic: /alarm, type: std_msgs/Bool",
        "topic: /order, type: geometry_msgs/Twist",
        21,
        "'order', too",
        "binding-observed",
    ),
    ("position.x: robot.x", "position.x: robot.z", 15, "did you mean", "binding-unknown"),
    ("position.x: robot.x", "position.x: obstacle.x", 15, "'obstacle.x' is not", "binding-unknown"),
    ("pose.pose.position.x: robot", "pose..x: robot", 15, "a place is a path such as", "binding-place"),
    ("  round: p99", "  rond: p99", 23, "did you mean 'round'?", "binding-unknown"),
    ("to: answer", "to: anser", 24, "did you mean 'answer'?", "binding-unknown"),
    ("{odometry: 50 Hz}", "{order: 50 Hz}", 26, "the tester must be the sender of 'order'", "binding-sense"),
    (
        "angular: motion",
        "angular: order",
        27,
        "must speak of one channel, but speaks of motion, order",
        "binding-channel",
    ),
    ("imminent_collision: alarm.data", "imminent_collision: 'true'", 28, "but speaks of none", "binding-channel"),
    ("part: request}", "part: request, observe: true}", 16, "a service, which cannot be overheard", "binding-service"),
    ("[./planner], r", "[./planner], remap: false, r", 16, "its sender is not remapped", "binding-separation"),
    ("transport: ros1", "transport: ros1\nmaster: here", 0, "must be an address with a port", "binding-master"),
    ("transport: ros1", "transport: ros1\ninterfaces: [nowhere]", 5, "must be a folder", "binding-folder"),
    ("transport: ros1", "transport: ros1\ndata: nowhere.yaml", 5, "must name a file of test inputs", "unreadable-file"),
    ("transport: ros1", "transport: ros1\nbefore_case: [{go: /x}]", 5, "has no key 'go'", "unknown-key"),
    ("transport: ros1", "transport: ros1\nbefore_case: [{set: /x}]", 5, "either 'to' or 'formula'", "binding-action"),
    ("transport: ros1", "transport: ros1\nbefore_case: [{call: /x}]", 5, "must have the key 'type'", "missing-key"),
    (
        "transport: ros1",
        "transport: ros1\nbefore_case: [{life: /x, is: up}]",
        5,
        "unconfigured, inactive",
        "binding-action",
    ),
    ("transport: ros1", "transport: ros1\nstack: {scan: /scan}", 5, "but names neither", "binding-stack"),
    (
        "transport: ros1",
        "transport: ros1\nstack: {command: /a, command_stamped: /b}",
        5,
        "but names 2",
        "binding-stack",
    ),
    (
        "transport: ros1",
        "transport: ros1\nstack: {command: /a, time: real}",
        5,
        "a stack is driven on ros2",
        "binding-stack",
    ),
    (
        "{command: [./server]}",
        "{running: true, ros_node: /s, realtime: true}",
        8,
        "says 'realtime: true'",
        "binding-start",
    ),
    ("[./planner], r", "[./planner], life: active, r", 7, "only nodes of ros2 have a life", "binding-life"),
    ("[./wheels]", "[./wheels], life: active", 9, "must say how to ask it", "missing-key"),
    ("name: pair", "name: &a pair", 2, "no anchors or aliases", "yaml-alias"),
]


@pytest.mark.parametrize(("given", "instead", "line", "said", "slug"), BAD)
def test_a_bad_binding_is_refused_with_line_and_reason(
    given: str, instead: str, line: int, said: str, slug: str
) -> None:
    assert given in TEXT
    binding, found = check_binding(TEXT.replace(given, instead, 1), "pair_binding.yaml", MODEL)
    assert binding is None
    fitting = [one for one in found if said in str(one) and one.rule == slug]
    assert fitting, "\n".join(map(str, found))
    assert line in (0, fitting[0].line)


def test_all_findings_are_said_at_once() -> None:
    text = (
        TEXT.replace("  round: p99", "  rond: p99")
        .replace("{v: linear.x}", "{vx: linear.x}")
        .replace("to: answer", "to: a")
    )
    with pytest.raises(BadRequest) as caught:
        made(text)
    assert caught.value.slug == "binding-errors"
    assert [f"pair_binding.yaml:{line}:" in str(caught.value) for line in (18, 23, 24)] == [True] * 3


def test_a_message_of_the_tester_without_content_is_warned_of_only() -> None:
    text = TEXT.replace("    inject: {base: {header: {frame_id: map}}, set: {pose.pose.position.x: robot.x}}\n", "")
    binding, found = check_binding(text, "pair_binding.yaml", MODEL)
    assert binding is not None
    assert [(one.severity, one.rule) for one in found] == [("warning", "binding-inject")]


def test_a_channel_of_the_model_that_is_not_bound_is_warned_of_only() -> None:
    text = "\n".join(line for line in TEXT.splitlines() if not line.startswith("  order:") and "order" not in line)
    binding, found = check_binding(text, "pair_binding.yaml", MODEL)
    assert binding is not None
    assert [(one.severity, one.rule) for one in found] == [("warning", "binding-unbound")]
    assert "'order'" in str(found[0])


def test_a_missing_file_and_one_of_noise_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="must be a readable file"):
        read_binding(tmp_path / "absent.yaml")
    noise = tmp_path / "noise.yaml"
    noise.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadRequest, match="no UTF-8 text"):
        read_binding(noise)


def test_an_error_of_the_model_names_the_file_of_the_model(tmp_path: Path) -> None:
    (tmp_path / "pair.yaml").write_text("parcours: model/1\nname: x\n", encoding="utf-8")
    path = tmp_path / "binding.yaml"
    path.write_text(TEXT, encoding="utf-8")
    with pytest.raises(BadRequest, match=r"pair\.yaml:1: .*'components'"):
        read_binding(path)

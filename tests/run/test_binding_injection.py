"""The tester's messages: a base and formulas over the world, compiled for their type; and what does not fit it."""

from __future__ import annotations

from typing import Any

import pytest

from message_classes import defined_types
from parcours.errors import BadRequest, HostFailure
from parcours.model import parse_model
from parcours.run.binding import Compiled, MessageTypes, compile_binding, parse_binding
from parcours.run.binding.access import compile_place
from parcours.run.binding.places import parse_place
from parcours.run.binding.worlds import body

DEFINITIONS = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "robot_msgs/Scene": """
        Header header
        geometry_msgs/Pose[] poses
        float64[3] corner
        string[] names
        bool sure
        int8 grade
    """,
}
TYPES = defined_types(DEFINITIONS)

MODEL = parse_model("""
parcours: model/1
name: eye
messages:
  Seen: {fields: {x: {type: real, unit: m, shape: [n]}, sure: {type: bool}}}
channels:
  seen: {from: environment, to: Eye, message: Seen}
components:
  Eye:
    machines:
      look: {initial: on, transitions: {e1: {from: on, to: on, event: seen(it)}}}
""")


def compiled(inject: str, fields: str = "{x: 'poses[*].position.x', sure: sure}") -> Compiled:
    text = f"""\
parcours: binding/1
name: eye
model: eye.yaml
transport: ros1
constants: {{unit: 0.001}}
nodes: {{Eye: {{command: [./eye]}}}}
channels:
  seen:
    topic: /seen
    type: robot_msgs/Scene
    fields: {fields}
    inject: {inject}
system: {{sense: {{seen: 10 Hz}}, command: {{linear: "seen.corner[0]", angular: "seen.corner[1]"}}}}
"""
    return compile_binding(parse_binding(text, "eye.yaml", MODEL), TYPES)


def test_the_testers_messages_are_a_base_and_formulas_over_the_world() -> None:
    made = compiled(
        "{base: {header: {frame_id: 12, seq: 3}, corner: [1, 2.5, 3], names: [a], poses: [{position: {z: 4}}]},"
        " set: {'poses[*].position.x': obstacle.x * unit, 'yaw(poses[*].orientation)': obstacle.heading,"
        " 'grade': obstacles, sure: robot.v > 0}}"
    )
    obstacles = [body("obstacle", 1000.0 * n, 0.0, 0.5 * n, 0.0, 0.0, 0.2) for n in range(3)]
    values = {**body("robot", 0.0, 0.0, 0.0, 0.25, 0.0, 0.2), "obstacles": 3, "unit": 0.001}
    message: Any = made.writers["seen"].message(values, obstacles)
    assert (message.header.frame_id, message.header.seq, message.corner) == ("12", 3, [1.0, 2.5, 3.0])
    assert [pose.position.z for pose in message.poses] == [4.0, 0.0, 0.0]
    readings = made.fields["seen"]
    assert readings["x"].value({"seen": message}) == pytest.approx([0.0, 1.0, 2.0])
    assert (message.grade, readings["sure"].value({"seen": message})) == (3, True)
    headings = compile_place(parse_place("yaw(poses[*].orientation)"), "robot_msgs/Scene", TYPES, "here")
    assert headings.read(message) == pytest.approx([0.0, 0.5, 1.0])


def test_each_message_of_the_tester_is_new() -> None:
    writer = compiled("{base: {names: [a], corner: [1, 2, 3]}}").writers["seen"]
    first: Any = writer.message({})
    second: Any = writer.message({})
    first.corner[0], first.names[0] = 9.0, "changed"
    assert (second.corner, second.names) == ([1.0, 2.0, 3.0], ["a"])
    third: Any = writer.message({})
    assert (third.corner, third.names) == ([1.0, 2.0, 3.0], ["a"])


def test_a_name_without_a_value_is_named() -> None:
    writer = compiled("{set: {'corner[0]': robot.x}}").writers["seen"]
    with pytest.raises(HostFailure, match=r"'robot\.x' has none"):
        writer.message({})


@pytest.mark.parametrize(
    ("inject", "fields", "line", "said"),
    [
        ("{base: {header: {frame: map}}}", "{}", 12, "std_msgs/Header has no 'frame'"),
        ("{base: {grade: 1000}}", "{}", 12, "grade is int8 and this is '1000'"),
        ("{base: {corner: [1, 2]}}", "{}", 12, "corner is float64[3] and this is a list"),
        ("{set: {'poses.x': robot.x}}", "{}", 12, "name an item"),
        ("{set: {sure: robot.x}}", "{}", 12, "sure is bool and 'robot.x' is real"),
        ("{set: {'corner[0]': robot.x && true}}", "{}", 12, "&& works on bool"),
        ("{}", "{x: poses}", 11, "must be of type list of real, but 'poses' is list of geometry_msgs/Pose"),
        ("{}", "{x: 'corner[0]'}", 11, "must be of type list of real, but 'corner[0]' is real"),
        ("{}", "{sure: size(poses)}", 11, "must be of type bool, but 'size(poses)' is int"),
        ("{}", "{sure: posses}", 11, "did you mean 'poses'?"),
        (
            "{}",
            "{sure: 'corner[0] && sure'}",
            11,
            '&& works on bool, but got real at the caret in "^corner[0] && sure"',
        ),
    ],
)
def test_what_does_not_fit_the_message_type_is_said_with_its_line(
    inject: str, fields: str, line: int, said: str
) -> None:
    with pytest.raises(BadRequest) as caught:
        compiled(inject, fields)
    assert said in str(caught.value)
    assert f"eye.yaml:{line}:" in str(caught.value)


def test_an_unknown_type_is_said_once_with_what_to_do() -> None:
    binding = compiled("{}").binding
    with pytest.raises(BadRequest) as caught:
        compile_binding(binding, MessageTypes(lambda name: None))
    assert str(caught.value) == (
        "eye.yaml:8: a type must be known here, but robot_msgs/Scene of channel 'seen' is not; install its package,"
        " or name the folder of its definition under 'interfaces' [unknown-message-type]"
    )

"""Places, formulas and injected messages over message classes of both ROS generations, without ROS."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from message_classes import defined_types
from parcours.errors import BadModel, HostFailure
from parcours.model.expression import Type
from parcours.run.binding import MessageTypes
from parcours.run.binding.access import Access, compile_place
from parcours.run.binding.formulas import parse_formula
from parcours.run.binding.message_types import read_definitions, slot_of
from parcours.run.binding.places import parse_place

DEFINITIONS = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "robot_msgs/Scene": """
        # what is seen
        int32 VERSION=3
        Header header
        geometry_msgs/Pose[] poses
        float64[3] corner
        uint8[] levels
        string[] names
        bool sure
        int8 grade
        duration age
    """,
    "robot_msgs/Plan": "Scene[] scenes\n---\nstring said",
    "robot_msgs/PlanRequest": "bool is_message",
}
TYPES = defined_types(DEFINITIONS)


def access(text: str, message: str = "robot_msgs/Scene", types: MessageTypes = TYPES) -> Access:
    return compile_place(parse_place(text), message, types, "here")


def scene(poses: int = 0) -> Any:
    made: Any = TYPES.create("robot_msgs/Scene")
    for number in range(poses):
        pose: Any = TYPES.create("geometry_msgs/Pose")
        pose.position.x = float(number)
        made.poses.append(pose)
    return made


@pytest.mark.parametrize(
    ("place", "type_"),
    [
        ("sure", Type("bool")),
        ("grade", Type("int")),
        ("corner[2]", Type("real")),
        ("corner", Type("real", rank=1)),
        ("poses[*].position.x", Type("real", rank=1)),
        ("poses[-1].position", Type("geometry_msgs/Point")),
        ("names[0]", Type("text")),
        ("yaw(poses[0].orientation)", Type("real")),
        ("yaw(poses[*].orientation)", Type("real", rank=1)),
        ("seconds(header.stamp)", Type("real")),
        ("seconds(age)", Type("real")),
        ("header.stamp.secs", Type("int")),
    ],
)
def test_a_place_has_the_type_of_what_lies_there(place: str, type_: Type) -> None:
    assert access(place).type == type_


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("sure", True),
        ("grade", -7),
        ("corner[1]", 2.5),
        ("corner", [1.0, 2.0, 3.0]),
        ("levels", [1, 255]),
        ("names[3]", "fourth"),
        ("poses[2].position.y", -0.25),
        ("yaw(poses[0].orientation)", 2.0),
        ("yaw(poses[0].orientation)", -3.0),
        ("seconds(header.stamp)", 1234.5),
        ("seconds(age)", -0.25),
    ],
)
def test_what_is_written_at_a_place_is_read_there(place: str, value: object) -> None:
    message = scene()
    access(place).write(message, value)
    read = access(place).read(message)
    assert read == (pytest.approx(value) if isinstance(value, float) else value)


def test_lists_grow_to_the_item_that_is_written_and_keep_the_others() -> None:
    message = scene(1)
    access("poses[*].position.x").write(message, 9.0, index=2)
    assert access("poses[*].position.x").read(message) == [0.0, 0.0, 9.0]


def test_every_item_of_nested_lists_is_read_in_one_list() -> None:
    request: Any = TYPES.create("robot_msgs/PlanResponse")
    assert request.said == ""
    types = defined_types({**DEFINITIONS, "a/All": "robot_msgs/Scene[] scenes"})
    message: Any = types.create("a/All")
    message.scenes = [scene(2), scene(1)]
    assert access("scenes[*].poses[*].position.x", "a/All", types).read(message) == [0.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("sur", "has no 'sur' in 'sur'; did you mean 'sure'?"),
        ("poses.position", "poses is geometry_msgs/Pose[], which has no fields"),
        ("poses.position", "name an item: [0], or every item: [*]"),
        ("poses[0].postion.x", "geometry_msgs/Pose has no 'postion'"),
        ("sure[0]", "an index needs a list, but 'sure' is bool"),
        ("sure.x", "which has no fields"),
        ("corner[3]", "an index must lie in its list, but 'corner[3]' does not: it is float64[3]"),
        ("corner[-4]", "an index must lie in its list"),
        ("yaw(corner)", "yaw works on a quaternion, but 'corner' is float64[3]"),
        ("seconds(grade)", "seconds works on a time or duration"),
    ],
)
def test_a_place_that_is_not_there_is_refused_with_what_is(place: str, said: str) -> None:
    with pytest.raises(BadModel) as caught:
        access(place)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("sure", 1),
        ("grade", 128),
        ("grade", 0.5),
        ("grade", "high"),
        ("corner", [1.0, 2.0]),
        ("corner[0]", True),
        ("levels[0]", -1),
        ("names[0]", 3),
        ("yaw(poses[0].orientation)", math.nan),
        ("seconds(age)", "soon"),
    ],
)
def test_a_value_that_does_not_fit_its_field_is_refused(place: str, value: object) -> None:
    with pytest.raises(HostFailure, match="must fit its field"):
        access(place).write(scene(), value)


def test_a_message_with_too_few_items_is_named_with_the_place() -> None:
    with pytest.raises(HostFailure, match=r"must reach to 'poses\[1\]', but has 1 items there") as caught:
        access("poses[1].position.x").read(scene(1))
    assert caught.value.slug == "message-size"


def test_messages_of_ros_2_are_read_and_written_alike() -> None:
    class Time:
        def __init__(self) -> None:
            self.sec = self.nanosec = 0

        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]:
            return {"sec": "int32", "nanosec": "uint32"}

    class Stamped:
        def __init__(self) -> None:
            self._stamp, self._data = Time(), [0.0]

        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]:
            return {"stamp": "builtin_interfaces/Time", "data": "sequence<double, 4>"}

        stamp = property(lambda self: self._stamp, lambda self, value: setattr(self, "_stamp", value))
        data = property(lambda self: self._data, lambda self, value: setattr(self, "_data", value))

    types = MessageTypes({"a/Stamped": Stamped, "builtin_interfaces/Time": Time}.get)
    message = types.create("a/Stamped")
    for place, value in (("seconds(stamp)", 2.5), ("data[2]", 4.0)):
        access(place, "a/Stamped", types).write(message, value)
        assert access(place, "a/Stamped", types).read(message) == value
    assert access("data", "a/Stamped", types).read(message) == [0.0, 0.0, 4.0]


@pytest.mark.parametrize("text", ["float64[9]", "double[9]"])
def test_the_words_of_either_generation_mean_the_same(text: str) -> None:
    assert (slot_of(text).type, slot_of(text).length) == (Type("real", rank=1), 9)


def test_a_message_is_meant_before_the_half_of_a_service_of_the_same_name() -> None:
    fields = TYPES.fields("robot_msgs/PlanRequest")
    assert fields is not None and list(fields) == ["is_message"]


def test_definitions_are_found_by_the_names_of_their_folders(tmp_path: Path) -> None:
    (tmp_path / "a" / "msg").mkdir(parents=True)
    (tmp_path / "a" / "msg" / "One.msg").write_text("float64 x", encoding="utf-8")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "Two.srv").write_text("---\na/One one", encoding="utf-8")
    types = defined_types(read_definitions([tmp_path]))
    message: Any = types.create("b/TwoResponse")
    assert message.one.x == 0.0


def test_constants_of_yaml_words_inside_texts_stay_texts() -> None:
    formula = parse_formula("mode == 'a.b[0]' && x1 < 1e3")
    assert [str(place) for place in formula.places] == ["mode", "x1"]
    assert formula.value({formula.places[0]: "a.b[0]", formula.places[1]: 2}, "here") is True

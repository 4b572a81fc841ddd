"""Values go into the same bytes as ROS's message classes write, and come back; other bytes are refused by name."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests_ros1.ros1_messages import Endpoint, load, written
from tests_ros1.ros1_toys import Field

from parcours.errors import BadRequest
from parcours.run.hosts.ros1 import interpreter_with
from parcours.run.hosts.ros1.interfaces import package_routes, read_index, write_package
from parcours.run.hosts.ros1.packing import MessagePacking
from parcours_ramp.components.ros1 import CODEC
from parcours_ramp.planner.wire import FORMS


@pytest.fixture(scope="module")
def messages(package: Path) -> Mapping[str, Endpoint]:
    return load(package)


def _values(channel: str, rng: np.random.Generator) -> tuple[Any, ...]:
    make: dict[str, Any] = {
        "float": lambda: float(rng.normal()),
        "int": lambda: int(rng.integers(-(2**63), 2**63)),
        "bool": lambda: bool(rng.integers(2)),
        "floats": lambda: rng.normal(size=rng.integers(5) * 7),
        "ints": lambda: rng.integers(-(2**63), 2**63, size=rng.integers(5) * 7),
    }
    return tuple(make[field.kind]() for field in FORMS[channel])


def test_topics_and_services_are_those_of_table_i(messages: Mapping[str, Endpoint]) -> None:
    services = {end.topic: end.service.__name__ for end in messages.values() if end.service}
    assert services == {
        "/trajectory_generation": "TrajectoryGeneration",
        "/trajectory_evaluation": "TrajectoryEvaluation",
        "/path_modification": "PathModification",
    }
    topics = {end.topic: end.message._type for end in messages.values() if not end.service}
    assert topics == {
        "/odometry": "parcours_ramp/Odometry",
        "/obstacles": "parcours_ramp/ObstacleList",
        "/best_trajectory": "parcours_ramp/RampTrajectory",
        "/update": "parcours_ramp/MotionState",
    }


def test_headers_say_what_ros_s_own_classes_say(messages: Mapping[str, Endpoint], package: Path) -> None:
    for route in package_routes(package):
        own = messages[route.interface.channel]
        whole = own.service or own.message
        assert (route.kind.type, route.kind.md5) == (whole._type, whole._md5sum)
        assert route.kind.definition == ("" if own.service else own.message._full_text)


def test_the_bytes_are_those_of_the_message_classes_and_the_values_come_back(messages: Mapping[str, Endpoint]) -> None:
    rng = np.random.default_rng(5)
    for channel in [*messages] * 20:
        packing, values = MessagePacking(channel, FORMS[channel]), _values(channel, rng)
        data = packing.pack(values)
        assert data == written(messages[channel].message, values)
        back = packing.unpack(data)
        assert [type(value) for value in back] == [type(value) for value in values]
        for one, other in zip(back, values, strict=True):
            np.testing.assert_array_equal(one, other, strict=True)


def test_bytes_that_are_too_few_or_too_many_and_other_values_are_refused_with_the_channel() -> None:
    packing = MessagePacking("news", [Field("a", "float"), Field("b", "floats"), Field("c", "bool")])
    data = packing.pack((1.0, [2.0, 3.0], True))
    assert packing.unpack(data)[::2] == (1.0, True)
    for wrong in [data[:cut] for cut in range(len(data))] + [data + b"\0", b"\xff" * len(data)]:
        with pytest.raises(BadRequest, match=rf"^channel 'news': {len(wrong)} bytes are no such message: .*ros1-bytes"):
            packing.unpack(wrong)
    for values in ((1.0, [2.0]), ("x", [2.0], True), (1.0, ["x"], True), (1.0, [[2.0], [3.0, 4.0]], True)):
        with pytest.raises(BadRequest, match=r"^channel 'news': .*ros1-bytes"):
            packing.pack(values)
    with pytest.raises(BadRequest, match="did you mean 'update'"):
        CODEC.decode("updat", b"")


def test_a_message_without_fields_is_no_bytes() -> None:
    assert MessagePacking("tick", []).pack(()) == b""
    assert MessagePacking("tick", []).unpack(b"") == ()


_HEADERS = """
import sys, genmsg.template_tools as t
target, *sources = sys.argv[1:]
for source in sources:
    t.generate_from_file(source, "parcours_ramp", target, "/usr/share/gencpp", [],
                         {"msg.h.template": "@NAME@.h"}, {"srv.h.template": "@NAME@.h"})
"""
_PROGRAM = """
#include <parcours_ramp/RampTrajectory.h>
#include <parcours_ramp/PathModification.h>
#include <cstdio>
#include <vector>
int main() {
  std::vector<uint8_t> in(1 << 20);
  in.resize(fread(in.data(), 1, in.size(), stdin));
  parcours_ramp::RampTrajectory message;
  ros::serialization::IStream reader(in.data(), in.size());
  ros::serialization::deserialize(reader, message);
  std::vector<uint8_t> out(ros::serialization::serializationLength(message));
  ros::serialization::OStream writer(out.data(), out.size());
  ros::serialization::serialize(writer, message);
  fwrite(out.data(), 1, out.size(), stdout);
  fprintf(stderr, "%s", ros::message_traits::md5sum<parcours_ramp::RampTrajectory>());
  return sizeof(parcours_ramp::PathModification::Request) == 0;  // it compiles
}
"""


def test_cpp_made_of_the_package_reads_and_writes_the_same_bytes(package: Path, tmp_path: Path) -> None:
    target = tmp_path / "include" / "parcours_ramp"
    target.mkdir(parents=True)
    sources = [str(source) for source in (*package.glob("msg/*.msg"), *package.glob("srv/*.srv"))]
    subprocess.run([interpreter_with("gencpp"), "-c", _HEADERS, str(target), *sources], check=True)
    (tmp_path / "echo.cpp").write_text(_PROGRAM)
    compiler = ["g++", "-std=c++17", "-O0", "-I", "include", "echo.cpp", "-o", "echo"]
    subprocess.run([*compiler, "-lroscpp_serialization", "-lrostime"], cwd=tmp_path, check=True)
    values = _values("best_trajectory", np.random.default_rng(11))
    data = MessagePacking("best_trajectory", FORMS["best_trajectory"]).pack(values)
    done = subprocess.run([tmp_path / "echo"], input=data, capture_output=True, check=True)
    assert done.stdout == data
    [kind] = [route.kind for route in package_routes(package) if route.interface.channel == "best_trajectory"]
    assert done.stderr.decode() == kind.md5


def test_two_packages_of_one_name_do_not_mix(package: Path, tmp_path: Path) -> None:
    class Only:
        name, kind, doc = "only", "bool", "nothing else"

    _, channels = read_index(package)
    write_package(tmp_path, "parcours_ramp", channels, {one.channel: [Only()] for one in channels})
    for other, first in zip(package_routes(tmp_path), package_routes(package), strict=True):
        assert other.kind.type == first.kind.type and other.kind.md5 != first.kind.md5

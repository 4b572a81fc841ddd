"""RAMP's messages as ROS carries them: the same bytes as ROS's own classes write, the same values back, in C++ too."""

from __future__ import annotations

import importlib.util
import subprocess
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import pytest

from parcours.errors import HostFailure
from parcours.run.hosts.ros1.interfaces import read_index, write_headers, write_package
from parcours.run.hosts.ros1.messages import Messages, load
from parcours_ramp.planner.wire import FORMS


@pytest.fixture(scope="module")
def messages(package: Path) -> Messages:
    return load(package)


def _values(channel: str, seed: int) -> tuple[Any, ...]:
    rng = np.random.default_rng(seed)
    make: dict[str, Callable[[], Any]] = {
        "float": lambda: float(rng.normal()),
        "int": lambda: int(rng.integers(-(2**63), 2**63)),
        "bool": lambda: bool(rng.integers(2)),
        "floats": lambda: rng.normal(size=rng.integers(5) * 7),
        "ints": lambda: rng.integers(-(2**63), 2**63, size=rng.integers(5) * 7),
    }
    return tuple(make[field.kind]() for field in FORMS[channel])


def _bytes(message: Any) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def _own_class(package: Path, kind: Any) -> Any:
    """Return the class as genpy made it, from the same file."""
    name = kind._type.partition("/")[2]
    short = name.removesuffix("Request").removesuffix("Response")
    room = package / "python" / "parcours_ramp"
    path = next(p for p in (room / f"msg/_{name}.py", room / f"srv/_{short}.py") if p.exists())
    spec = importlib.util.spec_from_file_location(f"genpy_{name}", path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)


def test_topics_and_services_are_those_of_table_i(messages: Messages) -> None:
    services = {end.interface.topic: end.service.__name__ for end in messages.endpoints.values() if end.service}
    assert services == {
        "/trajectory_generation": "TrajectoryGeneration",
        "/trajectory_evaluation": "TrajectoryEvaluation",
        "/path_modification": "PathModification",
    }
    topics = {end.interface.topic: end.message._type for end in messages.endpoints.values() if not end.service}
    assert topics == {
        "/odometry": "parcours_ramp/Odometry",
        "/obstacles": "parcours_ramp/ObstacleList",
        "/best_trajectory": "parcours_ramp/RampTrajectory",
        "/update": "parcours_ramp/MotionState",
    }


def test_every_channel_s_values_come_back_from_their_bytes(messages: Messages) -> None:
    for seed, channel in enumerate([*messages.endpoints] * 20):
        values = _values(channel, seed)
        kind = messages[channel].message
        back = messages.from_ros(channel, kind().deserialize(_bytes(messages.to_ros(channel, values))))
        assert [type(value) for value in back] == [type(value) for value in values]
        for one, other in zip(back, values, strict=True):
            np.testing.assert_array_equal(one, other, strict=True)


def test_the_bytes_are_those_that_genpy_writes_and_reads(messages: Messages, package: Path) -> None:
    for seed, channel in enumerate([*messages.endpoints] * 5):
        values = _values(channel, seed)
        ours = messages.to_ros(channel, values)
        theirs = _own_class(package, type(ours))
        assert theirs._md5sum == ours._md5sum
        written = _bytes(theirs(*(value.tolist() if isinstance(value, np.ndarray) else value for value in values)))
        assert _bytes(ours) == written
        read = messages.from_ros(channel, theirs().deserialize(written))
        for one, other in zip(read, values, strict=True):
            np.testing.assert_array_equal(one, other)


def test_bytes_that_are_too_few_or_too_many_are_refused(messages: Messages) -> None:
    kind = messages["best_trajectory"].message
    data = _bytes(messages.to_ros("best_trajectory", _values("best_trajectory", 3)))
    for wrong in [data[:cut] for cut in range(len(data))] + [data + b"\0", b"\xff" * len(data)]:
        with pytest.raises(genpy.DeserializationError, match=f"RampTrajectory: {len(wrong)} bytes are no such message"):
            kind().deserialize(wrong)


def test_values_of_the_wrong_number_or_kind_are_refused(messages: Messages) -> None:
    values = _values("update", 1)
    for wrong in (values[1:], (*values, 0), ("1", *values[1:]), (1.5, *values[1:]), (None, *values[1:])):
        with pytest.raises(HostFailure, match=r"channel 'update': .* \[ros1-message\]$"):
            messages.to_ros("update", wrong)
    at = next(i for i, field in enumerate(FORMS["best_trajectory"]) if field.kind == "ints")
    values = _values("best_trajectory", 1)
    for array in (np.ones(3), np.ones((2, 2), int), 7, ["a"]):
        with pytest.raises(HostFailure, match=FORMS["best_trajectory"][at].name):
            messages.to_ros("best_trajectory", (*values[:at], array, *values[at + 1 :]))
    with pytest.raises(HostFailure, match=r"did you mean 'update'.*\[unknown-channel\]$"):
        messages["updat"]
    with pytest.raises(genpy.SerializationError, match="MotionState"):
        _bytes(messages["update"].message(*(["x"] * len(FORMS["update"]))))


def test_a_message_of_another_class_lacks_fields(messages: Messages) -> None:
    with pytest.raises(HostFailure, match=r"channel 'update': .*\[ros1-message\]$"):
        messages.from_ros("update", messages.to_ros("best_trajectory", _values("best_trajectory", 1)))


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


def test_the_headers_compile_and_read_and_write_the_same_bytes(
    messages: Messages, package: Path, tmp_path: Path
) -> None:
    headers = write_headers(package, tmp_path / "include")
    assert {"RampTrajectory.h", "PathModification.h", "PathModificationRequest.h"} <= {h.name for h in headers}
    (tmp_path / "echo.cpp").write_text(_PROGRAM)
    compiler = ["g++", "-std=c++17", "-O0", "-I", "include", "echo.cpp", "-o", "echo"]
    libraries = ["-lroscpp_serialization", "-lrostime"]
    subprocess.run([*compiler, *libraries], cwd=tmp_path, check=True)
    message = messages.to_ros("best_trajectory", _values("best_trajectory", 11))
    done = subprocess.run([tmp_path / "echo"], input=_bytes(message), capture_output=True, check=True)
    assert done.stdout == _bytes(message)
    assert done.stderr.decode() == message._md5sum


def test_two_packages_of_one_name_do_not_mix(package: Path, tmp_path: Path) -> None:
    class Only:
        name, kind, doc = "only", "bool", "nothing else"

    _, channels = read_index(package)
    write_package(tmp_path, "parcours_ramp", channels, {one.channel: [Only()] for one in channels})
    other, first = load(tmp_path), load(package)
    assert other["update"].message.__slots__ == ["only"] != first["update"].message.__slots__

"""ROS 2 interfaces that are given as files of definitions: built once, and used like installed ones."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from parcours.errors import BadRequest
from parcours.run.hosts.ros2.building import built

USE = """
import rclpy
from part_msgs.msg import Part
from rclpy.serialization import deserialize_message, serialize_message
from whole_msgs.srv import Count

rclpy.init()
node = rclpy.create_node("counter")
node.create_service(Count, "count", lambda asked, answer: Count.Response(n=sum(part.n for part in asked.parts)))
client = node.create_client(Count, "count")
assert client.wait_for_service(10.0)
counted = client.call_async(Count.Request(parts=[Part(n=2), Part(n=3, name="other")]))
while not counted.done():
    rclpy.spin_once(node, timeout_sec=10.0)
print(counted.result().n, deserialize_message(serialize_message(Part()), Part).name)
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PARCOURS_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("ROS_DOMAIN_ID", "45")
    return tmp_path / "cache"


def defined(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        package, kind, base = name.split("__")
        path = folder / package / kind / f"{base}.{kind}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def test_packages_that_use_each_other_are_built_once_and_used_like_installed_ones(tmp_path: Path, cache: Path) -> None:
    folder = defined(tmp_path / "own", part_msgs__msg__Part='int32 n\nstring<=10 name "some"\n',
                     whole_msgs__srv__Count="part_msgs/Part[] parts\n---\nint64 n\n",
                     std_msgs__msg__String="string data\n")  # fmt: skip
    place = built([folder])
    assert place is not None and not (place / "std_msgs").exists()  # that is installed
    used = subprocess.run([sys.executable, "-c", USE], env={**os.environ, "PYTHONPATH": str(place)}, text=True,
                          capture_output=True, check=False, timeout=60)  # fmt: skip
    assert (used.returncode, used.stdout, used.stderr) == (0, "5 some\n", "")
    made = {path: path.stat().st_mtime_ns for path in cache.rglob("*")}
    assert built([folder]) == place
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*")} == made


@pytest.mark.parametrize(("text", "said"), [("int33 n\n", "int33"), ("float64 N\n", "N"), ("", "readable text")])
def test_a_definition_that_is_wrong_is_said(tmp_path: Path, cache: Path, text: str, said: str) -> None:
    with pytest.raises(BadRequest, match=said) as caught:
        built([defined(tmp_path / "own", part_msgs__msg__Part=text)])
    assert caught.value.slug == "message-definition"
    assert not list(cache.glob("ros2/*"))

"""A graph that runs becomes a first binding, which passes its check against the same graph."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from tests_ros2.conftest import soon

from parcours.run.binding import read_binding
from parcours.run.hosts.ros2.building import built
from parcours.run.hosts.ros2.participant import Ros2Participant

ROOT = Path(__file__).parents[1]
INTERFACES = ROOT / "examples" / "ros2_navigation" / "interfaces"
PROGRAMS = {
    "obstacle_filter": ROOT / "examples" / "ros2_python" / "obstacle_filter.py",
    "avoider": ROOT / "examples" / "ros2_python" / "avoider.py",
    "driver": ROOT / "tests_ros2" / "errand" / "driver.py",
}
DOMAIN = "47"


@pytest.fixture(scope="module")
def environment() -> Iterator[Mapping[str, str]]:
    """What commands need to be on the graph on which two nodes of the example and a server of an action run."""
    env = {**os.environ, "ROS_DOMAIN_ID": DOMAIN}
    path = os.pathsep.join(filter(None, (str(built([INTERFACES]) or ""), os.environ.get("PYTHONPATH", ""))))
    with contextlib.ExitStack() as closing:
        for file in PROGRAMS.values():
            node = subprocess.Popen([sys.executable, str(file)], env={**env, "PYTHONPATH": path})
            closing.callback(node.wait)
            closing.callback(node.kill)
        looking = Ros2Participant("looking", int(DOMAIN))
        closing.callback(looking.close)
        assert soon(lambda: set(looking.node.get_node_names()) >= set(PROGRAMS), 60.0)
        yield env


def parcours(env: Mapping[str, str], *words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "parcours", *map(str, words)]
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False)


def test_a_graph_is_drafted_and_the_draft_fits_it(environment: Mapping[str, str], tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    said = parcours(environment, "binding", "new", mine, "--from-graph", "--interfaces", INTERFACES)
    assert said.returncode == 0, said.stderr
    checked = parcours(environment, "binding", "check", mine / "binding.yaml", "--live")
    assert (checked.returncode, "the running system has all that is bound" in checked.stdout) == (0, True), (
        checked.stderr + (mine / "binding.yaml").read_text()
    )
    binding = read_binding(mine / "binding.yaml")
    assert {node.ros_node for node in binding.nodes} == {f"/{name}" for name in PROGRAMS}
    ends = {channel.name: (channel.type, *binding.ends(channel.name)) for channel in binding.channels}
    assert ends["obstacles"] == ("geometry_msgs/PoseArray", "ObstacleFilter", "Avoider")
    assert ends["plan_request"] == ("nav_msgs/GetPlan", "environment", "Avoider")
    assert ends["errand_goal"] == ("nav2_msgs/NavigateToPose_SendGoal", "environment", "Driver")
    assert "requests best effort" in (mine / "binding.yaml").read_text()
    again = parcours(environment, "binding", "new", mine, "--from-graph")
    assert (again.returncode, "file-there" in again.stderr) == (2, True), again.stderr


def test_an_empty_graph_is_named(environment: Mapping[str, str], tmp_path: Path) -> None:
    said = parcours({**environment, "ROS_DOMAIN_ID": "48"}, "binding", "new", tmp_path / "mine", "--from-graph")
    assert (said.returncode, "ROS domain 48" in said.stderr, "graph-empty" in said.stderr) == (2, True, True), (
        said.stderr
    )

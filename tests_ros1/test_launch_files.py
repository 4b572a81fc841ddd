"""Nodes that a launch file starts: its launcher is a node without components, the others run once it has."""

from __future__ import annotations

import re
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

from parcours.run.binding import read_binding
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.checking import is_own
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.results import Result
from parcours_navigation.foreign.running import ForeignStudy

LAUNCH = """
<launch>
  <arg name="prefix" default="/apart"/>
  <node pkg="small" type="obstacle_filter.py" name="obstacle_filter">
    <remap from="/obstacles" to="$(arg prefix)/obstacles"/>
  </node>
  <node pkg="small" type="avoider.py" name="avoider">
    <remap from="/obstacles" to="$(arg prefix)/avoider/obstacles"/>
  </node>
  <node pkg="small" type="follower.py" name="follower">
    <remap from="/obstacles" to="$(arg prefix)/follower/obstacles"/>
    <remap from="/plan" to="$(arg prefix)/plan"/>
  </node>
</launch>
"""
NODES = """
nodes:
  Launch:
    command: [roslaunch, small.launch]
    components: []
    env: {{PATH: "/usr/bin:/bin", ROS_PACKAGE_PATH: "{folder}"}}
    stop: 10 s
  ObstacleFilter: {{running: true, ros_node: /obstacle_filter, after: [Launch], timeout: 120 s}}
  Planner: {{running: true, ros_node: /avoider, after: [Launch], timeout: 120 s}}
  Follower: {{running: true, ros_node: /follower, after: [Launch], timeout: 120 s}}

quiescence: 3 s
"""
APART = {
    "obstacles": "out: /apart/obstacles, in: /apart/avoider/obstacles",
    "obstacles_near": "out: /apart/obstacles, in: /apart/follower/obstacles",
    "plan_request": "out: /apart/plan",
    "plan_response": "out: /apart/plan",
}


@pytest.fixture
def launched(tmp_path: Path) -> Path:
    """The binding of the example's nodes, hastened, which a launch file starts."""
    folder = shutil.copytree(Path(__file__).parents[1] / "examples" / "ros1_python", tmp_path / "small")
    (folder / "package.xml").write_text("<package><name>small</name></package>")
    (folder / "small.launch").write_text(LAUNCH)
    for node in folder.glob("*.py"):
        node.chmod(0o755)
    binding = folder / "binding.yaml"
    text = re.sub(r"\nnodes:.*?quiescence: 1 s\n", NODES.format(folder=tmp_path), binding.read_text(), flags=re.DOTALL)
    for channel, names in APART.items():
        given = "".join(f"    {one}\n" for one in names.split(", "))
        text = text.replace(f"\n  {channel}:\n", f"\n  {channel}:\n{given}")
    for old, new in (("/follower/speed: 0.25", "/follower/speed: 1.2"), ("v_max: 0.25", "v_max: 1.2")):
        text = text.replace(old, new)
    binding.write_text(text)
    return binding


def run(binding: Path, out: Path, **wanted: Any) -> list[Result]:
    with ForeignHost(read_binding(binding), out / "nodes") as host:
        return list(ForeignStudy(host, ProcessOrder(str(binding), str(out), **wanted)).run())


def test_nodes_of_a_launch_file_are_kept_in_order_and_drive(launched: Path, tmp_path: Path) -> None:
    results = run(launched, tmp_path, abstract=("sense_to_motion-tp11.tp32-0.0/0",), system=(0,), protocol="empty")
    judgements = [one.judged.judgement for one in results]
    assert [one.verdict for one in judgements] == [Verdict.PASS, Verdict.PASS], [one.why for one in judgements]
    assert is_own(read_binding(launched), None, "own")


def test_they_are_dead_when_their_launcher_is(launched: Path, tmp_path: Path) -> None:
    with ForeignHost(read_binding(launched), tmp_path / "nodes") as host:
        session = Session(host, whole(host.binding))
        try:
            session.start()
            session.act(session.slot_plan.slots[0], "kill")
            until = session.now() + 60_000_000_000
            while not session.deaths and session.now() < until:
                session.poll(until)
        finally:
            session.end()
    assert set(session.deaths) == {"ObstacleFilter", "Planner", "Follower"}
    assert f"Launch, which started it, ended: killed by {signal.SIGKILL.name}" in session.deaths["Planner"]

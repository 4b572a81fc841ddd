"""Nodes that another program starts, as a launch file does: a node without components, and those that come after it."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from parcours.run.binding import read_binding
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.running import ForeignStudy

LAUNCHER = """
python3 obstacle_filter.py --ros-args -r /obstacles:=/apart/obstacles &
python3 avoider.py --ros-args -r /obstacles:=/apart/avoider/obstacles &
python3 follower.py --ros-args -r /obstacles:=/apart/follower/obstacles -r /plan:=/apart/plan -p speed:=1.2 &
wait
"""
NODES = """
nodes:
  Launch: {command: [sh, launch.sh], components: []}
  ObstacleFilter: {running: true, ros_node: /obstacle_filter, after: [Launch]}
  Planner: {running: true, ros_node: /avoider, after: [Launch]}
  Follower: {running: true, ros_node: /follower, after: [Launch], timeout: 120 s}

quiescence: 5 s
"""
APART = {
    "obstacles": "    out: /apart/obstacles\n    in: /apart/avoider/obstacles\n",
    "obstacles_near": "    out: /apart/obstacles\n    in: /apart/follower/obstacles\n",
    "plan_request": "    out: /apart/plan\n",
    "plan_response": "    out: /apart/plan\n",
}


def test_nodes_of_a_launcher_are_kept_in_order_drive_and_are_dead_when_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ros1_python", "ros2_python"):
        shutil.copytree(Path(__file__).parents[1] / "examples" / name, tmp_path / name)
    binding = tmp_path / "ros2_python" / "binding.yaml"
    binding.with_name("launch.sh").write_text(LAUNCHER)
    text = re.sub(r"\nparameters:.*?\n\n", "\n", binding.read_text(), flags=re.DOTALL)
    text = re.sub(r"\nnodes:.*?quiescence: 1 s\n", NODES, text, flags=re.DOTALL).replace("v_max: 0.25", "v_max: 1.2")
    for channel, names in APART.items():
        text = text.replace(f"\n  {channel}:\n", f"\n  {channel}:\n{names}")
    binding.write_text(text)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "48")
    order = ProcessOrder(
        str(binding), str(tmp_path), abstract=("sense_to_motion-tp11.tp32-0.0/0",), system=(0,), protocol="empty"
    )
    with ForeignHost(read_binding(binding), tmp_path / "nodes") as host:
        results = list(ForeignStudy(host, order).run())
        assert [one.judged.judgement.verdict.value for one in results] == ["pass", "pass"], results
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
    assert "Launch, which started it, ended: killed by SIGKILL" in session.deaths["Planner"]

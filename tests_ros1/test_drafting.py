"""A graph that runs becomes a first binding, which passes its check against the same graph."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from parcours.run.binding import read_binding
from parcours.run.hosts.ros1.graph import ask_all
from parcours.run.hosts.ros1.master import Master

EXAMPLE = Path(__file__).parents[1] / "examples" / "ros1_python"


@pytest.fixture(scope="module")
def master() -> Iterator[Master]:
    """One at which two nodes of the example are registered."""
    with Master() as started, contextlib.ExitStack() as closing:
        for name in ("obstacle_filter", "avoider"):
            command = ["/usr/bin/python3", str(EXAMPLE / f"{name}.py")]
            node = subprocess.Popen(command, env={**os.environ, **started.environment})
            closing.callback(node.wait)
            closing.callback(node.kill)
        until = time.monotonic() + 60.0
        while not {"/plan", "/detections"} <= _registered(started.uri) and time.monotonic() < until:
            time.sleep(0.05)
        yield started


def _registered(uri: str) -> set[str]:
    [state] = ask_all(uri, [("getSystemState", ("/test",))])
    return {str(name) for table in state for name, _ in table}


def parcours(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "parcours", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_graph_is_drafted_and_the_draft_fits_it(master: Master, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    said = parcours("binding", "new", mine, "--from-graph", "--transport", "ros1", "--master", master.uri)
    assert said.returncode == 0, said.stderr
    checked = parcours("binding", "check", mine / "binding.yaml", "--live")
    assert (checked.returncode, "the running system has all that is bound" in checked.stdout) == (0, True), (
        checked.stderr
    )
    binding = read_binding(mine / "binding.yaml")
    assert (binding.master, {node.ros_node for node in binding.nodes}) == (master.uri, {"/obstacle_filter", "/avoider"})
    ends = {channel.name: (channel.type, *binding.ends(channel.name)) for channel in binding.channels}
    assert ends["obstacles"] == ("geometry_msgs/PoseArray", "ObstacleFilter", "Avoider")
    assert ends["plan_response"] == ("nav_msgs/GetPlan", "Avoider", "environment")

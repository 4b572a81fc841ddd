"""What the tests on real ROS 2 share: RAMP's nodes on one graph, and processes looked at from outside."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.ros2.transport import Ros2Transport
from parcours.run.hosts.scheduling import real_time
from parcours.run.port import links
from parcours_ramp.components.model import component_model

RESIDENT = "parcours_ramp.components.node_program"

collect_ignore_glob = ["counter/*.py", "errand/*.py"]
"""Programs of foreign nodes: not to be imported for doctests, since their message types are built by a test."""


@pytest.fixture(scope="session")
def ramp() -> Iterator[Ros2Transport]:
    """RAMP's components as nodes, for component cases."""
    model = component_model()
    names = [component.name for component in model.components]
    nodes = nodes_of(links(model), names, f"{RESIDENT}:ComponentNodeProgram")
    with real_time():
        transport = Ros2Transport(nodes, interfaces(model), [RESIDENT, "parcours_ramp.components.warm"])
        yield transport
        transport.close()


def lives(pid: int) -> bool:
    """Whether a process runs; one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def soon(holds: Callable[[], bool], within: float = 10.0) -> bool:
    """Whether something comes to hold within that many seconds."""
    deadline = time.monotonic() + within
    while time.monotonic() < deadline:
        if holds():
            return True
        time.sleep(0.01)
    return holds()

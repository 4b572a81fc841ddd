"""What the tests on real ROS 2 share: RAMP's nodes on one graph, foreign nodes, processes seen from outside."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from parcours.run.binding.decoding import Decoder
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.run.hosts.interfaces import interfaces
from parcours.run.hosts.node_program import nodes_of
from parcours.run.hosts.ros2.transport import Ros2Transport
from parcours.run.hosts.scheduling import real_time
from parcours.run.port import links
from parcours.run.recording import Raw
from parcours_navigation.foreign.tester_messages import Maker
from parcours_ramp.components.model import component_model

RESIDENT = "parcours_ramp.components.node_program"

collect_ignore_glob = ["bridge/*.py", "counter/*.py", "errand/*.py"]
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


class Run:
    """Foreign nodes that have been started, and what is said to them."""

    def __init__(self, host: ForeignHost) -> None:
        self.session, self._host, self._maker = Session(host, whole(host.binding)), host, Maker(host.compile())
        try:
            self.session.start()
        except BaseException:
            self.session.end()
            raise

    def say(self, channel: str, until: Callable[[], bool], within: float = 20.0) -> bool:
        """Send a message of the environment, and return whether something has happened within so many seconds."""
        self.session.relay.inject(channel, self._maker.of_the_environment(channel, self.session.now()))
        return self.wait(until, within)

    def wait(self, until: Callable[[], bool], within: float = 20.0) -> bool:
        """Relay until something has happened, for so many seconds at most; return whether it has."""
        last = self.session.now() + round(within * 1e9)
        while not until() and self.session.now() < last:
            self.session.poll(self.session.now() + 5_000_000)
        return until()

    def has(self, kind: str, channel: str) -> bool:
        """Whether that happened on a channel."""
        return any((one.kind, one.channel) == (kind, channel) for one in self.session.relay.events)

    def message(self, channel: str) -> Any:
        """Return the one message that came on a channel."""
        [event] = [one for one in self.session.relay.events if (one.kind, one.channel) == ("receive", channel)]
        assert isinstance(event.payload, Raw)
        return Decoder(self._host.binding, self._host.graph.types).message(channel, event.payload.content)

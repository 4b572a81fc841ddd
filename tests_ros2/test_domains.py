"""Nodes on several domains: joined by the tester as on one, and a domain that somebody uses already."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests_ros2.conftest import Run, soon

from parcours.errors import HostFailure
from parcours.run.binding import read_binding
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.running import ForeignStudy
from parcours_navigation.foreign.setup_steps import act
from parcours_navigation.foreign.tester_messages import Maker

COUNTER = Path(__file__).parent / "counter"
CLIENT, CLERK, STRANGE = 61, 62, 63
BESIDE = """
observe:
  overheard: {topic: /parameter_events, type: rcl_interfaces/ParameterEvent, domain: 62}
before_case:
- {set: /clerk/fee, to: 40.0}
- {wait: /clerk/fee, is: 40.0, domain: 62}
"""


@pytest.fixture
def parted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A binding whose client and clerk are on two domains; neither is that of the environment."""
    file = shutil.copytree(COUNTER, tmp_path / "counter") / "binding.yaml"
    text = file.read_text()
    for node, domain in (("/client", CLIENT), ("/clerk", CLERK)):
        text = text.replace(f"ros_node: {node}\n", f"ros_node: {node}\n    domain: {domain}\n")
    file.write_text(text + BESIDE)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "60")
    return file


def test_topics_calls_and_steps_reach_nodes_on_other_domains(parted: Path, tmp_path: Path) -> None:
    with ForeignHost(read_binding(parted), tmp_path) as host:
        session = Session(host, whole(host.binding))
        try:
            session.start()
            assert [host.graph.answers(f"/clerk{where}") for where in ("", "@61", "@62")] == [False, False, True]
            act(session, "before_case")
            session.relay.inject("order", Maker(host.compile()).of_the_environment("order", session.now()))
            until = session.now() + 20_000_000_000
            sent = lambda channel: [e for e in session.relay.events if (e.kind, e.channel) == ("send", channel)]  # noqa: E731
            while not (sent("bill") and sent("posted")) and session.now() < until:
                session.poll(until)
        finally:
            session.end()
        decoder = Decoder(host.binding, host.graph.types)
        [bill] = [decoder.message("bill", event.payload.content) for event in sent("bill")]
        assert bill.point.x == 7.0 + (1.0 + 41.0) + (100.0 + 41.0)
        events = [decoder.message("overheard", event.payload.content) for event in sent("overheard")]
        assert {event.node for event in events} == {"/clerk"}
        assert decoder.message("posted", sent("posted")[0].payload.content).point.x == 3.0


def test_the_order_of_a_case_is_enforced_over_domains(parted: Path, tmp_path: Path) -> None:
    with ForeignHost(read_binding(parted), tmp_path / "nodes") as host:
        order = ProcessOrder(str(parted), str(tmp_path), abstract=("sale-tp11.tp31-0.0/0",))
        [result] = ForeignStudy(host, order).run()
    assert result.judged.judgement.passed, result.judged.judgement.why


LAUNCHED = """  Launch:
    command: [sh, -c, "python3 passing.py /tick /reading --ros-args -r __node:=sensor PARAMETER & wait"]
    components: []
    domain: 68
  Sensor:
    running: true
    ros_node: /sensor
    domain: 68
    after: [Launch]
    timeout: 120 s
"""


@pytest.mark.parametrize("follows", [True, False])
def test_a_launched_node_that_does_not_follow_clock_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, follows: bool
) -> None:
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "60")
    file = shutil.copytree(COUNTER.with_name("bridge"), tmp_path / "bridge") / "binding.yaml"
    text = file.read_text()
    launched = LAUNCHED.replace("PARAMETER", f"-p use_sim_time:={str(follows).lower()}")
    text = text[: text.index("  Sensor:")] + launched + text[text.index("  Display:") :]
    file.write_text(text.replace("\nnodes:", "clock: 100 Hz\n\nnodes:"))
    with ForeignHost(read_binding(file), tmp_path / "nodes") as host:
        if follows:
            run = Run(host)
            assert run.say("tick", lambda: run.has("receive", "shown"))
            run.session.end()
        else:
            with pytest.raises(HostFailure, match=r"node Sensor: /sensor@68 must take .*ros2-sim-time"):
                Run(host)


def sees(host: ForeignHost, node: str) -> bool:
    host.graph.spin(time.perf_counter_ns() + 10_000_000)
    return host.graph.answers(node)


@contextlib.contextmanager
def stranger() -> Iterator[None]:
    """A node that nobody here knows, on a domain of its own."""
    words = [sys.executable, str(COUNTER / "clerk.py"), "--ros-args", "-r", "__node:=stranger"]
    node = subprocess.Popen(words, env={**os.environ, "ROS_DOMAIN_ID": str(STRANGE)})
    try:
        yield
    finally:
        node.kill()
        node.wait()


def test_a_domain_that_foreign_nodes_use_is_refused_unless_some_are_the_users_own(
    parted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(STRANGE))
    with stranger():
        with ForeignHost(read_binding(parted), tmp_path) as host:  # in a network of its own nobody else can be
            assert soon(lambda: sees(host, "/stranger"), 30.0)
        with pytest.raises(HostFailure, match=r"domain 63: .* /stranger run there already.*ros2-occupied"):
            ForeignHost(read_binding(parted), tmp_path, is_shared=True).__enter__()
        parted.write_text(
            parted.read_text().replace(
                "nodes:\n", "nodes:\n  Other: {running: true, ros_node: /stranger, components: []}\n"
            )
        )
        with ForeignHost(read_binding(parted), tmp_path, is_shared=True) as host:
            assert soon(lambda: sees(host, "/stranger"))

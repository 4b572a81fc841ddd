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
from parcours_navigation.foreign.recorded import rejudge
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


def test_the_order_of_a_case_is_enforced_over_domains_and_its_recording_says_so_again(
    parted: Path, tmp_path: Path
) -> None:
    with ForeignHost(read_binding(parted), tmp_path / "nodes") as host:
        order = ProcessOrder(str(parted), str(tmp_path), abstract=("sale-tp11.tp31-0.0/0",), record="mcap")
        [result] = ForeignStudy(host, order).run()
    assert result.judged.judgement.passed, result.judged.judgement.why
    again, recorded, _ = rejudge(tmp_path / result.recording, read_binding(parted))
    assert (again.judgement, recorded) == (result.judged.judgement, "pass")


LED = """

def told(what):
    print(what, flush=True)
    return TransitionCallbackReturn.SUCCESS


Clerk.on_configure = lambda self, state: told("configure")
Clerk.on_activate = lambda self, state: told("activate")
Clerk.on_deactivate = lambda self, state: told("deactivate")
"""


@pytest.mark.parametrize("domain", [CLERK, CLIENT])
def test_a_lifecycle_node_is_led_on_its_own_domain(parted: Path, tmp_path: Path, domain: int) -> None:
    clerk = parted.with_name("clerk.py")
    lifecycle = "rclpy.lifecycle import LifecycleNode as Node, TransitionCallbackReturn"
    text = clerk.read_text().replace("rclpy.node import Node", lifecycle)
    clerk.write_text(text.replace('\n\nif __name__ == "__main__":', LED + '\n\nif __name__ == "__main__":'))
    led = parted.read_text().replace("    ros_node: /clerk\n", "    ros_node: /clerk\n    life: active\n")
    step = f"- {{life: /clerk, is: LIFE, domain: {domain}, timeout: 3 s}}\n"
    parted.write_text(led + step.replace("LIFE", "inactive") + step.replace("LIFE", "active"))
    with ForeignHost(read_binding(parted), tmp_path / "nodes") as host:
        run = Run(host)
        try:
            if domain == CLERK:
                act(run.session, "before_case")
                assert run.say("order", lambda: run.has("send", "bill"))
            else:
                with pytest.raises(HostFailure, match=r"/clerk@61 .*foreign-step"):
                    act(run.session, "before_case")
            said = host.running["Clerk"][1].output().split()
        finally:
            run.session.end()
    assert said == ["configure", "activate", "deactivate", "activate"][: None if domain == CLERK else 2]


def test_a_killed_node_that_the_user_started_is_missed_on_its_domain_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "60")
    file = shutil.copytree(COUNTER, tmp_path / "counter") / "binding.yaml"
    text = file.read_text().replace("parameters:\n  /clerk/fee: 41.0\n\n", "")
    for name, domain in (("client", CLIENT), ("clerk", CLERK)):
        text = text.replace(f"command: [python3, {name}.py]", "running: true")
        text = text.replace(f"ros_node: /{name}\n", f"ros_node: /{name}\n    domain: {domain}\n")
    file.write_text(text)
    client, clerk = started("client", CLIENT), started("clerk", CLERK)
    namesake = started("clerk", CLIENT, "/price:=/fee", "/menu:=/board", "/posted:=/seen")
    with client, clerk as process, namesake, ForeignHost(read_binding(file), tmp_path / "nodes") as host:
        run = Run(host)
        try:
            assert run.say("order", lambda: run.has("send", "bill"))
            process.kill()
            assert run.wait(lambda: bool(run.session.deaths), 60.0)
        finally:
            run.session.end()
    assert list(run.session.deaths) == ["Clerk"]
    assert "/clerk@62 does not answer any more since" in run.session.deaths["Clerk"]


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
def started(program: str, domain: int, *remapped: str) -> Iterator[subprocess.Popen[bytes]]:
    """A node that the tester has not started."""
    remaps = [word for one in remapped for word in ("-r", one)]
    words = [sys.executable, str(COUNTER / f"{program}.py"), "--ros-args", *remaps]
    node = subprocess.Popen(words, env={**os.environ, "ROS_DOMAIN_ID": str(domain)})
    try:
        yield node
    finally:
        node.kill()
        node.wait()


def test_a_domain_that_foreign_nodes_use_is_refused_unless_some_are_the_users_own(
    parted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(STRANGE))
    with started("clerk", STRANGE, "__node:=stranger"):
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

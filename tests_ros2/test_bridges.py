"""What carries messages from one domain to another, the tester or a bridge of the system: qualities, deaths."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path

import pytest
from tests_ros2.conftest import Run

from parcours.errors import HostFailure
from parcours.run.binding import read_binding
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.running import ForeignStudy

BRIDGE = """  Bridge:
    command: [python3, passing.py, /reading, /reading, "68", "69", --ros-args, -r, "__node:=bridge"]
    components: []
    ros_node: /bridge
    domain: 68
    ready: [{parameter: /bridge/use_sim_time, is: false}]   # it spins, so both its ends are there
    timeout: 120 s
"""
ALONE = ("queue: 10, fields: {x: point.x}}\n  shown", "queue: 10, observe: true, fields: {x: point.x}}\n  shown")


@pytest.fixture
def binding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("ROS_DOMAIN_ID", "60")
    return shutil.copytree(Path(__file__).parent / "bridge", tmp_path / "bridge") / "binding.yaml"


def edit(file: Path, *changes: tuple[str, str]) -> None:
    text = file.read_text()
    for old, new in changes:
        assert text.count(old) >= 1, old
        text = text.replace(old, new)
    file.write_text(text)


def bridged(file: Path, *changes: tuple[str, str]) -> Path:
    """Return the binding with a bridge among its nodes."""
    edit(file, ("\nquiescence", f"{BRIDGE}\nquiescence"), *changes)
    return file


def hasty(file: Path, *nodes: str) -> None:
    """Let nodes offer and request best effort."""
    edit(file, *((f'/{said}, --ros-args, -r, "__node:={node}"', f'/{said}, hasty, --ros-args, -r, "__node:={node}"')
                 for node, said in (("sensor", "reading"), ("display", "shown")) if node in nodes))  # fmt: skip


@pytest.mark.parametrize("nodes", [(), ("display",), ("sensor", "display")])
def test_the_tester_takes_the_place_of_a_bridge_in_any_quality_that_connects(
    binding: Path, tmp_path: Path, nodes: tuple[str, ...]
) -> None:
    hasty(binding, *nodes)
    with ForeignHost(read_binding(binding), tmp_path / "nodes") as host:
        [tick] = ForeignStudy(host, ProcessOrder(str(binding), str(tmp_path), abstract=("show-tp11.tp21-0.0/0",))).run()
    assert tick.judged.judgement.passed, tick.judged.judgement.why


def test_ends_on_two_domains_that_would_not_connect_are_named(binding: Path, tmp_path: Path) -> None:
    hasty(binding, "sensor")
    with ForeignHost(read_binding(binding), tmp_path) as host, pytest.raises(HostFailure) as caught:
        Run(host)
    said = "cannot connect /sensor with /display: /sensor offers best effort, but reliable is requested by /display"
    assert (caught.value.slug, said in str(caught.value).replace("\n", " ")) == ("qos-mismatch", True)


@pytest.mark.parametrize("victim", ["Sensor", "Display"])
def test_a_node_that_dies_on_its_domain_is_named_and_the_next_run_has_another(
    binding: Path, tmp_path: Path, victim: str
) -> None:
    with ForeignHost(read_binding(binding), tmp_path) as host:
        first = Run(host)
        try:
            assert first.say("tick", lambda: first.has("receive", "shown"))
            os.kill(host.running[victim][1].pid, signal.SIGKILL)
            assert first.wait(lambda: bool(first.session.deaths))
        finally:
            first.session.end()
        assert list(first.session.deaths) == [victim] and "SIGKILL" in first.session.deaths[victim]
        second = Run(host)
        try:
            assert second.say("tick", lambda: second.has("receive", "shown"))
        finally:
            second.session.end()
        assert second.message("shown").point.x == 7.0


def test_a_bridge_of_the_system_carries_what_is_observed_and_its_death_is_named(binding: Path, tmp_path: Path) -> None:
    bridged(binding, ALONE)
    with ForeignHost(read_binding(binding), tmp_path) as host:
        run = Run(host)
        try:
            # Nobody is told when a bridge has found all the ends that it joins.
            assert any(run.say("tick", lambda: run.has("receive", "shown"), within=1.0) for _ in range(20))
            os.kill(host.running["Bridge"][1].pid, signal.SIGKILL)
            assert run.wait(lambda: bool(run.session.deaths))
        finally:
            run.session.end()
    assert list(run.session.deaths) == ["Bridge"] and "SIGKILL" in run.session.deaths["Bridge"]


def test_a_case_that_needs_what_a_bridge_carries_is_inconclusive_and_says_how_to_have_it(
    binding: Path, tmp_path: Path
) -> None:
    bridged(binding, ALONE)
    with ForeignHost(read_binding(binding), tmp_path / "nodes") as host:
        [show] = ForeignStudy(host, ProcessOrder(str(binding), str(tmp_path), abstract=("show-tp11.tp21-0.0/0",))).run()
    assert show.judged.judgement.verdict is Verdict.INCONCLUSIVE
    assert "reading is only observed" in show.judged.judgement.why


def refusal(host: ForeignHost) -> HostFailure | None:
    try:
        run = Run(host)
    except HostFailure as error:
        return error
    run.session.end()
    return None


def test_a_bridge_beside_the_tester_would_say_all_twice_and_is_named(binding: Path, tmp_path: Path) -> None:
    bridged(binding, ("    timeout: 120 s\n", "    timeout: 120 s\n    remap: false\n"))
    with ForeignHost(read_binding(binding), tmp_path) as host:  # discovery of one of its ends may come too late
        error = next(filter(None, (refusal(host) for _ in range(10))))
    assert error.slug == "bridged-twice"
    assert "/bridge hears it there, and /bridge says it, too" in str(error).replace("\n", " ")

"""Nodes that know nothing of Parcours, on a real master: order, conformance, life, recordings."""

from __future__ import annotations

import itertools
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from tests_ros1.conftest import patient

from parcours.run.binding import read_binding
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.run.hosts.ros1.client import Ros1Node
from parcours.run.hosts.ros1.endpoints import Kind
from parcours.run.hosts.ros1.graph import Slave, ask
from parcours.run.hosts.ros1.master import Master
from parcours.run.hosts.ros1.streams import Stream, read_header, write_header
from parcours.run.recording import read_recording
from parcours.run.trace import held
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.abstract import AbstractDrive, _Turn
from parcours_navigation.foreign.cases import abstract_scenes
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.recorded import rejudge
from parcours_navigation.foreign.results import Result
from parcours_navigation.foreign.running import ForeignStudy, SystemDrive

EXAMPLES = Path(__file__).parents[1] / "examples"
TOGETHER, SIDE_BY_SIDE = "ITP1-tp22.tp31.tp22-0.1.1", "plan-tp31.tp22.tp31-0.5.6"


@pytest.fixture
def nodes(tmp_path: Path) -> Path:
    """A copy of the Python nodes, hastened, to be changed."""
    folder = shutil.copytree(EXAMPLES / "ros1_python", tmp_path / "nodes")
    _hasten(folder / "binding.yaml")
    return folder


def _hasten(binding: Path) -> None:
    """Make the robot faster, and give the nodes all the time that they may need on a busy machine."""
    _edit(binding, ("/follower/speed: 0.25", "/follower/speed: 1.2"), ("v_max: 0.25", "v_max: 1.2"),
          ("quiescence: 1 s", "quiescence: 3 s"))  # fmt: skip
    patient(binding)


def _edit(file: Path, *changes: tuple[str, str]) -> None:
    text = file.read_text()
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text)


def _run(binding: Path, out: Path, **wanted: Any) -> list[Result]:
    with ForeignHost(read_binding(binding), out / "nodes") as host:
        return list(ForeignStudy(host, ProcessOrder(str(binding), str(out), **wanted)).run())


def _one(binding: Path, out: Path, case: str, record: str = "") -> Result:
    [result] = _run(binding, out, abstract=(f"{case}/0",), record=record)
    return result


@pytest.mark.parametrize("case", [TOGETHER, SIDE_BY_SIDE, "sense_to_motion-tp11.tp32-0.0"])
def test_cases_of_the_model_pass_in_their_order_and_a_recording_says_so_again(
    nodes: Path, tmp_path: Path, case: str
) -> None:
    for attempt in range(5):  # where the machine was too busy to enforce the order, that is said, and it is tried again
        out = tmp_path / str(attempt)
        result = _one(nodes / "binding.yaml", out, case, "mcap")
        if result.judged.judgement.verdict is not Verdict.INCONCLUSIVE:
            break
    assert result.judged.judgement.passed, result.judged.judgement.why
    assert result.judged.held
    recording = read_recording(out / result.recording)
    kept = held(recording.trace)
    assert sorted(kept.values()) == sorted(result.judged.held)
    again, recorded, _ = rejudge(out / result.recording, read_binding(nodes / "binding.yaml"))
    assert (again.judgement, recorded) == (result.judged.judgement, "pass")


def test_what_cannot_be_kept_in_order_has_no_verdict(
    nodes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    give = AbstractDrive._give

    def give_and_wait(self: AbstractDrive, reference: int, turn: _Turn) -> None:
        give(self, reference, turn)
        until = time.monotonic() + 30.0
        while reference in self._frozen and not self._failed and time.monotonic() < until:
            self._session.poll(self._session.now() + 5_000_000)

    monkeypatch.setattr(Session, "hold", lambda self, slot: False)  # as if its process were somebody else's
    monkeypatch.setattr(AbstractDrive, "_give", give_and_wait)  # and faster than we are
    judgement = _one(nodes / "binding.yaml", tmp_path, SIDE_BY_SIDE).judged.judgement
    assert judgement.verdict is Verdict.INCONCLUSIVE
    assert "could not be enforced" in judgement.why


PLANTED = {
    "sends unasked": ("obstacle_filter.py", 'self.least_gap = rospy.get_param("~least_gap", 0.05)',
                      "rospy.Timer(rospy.Duration(0.02), lambda e: self.publisher.publish(PoseArray()))\n"
                      '        self.least_gap = rospy.get_param("~least_gap", 0.05)',
                      "obstacles was sent, but nothing that it may do now sends it"),
    "is silent": ("obstacle_filter.py", "self.publisher.publish(kept)", "pass",
                  "nothing came on obstacles within 1000 ms, but must"),
}  # fmt: skip


@pytest.mark.parametrize("planted", PLANTED)
def test_a_planted_deviation_is_found_with_what_was_expected(nodes: Path, tmp_path: Path, planted: str) -> None:
    file, old, new, found = PLANTED[planted]
    _edit(nodes / file, (old, new))
    if planted == "is silent":  # the case ends in three seconds
        _edit(nodes / "binding.yaml", ("quiescence: 3 s", "quiescence: 1 s"))
    result = _run(nodes / "binding.yaml", tmp_path, system=(0,), protocol="empty")[0]
    assert result.judged.judgement.verdict is Verdict.FAIL
    deviation = next(one for one in result.judged.deviations if one.component == "ObstacleFilter")
    assert found in deviation.rule
    assert {str(one) for one in deviation.expected} <= {"receive detections", "send obstacles"}


def _killed_when_half_way(monkeypatch: pytest.MonkeyPatch, node: str) -> None:
    sense = SystemDrive._sense
    struck: list[int] = []

    def strike(self: SystemDrive, now: int) -> None:
        sense(self, now)
        process = self._session.host.running[node][1]
        if now > 1_200_000_000 and not struck:
            struck.append(now)
            os.kill(process.pid, signal.SIGKILL)

    monkeypatch.setattr(SystemDrive, "_sense", strike)


def test_a_dead_planner_fails_the_case_though_the_robot_coasts_to_its_goal(
    nodes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _killed_when_half_way(monkeypatch, "Planner")
    result = _run(nodes / "binding.yaml", tmp_path, system=(0,), protocol="empty", record="bag")[0]
    judged = result.judged
    assert judged.judgement.verdict is Verdict.FAIL
    assert judged.outcome == "reached"
    assert "Planner (killed by SIGKILL" in judged.judgement.why
    again, recorded, _ = rejudge(tmp_path / result.recording, read_binding(nodes / "binding.yaml"))
    assert (again.judgement, again.outcome, recorded) == (judged.judgement, "reached", "fail")


def _built(folder: Path) -> Path:
    """Return the binding of the C++ nodes, built by the one line that it names."""
    shutil.copytree(EXAMPLES / "ros1_cpp", folder / "ros1_cpp")
    shutil.copytree(EXAMPLES / "ros1_python", folder / "ros1_python")
    (folder / "ros1_cpp" / "build").mkdir()
    libraries = ["-lroscpp", "-lroscpp_serialization", "-lrosconsole", "-lrostime", "-lboost_thread"]
    building = [
        subprocess.Popen(["g++", "-std=c++17", f"{node}.cpp", "-o", f"build/{node}", *libraries],
                         cwd=folder / "ros1_cpp")
        for node in ("avoider", "follower")
    ]  # fmt: skip
    assert [one.wait() for one in building] == [0, 0]
    return folder / "ros1_cpp" / "binding.yaml"


def _verdicts(results: Sequence[Result]) -> dict[str, str]:
    return {one.id: f"{one.judged.judgement.verdict}: {one.judged.judgement.why}" for one in results}


def test_nodes_in_cpp_behind_the_same_model_pass(tmp_path: Path) -> None:
    binding = _built(tmp_path)
    _hasten(binding)
    first = tuple(scene.id for scene in itertools.islice(abstract_scenes(read_binding(binding), 1), 3))
    verdicts = _verdicts(_run(binding, tmp_path, abstract=first, system=(0,), protocol="empty"))
    assert all(why.startswith("pass") for why in verdicts.values()), verdicts
    assert len(verdicts) == 4


MODEL = """
parcours: model/1
name: gauge
messages: {Level: {fields: {level: {type: real, unit: m}}}}
channels: {level: {from: Gauge, to: environment, message: Level}}
components:
  Gauge: {machines: {measure: {initial: on, transitions: {g1: {from: on, to: on, message: level}}}}}
"""
BINDING = """
parcours: binding/1
name: gauge
model: model.yaml
transport: ros1
nodes: {Gauge: {command: [/usr/bin/python3, gauge.py], ros_node: /gauge, timeout: 120 s, env: {PYTHONPATH: "%s"}}}
channels: {level: {topic: /level, type: gauge_msgs/Level, fields: {level: "mm[0] * 0.001"}}}
"""
GAUGE = """
import rospy
from gauge_msgs.msg import Level
rospy.init_node("gauge")
publisher = rospy.Publisher("/level", Level, queue_size=10)
while not rospy.is_shutdown():
    publisher.publish(mm=[250, 251])
    rospy.sleep(0.02)
"""


def test_a_type_that_only_the_node_knows_is_learned_from_its_connection(tmp_path: Path) -> None:
    package = tmp_path / "gauge_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "msg" / "Level.msg").write_text("int32[] mm\n")
    generator = ["/usr/bin/python3", "/usr/lib/genpy/genmsg_py.py"]
    made = tmp_path / "python" / "gauge_msgs" / "msg"
    arguments = ["-p", "gauge_msgs", "-o", str(made)]
    subprocess.run([*generator, *arguments, str(package / "msg" / "Level.msg")], check=True)
    subprocess.run([*generator, *arguments, "--initpy"], check=True)
    (made.parent / "__init__.py").touch()
    for name, text in (("model.yaml", MODEL), ("gauge.py", GAUGE), ("binding.yaml", BINDING % (tmp_path / "python"))):
        (tmp_path / name).write_text(text)
    [result] = _run(tmp_path / "binding.yaml", tmp_path / "out", abstract=("Gauge-tp11/0",), record="mcap")
    assert (result.id, result.judged.judgement.verdict) == ("Gauge-tp11/0", Verdict.PASS), result.judged.judgement.why
    again, _, _ = rejudge(tmp_path / "out" / result.recording, read_binding(tmp_path / "binding.yaml"))
    assert again.judgement == result.judged.judgement


def test_a_publisher_that_hangs_up_at_first_is_heard_all_the_same() -> None:
    kind = Kind("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data\n")
    refused: list[str] = []
    heard: list[bytes] = []
    with Master() as master, socket.create_server(("127.0.0.1", 0)) as door:
        door.settimeout(30.0)
        where = ["TCPROS", *door.getsockname()]
        speaker = Slave(master.uri, {"requestTopic": lambda topic, protocols: where})
        middle = Ros1Node("/parcours", master.uri, refused.append)
        try:
            ask(master.uri, "registerPublisher", "/speaker", "/said", kind.type, speaker.uri)
            middle.subscribe("/said", kind, heard.append)
            middle.join()
            door.accept()[0].close()
            connection, _ = door.accept()
            assert read_header(connection)["topic"] == "/said"
            write_header(connection, kind.fields() | {"callerid": "/speaker", "topic": "/said"})
            said = Stream(connection, "/parcours")
            said.send(b"now")
            until = time.perf_counter_ns() + 30_000_000_000
            while not heard and time.perf_counter_ns() < until:
                middle.spin(until)
            said.close()
        finally:
            middle.close()
            speaker.close()
    assert heard == [b"now"]
    assert len(refused) == 1 and refused[0].startswith("/said: no connection to the publisher at ")

"""What is wrong with a foreign system is said within 5 s: what, and where."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from tests_ros1.conftest import patient

from parcours.errors import HostFailure
from parcours.run.binding import read_binding
from parcours.run.binding.slots import whole
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.process import KeptProcess
from parcours.run.hosts.foreign.session import Session
from parcours.run.hosts.ros1.master import Master
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.isolation import ProcessOrder
from parcours_navigation.foreign.running import ForeignStudy

EXAMPLE = Path(__file__).parents[1] / "examples" / "ros1_python"
WITHIN = 30.0


@pytest.fixture
def binding(tmp_path: Path) -> Path:
    """A copy of the example's binding, to be spoilt."""
    return shutil.copytree(EXAMPLE, tmp_path / "nodes") / "binding.yaml"


def _spoil(file: Path, *changes: tuple[str, str]) -> None:
    text = file.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file.write_text(text)


def _complaint(binding: Path, out: Path, master: str = "") -> HostFailure:
    began = time.monotonic()
    with pytest.raises(HostFailure) as caught, ForeignHost(read_binding(binding), out, master) as host:
        session = Session(host, whole(host.binding))
        try:
            session.start()
        finally:
            said = time.monotonic()
            session.end()
    assert (said if "said" in locals() else time.monotonic()) - began < WITHIN
    return caught.value


def test_an_absent_topic_is_named_with_its_line_and_its_like(binding: Path, tmp_path: Path) -> None:
    _spoil(binding, ("topic: /stopped", "topic: /stoped"))
    error = _complaint(binding, tmp_path)
    assert error.slug == "absent-topic"
    assert "did you mean '/stopped'?" in str(error)
    assert re.match(rf"{re.escape(str(binding))}:\d+", error.where)


def test_another_type_is_named_with_who_sends_it(binding: Path, tmp_path: Path) -> None:
    twist = ("type: geometry_msgs/Twist", "type: geometry_msgs/Pose")
    fields = ("linear.x", "position.x"), ("angular.z", "position.y")
    _spoil(binding, twist, *(("{v: linear.x, w: angular.z}", "{v: position.x, w: position.y}"),), *(
        (f"command.{old}", f"command.{new}") for old, new in fields
    ))  # fmt: skip
    error = _complaint(binding, tmp_path)
    assert error.slug == "topic-type"
    assert "/follower publishes /cmd_vel as geometry_msgs/Twist" in str(error)


def test_a_master_that_is_not_there_is_named(binding: Path, tmp_path: Path) -> None:
    assert _complaint(binding, tmp_path, "http://127.0.0.1:9").slug == "no-master"


def test_a_command_that_cannot_be_run_is_named(binding: Path, tmp_path: Path) -> None:
    _spoil(binding, ("/usr/bin/python3, avoider.py", "/no/such/planner, avoider.py"))
    error = _complaint(binding, tmp_path)
    assert (error.slug, error.where) == ("foreign-start", "node Planner")


def test_a_node_that_dies_at_once_is_quoted(binding: Path, tmp_path: Path) -> None:
    _spoil(binding.parent / "avoider.py", ('rospy.init_node("avoider")', 'raise SystemExit("no map")'))
    patient(binding)
    error = _complaint(binding, tmp_path)
    assert error.slug == "foreign-start"
    assert "exit status 1; its last lines: no map" in str(error)


def test_a_port_in_use_is_named() -> None:
    with Master() as master, pytest.raises(HostFailure, match=r"a ROS master .* listens there"):
        Master(master.port).__enter__()


def test_a_message_of_the_wrong_size_is_an_error_with_the_line_of_its_channel(binding: Path, tmp_path: Path) -> None:
    short = "Twist.serialize = lambda self, to: to.write(b'xyz')\n\n\nclass Follower:"
    _spoil(binding.parent / "follower.py", ("class Follower:", short))
    patient(binding)
    with ForeignHost(read_binding(binding), tmp_path) as host:
        order = ProcessOrder(str(binding), str(tmp_path), system=(0,), protocol="empty")
        result = next(ForeignStudy(host, order).run())
    assert result.judged.judgement.verdict is Verdict.ERROR
    assert re.search(r"binding.yaml:\d+: channel 'command': .*these 3 bytes are not one", result.judged.judgement.why)
    assert result.seconds < WITHIN


def test_nothing_that_a_node_has_started_outlives_it(tmp_path: Path) -> None:
    mark = f"{time.monotonic_ns() % 10**9 + 10**9}"
    command = ["/bin/sh", "-c", f"setsid sleep {mark} & exec sleep {mark}"]
    process = KeptProcess("sleeper", command, tmp_path, {"PATH": "/usr/bin:/bin"}, tmp_path / "log")
    process.await_start()
    process.ask_to_end()
    process.end(2.0)
    assert process.how().startswith("killed by SIG")
    assert subprocess.run(["pgrep", "-f", f"sleep {mark}"], stdout=subprocess.DEVNULL, check=False).returncode == 1

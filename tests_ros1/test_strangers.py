"""Other people's nodes on the same graph, with real rospy: they may listen; what else they do is refused, and told."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

import pytest
from tests_ros1 import ros1_toys as toys

from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours.run.port import ENVIRONMENT, Link, LinkKind, links

PIPE = (Link("numbers", "Source", "Sink", 1, LinkKind.SERVICE), Link("seen", "Sink", ENVIRONMENT, 1000))
_LIMIT = 20_000_000_000

_HEAD = """
import sys, time
import rospy
from std_msgs.msg import String
sys.path.insert(0, sys.argv[1] + "/python")
import toys.msg, toys.srv
rospy.init_node("stranger", disable_signals=True)
"""

_LISTENER = """
heard = []
hear = lambda message: heard.append(message.number)
subscriber = rospy.Subscriber("/numbers", toys.msg.Numbers, hear, tcp_nodelay=True)
print("ready", flush=True)
sys.stdin.readline()
deadline = time.monotonic() + 10.0
while len(heard) < 40 and time.monotonic() < deadline:
    time.sleep(0.01)
print(heard, flush=True)
"""

_INTRUDER = """
publishers = [rospy.Publisher("/parcours/out/seen", String, queue_size=1),
              rospy.Publisher("/parcours/out/numbers", toys.msg.Numbers, queue_size=1)]
print("ready", flush=True)
sys.stdin.readline()
"""

_CALLER = """
try:
    rospy.ServiceProxy("/parcours/out/counting", toys.srv.Counting)([104, 105], [])
except rospy.ServiceException as error:
    print(error, flush=True)
"""


def _rospy(transport: Ros1Transport, script: str) -> subprocess.Popen[str]:
    """Start a stranger that finds the transport's master in its environment."""
    return subprocess.Popen([sys.executable, "-c", _HEAD + script, str(transport.folder)], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True)  # fmt: skip


def _said(stranger: subprocess.Popen[str]) -> str:
    assert stranger.stdout is not None
    return stranger.stdout.readline().strip()


def _soon(holds: Callable[[], object], within: float = 10.0) -> bool:
    deadline = time.monotonic() + within
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.01)
    return bool(holds())


@pytest.fixture(scope="module")
def running(master: str) -> Iterator[Ros1Transport]:
    started = toys.transport_of(PIPE, ["Source", "Sink"], master=master)
    yield started
    started.close()


@pytest.fixture
def transport(running: Ros1Transport) -> Ros1Transport:
    running.refusals.clear()
    return running


def _run(transport: Ros1Transport) -> list[object]:
    host = RealTimeHost(transport, PIPE, toys.CODEC)
    host.run(_LIMIT)
    host.rest()
    return [e.payload for e in host.trace().events if e.kind == "send" and e.channel == "seen"]


def test_rospy_hears_what_passes_on_a_model_s_topic(transport: Ros1Transport) -> None:
    with _rospy(transport, _LISTENER) as stranger:
        assert _said(stranger) == "ready"
        tester = ask(transport.master, "lookupNode", "/test", "/parcours")
        assert _soon(lambda: "/stranger" in str(ask(tester, "getBusInfo", "/test"))), "it is connected"
        assert _run(transport) == list(range(40))
        assert stranger.stdin is not None
        stranger.stdin.write("\n")
        stranger.stdin.flush()
        assert _said(stranger) == str(list(range(40)))
    assert not transport.refusals


def test_publishers_that_do_not_belong_there_are_not_heard_and_named(transport: Ros1Transport) -> None:
    with _rospy(transport, _INTRUDER) as stranger:
        assert _said(stranger) == "ready"
        assert _soon(lambda: len(transport.refusals) == 2)
        wrong, foreign = sorted(transport.refusals, key=lambda text: "belongs" in text)
        assert (
            "/parcours/out/seen: no connection to the publisher at http://127.0.0.1:" in wrong
            and "types do not match" in wrong
        )
        assert foreign.startswith("/parcours/out/numbers: /stranger publishes toys/Numbers (md5 ")
        assert foreign.endswith(") there, but it belongs to /Source; it is not heard")
        assert _run(transport) == list(range(40))
        stranger.communicate("\n", timeout=20.0)


def test_a_stranger_s_call_is_declined_with_the_reason() -> None:
    transport = toys.transport_of(links(toys.MODEL), ["Client", "Counting"], model=toys.MODEL)
    with _rospy(transport, _CALLER) as stranger:
        assert "serves /Client only, but /stranger calls it" in _said(stranger)
    assert [text for text in transport.refusals if "/parcours/out/counting: serves /Client only" in text]
    transport.close()


def test_what_is_no_ros_is_told_and_harms_nobody(transport: Ros1Transport) -> None:
    tester = ask(transport.master, "lookupNode", "/test", "/parcours")
    _, host, port = ask(tester, "requestTopic", "/test", "/numbers", [["TCPROS"]])
    assert (host, urlsplit(tester).hostname) == ("127.0.0.1", "127.0.0.1"), "it listens on loopback"
    for said in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 64, b"\x08\0\0\0\x04\0\0\0what", b""):
        transport.refusals.clear()
        with socket.create_connection((host, port)) as connection:
            connection.sendall(said)
            with contextlib.suppress(OSError):  # it may have hung up already
                connection.shutdown(socket.SHUT_WR)
            assert _soon(lambda: transport.refusals)
        assert "ROS 1 connection: begins with a header, but: " in transport.refusals[0]
    assert _run(transport) == list(range(40))

"""The ROS 2 host: nodes live, are watched, are frozen and killed, and leave nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pytest
from tests_ros2.conftest import lives, soon

from parcours.errors import HostFailure
from parcours.model.structure import Cefsm, Channel
from parcours.run.hosts.battery import DUTIES, Counting, HostUnderTest, Sink, Source
from parcours.run.hosts.frames import (
    Deliver,
    Died,
    Idle,
    Ready,
    Received,
    Report,
    Rest,
    RunFreely,
    TransitionTaken,
    Wire,
)
from parcours.run.hosts.interfaces import Interface, interfaces
from parcours.run.hosts.node_program import Plain, nodes_of
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.ros2.participant import Ros2Participant
from parcours.run.hosts.ros2.transport import Ros2Transport
from parcours.run.hosts.scheduling import real_time
from parcours.run.hosts.slots import Answer
from parcours.run.port import ENVIRONMENT, Component, Link

DESK = (Link("ask", ENVIRONMENT, "Counting", 1000), Link("answer", "Counting", ENVIRONMENT, 1000))
NO_MODEL = Cefsm("none", (), ())
TOYS = "parcours.run.hosts.battery:node_program"


def toys(component: str) -> Plain:
    return Plain(component, {"Source": partial(Source, period=1_000_000), "Sink": Sink, "Counting": Counting})


def toy_host(components: Sequence[Component], links: Sequence[Link], tester: Answer) -> HostUnderTest:
    names = [part.name for part in components]
    return RealTimeHost(
        Ros2Transport(nodes_of(links, names, TOYS), interfaces(NO_MODEL, links)), links, toys(""), environment=tester
    )


def desk(channels: Sequence[Interface] = interfaces(NO_MODEL, DESK), domain: int | None = None) -> Ros2Transport:
    return Ros2Transport(nodes_of(DESK, ["Counting"], TOYS), channels, domain=domain)


def heard(transport: Ros2Transport, last: type | Report, within: float = 10.0) -> list[Report]:
    """Return what the one node says, up to that report, or the first of that kind."""
    said: list[Report] = []
    until = time.perf_counter_ns() + int(within * 1e9)
    while time.perf_counter_ns() < until:
        for _, report in transport.poll(until):
            said.append(report)
            if isinstance(report, last) if isinstance(last, type) else report == last:
                return said
    raise AssertionError(f"no {last}, only {said}")


@pytest.mark.parametrize("duty", DUTIES.values(), ids=DUTIES)
def test_it_does_what_every_host_owes(duty: Callable[..., None]) -> None:
    duty(toy_host)


def test_a_killed_node_is_noticed_after_its_last_words() -> None:
    transport = desk()
    transport.command("Counting", RunFreely(b"", time.perf_counter_ns()))
    heard(transport, Idle)
    transport.deliver("ask", 0, toys("").encode("ask", "a"))
    transport.poll(time.perf_counter_ns() + 100_000)
    transport.signal("Counting", signal.SIGSTOP)
    transport.signal("Counting", signal.SIGKILL)
    *_, died = heard(transport, Died)
    transport.close()
    assert isinstance(died, Died) and died.status == -signal.SIGKILL


def test_what_a_node_has_said_before_it_ended_is_heard() -> None:
    with real_time():
        transport = desk()
        transport.command("Counting", RunFreely(b"", time.perf_counter_ns()))
        heard(transport, Idle)
        transport.deliver("ask", 7, toys("").encode("ask", "a"))
        transport.poll(time.perf_counter_ns())
        time.sleep(1.0)  # it answers, and the tester does not listen yet
        transport.signal("Counting", signal.SIGKILL)
        assert soon(lambda: not lives(transport.pids["Counting"]))
        said = heard(transport, Died)
        transport.close()
    assert [type(one) for one in said] == [Received, TransitionTaken, Idle, Died]


def test_a_frozen_node_takes_up_afterwards_all_that_it_was_sent() -> None:
    transport = desk()
    transport.command("Counting", RunFreely(b"", time.perf_counter_ns()))
    heard(transport, Idle)
    transport.signal("Counting", signal.SIGSTOP)
    for number in range(500):
        transport.deliver("ask", number, toys("").encode("ask", "x" * 1000))
    assert not transport.poll(time.perf_counter_ns() + 100_000_000)
    transport.signal("Counting", signal.SIGCONT)
    said = heard(transport, Idle(500))
    transport.close()
    assert [one.number for one in said if isinstance(one, Received)] == list(range(500))
    assert [toys("").decode("answer", one.sends[0].data) for one in said if isinstance(one, TransitionTaken)] == [
        *range(1, 501)
    ]


def test_no_process_no_thread_and_no_shared_memory_is_left() -> None:
    desk().close()  # libraries keep some threads from their first use on
    threads, files = _threads(), _shared_memory()
    transport = desk()
    [pid] = transport.pids.values()
    assert _threads() > threads
    transport.signal("Counting", signal.SIGKILL)
    transport.close()
    transport.close()
    assert not lives(pid)
    assert soon(lambda: _threads() == threads)
    assert _shared_memory() == files


def _threads() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def _shared_memory() -> set[str]:
    return {entry.name for entry in Path("/dev/shm").glob("*fast*")}


def test_no_node_outlives_a_tester_that_is_killed() -> None:
    program = (
        "from tests_ros2.test_host import desk\n"
        "import time\n"
        "if __name__ == '__main__':\n"
        "    print(desk().pids['Counting'], flush=True)\n"
        "    time.sleep(60)\n"
    )
    tester = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True,
                              cwd=Path(__file__).parent.parent)  # fmt: skip
    assert tester.stdout is not None
    pid = int(tester.stdout.readline())
    assert lives(pid)
    tester.kill()
    tester.wait()
    tester.stdout.close()
    assert soon(lambda: not lives(pid), within=30.0)


def test_several_graphs_of_one_machine_do_not_hear_each_other() -> None:
    one = desk(domain=50)
    other = desk(domain=51)
    one.command("Counting", Rest())
    heard(one, Ready)
    assert not other.poll(time.perf_counter_ns() + 50_000_000)
    one.close()
    other.close()


def test_two_testers_do_not_share_a_graph() -> None:
    first = desk()
    with pytest.raises(HostFailure, match=r"ROS domain.*another tester.*ros2-occupied"):
        desk()
    first.command("Counting", RunFreely(b"", time.perf_counter_ns()))
    first.deliver("ask", 0, toys("").encode("ask", "a"))
    assert not any(isinstance(one, Died) for one in heard(first, Idle(1)))
    first.close()


def test_a_domain_that_does_not_exist_is_refused() -> None:
    with pytest.raises(HostFailure, match=r"0 to 232, but 9999.*ros2-domain"):
        desk(domain=9999)


def test_channels_that_would_share_a_topic_are_refused() -> None:
    two = Cefsm("two", (), tuple(Channel(one, ENVIRONMENT, "Counting", "Text", "/desk") for one in ("ask", "more")))
    with pytest.raises(HostFailure, match=r"ask, more.*topic-shared"):
        desk(interfaces(two))


def test_a_node_program_that_is_not_there_ends_the_start() -> None:
    began = time.monotonic()
    with pytest.raises(HostFailure, match=r"Counting.*node-start"):
        nobody = nodes_of(DESK, ["Counting"], "parcours.run.hosts.battery:nobody")
        Ros2Transport(nobody, interfaces(NO_MODEL, DESK))
    assert time.monotonic() - began < 20


def test_messages_travel_on_the_topics_that_the_model_names() -> None:
    model = Cefsm("desk", (), (
        Channel("ask", ENVIRONMENT, "Counting", "ObstacleList", "/obstacles"),
        Channel("answer", "Counting", ENVIRONMENT, "MotionState", "/update"),
    ))  # fmt: skip
    transport = desk(interfaces(model))
    onlooker = Ros2Participant("onlooker", int(os.environ["ROS_DOMAIN_ID"]))  # as any other node sees the graph
    wanted = {"/obstacles", "/parcours/out/update", "/parcours/Counting/command", "/parcours/Counting/report"}
    seen: dict[str, list[str]] = {}

    def sees_all() -> bool:
        seen.update(onlooker.node.get_topic_names_and_types())
        return wanted <= set(seen)

    try:
        assert soon(sees_all), seen
        assert {kind for topic in wanted for kind in seen[topic]} == {"std_msgs/msg/UInt8MultiArray"}
    finally:
        onlooker.close()
        transport.close()


def test_a_node_ends_at_once_even_if_a_message_that_was_announced_never_came() -> None:
    transport = desk()
    transport.command("Counting", Deliver(1, Wire("ask")))
    began = time.monotonic()
    transport.close()
    assert time.monotonic() - began < 1.5  # after 2 s it would be killed


@pytest.mark.parametrize("name", ["deliver", "command"])
def test_what_is_meant_for_nobody_goes_nowhere(name: str) -> None:
    transport = desk()
    transport.signal("Counting", signal.SIGKILL)
    heard(transport, Died)
    if name == "deliver":
        for channel in ("a channel that nobody knows", "ask", "answer"):
            transport.deliver(channel, 0, b"x")
    else:
        transport.command("Counting", Rest())
    assert not transport.poll(time.perf_counter_ns() + 20_000_000)
    transport.close()

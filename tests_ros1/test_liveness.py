"""Nodes that are killed or frozen are noticed, what cannot start is told at once, and nothing is left behind."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from tests_ros1 import ros1_toys as toys

from parcours.errors import HostFailure
from parcours.run.hosts.frames import Died, Rest, RunFreely
from parcours.run.hosts.realtime import RealTimeHost
from parcours.run.hosts.ros1.graph import ask
from parcours.run.hosts.ros1.master import Master
from parcours.run.hosts.ros1.transport import Ros1Transport
from parcours.run.port import ENVIRONMENT, Link, links

DESK = (Link("ask", ENVIRONMENT, "Counting", 100_000), Link("answer", "Counting", ENVIRONMENT, 100_000))
Start = Callable[..., Ros1Transport]
_LIMIT = 20_000_000_000


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_a_killed_node_is_noticed_at_once_and_the_run_goes_on_without_it(start: Start) -> None:
    transport = start(DESK, ["Counting"])
    began = time.perf_counter_ns()
    transport.signal("Counting", signal.SIGKILL)
    [(node, said)] = transport.poll(began + _LIMIT)
    assert isinstance(said, Died) and (node, said.status) == ("Counting", -signal.SIGKILL)
    assert said.time - began < 1_000_000_000
    transport.deliver("ask", 0, toys.CODEC.encode("ask", "a"))
    transport.command("Counting", Rest())


def test_a_node_that_is_killed_in_a_run_is_buried_with_its_signal(start: Start) -> None:
    transport = start(links(toys.MODEL), ["Client", "Counting"], model=toys.MODEL)
    host = RealTimeHost(transport, links(toys.MODEL), toys.CODEC)
    host.run(1_000_000)
    transport.signal("Counting", signal.SIGKILL)
    host.run(_LIMIT)
    assert host.deaths == {"Counting": "killed by SIGKILL"}
    host.close()


def test_a_frozen_node_does_not_hold_up_the_tester_and_finds_everything_when_it_goes_on(start: Start) -> None:
    transport = start(DESK, ["Counting"])
    seen: list[object] = []
    transport.command("Counting", RunFreely(b"", time.perf_counter_ns()))
    transport.poll(time.perf_counter_ns() + 50_000_000)
    transport.signal("Counting", signal.SIGSTOP)
    began = time.perf_counter()
    message = toys.CODEC.encode("ask", "x" * 101)  # 100 kB each, 20 MB in all: more than sockets hold
    for number in range(200):
        transport.deliver("ask", number, message)
        transport.poll(0)
    assert time.perf_counter() - began < 5.0
    transport.signal("Counting", signal.SIGCONT)
    deadline = time.perf_counter_ns() + _LIMIT
    while len(seen) < 200 and time.perf_counter_ns() < deadline:
        for _, said in transport.poll(deadline):
            seen += [toys.CODEC.decode(wire.channel, wire.data) for wire in getattr(said, "sends", ())]
    assert seen == list(range(1, 201))


def test_nothing_is_left_of_it_on_a_master_that_lives_on() -> None:
    threads = set(threading.enumerate())
    with Master() as master:
        before = ask(master.uri, "getSystemState", "/test")
        transport = toys.transport_of(links(toys.MODEL), ["Client", "Counting"], model=toys.MODEL, master=master.uri)
        pids, folder = list(transport.pids.values()), transport.folder
        assert ask(master.uri, "getSystemState", "/test") != before
        assert len(pids) == 2 and all(map(_lives, pids)) and folder.exists()
        transport.close()
        transport.close()
        assert ask(master.uri, "getSystemState", "/test") == before
        assert not any(map(_lives, pids)) and not folder.exists()
        deadline = time.monotonic() + 5.0
        while set(threading.enumerate()) - threads and time.monotonic() < deadline:
            time.sleep(0.01)
        assert set(threading.enumerate()) <= threads
        again = toys.transport_of(links(toys.MODEL), ["Client", "Counting"], model=toys.MODEL, master=master.uri)
        again.close()


def test_a_name_that_a_living_node_has_is_refused_and_that_node_lives_on(start: Start) -> None:
    transport = start(DESK, ["Counting"])
    with pytest.raises(HostFailure, match=r"ROS 1 node /parcours: must be free on the graph, .* \[ros1-name\]$"):
        start(DESK, ["Counting"])
    assert _lives(transport.pids["Counting"])


def test_a_killed_node_s_name_is_free_again(start: Start) -> None:
    for _ in range(2):
        transport = start(DESK, ["Counting"])
        transport.signal("Counting", signal.SIGKILL)
        transport.close()


def test_a_master_that_is_not_there_and_a_node_that_does_not_start_are_told_in_time(start: Start) -> None:
    began = time.monotonic()
    with pytest.raises(HostFailure, match=r"\[no-master\]$"):
        toys.transport_of(DESK, ["Counting"], master="http://127.0.0.1:1")
    assert time.monotonic() - began < 5.0
    with pytest.raises(HostFailure, match=r"node Counting: must start, but raised .*\[node-start\]$"):
        start(DESK, ["Counting"], kind="nobody")


def test_a_node_that_is_told_to_shut_down_by_the_graph_s_tools_ends(start: Start) -> None:
    transport = start(DESK, ["Counting"])
    ask(ask(transport.master, "lookupNode", "/test", "/Counting"), "shutdown", "/test", "by a test")
    [(node, said)] = transport.poll(time.perf_counter_ns() + _LIMIT)
    assert isinstance(said, Died) and (node, said.status) == ("Counting", 0)
